"""Which roughness has a mean: Phong's opposite facets end at sqrt 2."""

from __future__ import annotations

from brdftab.errors import ParameterError
from brdftab.models._shared.codes import PHONG
from brdftab.models.resolve import Setup
from brdftab.models.vgroove_nonsym.rules import MOST_PHONG


def validate_setup(setup: Setup) -> Setup:
    """Return the setup.

    Raises
    ------
    ParameterError
        For facets whose opposite ones have no distribution.
    """
    if setup.ndf == PHONG and setup.alpha_x >= MOST_PHONG:
        raise ParameterError(
            f"alpha = {setup.alpha_x:g} is outside (0, sqrt 2) for ndf = phong in vgroove-nonsym: the opposite facet's "
            "distribution D sin^2 has no finite integral; use a smaller alpha or vgroove-sym"
        )
    return setup
