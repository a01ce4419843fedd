"""How stiff a fit would be: condition numbers of the Jacobian by the twins' derivatives, for every residual."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import jax
import numpy as np

from brdftab.fit.losses import LOSSES, MEANING, transform
from brdftab.models import twins
from brdftab.models._shared.twin.static import WEIGHTS
from brdftab.models.resolve import Setup
from brdftab.typing import Array
from brdftab.validate.angles import Angles

# directions that a fit would see: polar angles up to 75 degrees, as `brdftab fit` takes them
COUNT, FAR = 192, math.radians(75.0)
# condition number of the scaled Jacobian from which on a fit is called stiff: a step's error grows with it
STIFF = 1e3
# values below (1/sr) are left out of residuals that need logarithms
DARK = 1e-12
LINEAR = "linear"
RESIDUALS = (LINEAR, *LOSSES)


@dataclass(frozen=True)
class Conditioning:
    """Condition numbers of one setup's Jacobian.

    Attributes
    ----------
    names : tuple of str
        The parameters, canonical.
    scaled : dict of str to float
        By residual: condition number of J diag(x), what a solver with relative steps sees.
    plain : dict of str to float
        By residual: of J itself, in the parameters' own units.
    """

    names: tuple[str, ...]
    scaled: dict[str, float]
    plain: dict[str, float]

    @property
    def best(self) -> str:
        """Return the residual with the smallest condition number."""
        return min(LOSSES, key=lambda loss: self.scaled[loss])


def fit_directions(seed: int = 0, count: int = COUNT) -> Angles:
    """Return directions as a fit takes them, uniform in the angles, and some at the mirror side (count,)."""
    rng = np.random.default_rng(seed)
    ti, to = rng.uniform(0.0, FAR, (2, count))
    phi = rng.uniform(0.0, math.pi, count)
    near = slice(0, count // 4)
    to[near] = np.clip(ti[near] + rng.normal(0.0, 0.1, count // 4), 0.0, FAR)
    phi[near] = math.pi - np.abs(rng.normal(0.0, 0.1, count // 4))
    return ti, to, phi, np.zeros(count)


def free_numbers(setup: Setup) -> list[str]:
    """Return what a fit would vary: the roughness once, albedo, and reflectance."""
    _, params = twins.split(setup)
    return [k for k, v in params.items() if k != WEIGHTS and v.size == 1 and not (k == "alpha_y" and setup.isotropic)]


def jacobian(setup: Setup, names: Sequence[str], angles: Angles, tolerance: float) -> tuple[Array, Array]:
    """Return values (N,) and derivatives (N, P) of the first channel, 1/sr and 1/sr over the parameters' units."""
    values = twins.evaluate(setup, *angles, tolerance)[:, 0]
    slopes = [twins.derivative(setup, name, *angles, tolerance)[:, 0] for name in names]
    return values, np.stack(slopes, axis=1)


def condition(matrix: Array) -> float:
    """Return the ratio of largest to smallest singular value; infinite where a parameter has no effect."""
    if not np.isfinite(matrix).all():
        return math.nan
    singular = np.linalg.svd(matrix, compute_uv=False)
    return float(singular[0] / singular[-1]) if singular[-1] > 0.0 else math.inf


def residual_jacobian(residual: str, values: Array, slopes: Array, cosine: Array) -> Array:
    """Return the derivatives (M, P) of a residual from those of the values; what is dark is left out."""
    if residual == LINEAR:
        return slopes
    lit = values > DARK
    kept, light = values[lit], cosine[lit]
    with jax.enable_x64(True):
        factor = np.asarray(jax.vmap(jax.grad(lambda f, c: transform(residual, f, c)))(kept, light))
    return factor[:, None] * slopes[lit]


def scaled_jacobian(setup: Setup, residual: str, angles: Angles, tolerance: float) -> Array:
    """Return the derivatives (M, P) of a residual by the logarithms of the parameters."""
    names = free_numbers(setup)
    values, slopes = jacobian(setup, names, angles, tolerance)
    return residual_jacobian(residual, values, slopes, np.cos(angles[0])) * sizes(setup, names)


def sizes(setup: Setup, names: Sequence[str]) -> Array:
    """Return the values (P,) of parameters."""
    _, params = twins.split(setup)
    return np.array([params[name][0] for name in names])


def conditioning(setup: Setup, tolerance: float = 1e-2, angles: Angles | None = None) -> Conditioning:
    """Return the condition numbers of a setup's Jacobian for every residual.

    Parameters
    ----------
    setup : Setup
        A setup whose numbers lie inside their bounds.
    tolerance : float, optional
        Of the rules of models that integrate.
    angles : tuple of ndarray, optional
        Directions of the data; those of `fit_directions` by default.
    """
    at = fit_directions() if angles is None else angles
    names = free_numbers(setup)
    values, slopes = jacobian(setup, names, at, tolerance)
    scale = sizes(setup, names)
    plain, scaled = {}, {}
    for residual in RESIDUALS:
        matrix = residual_jacobian(residual, values, slopes, np.cos(at[0]))
        plain[residual], scaled[residual] = condition(matrix), condition(matrix * scale)
    return Conditioning(tuple(names), scaled, plain)


def told(found: Sequence[Conditioning]) -> str:
    """Say in one line how stiff fits are over a box, and which residual mends it."""
    default = np.array([c.scaled["log"] for c in found])
    stiff = default > STIFF
    counts = {loss: sum(c.best == loss for c in found) for loss in LOSSES}
    best = max(counts, key=lambda loss: counts[loss])
    worst = max(c.plain[LINEAR] for c in found)
    line = (
        f"scaled condition with log: median {np.median(default):.2g}, largest {default.max():.2g}; "
        f"linear unscaled up to {worst:.2g}; best residual mostly {best}"
    )
    if not stiff.any():
        return f"{line}; no fit is stiff"
    mended = [min(c.scaled[loss] for loss in LOSSES) <= STIFF for c, s in zip(found, stiff, strict=True) if s]
    also = f"another residual ({MEANING[best]}) mends {sum(mended)} of them" if any(mended) else "no residual mends it"
    return f"{line}; stiff at {int(stiff.sum())} of {len(found)} points, {also}"
