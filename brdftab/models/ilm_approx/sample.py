"""Sampling of the closed form: the mixture that interfaced surfaces share, as the lobes are those of ilm."""

from __future__ import annotations

from brdftab.models.microfacet.interfaced_sampling import pdf, sample

__all__ = ["pdf", "sample"]
