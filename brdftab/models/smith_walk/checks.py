"""What `brdftab check` should know of this model."""

from brdftab.models.protocols import Checks

CHECKS = Checks(
    thin={"fast": 14, "full": 3},
    directions={"fast": 4, "full": 2},
    # mirrors, and glass with light from either side
    furnace=({"material": "mirror"}, {"ior": 1.5}),
)
