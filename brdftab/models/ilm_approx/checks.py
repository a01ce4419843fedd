"""What `brdftab check` should know of this model."""

from brdftab.models.protocols import Checks

CHECKS = Checks(
    # facets that are tilted lose light by design: a single bounce
    furnace=({"kd": 1.0, "ndf": "beckmann", "sigma": 0.0},),
)
