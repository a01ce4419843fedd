"""Make files as a MERL goniometer would, from known parameters, fit them, and compare with the truth.

    python examples/merl_like/make_and_fit.py                       # whole files, 90 x 90 x 180
    python examples/merl_like/make_and_fit.py --directions 20000    # most cells not measured: seconds

Two paints are interfaced Lambertian microfacets (Beckmann). Their files get 1 % of multiplicative noise, 1 % of
outliers, cells that were not measured, and in a second round a peak that the camera clipped. The exit status is 1 where
a parameter is further from the truth than the limits below.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import brdftab
from brdftab.io.merl import directions, write_merl
from brdftab.models import twins
from brdftab.models.resolve import resolve

Array = NDArray[np.float64]
NOISE, OUTLIERS, MISSING = 0.01, 0.01, 0.02
THETA_MAX = math.radians(80.0)
# directions evaluated at once: bounds the memory, and all blocks share one compiled program
BLOCK = 16384
# four standard errors: 5 parameters in 4 fits are 20 chances to be beyond three
MOST_Z = 4.0
# largest relative error on whole files; fewer directions are held to their standard errors only
WHOLE = {"sigma": 1e-3, "ior": 5e-4}
# largest error of n_i where the peak is clipped: its noise is clipped, too, which moves n_i by 1e-5 to 1e-4
CLIPPED_IOR = 1e-3


@dataclass(frozen=True)
class Paint:
    """Known parameters, and the value (1/sr) at which the camera saturates in the second round."""

    name: str
    kd: tuple[float, float, float]
    ior: float
    sigma: float
    clip: float


PAINTS = (
    Paint("smooth", (0.38, 0.34, 0.22), 1.12, 0.065, 0.2),
    Paint("rough", (0.50, 0.425, 0.31), 1.20, 0.101, 0.3),
)


def exact(paint: Paint, theta_i: Array, theta_o: Array, phi: Array) -> Array:
    """Return the true f (N, 3) in 1/sr, by a finer rule than the fit takes."""
    setup = resolve("ilm", ndf="beckmann", kd=list(paint.kd), ior=paint.ior, sigma=paint.sigma)
    parts = []
    for at in range(0, theta_i.size, BLOCK):
        block = [np.resize(x[at : at + BLOCK], BLOCK) for x in (theta_i, theta_o, phi)]
        parts.append(twins.evaluate(setup, *block, np.zeros(BLOCK), tolerance=1e-4))
    return np.concatenate(parts)[: theta_i.size]


def measure(truth: Array, clip: float | None, rng: np.random.Generator) -> Array:
    """Return what an imperfect camera makes of true values (N, 3); NaN where it measured nothing."""
    seen = truth * np.exp(NOISE * rng.standard_normal(truth.shape))
    # dust and flares: too dark or too bright by a factor of 1.5 to 5
    factor = np.exp(rng.choice([-1.0, 1.0], truth.shape) * rng.uniform(math.log(1.5), math.log(5.0), truth.shape))
    seen = np.where(rng.random(truth.shape) < OUTLIERS, seen * factor, seen)
    if clip is not None:
        seen = np.minimum(seen, clip)
    # single channels, and whole cells
    lost = (rng.random(truth.shape) < MISSING) | (rng.random((len(truth), 1)) < MISSING)
    return np.where(lost, np.nan, seen)


def make(paint: Paint, clip: float | None, count: int | None, seed: int, path: Path) -> None:
    """Write one file of which `count` cells below 80 degrees, or all, are measured."""
    theta_i, theta_o, phi = (x.reshape(-1) for x in directions())
    rng = np.random.default_rng(seed)
    cells = np.flatnonzero((theta_i < THETA_MAX) & (theta_o < THETA_MAX))
    if count is not None:
        cells = np.sort(rng.choice(cells, min(count, cells.size), replace=False))
    values = np.full((theta_i.size, 3), np.nan)
    values[cells] = measure(exact(paint, theta_i[cells], theta_o[cells], phi[cells]), clip, rng)
    write_merl(values.T.reshape(3, 90, 90, 180), path)


def compare(paint: Paint, found: Any, clipped: bool, whole: bool) -> bool:
    """Print recovered and true parameters; tell whether all are within their limits."""
    good = True
    for name, truth in (("kd", paint.kd), ("ior", paint.ior), ("sigma", paint.sigma)):
        columns = (np.atleast_1d(x).tolist() for x in (found.values[name], found.stderr[name], truth))
        for value, error, true in zip(*columns, strict=True):
            z, apart = (value - true) / error, abs(value / true - 1.0)
            if clipped and name == "ior":
                bad = not abs(value - true) <= CLIPPED_IOR
            else:
                bad = not abs(z) <= MOST_Z or (whole and not clipped and apart > WHOLE.get(name, math.inf))
            good &= not bad
            off = f"{100.0 * apart:.4f} %"
            print(f"  {name:<6}{true:<8g}{value:<10.6f}+- {error:<10.2g}{z:>6.2f}{off:>12}{'  FAR' if bad else ''}")
    return good


def run(paint: Paint, clipped: bool, count: int | None, seed: int, folder: Path) -> bool:
    """Make, read back and fit one file."""
    clip = paint.clip if clipped else None
    path = folder / f"{paint.name}{'-clipped' if clipped else ''}.binary"
    make(paint, clip, count, seed, path)
    found = brdftab.fit_model(
        path,
        "ilm",
        ndf="beckmann",
        theta_max=THETA_MAX,
        sampling="grid",
        robust="auto",
        # the file's scale factors round: what was clipped may lie a digit below the clipped value
        saturation=None if clip is None else clip * (1.0 - 1e-9),
        seed=seed,
    )
    points, times = found.points, found.times
    share = points["saturated"] / points["residuals"]
    counts = f"{points['directions']:,} directions, {points['residuals']:,} values"
    print(f"{path.name}: {counts}, {100.0 * share:.1f} % clipped")
    print(f"  {'':<6}{'truth':<8}{'found':<10}{'error':<13}{'z':>6}{'off':>12}")
    good = compare(paint, found, clipped, count is None)
    print(f"  {found.starts['agreed']} of {found.starts['tried']} starts agree; log-RMS {found.metrics['log_rms']:.4f}")
    for line in found.warnings:
        print(f"  warning: {line}")
    print(f"  {times['total'] - times['compile']:.2f} s and {times['compile']:.2f} s of compilation", file=sys.stderr)
    return good


def main() -> int:
    """Fit every paint, plain and clipped; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--directions", type=int, help="cells measured, at random [default: all below 80 degrees]")
    parser.add_argument("--seed", type=int, default=1, help="of noise, outliers and losses [default: 1]")
    chosen = parser.parse_args()
    if chosen.directions is not None and chosen.directions < 1000:
        parser.error("--directions must be at least 1000: fewer do not determine the parameters")
    with tempfile.TemporaryDirectory() as folder:
        good = [
            run(paint, clipped, chosen.directions, chosen.seed, Path(folder))
            for clipped in (False, True)
            for paint in PAINTS
        ]
    print(f"{sum(good)} of {len(good)} files recovered")
    return 0 if all(good) else 1


if __name__ == "__main__":
    raise SystemExit(main())
