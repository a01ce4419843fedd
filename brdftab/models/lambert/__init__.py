"""Perfectly diffuse reflection."""

from brdftab.models.common_params import ALBEDOS
from brdftab.models.declaration import Model, Param

SPEC = Model(
    name="lambert",
    title="Lambertian diffuser",
    summary="constant kd/pi",
    params=(
        Param(
            "kd",
            "",
            0.5,
            (0.0, 1.0),
            "albedo; one value or three (R, G, B)",
            "channels",
            role="albedo",
            extremes=ALBEDOS,
            neutral=0.0,
        ),
    ),
    components=("diffuse",),
    citation="Lambert: Photometria, 1760",
    doi="",
    variant="f = kd/pi.",
)
