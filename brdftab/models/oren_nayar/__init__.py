"""Rough diffuse reflection: Lambertian facets in V-cavities."""

import math

from brdftab.models.common_params import ALBEDOS, TILTS
from brdftab.models.declaration import Model, Param

SPEC = Model(
    name="oren-nayar",
    title="Oren-Nayar rough diffuser",
    summary="Lambertian V-cavities, masking and one interreflection, by the 1994 fit",
    params=(
        Param(
            "kd",
            "",
            0.5,
            (0.0, 1.0),
            "albedo of a facet; one value or three (R, G, B)",
            "channels",
            role="albedo",
            extremes=ALBEDOS,
            neutral=0.0,
        ),
        Param(
            "sigma",
            "rad",
            math.radians(20.0),
            (0.0, math.pi / 2),
            "standard deviation of the facets' tilt",
            role="tilt",
            extremes=TILTS,
        ),
        Param(
            "variant",
            "",
            "full",
            None,
            "the full 1994 fit with its interreflection term, or the qualitative form",
            "choice",
            ("full", "qualitative"),
        ),
    ),
    components=("direct", "interreflection"),
    citation="Oren, Nayar: Generalization of Lambert's Reflectance Model, SIGGRAPH 1994",
    doi="10.1145/192161.192213",
    variant=(
        "Full functional fit (Eqs. 27-29) by default; the qualitative form (Eq. 30) drops C3 and the interreflection."
    ),
    errata=(
        "The fit's direct part falls below zero at grazing mirror directions for large sigma; it is clamped at zero. "
        "The qualitative form's 0.33 is kept (a later remark by the authors suggests 0.57 to imitate interreflection)."
    ),
    # the paper's short form of its own model
    methods={"variant": ("qualitative",)},
)
