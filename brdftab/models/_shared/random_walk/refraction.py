"""Dielectric interfaces seen from either side: Fresnel, refraction, and how a facet reflects and transmits.

Air (index 1) lies above the surface, the medium (index n) below. Directions point away from the facet; `side` is 1
where the light arrives from above the interface and -1 where it arrives from below, whatever the sign of its z: between
bounces light travels up and down on either side. `eta` is n_t/n_i, the index of the far side over that of the light's
side. Transmission is the BSDF of light at i seen from o, so it carries n_o^2 (Walter et al. 2007, Eq. 21).
"""

from __future__ import annotations

import math

from brdftab.directions import HORIZON
from brdftab.jit import kernel
from brdftab.models._shared.codes import GGX, SEPARABLE
from brdftab.models._shared.facets.masking import projected_alpha
from brdftab.models._shared.facets.ndf import density, shape_at
from brdftab.models._shared.single_bounce.single import geometry


@kernel
def refract(cos_i, eta):
    """Return the cosine of refraction (positive) at the cosine of incidence in [0, 1]; 0 at total reflection."""
    g2 = (eta - 1.0) * (eta + 1.0) + cos_i * cos_i
    return math.sqrt(max(g2, 0.0)) / eta


@kernel
def fresnel(cos_i, eta):
    """Return the unpolarised reflectance at the cosine of incidence (clipped to [0, 1]); 1 at total reflection."""
    q = (eta - 1.0) * (eta + 1.0)
    if q == 0.0:
        return 0.0
    c = min(max(cos_i, 0.0), 1.0)
    c2 = c * c
    g2 = q + c2
    if g2 <= 0.0:
        return 1.0
    g = math.sqrt(g2)
    # (c - g)/(c + g) and its partner over products, so that eta -> 1 keeps all digits
    u = c + g
    v = (q + 1.0) * c + g
    rs = q / (u * u)
    rp = q * ((q + 2.0) * c2 - 1.0) / (v * v)
    return 0.5 * (rs * rs + rp * rp)


@kernel
def transmittance(cos_i, cos_t, eta):
    """Return 1 - F from both cosines (positive); keeps its digits at grazing, and is the same from either side."""
    if cos_i <= 0.0 or cos_t <= 0.0:
        return 0.0
    u = cos_i + eta * cos_t
    v = eta * cos_i + cos_t
    return 2.0 * eta * cos_i * cos_t * (1.0 / (u * u) + 1.0 / (v * v))


@kernel
def refracted(ix, iy, iz, hx, hy, hz, eta):
    """Return the unit direction into which i refracts at a facet with normal h (either sign); zeros if it cannot."""
    c = ix * hx + iy * hy + iz * hz
    t = refract(abs(c), eta)
    if t <= 0.0:
        return 0.0, 0.0, 0.0
    k = c / eta - math.copysign(t, c)
    x, y, z = k * hx - ix / eta, k * hy - iy / eta, k * hz - iz / eta
    # rounding is not left to grow along a path
    s = 1.0 / math.sqrt(x * x + y * y + z * z)
    return x * s, y * s, z * s


@kernel
def transmission_normal(ix, iy, iz, ox, oy, oz, n_i, n_o):
    """Return the unit normal (z >= 0) that refracts i into o, and the length |n_i i + n_o o|; zeros if none does."""
    x, y, z = n_i * ix + n_o * ox, n_i * iy + n_o * oy, n_i * iz + n_o * oz
    length = math.sqrt(x * x + y * y + z * z)
    if length <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    s = math.copysign(1.0 / length, z)
    return x * s, y * s, z * s, length


@kernel
def facet_density(ndf, alpha_x, alpha_y, hx, hy, hz):
    """Return D (1/sr) at a unit normal; 0 at and below the horizon."""
    if hz <= 0.0:
        return 0.0
    flat = math.hypot(hx, hy)
    cos_a, sin_a = (hx / flat, hy / flat) if flat > 0.0 else (1.0, 0.0)
    shape, amp = shape_at(ndf, alpha_x, alpha_y, cos_a, sin_a)
    return amp * density(ndf, shape, hz, flat)


@kernel
def reflected_vertex(ndf, alpha_x, alpha_y, side, ix, iy, iz, ox, oy, oz, eta):
    """Return F D/4 of the facet that reflects i into o on one side; divide by both |z| for the path's vertex term."""
    x, y, z = side * (ix + ox), side * (iy + oy), side * (iz + oz)
    length = math.sqrt(x * x + y * y + z * z)
    if z <= 0.0:
        return 0.0
    d = facet_density(ndf, alpha_x, alpha_y, x / length, y / length, z / length)
    return 0.25 * d * fresnel(0.5 * length, eta)


@kernel
def transmitted_vertex(ndf, alpha_x, alpha_y, side, ix, iy, iz, ox, oy, oz, n_i, n_o):
    """Return n_o^2 (1 - F) D |i.h| |o.h|/(n_i i.h + n_o o.h)^2 of the facet that refracts i into o.

    Divided by both |z| it is the path's vertex term; 0 where the facet would be seen from behind.
    """
    hx, hy, hz, length = transmission_normal(ix, iy, iz, ox, oy, oz, n_i, n_o)
    cos_i = side * (ix * hx + iy * hy + iz * hz)
    cos_o = -side * (ox * hx + oy * hy + oz * hz)
    if hz <= 0.0 or cos_i <= 0.0 or cos_o <= 0.0:
        return 0.0
    d = facet_density(ndf, alpha_x, alpha_y, hx, hy, hz)
    r = n_o / length
    return d * transmittance(cos_i, cos_o, n_o / n_i) * cos_i * cos_o * r * r


@kernel
def weight(ndf, alpha, s, c):
    """Return 1/(|c| (1 + Lambda)) of a direction with that sine and cosine (Beckmann 0, GGX 1); finite at c = 0."""
    z, x = abs(c), alpha * s
    if ndf == GGX:
        return 2.0 / (z + math.sqrt(z * z + x * x))
    if z > 26.0 * x:
        return 1.0 / z
    v = z / x
    return 1.0 / (z + x * (0.5 * math.exp(-v * v) / math.sqrt(math.pi) - 0.5 * v * math.erfc(v)))


@kernel
def single_bounce(ndf, alpha_x, alpha_y, theta_i, theta_o, phi, phi_i, n):
    """Return the single-bounce BSDF in 1/sr, without cosine, masked by Smith's separable G1 G1.

    Parameters
    ----------
    ndf : int
        0 Beckmann, 1 GGX.
    alpha_x, alpha_y : float
        Roughness.
    theta_i, theta_o : float
        Radians in [0, pi]; below the surface beyond pi/2, and 0 is returned at the horizon.
    phi, phi_i : float
        phi_o - phi_i and phi_i, radians; straight through is phi = pi.
    n : float
        Index below the surface, positive; 1 above.
    """
    si, ci = math.sin(theta_i), math.cos(theta_i)
    so, co = math.sin(theta_o), math.cos(theta_o)
    if min(abs(ci), abs(co)) <= HORIZON:
        return 0.0
    if ci > 0.0 and co > 0.0:
        value, i_h = geometry(SEPARABLE, ndf, alpha_x, alpha_y, theta_i, theta_o, phi, phi_i)
        return value * fresnel(i_h, n)
    if ci < 0.0 and co < 0.0:
        # a facet seen from below is tilted the opposite way, which D does not mind
        value, i_h = geometry(SEPARABLE, ndf, alpha_x, alpha_y, math.pi - theta_i, math.pi - theta_o, phi, phi_i)
        return value * fresnel(i_h, 1.0 / n)
    side, n_i, n_o = (1.0, 1.0, n) if ci > 0.0 else (-1.0, n, 1.0)
    cos_p, sin_p = math.cos(phi_i), math.sin(phi_i)
    cos_q, sin_q = math.cos(phi_i + phi), math.sin(phi_i + phi)
    i = si * cos_p, si * sin_p, ci
    o = so * cos_q, so * sin_q, co
    vertex = transmitted_vertex(ndf, alpha_x, alpha_y, side, *i, *o, n_i, n_o)
    alpha_i = projected_alpha(ndf, alpha_x, alpha_y, cos_p, sin_p)
    alpha_o = projected_alpha(ndf, alpha_x, alpha_y, cos_q, sin_q)
    return vertex * weight(ndf, alpha_i, si, ci) * weight(ndf, alpha_o, so, co)
