"""What `brdftab check` should know of this model."""

from brdftab.models.protocols import Checks

CHECKS = Checks(
    thin={"fast": 10, "full": 3},
    scans={"full": 2},
    skip_fast={"continuity": "every roughness integrates its own albedo: in the full check"},
    switches=(
        ("rules of the albedo at 1e-4", {"ndf": "ggx", "alpha": 0.5, "material": "Au"}, "tolerance", 1e-4),
        ("few nodes of smooth facets", {"ndf": "beckmann", "alpha": 0.2999, "f0": 0.5}, "tolerance", 1e-4),
    ),
)
