"""Sampling of the approximate model: as interfaced Lambertian facets, microfacet/interfaced.py; weights differ."""

from brdftab.models.microfacet.interfaced import pdf, sample

__all__ = ["pdf", "sample"]
