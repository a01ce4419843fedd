"""Sampling of interfaced Lambertian facets: the mixture that interfaced surfaces share."""

from __future__ import annotations

from brdftab.models._shared.sampling.interfaced_sampling import mirror_mass, pdf, sample

__all__ = ["mirror_mass", "pdf", "sample"]
