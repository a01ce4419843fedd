"""Interfaced Lambertian microfacets in JAX: closed specular part, body integral at fixed nodes.

The nodes follow from the tolerance alone (`rules`), so that the sum is smooth in all parameters; the kernel gives the same
sum where it takes the plain rule. Single bounces between facets only.
"""

from __future__ import annotations

import math

import jax.numpy as jnp
import numpy as np

from brdftab.models.ilm.rules import radial_nodes
from brdftab.models.ilm.twin_body import integral
from brdftab.models.microfacet.twin.frame import half_vector, lifted
from brdftab.models.microfacet.twin.fresnel import reflectance
from brdftab.models.microfacet.twin.gaussian import gaussian_density, gaussian_norm
from brdftab.models.microfacet.twin.interface import body_factor
from brdftab.models.microfacet.twin.masking import projected_alpha, smith_g2, smith_lambda, v_cavity
from brdftab.models.microfacet.twin.ndf import density, shape_at

SHAPE_PARAMS = ("alpha_x", "alpha_y", "a")
GAUSSIAN = 3


def shapes(static, p, d):
    """Return the specular part and the body integral I, both (N,) in 1/sr."""
    above, d = lifted(d)
    sin_h, cos_h, i_h, cos_a, sin_a = half_vector(d)
    rough = p["alpha_x"] > 0.0
    ax = jnp.where(rough, p["alpha_x"], 1.0)
    ay = ax if static.isotropic else jnp.where(rough, p["alpha_y"], 1.0)
    cavity = static.option("masking") == "torrance-sparrow"
    if cavity:
        masking, both = v_cavity(cos_h, d.ci, d.co, i_h), jnp.ones(())
    else:
        lambdas = [
            smith_lambda(static.ndf, projected_alpha(static.isotropic, ax, ay, c, s), t, False)
            for c, s, t in ((d.cos_i, d.sin_i, d.si / d.ci), (d.cos_o, d.sin_o, d.so / d.co))
        ]
        masking = both = jnp.where(rough, smith_g2(0, *lambdas), 1.0)
    if static.ndf == GAUSSIAN:
        facets = gaussian_density(ax, gaussian_norm(ax), cos_h, sin_h)
    else:
        shape, amp = shape_at(static.ndf, static.isotropic, ax, ay, cos_a, sin_a)
        facets = amp * density(static.ndf, shape, cos_h, sin_h)
    # a flat surface reflects specularly in one direction only, which has no value
    front = jnp.where(above & rough, facets * masking / (4.0 * d.ci * d.co), 0.0)
    specular = front * reflectance(2, p["a"], None, i_h)
    stretch = (jnp.where(rough, ax, 0.0), jnp.where(rough, ay, 0.0))
    body = jnp.where(above, both * _body(static, cavity, stretch, p["a"], d), 0.0)
    return specular, body


def value(static, p, shapes, d):
    """Return the BRDF (1/sr) of one channel, (N,)."""
    specular, body = shapes
    return specular + body_factor(p["kd"], p["a"]) * body


def _slopes(static, stretch):
    """Return stretched slopes X, Y, their scales and weights of all nodes, (K M,); slopes are scale times stretched."""
    nodes, steps = radial_nodes(static.ndf, static.tolerance)
    azimuth = 2.0 * math.pi * (np.arange(steps) + 0.5 * (np.arange(nodes.shape[1]) % 2)[:, None]) / steps
    radius = np.broadcast_to(np.sqrt(nodes[0])[:, None], azimuth.shape).reshape(-1)
    weight = jnp.asarray(np.broadcast_to(nodes[1][:, None] / steps, azimuth.shape).reshape(-1))
    cos, sin = np.cos(azimuth).reshape(-1), np.sin(azimuth).reshape(-1)
    if static.ndf != GAUSSIAN:
        return radius * cos, radius * sin, weight
    tilt = math.sqrt(2.0) * stretch[0] * radius
    inside = tilt < 0.5 * math.pi
    bent = stretch[0] > 0.0
    safe = jnp.where(inside & bent, tilt, 1.0)
    norm = gaussian_norm(jnp.where(bent, stretch[0], 1.0))
    weight = jnp.where(bent, jnp.where(inside, weight * norm * jnp.sin(safe) / safe, 0.0), weight)
    # tan(tilt) in units of sigma, so that sigma scales the slopes of every distribution
    slope = jnp.where(inside & bent, jnp.tan(safe) / jnp.where(bent, stretch[0], 1.0), 0.0)
    return slope * cos, slope * sin, weight


def _body(static, cavity, stretch, n, d):
    """Return the body integral I (1/sr), unmasked with Smith, (N,); the loop over nodes runs in static.precision."""
    kind = jnp.float32 if static.precision == "float32" else jnp.float64
    ti, to = d.si / d.ci, d.so / d.co
    slopes = (ti * d.cos_i, ti * d.sin_i, d.ci, to * d.cos_o, to * d.sin_o, d.co)
    geometry = tuple(jnp.asarray(v).astype(kind) for v in slopes)
    nodes = tuple(jnp.asarray(v).astype(kind) for v in _slopes(static, stretch))
    scales = (jnp.asarray(v).astype(kind) for v in (*stretch, n))
    return integral(cavity, static.ndf == GAUSSIAN, *scales, nodes, geometry).astype(jnp.float64)
