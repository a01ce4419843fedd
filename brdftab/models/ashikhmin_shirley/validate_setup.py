"""What a base of three colours goes with, and how wide the highlight is."""

from __future__ import annotations

import math
from dataclasses import replace

from brdftab.errors import ParameterError
from brdftab.materials.spectra import CHANNELS
from brdftab.models.resolve import Setup


def validate_setup(setup: Setup) -> Setup:
    """Return the setup with the highlight's widths, by which quadratures place their nodes.

    Raises
    ------
    ParameterError
        If kd has three values and the reflectance is that of single wavelengths.
    """
    assert setup.fresnel is not None
    if setup.values["kd"].size > 1 and setup.fresnel.channels not in (("Y",), CHANNELS):
        raise ParameterError(
            f"kd has {setup.values['kd'].size} values where the channels are {', '.join(setup.fresnel.channels)}; "
            "give one, or leave wavelengths out"
        )
    along, across = (math.sqrt(2.0 / (setup.values[name] + 2.0)) for name in ("nu", "nv"))
    return replace(setup, alpha_x=along, alpha_y=across)
