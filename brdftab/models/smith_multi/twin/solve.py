"""All bounces between facets in JAX: closed azimuth modes of the GGX kernel, and back-substitution in elevation.

With t = d_z of the direction of propagation and X = |d' - d|^2, the kernel of one bounce is
K = F(X) alpha^2 X^2/(4 pi (X - b)^2), b = (1 - alpha^2) dz^2 (Wang et al. 2022, Eq. 2, with the terms of the errata).
For F = c_0 + sum c_j/(X + x_j) its azimuth modes are sums of exp(-m eta) (Poisson kernels), for real m,
too. A reflection raises t, so that the modes' integral equations are triangular.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

from brdftab.models._shared.twin.fresnel import CONDUCTOR, MIRROR, reflectance
from brdftab.models.smith_multi.twin.rules import LAST_TERM

# panels that are solved together; their own equations by doubling, which ends with the square of the last power
TOGETHER, DOUBLINGS = 4, 4


def masked_measure(alpha: Any, beta: Any) -> Any:
    """Return 2 pi cos(beta)/(|t| (1 + Lambda)), t = sin(beta): what a bounce's light is weighted with on its way on."""
    t, s = jnp.abs(jnp.sin(beta)), jnp.cos(beta)
    return 4.0 * math.pi * s / (t + jnp.sqrt(t * t + (alpha * s) ** 2))


def kernel_modes(alpha: Any, c_0: Any, c_j: Any, n: dict[str, Any], then: Callable[[Any], Any] = lambda k: k) -> Any:
    """Return K_m of all pairs of `twin_nodes`, (M, L), for F = c_0 + sum c_j/(X + x_j); `c_j` (J,) or None.

    `then` maps the row (L,) of each mode to something else.
    """
    a2 = alpha * alpha
    dz2, ss = n["dz2"], n["ss"]
    c, b = n["ds2"] + a2 * dz2, (1.0 - a2) * dz2
    root = jnp.sqrt(c * (c + 4.0 * ss))
    eta = 2.0 * jnp.arcsinh(0.5 * jnp.sqrt(c / ss))
    scale = a2 / (4.0 * math.pi)
    poles = 0 if c_j is None else c_j.shape[0]
    over = [1.0 / (b + n["poles"][j]) for j in range(poles)]
    f = c_0 + sum(c_j[j] * over[j] for j in range(poles))
    slope = -sum(c_j[j] * over[j] * over[j] for j in range(poles))
    share = [scale * c_j[j] * (n["poles"][j] * over[j]) ** 2 for j in range(poles)]
    double = b * b * f
    plain = scale * ((2.0 * b * f + b * b * slope) / root + double * (c + 2.0 * ss) / root**3)
    linear = scale * double / root**2

    def mode(given: tuple[Any, ...]) -> Any:
        m, *decay = given
        tail = sum(s * d for s, d in zip(share, decay, strict=True))
        return then(jnp.exp(-m * eta) * (plain + m * linear) + tail + jnp.where(m == 0.0, c_0, 0.0) * scale)

    # mode by mode: in one expression XLA computes what belongs to a pair anew for every mode
    return jax.lax.map(mode, (n["orders"], *(n["decay"][j] for j in range(poles))))


def _blocks(alpha: Any, c_0: Any, c_j: Any, n: dict[str, Any]) -> tuple[Any, Any, Any]:
    """Return T (M, N, N) and the views' rows (M, n, N), weighted, and the light's columns (M, N, n)."""
    size, p = n["near_beta"].shape
    weight = n["weight"] * masked_measure(alpha, n["beta"])
    near_weight = (n["near_weight"] * masked_measure(alpha, n["near_beta"])).reshape(size // p, p, p)
    same = jnp.eye(size // p)[:, None, :, None]

    def place(row: Any) -> tuple[Any, Any, Any]:
        padded = jnp.pad(row, (0, 1))
        inner, views = padded[n["inner_at"]] * weight, padded[n["views_at"]]
        near = row[row.shape[0] - size * p :].reshape(size // p, p, p) * near_weight
        # from a node to the nodes of its own panel
        own = jnp.einsum("kiq,iqj->kij", near, n["near_basis"])
        apart = inner.reshape(size // p, p, size // p, p)
        transport = (apart + own[:, :, None] * same).reshape(size, size)
        # by reciprocity the way from a node to the view is that from the light to its mirror image
        return transport, views * weight, views[:, ::-1].T

    placed: tuple[Any, Any, Any] = kernel_modes(alpha, c_0, c_j, n, place)
    return placed


def _by_slope(f: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return f of one number, differentiated once however many tangents there are: most of them leave it alone."""
    g = jax.custom_jvp(f)

    @g.defjvp
    def _(primals: Any, tangents: Any) -> Any:
        value, slope = jax.jvp(f, primals, (jnp.ones_like(primals[0]),))
        return value, jax.tree.map(lambda s: tangents[0] * s, slope)

    return g


def _channel_blocks(static: Any, p: dict[str, Any]) -> tuple[Any, Any, Any]:
    """Return `_blocks` for one channel's reflectance."""
    n = p["nodes"]

    if static.fresnel == MIRROR:
        return _blocks(p["alpha_x"], 1.0, None, n)
    if static.fresnel == CONDUCTOR:
        found = n["fit"] @ reflectance(CONDUCTOR, p["a"], p["b"], n["fit_cosines"])
        return _blocks(p["alpha_x"], found[0], found[1:], n)
    # Schlick's form is affine in f0: both ends of it are the same for all channels and computed once
    found = n["fit"] @ (1.0 - n["fit_cosines"]) ** 5

    def ends(alpha: Any) -> Any:
        return _blocks(alpha, found[0], found[1:], n), _blocks(alpha, 1.0, None, n)

    black, white = _by_slope(ends)(p["alpha_x"])
    mixed: tuple[Any, Any, Any] = jax.tree.map(lambda k, w: k + p["a"] * (w - k), black, white)
    return mixed


def _factors(transport: Any, p: int) -> tuple[Any, Any]:
    """Return T by block rows (B, M, step, size) and the inverses of the diagonal blocks of 1 - T (B, M, step, step)."""
    modes, size, _ = transport.shape
    step = TOGETHER * p
    count = -(-size // step)
    # added unknowns stand before the others and light nothing
    short = count * step - size
    padded = jnp.pad(transport, ((0, 0), (short, 0), (short, 0)))
    rows = jnp.moveaxis(padded.reshape(modes, count, step, count * step), 1, 0)
    ends = jnp.arange(count)
    power = rows.reshape(count, modes, step, count, step)[ends, :, :, ends]

    def double(_: Any, kept: tuple[Any, Any]) -> tuple[Any, Any]:
        inverse, power = kept
        power = power @ power
        return inverse + power @ inverse, power

    return rows, jax.lax.fori_loop(0, DOUBLINGS, double, (jnp.eye(step) + power, power))[0]


def _substituted(factors: tuple[Any, Any], right: Any) -> Any:
    """Return the solution of (1 - T) X = B for B (M, N, n), a block of panels after the other."""
    rows, inverse = factors
    count, modes, step, size = rows.shape
    short = size - right.shape[1]
    padded = jnp.pad(right, ((0, 0), (short, 0), (0, 0)))
    given = jnp.moveaxis(padded.reshape(modes, count, step, -1), 1, 0)

    def block(found: Any, k: Any) -> tuple[Any, None]:
        x = inverse[k] @ (given[k] + rows[k] @ found)
        return jax.lax.dynamic_update_slice_in_dim(found, x, k * step, 1), None

    return jax.lax.scan(block, jnp.zeros_like(padded), jnp.arange(count - 1, -1, -1))[0][:, short:]


@partial(jax.custom_jvp, nondiff_argnums=(2,))
def back_substitute(transport: Any, right: Any, p: int) -> Any:
    """Return the solution (M, N, n) of (1 - T) X = B, T (M, N, N) zero below its diagonal panels of p nodes."""
    return _substituted(_factors(transport, p), right)


@back_substitute.defjvp
def _(p: int, primals: Any, tangents: Any) -> Any:
    # dX solves the same equations, whose factors all tangents share
    factors = _factors(primals[0], p)
    x = _substituted(factors, primals[1])
    return x, _substituted(factors, tangents[1] + tangents[0] @ x)


def solve(static: Any, p: dict[str, Any]) -> Any:
    """Return the modes (M, n, n) of the light of two and more bounces between the solved polar angles.

    Parameters
    ----------
    static : Static
        With max_bounces.
    p : dict
        alpha_x, a, b of one channel, and ``nodes`` from `twin_nodes.nodes`.
    """
    transport, views, light = _channel_blocks(static, p)
    most = static.max_bounces
    if most is None or most > LAST_TERM:
        return views @ back_substitute(transport, light, p["nodes"]["near_beta"].shape[1])
    carried = jax.lax.fori_loop(0, most - 2, lambda _, x: light + transport @ x, light)
    return views @ carried
