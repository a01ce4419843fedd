"""JAX twin of the nodes for the far tail of the bounce sum; see `grooves.tail`.

The nodes follow Phong's exponent, but the integral does not depend on where they stand: their place carries no
derivative, so that differentiating the sum gives the quadrature of the differentiated integrand.
"""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array, lax

from brdftab.models._shared.codes import PHONG
from brdftab.models._shared.grooves.tail import SPAN


def tail_power(ndf: int, shape: Array) -> Array:
    """Return q of x = low + (high - low) s^q, or 0 for a logarithmic scale, shape of `shape`; without derivative."""
    shape = lax.stop_gradient(shape)
    if ndf != PHONG:
        return jnp.ones_like(shape)
    # the last branch's divisor must not vanish where it is not taken
    n1 = jnp.where(shape < 0.0, 1.0, shape + 1.0)
    return jnp.where(shape >= 1.0, 1.0, jnp.where(shape < 0.0, 0.0, jnp.ceil(n1) / n1))


def tail_panels(power: Array, low: Array, high: Array) -> Array:
    """Return how many panels, equal ones in log x, the tail over x in (low, high) takes; one without that scale."""
    return jnp.where(power > 0.0, 1.0, jnp.maximum(jnp.ceil(jnp.log(high / low) / SPAN), 1.0))


def tail_node(
    ndf: int, power: Array, panels: Array, number: Array, low: Array, high: Array, s: Array
) -> tuple[Array, Array]:
    """Return x and dx/ds at s in (0, 1) of a panel; low and high are positive. Only Phong takes other than one."""
    span = high - low
    plain = low + span * s
    if ndf != PHONG:
        return plain, span
    rate = jnp.log(high / low) / panels
    spread = low * jnp.exp(rate * (number + s))
    part = s**power
    straight = (power == 1.0) | (low > 0.5 * high)
    x = jnp.where(power == 0.0, spread, jnp.where(straight, plain, low + span * part))
    dx = jnp.where(power == 0.0, spread * rate, jnp.where(straight, span, span * power * part / s))
    return x, dx
