"""Interfaced Lambertian microfacets in JAX: closed specular part, body integral at fixed nodes.

The nodes follow from the tolerance alone (`rules`), so that the sum is smooth in all parameters. Single bounces between
facets only.
"""

from __future__ import annotations

import math

import jax.numpy as jnp
import numpy as np

from brdftab.errors import ParameterError
from brdftab.models._shared.codes import GAUSSIAN
from brdftab.models._shared.twin.frame import half_vector, lifted
from brdftab.models._shared.twin.fresnel import reflectance
from brdftab.models._shared.twin.gaussian import gaussian_density, gaussian_norm
from brdftab.models._shared.twin.interface import body_factor
from brdftab.models._shared.twin.masking import projected_alpha, smith_g2, smith_lambda, v_cavity
from brdftab.models._shared.twin.ndf import density, shape_at
from brdftab.models.ilm.single_bounce.twin_nodes import MOST_NODES, polar_nodes
from brdftab.models.ilm.twin.body import integral

SHAPE_PARAMS = ("alpha_x", "alpha_y", "a")


def shapes(static, p, d):
    """Return the specular part and the body integral I, both (N,) in 1/sr.

    Raises
    ------
    ParameterError
        If more than single bounces are asked: they have no closed sum to differentiate.
    """
    if static.max_bounces != 1:
        raise ParameterError(
            f"bounces = {static.option('bounces')} has no twin; fit with bounces = 1 and tabulate the answer with more"
        )
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
    body = jnp.where(above, both * _body(static, cavity, stretch, p, d), 0.0)
    return specular, body


def value(static, p, shapes, d):
    """Return the BRDF (1/sr) of one channel, (N,)."""
    specular, body = shapes
    return specular + body_factor(p["kd"], p["a"]) * body


def rule_nodes(static, tolerance):
    """Return the nodes of a tolerance as numbers to be put among the parameters, padded to one size.

    With them `shapes` compiles once for every rule; without them it takes the nodes of static.tolerance.
    """
    nodes = polar_nodes(static.ndf, tolerance)
    room = MOST_NODES[static.ndf] - nodes[0].size
    names = ("node_radius", "node_cos", "node_sin", "node_weight")
    found = {name: np.concatenate([v, np.zeros(room)]) for name, v in zip(names, nodes, strict=True)}
    return {**found, "node_count": np.array(float(nodes[0].size))}


def _slopes(static, stretch, p):
    """Return slopes X, Y in units of the stretch and weights of all nodes, each (Q,)."""
    if "node_count" in p:
        radius, cos, sin, weight = (p[f"node_{name}"] for name in ("radius", "cos", "sin", "weight"))
    else:
        radius, cos, sin, weight = (jnp.asarray(v) for v in polar_nodes(static.ndf, static.tolerance))
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


def _body(static, cavity, stretch, p, d):
    """Return the body integral I (1/sr), unmasked with Smith, (N,); the loop over nodes runs in static.precision."""
    kind = jnp.float32 if static.precision == "float32" else jnp.float64
    ti, to = d.si / d.ci, d.so / d.co
    slopes = (ti * d.cos_i, ti * d.sin_i, d.ci, to * d.cos_o, to * d.sin_o, d.co)
    geometry = tuple(jnp.asarray(v).astype(kind) for v in slopes)
    nodes = tuple(jnp.asarray(v).astype(kind) for v in _slopes(static, stretch, p))
    scales = (jnp.asarray(v).astype(kind) for v in (*stretch, p["a"]))
    count = p.get("node_count", float(nodes[0].shape[0]))
    return integral(cavity, static.ndf == GAUSSIAN, *scales, nodes, geometry, count).astype(jnp.float64)
