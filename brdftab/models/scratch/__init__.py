"""Extruded scratches with all interreflections between their walls."""

import math

from brdftab.models.common_params import FRESNEL_PARAMS
from brdftab.models.declaration import Model, Param
from brdftab.models.scratch.bounds import BINS, PROFILES

SPEC = Model(
    name="scratch",
    title="Extruded scratch, traced",
    summary="parallel scratches of any cross-section along azimuth 0, all interreflections between their walls",
    params=(
        Param(
            "profile",
            "",
            "quartic:1",
            None,
            f"cross-section: {PROFILES}; depths in half widths, angles in degrees",
            "text",
        ),
        Param(
            "psi",
            "rad",
            math.radians(1.0),
            (math.radians(0.01), math.radians(20.0)),
            "half width to which the infinitely thin cone of reflection is blurred",
        ),
        Param("bins", "", 256, BINS, "bins of angle across the scratch", "int"),
        Param("rays", "", None, (16, 1_000_000), "rays a bin (default: as tolerance asks)", "int"),
        Param(
            "max_bounces",
            "",
            None,
            (1, 1_000_000),
            "bounces followed (64 if not given); more are left out",
            "int",
            role="bounces",
            extremes=(1, 2, 5, 100_000),
        ),
        Param(
            "fresnel",
            "",
            "exact",
            None,
            "reflectance of metals: exact, or one of two approximations",
            "choice",
            ("exact", "schlick", "lazanyi"),
        ),
        *FRESNEL_PARAMS,
    ),
    components=("order1", "order2", "order3", "order4", "higher"),
    grain=True,
    forms=("native", "triplet", "dense", "blurred"),
    citation=(
        "Raymond, Guennebaud, Barla: Multi-Scale Rendering of Scratched Materials using a Structured SV-BRDF Model. "
        "ACM Transactions on Graphics 35(4), 2016"
    ),
    doi="10.1145/2897824.2925945",
    variant=(
        "Flux between bins of angle by bounce order, scaled to be reciprocal and keep energy; Fresnel exact in the "
        "first bounce and by groups of cosines of incidence beyond; the cone blurred by a kernel that keeps energy."
    ),
    errata=(
        "The printed density M/(N cos p_o) is pi times the one per radian, and Eq. 6 lacks the kernel's norm and "
        "1/cos(t_o) in its bounds. The exponent gamma of Eq. 2 has no value where exact Fresnel dips below normal "
        "incidence, so that it is an export only."
    ),
    # rays a bin, and the Fresnel term at a bounce; the finest trace and the exact term are what these stand for
    methods={"rays": (16, 32, 64, 128, 256, 512, 1024), "fresnel": ("schlick", "lazanyi")},
    # golden tables: few rays are the same code, and a wide cone is seen from everywhere
    golden={"bins": 32, "rays": 256, "psi": math.radians(20.0)},
)
