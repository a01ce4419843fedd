"""Find the stored wavelength quadratures; run by hand when a material is added: ``python tools/find_wavelengths.py``.

Variable projection (Golub and Pereyra 1973, doi:10.1137/0710036): for given wavelengths the weights follow by linear
least squares against the 5 nm projection of many products of Fresnel terms, each divided by its largest channel; the
wavelengths move freely between bounds (trust region) from several starts, and the rule with the smallest measured error
is kept.
It needs scipy, which brdftab itself does not depend on, and takes some minutes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from brdftab.materials import indices, quadrature, spectra

COUNTS = range(3, 11)
STARTS = 16
# rows that hold the columns' sums at 1, and rows that keep weights from growing with opposite signs
PIN, RIDGE = 1e3, 1e-7
COSINES = np.sin(np.linspace(0.0, 0.5 * np.pi, 13)[1:])
# weights larger than this amplify the kernel's own error for nothing
LARGEST_SUM = 5.0


class Fit:
    """Least-squares problem of one metal: weights for given wavelengths, and what they leave."""

    def __init__(self, name: str) -> None:
        self.name = name
        exact = self.products(spectra.wavelengths()) @ spectra.weights()
        self.scale = exact.max(axis=1, keepdims=True)
        self.target = np.concatenate([exact / self.scale, np.full((1, 3), PIN)])

    def products(self, wavelengths: np.ndarray) -> np.ndarray:
        """Return the training products, float64 (rows, W)."""
        return quadrature.family(quadrature.terms(self.name, wavelengths, COSINES), 150, seed=1)

    def system(self, wavelengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return matrix and right-hand side of the linear problem."""
        count = len(wavelengths)
        rows = self.products(wavelengths) / self.scale
        matrix = np.concatenate([rows, np.full((1, count), PIN), RIDGE * np.eye(count)])
        return matrix, np.concatenate([self.target, np.zeros((count, 3))])

    def weights(self, wavelengths: np.ndarray) -> np.ndarray:
        """Return the best weights, float64 (W, 3), columns adding up to 1."""
        matrix, target = self.system(wavelengths)
        return spectra.unit_sum(np.linalg.lstsq(matrix, target, rcond=None)[0])

    def residual(self, wavelengths: np.ndarray) -> np.ndarray:
        """Return what the best weights leave, as one vector."""
        matrix, target = self.system(wavelengths)
        # scaled up: the solver's stopping rule compares with absolute numbers
        return 1e4 * (matrix @ np.linalg.lstsq(matrix, target, rcond=None)[0] - target).ravel()


def best_of(fit: Fit, starts: list[np.ndarray], best: quadrature.Rule | None = None) -> quadrature.Rule | None:
    """Move the wavelengths from every start and return the rule with the smallest measured error, or `best`."""
    from scipy.optimize import least_squares

    for start in starts:
        found = least_squares(fit.residual, start, bounds=(380.0, 780.0), x_scale=5.0, max_nfev=60)
        nodes = np.unique(found.x.round(1))
        if len(nodes) < len(start):
            continue
        weights = fit.weights(nodes)
        single, error = quadrature.measure(fit.name, nodes, weights, size=48)
        if np.abs(weights).sum(axis=0).max() <= LARGEST_SUM and (best is None or error < best.error):
            best = quadrature.Rule(nodes, weights, error, single)
    return best


def search(name: str) -> list[quadrature.Rule]:
    """Search the rules of all `COUNTS` for one metal; deterministic.

    First from even and random wavelengths, then downwards from the rule of one wavelength more, each dropped in turn.
    """
    fit = Fit(name)
    random = np.random.default_rng(1)
    rules: dict[int, quadrature.Rule] = {}
    for count in reversed(COUNTS):
        starts = [np.linspace(410.0, 680.0, count)]
        starts += [np.sort(random.uniform(400.0, 700.0, count)) for _ in range(STARTS - 1)]
        if count + 1 in rules:
            starts += [np.delete(rules[count + 1].wavelengths, drop) for drop in range(count + 1)]
        rule = best_of(fit, starts)
        if rule is None:
            raise RuntimeError(f"no start gave a rule of {count} wavelengths for {name}")
        rules[count] = rule
    return [rules[count] for count in COUNTS]


def main() -> None:
    """Search all rules and write ``data/quadrature.csv`` beside this file."""
    lines = [
        "# wavelength quadratures of products of Fresnel terms, linear sRGB under D65",
        "# taken from: python tools/find_wavelengths.py",
        "# single, error: largest error relative to the largest channel, one bounce and up to 8 bounces",
        "metal,count,single,error,wavelength_nm,red,green,blue",
    ]
    for name in indices.names():
        for rule in search(name):
            count = len(rule.wavelengths)
            single, error = quadrature.measure(name, rule.wavelengths, rule.weights)
            print(f"{name} {count}: {single:.1e} {error:.1e} {rule.wavelengths}", flush=True)
            for nm, row in zip(rule.wavelengths, rule.weights, strict=True):
                numbers = ",".join(repr(float(weight)) for weight in row)
                lines.append(f"{name},{count},{single:.2e},{error:.2e},{nm:g},{numbers}")
    target = Path(quadrature.__file__).with_name("data") / "quadrature.csv"
    target.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
