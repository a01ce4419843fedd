"""How fine the solver resolves angles and azimuths at a tolerance."""

from __future__ import annotations

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
        Widest panel over roughness plus elevation.
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


LEVELS = (
    (1e-3, Level(1, 0.1, 0.7, 0.5, 6, 32, 9.0, 7, 1e-6)),
    (1e-4, Level(2, 0.1, 0.7, 0.5, 8, 48, 12.0, 9, 1e-7)),
    (1e-5, Level(3, 0.1, 0.7, 0.5, 10, 64, 15.0, 11, 1e-8)),
    (1e-6, Level(4, 0.08, 0.6, 0.4, 12, 96, 18.0, 13, 1e-10)),
)


def level(tolerance: float) -> Level:
    """Return the resolution for a relative error; the finest one below 1e-6."""
    for least, found in LEVELS:
        if tolerance >= least:
            return found
    return LEVELS[-1][1]


def energy_levels(tolerance: float) -> tuple[Level, Level]:
    """Return the resolutions of an albedo, for states that directions share and for one direction alone."""
    shared = level(tolerance)
    return replace(shared, nodes=shared.nodes + 1, width=0.05), replace(shared, nodes=shared.nodes + 2, width=0.05)
