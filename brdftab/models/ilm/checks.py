"""What `brdftab check` should know of this model."""

from brdftab.models.protocols import Checks

_BODY = {"kd": 0.5, "ior": 1.5, "sigma": 0.3}
CHECKS = Checks(
    # the body is an integral, and a cavity a system of equations
    tolerance=1e-5,
    thin={"fast": 14, "full": 3},
    directions={"fast": 6, "full": 2},
    scans={"fast": 1, "full": 3},
    variants={"fast": 1, "full": 3},
    box={"fast": 3, "full": 12},
    twin_directions=40,
    # interreflections, which thinning would leave out
    settings=({"bounces": "2", "kd": 0.9}, {"bounces": "inf", "kd": 0.9, "ndf": "ggx", "sigma": 0.7}),
    furnace=(
        {"bounces": "inf", "kd": 1.0},
        {"bounces": "inf", "kd": 1.0, "ior": 2.0},
        {"bounces": "inf", "kd": 1.0, "ndf": "beckmann", "sigma": 0.0},
    ),
    # series of the diffuse reflectance to its closed form, the plain rules to the split one, and the counts of nodes
    switches=(
        ("series of the diffuse reflectance", {"kd": 0.9}, "ior", 1.6),
        ("split rule at 5e-4", _BODY, "tolerance", 5e-4),
        ("split rule at 3e-5", _BODY, "tolerance", 3e-5),
        ("plain rule beyond a slope of 0.3", {"kd": 0.9, "ior": 1.5, "sigma": 0.3}, "tolerance", 8e-6),
        ("smooth cavities", {"kd": 0.9, "ior": 1.5, "bounces": "inf"}, "sigma", 1e-4),
    ),
)
