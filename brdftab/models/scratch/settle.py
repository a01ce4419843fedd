"""Checks of the profile before anything is traced."""

from __future__ import annotations

from brdftab.models.scratch.profiles import parse
from brdftab.models.setup import Setup


def settle(setup: Setup) -> Setup:
    """Return the setup after its profile has been read.

    Raises
    ------
    ParameterError, FileFormatError
        If there is no such profile.
    """
    parse(setup.values["profile"])
    return setup
