"""What a tolerance means for the solver: nodes, panels, modes, poles."""

from __future__ import annotations

import math
from dataclasses import dataclass

from brdftab.models._shared.codes import BECKMANN

# finer tolerances keep the finest rule
FINEST = 1e-10
# roughness that the solver serves
SOLVER_ALPHA = (0.01, 2.0)
# most Gauss nodes a panel; wider ones are split
MOST_NODES = 12
# modes an octave, exponent where modes end, and exponent where a mode is 0 beside the largest, that reach rounding
TAIL_MODES, TAIL_DECAY, TAIL_DEPTH = 26, 40.0, 36.0
# elevation of the last row of a table of one degree, for which the modes were calibrated
USUAL = math.tan(math.radians(0.5))


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
    share : float
        Half a panel is at most this share of its upper end: the modes of a grazing pair decay over its elevation.
    dense : int
        Azimuth modes 0 .. dense - 1 are solved one by one.
    poles : float
        Error asked of the fit of the reflectance.
    """

    tolerance: float
    nodes: int
    panel: float
    share: float
    dense: int
    poles: float

    def chebyshev(self, ndf: int, alpha: float, lowest: float) -> int:
        """Return how many modes are solved in an octave, for a roughness and the lowest elevation (radians).

        A narrow peak stands over faint azimuths, whose relative error its interpolation must not spoil. Beckmann's
        tails are as faint as can be: its modes are always as good as rounding allows.
        """
        if ndf == BECKMANN:
            return TAIL_MODES
        faint = -2.2 * math.log10(_sharpness(alpha, lowest))
        return max(4, min(TAIL_MODES, math.ceil(8.0 + 1.63 * (faint - 6.5 - math.log10(self.tolerance)))))

    def decay(self, ndf: int, alpha: float, lowest: float) -> float:
        """Return the exponent from which on modes are left out, likewise."""
        if ndf == BECKMANN:
            return TAIL_DECAY
        return max(6.0, 1.0 - math.log(self.tolerance) - 2.2 * math.log(_sharpness(alpha, lowest)))


def _sharpness(alpha: float, lowest: float) -> float:
    """Return the width of the narrowest azimuth peak in units of that of alpha = 1 on the usual grid, at most 1."""
    return min(1.0, alpha * min(1.0, math.tan(lowest) / USUAL))


def settings(ndf: int, tolerance: float, trial: bool = False) -> Settings:
    """Return the sizes for a relative tolerance of a cell; below 1e-3 every factor of 100 adds a node to each panel.

    Parameters
    ----------
    ndf : int
        Beckmann (0) or GGX (1).
    tolerance : float
        In (0, 1); what is below 1e-10 is taken as 1e-10.
    trial : bool
        As coarse as can be, only to compile the kernels.
    """
    asked = 0.5 if trial else max(tolerance, FINEST)
    digits = -math.log10(asked)
    # Beckmann's exponentials bend more than GGX's powers
    panel = (0.035 if ndf == BECKMANN else 0.7) * asked
    return Settings(
        tolerance=asked,
        nodes=max(1, int(0.16 - 0.5 * math.log10(panel))),
        panel=panel,
        share=0.5 if asked > 5e-4 else 0.25,
        dense=max(16, min(32, 8 + int(6.0 * digits))),
        poles=asked,
    )
