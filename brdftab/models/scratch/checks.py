"""What `brdftab check` should know of this model."""

import math

from brdftab.models.protocols import Checks

CHECKS = Checks(
    # few wide bins, so that a quadrature of the albedo sees them
    at_most={"rays": 512},
    cheap={"bins": 32, "rays": 512, "psi": math.radians(20.0)},
    # walls that are vertical at the rim or all over, the deepest notch, and none at all
    settings=(
        *(
            {"profile": profile}
            for profile in ("ellipse:1", "ellipse:100", "u:2:100", "u:100:100", "v:0.6", "quartic:100", "v:90", "flat")
        ),
        # rays as the tolerance asks
        {"rays": None},
    ),
    furnace=tuple({"profile": profile, "material": "mirror"} for profile in ("quartic:1", "u:2:100", "v:40")),
    # without max_bounces 64 are traced; the cone's half width is that of the samples along the scratch
    uncapped=False,
    cone="psi",
)
