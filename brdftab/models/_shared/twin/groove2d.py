"""JAX twin of the beam widths of one V groove in its plane; see `grooves.groove2d`.

The beams depend on directions and tilts alone, never on a traced parameter, and their clamps need no guard.
"""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array


def beam_symmetric(sin_y: Array, cos_y: Array, sin_t: Array, cos_t: Array, sin_q: Array, cos_q: Array) -> Array:
    """Return the beam of a symmetric groove with facets of length 1, negative where closed; shapes broadcast.

    y = pi/2 - tilt is half the step between bounces, t the incoming angle, q = -(-1)^k times the outgoing one.
    """
    p1, p2 = sin_y * cos_t, cos_y * sin_t
    p3, p4 = sin_y * cos_q, cos_y * sin_q
    hidden = jnp.maximum(0.0, jnp.maximum(-(p1 + p2), -(p3 + p4)))
    return jnp.minimum(p1 - p2, p3 - p4) - hidden


def beam_even(sl: Array, cl: Array, sr: Array, cr: Array, st: Array, ct: Array, su: Array, cu: Array) -> Array:
    """Return sin(l) sin(r) times the beam of a groove of height 1 after an even number of bounces; t in, u out."""
    top = jnp.minimum(sr * (cl * ct - sl * st), sl * (cr * cu + sr * su))
    hidden = jnp.maximum(-sl * (cr * ct + sr * st), -sr * (cl * cu - sl * su))
    return top - jnp.maximum(0.0, hidden)


def beam_odd(
    sl: Array, cl: Array, sr: Array, cr: Array, s_max: Array, c_max: Array, s_min: Array, c_min: Array
) -> Array:
    """Return sin(l) sin(r) times the beam after an odd number of bounces >= 3; larger and smaller of both angles."""
    c_lm = cl * c_max - sl * s_max
    s_lm = sl * c_max + cl * s_max
    far = -sl * ((cl * cr - sl * sr) * c_lm - (sl * cr + cl * sr) * s_lm)
    return jnp.minimum(sr * c_lm, far) - jnp.maximum(0.0, -sl * (cr * c_min + sr * s_min))
