"""Single-bounce microfacet models in JAX, F D G/(4 i_z o_z): what cook-torrance and smith share."""

from __future__ import annotations

import jax.numpy as jnp

from brdftab.models._shared.codes import V_CAVITY
from brdftab.models._shared.twin.frame import half_vector, lifted
from brdftab.models._shared.twin.fresnel import reflectance
from brdftab.models._shared.twin.masking import WALTER, projected_alpha, smith_g2, smith_lambda, v_cavity
from brdftab.models._shared.twin.ndf import density, shape_at

SHAPE_PARAMS = ("alpha_x", "alpha_y")


def geometry(static, masking, p, d):
    """Return D G/(4 i_z o_z) in 1/sr and i.h, both (N,); `masking` is a Smith code or V_CAVITY, static."""
    above, d = lifted(d)
    sin_h, cos_h, i_h, cos_a, sin_a = half_vector(d)
    ax, ay = p["alpha_x"], p["alpha_y"]
    shape, amp = shape_at(static.ndf, static.isotropic, ax, ay, cos_a, sin_a)
    if masking == V_CAVITY:
        g = v_cavity(cos_h, d.ci, d.co, i_h)
    else:
        alpha_i = projected_alpha(static.isotropic, ax, ay, d.cos_i, d.sin_i)
        alpha_o = projected_alpha(static.isotropic, ax, ay, d.cos_o, d.sin_o)
        walter = masking == WALTER
        lambda_i = smith_lambda(static.ndf, alpha_i, d.si / d.ci, walter)
        lambda_o = smith_lambda(static.ndf, alpha_o, d.so / d.co, walter)
        g = smith_g2(masking, lambda_i, lambda_o)
    value = amp * density(static.ndf, shape, cos_h, sin_h) * g / (4.0 * d.ci * d.co)
    return jnp.where(above, value, 0.0), i_h


def value(static, p, shapes, d):
    """Return the BRDF (1/sr) of one wavelength, (N,)."""
    front, i_h = shapes
    return front * reflectance(static.fresnel, p.get("a"), p.get("b"), i_h)
