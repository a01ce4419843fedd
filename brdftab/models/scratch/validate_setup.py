"""What is checked and chosen before anything is traced."""

from __future__ import annotations

from dataclasses import replace

from brdftab.materials.fresnel import approximated
from brdftab.models.resolve import Setup
from brdftab.models.scratch.profiles import parse


def validate_setup(setup: Setup) -> Setup:
    """Return the setup with the reflectance that it asks for, after its profile has been read.

    Raises
    ------
    ParameterError, FileFormatError
        If there is no such profile.
    """
    parse(setup.values["profile"])
    assert setup.fresnel is not None
    return replace(setup, fresnel=approximated(setup.fresnel, setup.values["fresnel"]))
