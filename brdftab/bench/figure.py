"""Error against run time, log-log with error bars, an axis a setup."""

from __future__ import annotations

import math
import os
from typing import Any

from brdftab import models
from brdftab.bench.front import front
from brdftab.bench.report import settings
from brdftab.plotting.figure import figure

LABELS = {
    "l1": "relative L1 error",
    "l2": "relative L2 error",
    "max": "largest relative error",
    "albedo": "relative albedo error",
}
MARKERS = "os^vDP*X<>ph"


def draw(
    results: list[dict[str, Any]],
    path: str | os.PathLike[str],
    *,
    error: str = "l1",
    time: str = "kernel",
    overwrite: bool = False,
) -> None:
    """Draw results of `benchmark`.

    Parameters
    ----------
    results : list of dict
        One axis each.
    path : str or path-like
        Ends in .png, .pdf or .svg; written whole or not at all.
    error : {"l1", "l2", "max", "albedo"}, optional
        Measure of the ordinate.
    time : {"kernel", "total"}, optional
        Run time of the abscissa.
    overwrite : bool, optional
        Whether an existing file may be replaced.

    Raises
    ------
    BrdftabError
        Where matplotlib is missing, the ending is unknown or the file cannot be written.
    """
    columns = min(3, len(results))
    rows = math.ceil(len(results) / columns)
    with figure(path, (4.6 * columns, 4.4 * rows), "figure", overwrite=overwrite) as picture:
        axes = picture.subplots(rows, columns, squeeze=False).ravel()
        for axis, result in zip(axes, results, strict=False):
            _draw_one(axis, result, error, time)
        for axis in axes[len(results) :]:
            axis.set_visible(False)


def _bars(row: dict[str, Any], known: dict[str, Any], error: str, time: str) -> dict[str, float]:
    """Return a row's place and how far its bars reach; errors below the reference's uncertainty stand at that."""
    own, doubt = row["error"][error], known["uncertainty"][error]
    low, high = row["error_range"][error] if row["error_range"] else (own - doubt, own + doubt)
    at, took = max(own, doubt), row[f"{time}_s"]
    # a bar that reaches zero would run to the axis' end
    down = min(at - low, 0.9 * at)
    return {
        "x": took["median"],
        "y": at,
        "left": max(0.0, took["median"] - took["min"]),
        "right": max(0.0, took["max"] - took["median"]),
        "down": max(0.0, down),
        "up": max(0.0, high - at),
    }


def _draw_one(axis: Any, result: dict[str, Any], error: str, time: str) -> None:
    """Draw one setup: a line a family, hollow where the reference resolves nothing, and the front."""
    known = result["reference"]
    families = dict.fromkeys(row["family"] for row in result["methods"])
    places: dict[str, tuple[float, float]] = {}
    for number, family in enumerate(families):
        rows = [row for row in result["methods"] if row["family"] == family]
        bars = [_bars(row, known, error, time) for row in rows]
        places |= {row["name"]: (bar["x"], bar["y"]) for row, bar in zip(rows, bars, strict=True)}
        marker = MARKERS[number % len(MARKERS)]
        x, y = [bar["x"] for bar in bars], [bar["y"] for bar in bars]
        drawn = axis.errorbar(
            x,
            y,
            xerr=[[bar["left"] for bar in bars], [bar["right"] for bar in bars]],
            yerr=[[bar["down"] for bar in bars], [bar["up"] for bar in bars]],
            fmt=f"{marker}-",
            markersize=4.5,
            linewidth=1.0,
            elinewidth=0.7,
            label=family.replace("_", " "),
        )
        for row, bar in zip(rows, bars, strict=True):
            if not row["resolved"][error]:
                axis.plot(bar["x"], bar["y"], marker, markersize=4.5, mfc="white", mec=drawn[0].get_color(), zorder=5)
    best = [places[name] for name in front(result["methods"], known["uncertainty"], error, time)]
    axis.step(*zip(*best, strict=True), where="post", color="0.3", linewidth=0.8, linestyle=":", label="front")
    axis.axhspan(0.0, known["uncertainty"][error], color="0.9", zorder=0)
    axis.set(xscale="log", yscale="log", xlabel=f"{time} time (s), {result['pairs']:,} pairs", ylabel=LABELS[error])
    rough = models.spec(result["model"]).roughness
    words = [word for word in settings(result) if "[" not in word]
    # the distribution and its roughness tell more than the rest
    shown = sorted(words, key=lambda word: not word.startswith(("ndf ", rough)))[:3]
    axis.set_title(f"{result['model']}: {', '.join(shown)}", fontsize=9)
    axis.grid(alpha=0.25)
    axis.legend(fontsize=6.5)
