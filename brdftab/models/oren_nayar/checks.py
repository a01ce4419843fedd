"""What `brdftab check` should know of this model."""

import math

from brdftab.models.protocols import Checks

CHECKS = Checks(
    # a white body at every roughness, in both forms
    settings=tuple(
        {"kd": 1.0, "sigma": math.radians(s), "variant": v}
        for s in (0.0, 20.0, 45.0, 90.0)
        for v in ("full", "qualitative")
    ),
    furnace=({"kd": 1.0, "sigma": 0.0},),
)
