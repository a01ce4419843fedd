"""Sampling of interfaced Lambertian facets: microfacet/interfaced.py, which the approximate model shares."""

from brdftab.models.microfacet.interfaced import pdf, sample

__all__ = ["pdf", "sample"]
