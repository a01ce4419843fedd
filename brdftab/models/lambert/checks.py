"""What `brdftab check` should know of this model."""

from brdftab.models.protocols import Checks

CHECKS = Checks(
    furnace=({"kd": 1.0},),
)
