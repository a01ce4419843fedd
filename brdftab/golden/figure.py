"""A figure of where point values differ from the golden ones."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from brdftab.golden.differences import relative
from brdftab.golden.points import Held
from brdftab.golden.quantities import QUANTITIES
from brdftab.plotting.figure import figure

FLOOR = 1e-17


def draw_points(
    pairs: Sequence[tuple[Held, Held]],
    atol_part: float,
    rtol: float,
    model: str,
    path: str | os.PathLike[str],
    *,
    overwrite: bool = False,
) -> None:
    """Draw the relative differences of every setting, a colour a quantity, and the tolerance.

    Parameters
    ----------
    pairs : sequence of (Held, Held)
        Golden and today's settings.
    atol_part, rtol : float
        Tolerances, the first in parts of a quantity's largest value.
    model : str
        For the title.
    path : str or path-like
        Ends in .png, .pdf or .svg; written whole or not at all.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    BrdftabError
        Where matplotlib is missing or the file cannot be written.
    """
    with figure(path, (10.0, 1.6 + 0.3 * len(pairs)), "figure", overwrite=overwrite) as picture:
        axes = picture.subplots()
        for shift, name in enumerate(QUANTITIES):
            x, y = [], []
            for row, (golden, now) in enumerate(pairs):
                a, b = golden.quantities.get(name), now.quantities.get(name)
                if a is None or b is None or a.shape != b.shape:
                    continue
                largest = float(np.abs(a[np.isfinite(a)]).max(initial=0.0))
                gap = relative(a, b, atol_part * largest).ravel()
                gap = np.minimum(gap[gap > 0.0], 2.0)
                x += gap.tolist()
                y += [row + 0.15 * (shift - 0.5 * (len(QUANTITIES) - 1))] * gap.size
            axes.plot(np.maximum(x, FLOOR), y, ".", markersize=4, label=name)
        axes.axvline(rtol, color="k", linestyle="--", label=f"rtol = {rtol:g}")
        axes.set_xscale("log")
        axes.set_yticks(range(len(pairs)), [golden.label for golden, _ in pairs])
        axes.invert_yaxis()
        axes.set(title=f"{model}: golden against now", xlabel="relative difference of every number")
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
