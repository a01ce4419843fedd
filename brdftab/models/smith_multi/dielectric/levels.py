"""How fine the solver resolves angles and azimuths at a tolerance.

GGX, n = 1.5, a table of 45 x (45 + 45) angles to 89 degrees and 90 azimuths: at 1e-3 and alpha .5 the largest error
over the value of its own cell is 9e-4 (rms 3e-5) in 2.2 CPU seconds. Dark cells far beside narrow lobes are harder: at
alpha .1, 24 x (24 + 24) angles, 5e-3 (rms 2e-4). Finer levels gain slowly in cells that only two bounces and more
reach, beside the end of refraction: 5e-4 at 1e-4 (rms 2e-5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Level:
    """Resolution of the solver.

    Attributes
    ----------
    nodes : int
        Gauss nodes a panel of p.
    width : float
        Widest panel in angle (radians).
    lobe : float
        Widest panel over the half-width of a lobe.
    grading : float
        Widest panel over its elevation plus that of the lowest direction.
    azimuths : int
        Gauss nodes a panel of azimuth.
    modes : int
        Azimuth modes that are integrated; higher ones keep the lobes only.
    reach : float
        Modes are left out where lobes have decayed by exp(-reach).
    octave : int
        Chebyshev nodes an octave of the higher modes.
    sweep : float
        Scattering orders end when a further one adds less than this part.
    """

    nodes: int
    width: float
    lobe: float
    grading: float
    azimuths: int
    modes: int
    reach: float
    octave: int
    sweep: float


# by least tolerance, for alpha = ROUGH
LEVELS = (
    (1e-2, Level(1, 0.06, 0.7, 0.8, 10, 32, 9.0, 7, 1e-6)),
    (1e-3, Level(2, 0.05, 0.7, 0.8, 12, 40, 11.0, 9, 1e-7)),
    (1e-4, Level(3, 0.05, 0.7, 0.6, 12, 56, 14.0, 11, 1e-8)),
    (1e-5, Level(3, 0.035, 0.6, 0.5, 14, 72, 17.0, 13, 1e-9)),
    (1e-6, Level(4, 0.03, 0.5, 0.4, 16, 96, 20.0, 15, 1e-11)),
)
# smoother surfaces take more modes, up to MORE times as many
ROUGH, MORE = 0.5, 6.0
# finest level of the bounces from three on between listed pairs, and of all that is solved
FURTHER, FINEST = 1e-5, LEVELS[-1][0]


def level(tolerance: float, alpha: float) -> Level:
    """Return the resolution for a relative error; the finest one below 1e-6."""
    # 100 times 1e-6 is less than 1e-4 by rounding
    found = next((found for least, found in LEVELS if tolerance >= (1.0 - 1e-9) * least), LEVELS[-1][1])
    more = max(ROUGH / alpha, 1.0)
    # the tails between narrow lobes fall like a power of alpha against their peaks
    return replace(found, modes=int(found.modes * min(more**0.75, MORE)), reach=found.reach + 3.0 * math.log(more))


def further(tolerance: float, alpha: float) -> Level:
    """Return the resolution of the bounces from three on, where two are resolved for a relative error.

    Two bounces need one sum over states and are as good as their azimuth modes; more of them need the kernels between
    all states, weigh less, and are solved at `FURTHER` at best: 3e-6 of them are left, no more than a level above.
    """
    return level(max(tolerance, FURTHER), alpha)


def energy_levels(tolerance: float, alpha: float) -> tuple[Level, Level]:
    """Return the resolutions of an albedo, for states that directions share and for one direction alone."""
    shared = level(tolerance, alpha)
    return replace(shared, nodes=shared.nodes + 1, width=0.05), replace(shared, nodes=shared.nodes + 2, width=0.05)
