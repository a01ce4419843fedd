"""Sampling of the closed form: the mixture that interfaced surfaces share, as the lobes are those of ilm."""

from __future__ import annotations

from brdftab.models._shared.sampling.interfaced_sampling import mirror_mass, pdf, sample

__all__ = ["mirror_mass", "pdf", "sample"]
