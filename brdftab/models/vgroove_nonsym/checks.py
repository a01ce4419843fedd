"""What `brdftab check` should know of this model."""

from brdftab.models.protocols import Checks

CHECKS = Checks(
    # every value is an integral
    tolerance=1e-5,
    # nearly all opposite facets are vertical as Phong's exponent nears -1
    settings=tuple({"ndf": "phong", "alpha": alpha} for alpha in (1.1, 1.2, 1.3, 1.4, 1.414)),
    thin={"fast": 14, "full": 4},
    directions={"fast": 6, "full": 2},
    scans={"fast": 1, "full": 2},
    variants={"fast": 1, "full": 2},
    box={"full": 12},
    skip_fast=dict.fromkeys(("twin", "gradient", "stiffness"), "the twin takes a minute to compile: in the full check"),
    twin_directions=40,
    # both sides of each change of rule and of the fitted reflectance
    switches=(
        ("nodes at 1e-4", {"ndf": "ggx", "alpha": 0.5, "material": "mirror"}, "tolerance", 1e-4),
        ("orders at 1e-5", {"ndf": "ggx", "alpha": 0.5, "material": "mirror"}, "tolerance", 1e-5),
        ("nodes at 1e-6", {"ndf": "ggx", "alpha": 0.5, "material": "mirror"}, "tolerance", 1e-6),
        ("fitted reflectance", {"ndf": "beckmann", "alpha": 0.5, "eta": 0.2, "k": 3.0}, "tolerance", 0.999e-5),
    ),
    # a known limit of the tolerance: derivatives need only be finite there
    unresolved={"a": (0.0, 1.0), "b": (0.0, 0.05)},
)
