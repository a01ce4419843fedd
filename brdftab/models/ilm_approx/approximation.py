"""A closed form of the body integral of V-cavities with Beckmann facets, in a few dozen operations.

    I ~ L_a(sigma) T(n, c_i) T(n, c_o) / pi

L_a stands for Lambertian facets (n = 1), in the spirit of Oren and Nayar: a dot product of both slopes that saturates
towards grazing angles, here inside a root that cannot go below zero. c_i and c_o are the cosines of incidence on a mean
facet: towards grazing angles only facets that lean to a direction are lit and seen, and the more so the rougher.
Eq. 33 of Meneveaux et al. (2018) blends T with its hemispherical mean for the same reason.

With sigma = 0 it is T(i) T(o)/pi, with n = 1 L_a/pi, both to rounding; exchanging both directions changes nothing.
Coefficients: coefficients.py, written by tools/fit_ilm_approx.py; the errors: docs/ilm-approx.md.
"""

from __future__ import annotations

import math

from brdftab.jit import kernel
from brdftab.models._shared.fresnel.interface import transmission
from brdftab.models.ilm_approx.coefficients import FACET, LAMBERTIAN

# product of both cosines below which the dot product of the slopes grows no more
LEAST = 1e-12


@kernel
def root(h, square):
    """Return h + sqrt(square + h^2) > 0 without cancellation: 2 h far above 0, falling to 0 far below."""
    r = math.sqrt(square + h * h)
    return r + h if h > 0.0 else square / (r - h)


@kernel
def slopes(saturation, si, ci, so, co):
    """Return the denominator i_z o_z sqrt(1 + k^2 (tan^2 theta_i + tan^2 theta_o)), k^2 = saturation."""
    a, b = si * co, so * ci
    return max(math.sqrt(ci * ci * co * co + saturation * (a * a + b * b)), LEAST)


@kernel
def lambertian(p, sigma, si, ci, so, co, c):
    """Return L_a >= 0 (1 for a flat surface), pi times the body integral of Lambertian facets.

    Parameters
    ----------
    p : sequence of 15 floats
        `LAMBERTIAN` or a trial.
    sigma : float
        Roughness in [0, 1.5].
    si, ci, so, co : float
        Sines and cosines of the polar angles.
    c : float
        Cosine of phi_o - phi_i.
    """
    s2 = sigma * sigma
    k = sigma * (p[1] + p[2] * sigma)
    both = si * so
    q = both / slopes(k * k, si, ci, so, co)
    t = p[3] * sigma * q
    t = t / (1.0 + t)
    turn = c + sigma * (p[4] + p[5] * c * c) / (1.0 + sigma) + t * (p[6] + c * (p[7] + p[8] * c))
    gain = s2 * (p[9] + p[10] * sigma) / (1.0 + p[11] * sigma)
    bend = 1.0 + s2 * both * (p[12] + p[13] * c) / (1.0 + p[14] * s2)
    return root(gain * q * turn, 1.0) * bend / math.sqrt(1.0 + p[0] * s2)


@kernel
def cosines(p, sigma, n, si, ci, so, co, c):
    """Return c_i and c_o in (0, 1], the cosines of incidence on the mean facet; theirs on a flat surface if sigma = 0.

    p is `FACET` or a trial, 11 floats; n >= 1 the refractive index, the others as in `lambertian`.
    """
    s2 = sigma * sigma
    k = sigma * (p[3] + p[4] * sigma)
    over = slopes(k * k, si, ci, so, co)
    lean = s2 * (p[0] + p[1] * sigma) / (1.0 + p[2] * s2) * (1.0 + p[5] * (1.0 - 1.0 / (n * n)))
    a, b = si * co, so * ci
    tilt = 1.0 / math.sqrt(1.0 + p[6] * s2 / (1.0 + p[7] * s2))
    t = sigma * si * so / over
    lift = sigma * p[8] * t / (1.0 + t) * (1.0 + p[9] * c)
    first = tilt * root(lean * si * (a + p[10] * b * c) / over, ci * ci) + lift * (1.0 - ci)
    second = tilt * root(lean * so * (b + p[10] * a * c) / over, co * co) + lift * (1.0 - co)
    return min(first, 1.0), min(second, 1.0)


@kernel
def body_with(lambert, facet, sigma, n, si, ci, so, co, c):
    """Return I (1/sr) of trial coefficients."""
    first, second = cosines(facet, sigma, n, si, ci, so, co, c)
    through = transmission(n, first) * transmission(n, second)
    return lambertian(lambert, sigma, si, ci, so, co, c) * through / math.pi


@kernel
def body(sigma, n, si, ci, so, co, c):
    """Return I (1/sr), the body integral that all channels of one index share."""
    return body_with(LAMBERTIAN, FACET, sigma, n, si, ci, so, co, c)
