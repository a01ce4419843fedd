"""Which roughnesses count as flat, which choices go together, and how many bounces a word means."""

from __future__ import annotations

from dataclasses import replace

from brdftab.errors import ParameterError
from brdftab.models._shared.facets.flat import resolvable
from brdftab.models.resolve import Setup

_CAPS = {"1": 1, "2": 2, "inf": None}


def validate_setup(setup: Setup) -> Setup:
    """Return the setup with its cap of the bounces, and roughnesses that float64 resolves; what is narrower is flat.

    Raises
    ------
    ParameterError
        For choices that exclude each other.
    """
    ndf, masking, bounces = setup.parameters["ndf"], setup.values["masking"], setup.values["bounces"]
    if ndf == "gaussian" and masking == "smith":
        raise ParameterError(
            "masking = smith is not defined for ndf = gaussian, whose facets near 90 degrees make Lambda infinite; "
            "use torrance-sparrow"
        )
    if bounces != "1" and masking == "smith":
        raise ParameterError(
            f"bounces = {bounces} follows light in V-cavities and needs masking = torrance-sparrow, not smith"
        )
    if bounces != "1" and ndf == "gaussian":
        raise ParameterError(
            f"bounces = {bounces} follows light in V-cavities and needs ndf = beckmann or ggx, not gaussian"
        )
    return resolvable(replace(setup, max_bounces=_CAPS[bounces]))
