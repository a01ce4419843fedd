"""The interface of this model, under the name by which its parts know it; shared with others in microfacet/."""

from brdftab.models.microfacet.interface import (
    body_factor,
    external_reflectance,
    grazing_scale,
    internal_reflectance,
    transmission,
)

__all__ = ["body_factor", "external_reflectance", "grazing_scale", "internal_reflectance", "transmission"]
