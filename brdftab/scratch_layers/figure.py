"""Cross-sections in numbers and drawn with matplotlib (extra ``report``)."""

from __future__ import annotations

import math
import os
from typing import Any

import numpy as np

from brdftab.models.scratch.profiles import Profile, parse
from brdftab.plotting.figure import figure

POINTS = 1025


def profile_of(text: str) -> Profile:
    """Return the profile that a string names; raises `ParameterError` or `FileFormatError`."""
    return parse(text)


def summary(profile: Profile) -> dict[str, Any]:
    """Return what a profile is: name, depth in half widths, steepest slope and its angle in degrees, pieces, symmetry.

    Walls that end vertically have the slope of their last parabola.
    """
    ends = profile.slope + 2.0 * profile.bend * np.diff(profile.knots)
    steepest = float(max(np.abs(profile.slope).max(), np.abs(ends).max()))
    return {
        "profile": profile.text,
        "depth": profile.depth,
        "steepest_slope": steepest,
        "steepest_degrees": math.degrees(math.atan(steepest)),
        "pieces": int(profile.height.size),
        "symmetric": profile.symmetric,
    }


def draw(profile: Profile, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Draw heights to scale, and the angles of the slopes below them.

    Parameters
    ----------
    profile : Profile
    path : str or path-like
        Ends in .png, .pdf or .svg; written whole or not at all.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    BrdftabError
        Where matplotlib is missing, the ending is unknown or the file cannot be written.
    """
    # both sides of every knot, so that walls which meet in an edge keep it
    tiny = 1e-9
    x = np.unique(np.clip(np.concatenate([np.linspace(-1.0, 1.0, POINTS), profile.knots, profile.knots - tiny]), -1, 1))
    height, slope = profile.at(x)
    with figure(path, (7.0, 6.0), "out", overwrite=overwrite) as picture:
        top, bottom = picture.subplots(2, 1, sharex=True)
        across, surface = np.concatenate([[-1.6], x, [1.6]]), np.concatenate([[0.0], height, [0.0]])
        top.plot(across, surface, "k")
        top.fill_between(across, surface, -1.25 * max(profile.depth, 0.1), color="0.85")
        top.set(title=f"{profile.text}: depth {profile.depth:.4g} half widths", ylabel="height (half widths)")
        if profile.depth <= 4.0:
            top.set_aspect("equal", adjustable="datalim")
        bottom.plot(x, np.degrees(np.arctan(slope)), "k")
        bottom.axhline(0.0, color="0.6", linewidth=0.8)
        bottom.set(xlabel="place across the scratch (half widths)", ylabel="slope (degrees)")
