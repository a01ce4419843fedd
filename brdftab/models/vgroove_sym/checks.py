"""What `brdftab check` should know of this model."""

from brdftab.models.protocols import Checks

CHECKS = Checks(
    # both sides of each change of rule
    switches=(
        ("orders at 5e-4", {"ndf": "ggx", "alpha": 1.0, "material": "mirror"}, "tolerance", 5e-4),
        ("nodes at 5e-5", {"ndf": "ggx", "alpha": 1.0, "material": "mirror"}, "tolerance", 5e-5),
        ("orders at 2e-5", {"ndf": "ggx", "alpha": 1.0, "material": "mirror"}, "tolerance", 2e-5),
        ("orders at 2e-6", {"ndf": "ggx", "alpha": 1.0, "material": "mirror"}, "tolerance", 2e-6),
    ),
    thin={"fast": 8, "full": 2},
    scans={"fast": 1, "full": 3},
    variants={"fast": 1, "full": 3},
)
