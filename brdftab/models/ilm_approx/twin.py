"""The closed form of interfaced Lambertian microfacets in JAX; names as in approximation.py."""

from __future__ import annotations

import math

import jax.numpy as jnp

from brdftab.materials.fresnel import DIELECTRIC
from brdftab.models._shared.codes import BECKMANN
from brdftab.models._shared.twin.frame import half_vector, lifted
from brdftab.models._shared.twin.fresnel import reflectance
from brdftab.models._shared.twin.interface import body_factor, transmission
from brdftab.models._shared.twin.masking import v_cavity
from brdftab.models._shared.twin.ndf import density
from brdftab.models.ilm_approx.coefficients import FACET, LAMBERTIAN

SHAPE_PARAMS = ("alpha_x", "a")
_LEAST = 1e-12


def _root(h, square):
    """Return h + sqrt(square + h^2) without cancellation."""
    r = jnp.sqrt(square + h * h)
    return jnp.where(h > 0.0, r + h, square / (r - jnp.minimum(h, 0.0)))


def _slopes(saturation, d):
    """Return the saturating denominator of products of both _slopes."""
    a, b = d.si * d.co, d.so * d.ci
    square = (d.ci * d.co) ** 2 + saturation * (a * a + b * b)
    live = square > _LEAST * _LEAST
    return jnp.where(live, jnp.sqrt(jnp.where(live, square, 1.0)), _LEAST)


def _lambertian(sigma, d, c):
    """Return L_a, (N,)."""
    p, s2, both = LAMBERTIAN, sigma * sigma, d.si * d.so
    q = both / _slopes((sigma * (p[1] + p[2] * sigma)) ** 2, d)
    t = p[3] * sigma * q
    t = t / (1.0 + t)
    turn = c + sigma * (p[4] + p[5] * c * c) / (1.0 + sigma) + t * (p[6] + c * (p[7] + p[8] * c))
    gain = s2 * (p[9] + p[10] * sigma) / (1.0 + p[11] * sigma)
    bend = 1.0 + s2 * both * (p[12] + p[13] * c) / (1.0 + p[14] * s2)
    return _root(gain * q * turn, 1.0) * bend / jnp.sqrt(1.0 + p[0] * s2)


def _cosines(sigma, n, d, c):
    """Return the _cosines of incidence on the mean facet, (N,) each."""
    p, s2 = FACET, sigma * sigma
    over = _slopes((sigma * (p[3] + p[4] * sigma)) ** 2, d)
    lean = s2 * (p[0] + p[1] * sigma) / (1.0 + p[2] * s2) * (1.0 + p[5] * (1.0 - 1.0 / (n * n)))
    a, b = d.si * d.co, d.so * d.ci
    tilt = 1.0 / jnp.sqrt(1.0 + p[6] * s2 / (1.0 + p[7] * s2))
    t = sigma * d.si * d.so / over
    lift = sigma * p[8] * t / (1.0 + t) * (1.0 + p[9] * c)
    first = tilt * _root(lean * d.si * (a + p[10] * b * c) / over, d.ci * d.ci) + lift * (1.0 - d.ci)
    second = tilt * _root(lean * d.so * (b + p[10] * a * c) / over, d.co * d.co) + lift * (1.0 - d.co)
    return jnp.minimum(first, 1.0), jnp.minimum(second, 1.0)


def shapes(static, p, d):
    """Return the specular part and the body integral I, both (N,) in 1/sr."""
    above, d = lifted(d)
    sin_h, cos_h, i_h, _, _ = half_vector(d)
    sigma, n = p["alpha_x"], p["a"]
    rough = sigma > 0.0
    facets = density(BECKMANN, jnp.where(rough, sigma, 1.0), cos_h, sin_h) * v_cavity(cos_h, d.ci, d.co, i_h)
    # a flat surface reflects specularly in one direction only, which has no value
    specular = jnp.where(above & rough, facets / (4.0 * d.ci * d.co), 0.0) * reflectance(DIELECTRIC, n, None, i_h)
    c = jnp.cos(d.phi)
    first, second = _cosines(sigma, n, d, c)
    body = _lambertian(sigma, d, c) * transmission(n, first) * transmission(n, second) / math.pi
    return specular, jnp.where(above, body, 0.0)


def value(static, p, shapes, d):
    """Return the BRDF (1/sr) of one channel, (N,)."""
    specular, body = shapes
    return specular + body_factor(p["kd"], p["a"]) * body
