"""Which plugin of Mitsuba 3 computes the same: roughconductor, whose masking is separable."""

from __future__ import annotations

from typing import Any

import numpy as np

from brdftab.materials.fresnel import CONDUCTOR, MIRROR
from brdftab.models.resolve import Setup

# Mitsuba takes Walter's rational fit of Beckmann's G1
_MASKINGS = {"ggx": "separable", "beckmann": "smith-walter"}


def plugin(setup: Setup) -> dict[str, Any] | str:
    """Return the plugin's dictionary, or why there is none."""
    ndf, fresnel = str(setup.parameters["ndf"]), setup.fresnel
    assert fresnel is not None
    if ndf not in _MASKINGS:
        return f"roughconductor has no ndf = {ndf}"
    if setup.values["masking"] != _MASKINGS[ndf]:
        return f"roughconductor computes masking = {_MASKINGS[ndf]} for ndf = {ndf}"
    if fresnel.kind == MIRROR:
        colour: dict[str, Any] = {"material": "none"}
    elif fresnel.kind == CONDUCTOR and np.array_equal(fresnel.weights, np.eye(3)):
        colour = {n: {"type": "rgb", "value": list(map(float, v))} for n, v in (("eta", fresnel.a), ("k", fresnel.b))}
    else:
        return "roughconductor takes one index a channel: give eta and k with three values, or material = mirror"
    rough = {"alpha": setup.alpha_x} if setup.isotropic else {"alpha_u": setup.alpha_x, "alpha_v": setup.alpha_y}
    return {"type": "roughconductor", "distribution": ndf, **rough, **colour}
