"""What a fit found, how sure it is, how far it is from the data, and what should be doubted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from brdftab._version import __version__
from brdftab.evaluation.points import evaluate as evaluate_model
from brdftab.fit.parameters import Sum, Term
from brdftab.tables.content import SeveralArrays, listed, same_fields, told
from brdftab.tables.grid import Grid
from brdftab.tables.table import Table
from brdftab.tabulation.tabulate import tabulate
from brdftab.typing import Array


@dataclass(repr=False, eq=False)
class FitResult(SeveralArrays):
    """The result of `brdftab.fit_model`.

    Equal (``==``) where all but `times` is; without a hash.

    Attributes
    ----------
    model : str
        What was fitted, as ``ilm`` or ``smith+lambert``.
    channels : tuple of str
        Channels of the data.
    values : dict
        Free parameters in API units: floats, or arrays (C,) where a channel has its own.
    stderr : dict
        Standard errors of the same shapes from the sandwich covariance clustered by direction; NaN on a bound.
    stderr_classical : dict
        The same from s^2 (J^T J)^-1, which assumes independent noise of one size.
    fixed : dict
        Parameters that were held, by term, defaults included.
    fixed_from : dict
        Where each of them comes from, by term: "user", "file" (the data's own provenance) or "default".
    correlation : ndarray (n, n)
        Of the entries named by `labels`.
    labels : list of str
        As ``sigma`` and ``kd[R]``.
    metrics : dict
        logeps, log_rms, cube_root_rms, cosine_rms, l1p (see `brdftab.fit.metrics`), and the reciprocity floor of
        the data (None where the format stores both orders as one value).
    error_by_theta : list of dict
        Mean and rms of the error by theta_i (radians).
    points : dict
        Directions, residuals used, saturated ones, and what was left out a channel, by reason.
    loss : dict
        Residual with the floor of the logarithm (1/sr), robust scale and noise floor.
    starts : dict
        Tried, how many agreed with the best, and the cost each ended with.
    solver : dict
        Method, verdict in words, steps, and the quadrature rule with its measured bias in standard errors (both None of
        closed forms, which have no rule).
    cost, bic : float
        Half the sum of squared residuals, and n ln(2 cost/n) + k ln n.
    times : dict
        Seconds: compile, starts, first_stage, polish, total.
    warnings : list of str
        One line each; empty for a fit that nothing speaks against.
    source, sampling : str
        Where the data come from and how directions were chosen.
    """

    model: str
    channels: tuple[str, ...]
    values: dict[str, Any]
    stderr: dict[str, Any]
    stderr_classical: dict[str, Any]
    fixed: dict[str, dict[str, Any]]
    fixed_from: dict[str, dict[str, str]]
    correlation: Array
    labels: list[str]
    metrics: dict[str, float | None]
    error_by_theta: list[dict[str, Any]]
    points: dict[str, Any]
    loss: dict[str, Any]
    starts: dict[str, Any]
    solver: dict[str, Any]
    cost: float
    bic: float
    times: dict[str, float]
    source: str
    sampling: str
    total: Sum = field(repr=False)
    warnings: list[str] = field(default_factory=list)

    _arrays = "correlation, values['NAME'] and stderr['NAME'] of a parameter with a value a channel"

    def __eq__(self, other: object) -> bool:
        left = ("times", "total")
        return same_fields(self, other, [name for name in self.__dataclass_fields__ if name not in left])

    __hash__ = None  # type: ignore[assignment]  # its content can change

    def __repr__(self) -> str:
        found = [
            f"{name} = {value:.6g} +- {self.stderr[name]:.2g}"
            if isinstance(value, float)
            else f"{name} = {listed(f'{v:.6g}' for v in value)}"
            for name, value in self.values.items()
        ]
        rms = self.metrics.get("logeps")
        return told(
            self,
            self.model,
            *found,
            f"{self.points['directions']:,} directions",
            "" if rms is None else f"logeps {rms:.3g}",
            f"bic {self.bic:.6g}",
            f"{len(self.warnings)} warnings" if self.warnings else "no warnings",
        )

    def _parameters(self, term: Term, at: int) -> dict[str, Any]:
        """Return all parameters of one term for the evaluating functions."""
        found = dict(term.fixed)
        for variable in self.total.variables:
            if variable.term == at:
                value = self.values[variable.name]
                found[variable.param] = value.tolist() if variable.channels else value
        return found

    def evaluate(self, theta_i: ArrayLike, theta_o: ArrayLike, phi: ArrayLike, *, tolerance: float = 1e-6) -> Array:
        """Evaluate the fitted models with their exact kernels.

        Parameters
        ----------
        theta_i, theta_o, phi : array_like
            Radians, broadcast together.
        tolerance : float, optional
            Relative error asked of models that integrate.

        Returns
        -------
        ndarray (..., C)
            f in 1/sr without cosine.
        """
        total: Any = 0.0
        for at, term in enumerate(self.total.terms):
            given = self._parameters(term, at)
            if len(self.channels) in (1, 3):
                part = evaluate_model(term.model.name, theta_i, theta_o, phi, tolerance=tolerance, **given)
            else:
                each = [
                    evaluate_model(term.model.name, theta_i, theta_o, phi, tolerance=tolerance, **_pick(given, c))
                    for c in range(len(self.channels))
                ]
                part = np.concatenate([np.asarray(e) for e in each], axis=-1)
            total = total + part
        return np.broadcast_to(total, (*total.shape[:-1], len(self.channels))).copy()

    def predict(
        self, grid: Grid | str | Mapping[str, Any] | None = None, *, dtype: str = "float32", tolerance: float = 1e-3
    ) -> Table:
        """Tabulate the fitted models.

        Parameters
        ----------
        grid : Grid, str or mapping, optional
            As in `brdftab.tabulate`.
        dtype : {"float32", "float64"}, optional
            Type of the stored values.
        tolerance : float, optional
            Relative error asked of each term.

        Returns
        -------
        Table
            The sum, with the fit in its provenance.
        """
        if len(self.total.terms) == 1 and len(self.channels) in (1, 3):
            (term,) = self.total.terms
            table = tabulate(term.model.name, grid, dtype=dtype, tolerance=tolerance, **self._parameters(term, 0))
            if table.channels == self.channels:
                table.provenance["fit"] = self.to_json()
                return table
        tables = []
        for at, term in enumerate(self.total.terms):
            given = self._parameters(term, at)
            if len(self.channels) in (1, 3):
                tables.append(tabulate(term.model.name, grid, dtype="float64", tolerance=tolerance, **given))
                continue
            parts = [
                tabulate(term.model.name, grid, dtype="float64", tolerance=tolerance, **_pick(given, c))
                for c in range(len(self.channels))
            ]
            parts[0].values = np.concatenate([p.values for p in parts], axis=-1)
            tables.append(parts[0])
        shape = (*tables[0].grid.shape, len(self.channels))
        values = np.zeros(shape)
        for table in tables:
            values += table.values
        worst = max((t.provenance["error"] for t in tables), key=lambda e: e["estimate"])
        provenance = {
            "model": self.model,
            "parameters": {t.label: self._parameters(t, n) for n, t in enumerate(self.total.terms)},
            "tolerance": tolerance,
            "components": False,
            "error": worst,
            "kernel_time_s": sum(t.provenance["kernel_time_s"] for t in tables),
            "total_time_s": sum(t.provenance["total_time_s"] for t in tables),
            "fit": self.to_json(),
        }
        return Table(values.astype(dtype), tables[0].grid, self.channels, {}, None, provenance, __version__)

    def to_json(self) -> dict[str, Any]:
        """Return everything as plain JSON; numbers that do not exist are null, angles are radians."""
        left = ("total",)
        facts = {name: getattr(self, name) for name in self.__dataclass_fields__ if name not in left}
        facts = {"format": "brdftab-fit", "format_version": 1, "version": __version__, **facts}
        return _plain(facts)


def _pick(given: Mapping[str, Any], channel: int) -> dict[str, Any]:
    """Return parameters of one channel."""
    return {k: (v[channel] if isinstance(v, list) and len(v) > 1 else v) for k, v in given.items()}


def _plain(value: Any) -> Any:
    """Return plain JSON values; NaN and infinity become null."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
