"""What a tolerance means for the solver: nodes, panels, modes, poles."""

from __future__ import annotations

import math
from dataclasses import dataclass

# finer tolerances keep the finest rule
FINEST = 1e-10
# most Gauss nodes a panel; wider ones are split
MOST_NODES = 12


@dataclass(frozen=True)
class Settings:
    """Sizes of every rule.

    Attributes
    ----------
    tolerance : float
        Relative error asked of a cell.
    nodes : int
        Least Gauss nodes a panel.
    panel : float
        Error asked of the Gauss rule of a panel.
    dense : int
        Azimuth modes 0 .. dense - 1 are solved one by one.
    chebyshev : int
        Modes solved in each octave above.
    decay : float
        A mode is left out where exp(-decay) bounds it, relative to mode 0.
    poles : float
        Error asked of the fit of the reflectance.
    """

    tolerance: float
    nodes: int
    panel: float
    dense: int
    chebyshev: int
    decay: float
    poles: float


def settings(tolerance: float, trial: bool = False) -> Settings:
    """Return the sizes for a relative tolerance of a cell; every factor of 100 adds a node to each panel.

    Parameters
    ----------
    tolerance : float
        In (0, 1); what is below 1e-10 is taken as 1e-10.
    trial : bool
        As coarse as can be, only to compile the kernels.
    """
    asked = 0.5 if trial else max(tolerance, FINEST)
    digits = -math.log10(asked)
    return Settings(
        tolerance=asked,
        nodes=1 + int(0.5 * digits + 0.15),
        panel=0.3 * asked,
        dense=max(16, min(32, 8 + int(6.0 * digits))),
        chebyshev=4 + round(1.2 * digits),
        decay=6.0 + 2.0 * digits,
        poles=asked,
    )
