"""Few wavelengths in place of 81: an empirical quadrature for products of Fresnel terms, one rule a metal and count.

A multi-bounce model needs, per channel, ``sum_w weight[w, c] prod_j F_w(cos_j)``: the projection to sRGB acts after the
product over bounces, and each wavelength costs kernel time. F(wavelength, cos) of one metal spans a space of few
dimensions, so wavelengths and weights fitted to that metal reach an error that fixed wavelengths need many more for.
The rules lie in ``data/quadrature.csv``; tools/find_wavelengths.py finds them (and needs scipy, this module does not).

``python -m brdftab.materials.quadrature`` prints the error of every rule, computed anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np

from brdftab.errors import ParameterError
from brdftab.materials import formulas, indices, spectra

TARGET = 1e-5
BOUNCES = 8


@dataclass(frozen=True, eq=False)
class Rule:
    """A quadrature in the wavelength.

    Attributes
    ----------
    wavelengths : float64 (W,)
        In nm, increasing.
    weights : float64 (W, 3)
        Columns add up to 1; single entries may be negative.
    error : float
        Largest measured error, relative to the largest channel of the exact value, over products of up to `BOUNCES`
        terms; other products were seen to exceed it by 10 % where it is near `TARGET`.
    single : float
        The same for one bounce.
    """

    wavelengths: np.ndarray
    weights: np.ndarray
    error: float
    single: float


def family(reflectance: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Return products of up to `BOUNCES` Fresnel terms: powers at every cosine and `count` random mixed products.

    Parameters
    ----------
    reflectance : float64 (M, W)
        Fresnel terms at M cosines; the first M rows of the result.
    count : int
        Number of mixed products.
    seed : int
        Seed that fixes which cosines are multiplied.

    Returns
    -------
    float64 (BOUNCES * M + count, W)
    """
    powers = np.cumprod(np.broadcast_to(reflectance, (BOUNCES, *reflectance.shape)), axis=0)
    random = np.random.default_rng(seed)
    size = len(reflectance)
    pick = random.integers(0, size, (count, BOUNCES))
    pick[np.arange(BOUNCES) >= random.integers(2, BOUNCES + 1, (count, 1))] = size  # past the last bounce: 1
    padded = np.concatenate([reflectance, np.ones((1, reflectance.shape[1]))])
    mixed = padded[pick[:, 0]]
    for bounce in range(1, BOUNCES):
        mixed = mixed * padded[pick[:, bounce]]
    return np.concatenate([*powers, mixed])


def terms(name: str, wavelengths: np.ndarray, cos: np.ndarray) -> np.ndarray:
    """Return F at every cosine and wavelength of a metal, float64 (M, W)."""
    return formulas.conductor(*indices.at(name, wavelengths), cos[:, None])


def measure(name: str, wavelengths: np.ndarray, weights: np.ndarray, size: int = 160) -> tuple[float, float]:
    """Measure a rule against the 5 nm projection.

    The products are not those that the search fits: powers at `size` cosines and 80 times as many mixed products.

    Parameters
    ----------
    name : str
        One of `indices.names`.
    wavelengths, weights : float64 (W,), (W, 3)
        The rule.
    size : int
        Number of cosines, evenly spaced up to 1.

    Returns
    -------
    single, error : float
        Largest error relative to the largest channel of the exact value: one bounce; up to `BOUNCES` bounces.
    """
    cos = (np.arange(size) + 0.5) / (size - 0.5)
    both = terms(name, np.concatenate([spectra.wavelengths(), wavelengths]), cos)
    products = family(both, 80 * size, seed=2024)
    split = len(spectra.wavelengths())
    exact = products[:, :split] @ spectra.weights()
    gap = np.abs(products[:, split:] @ weights - exact).max(axis=1) / exact.max(axis=1)
    return float(gap[: len(cos)].max()), float(gap.max())


@cache
def _rules() -> dict[str, dict[int, Rule]]:
    """Read the stored rules: name -> count -> rule."""
    found: dict[tuple[str, int], list[list[str]]] = {}
    text = (resources.files(__package__) / "data" / "quadrature.csv").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    for metal, size, *numbers in (line.split(",") for line in lines[1:]):
        found.setdefault((metal, int(size)), []).append(numbers)
    rules: dict[str, dict[int, Rule]] = {}
    for (name, count), rows in found.items():
        table = np.array(rows, dtype=np.float64)
        rules.setdefault(name, {})[count] = Rule(table[:, 2], table[:, 3:], table[0, 1], table[0, 0])
    return rules


def counts(name: str) -> list[int]:
    """Return the wavelength counts that a rule is stored for, increasing."""
    return sorted(_rules().get(indices.check(name), {}))


def rule(name: str, samples: int | None = None) -> Rule:
    """Return the quadrature of a metal.

    Parameters
    ----------
    name : str
        One of `indices.names`.
    samples : int, optional
        Number of wavelengths: one of `counts`, or 81 for the 5 nm reference itself. By default the smallest
        count whose stated error is at most `TARGET`.

    Raises
    ------
    ParameterError
        If the metal is not known or there is no rule of that count.
    """
    stored = _rules().get(indices.check(name), {})
    reference = spectra.wavelengths()
    if samples is None:
        samples = next((count for count in sorted(stored) if stored[count].error <= TARGET), len(reference))
    if samples == len(reference):
        return Rule(reference, spectra.weights(), 0.0, 0.0)
    if samples not in stored:
        span = f"{min(stored)} to {max(stored)}" if stored else "no count"
        raise ParameterError.out_of_range(
            "samples", samples, f"{span} (or {len(reference)}) for {name}", "choose one of these or leave it out"
        )
    return stored[samples]


def uniform(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the plain alternative: `count` equally spaced wavelengths, 400 to 700 nm, with the best fixed weights.

    Each 5 nm sample of the projection is shared between its two neighbours (linear interpolation of the spectrum).
    """
    nodes = np.linspace(400.0, 700.0, count)
    share = np.array([np.interp(spectra.wavelengths(), nodes, unit) for unit in np.eye(count)])
    return nodes, spectra.unit_sum(share @ spectra.weights())


def report() -> Iterator[str]:
    """Yield the lines of the error table, in Markdown: one bounce / up to 8 bounces; ``*`` marks the default count."""
    metals = indices.names()
    sizes = sorted({count for name in metals for count in counts(name)})
    yield "| N | " + " | ".join(metals) + " |"
    yield "|" + " --- |" * (len(metals) + 1)
    for size in sizes:
        cells = []
        for name in metals:
            chosen = rule(name, size)
            single, error = measure(name, chosen.wavelengths, chosen.weights)
            mark = " *" if size == len(rule(name).wavelengths) else ""
            cells.append(f"{single:.0e} / {error:.0e}{mark}")
        yield f"| {size} | " + " | ".join(cells) + " |"
    for size in (8, 16, 31):
        errors = (measure(name, *uniform(size)) for name in metals)
        yield f"| {size} uniform | " + " | ".join(f"{single:.0e} / {error:.0e}" for single, error in errors) + " |"


if __name__ == "__main__":
    print("\n".join(report()))
