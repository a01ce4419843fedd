"""Sampling of the scaled single bounce: normals as the light sees them, then the mirror law."""

from brdftab.models._shared.sampling.facet_samples import pdf, sample

__all__ = ["pdf", "sample"]
