"""What is checked and chosen before anything is traced."""

from __future__ import annotations

from dataclasses import replace

from brdftab.materials.fresnel import approximated
from brdftab.models.scratch.profiles import parse
from brdftab.models.setup import Setup


def settle(setup: Setup) -> Setup:
    """Return the setup with the reflectance that it asks for, after its profile has been read.

    Raises
    ------
    ParameterError, FileFormatError
        If there is no such profile.
    """
    parse(setup.values["profile"])
    assert setup.fresnel is not None
    return replace(setup, fresnel=approximated(setup.fresnel, setup.values["fresnel"]))
