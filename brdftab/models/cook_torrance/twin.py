"""Cook-Torrance in JAX: the shared single bounce with V-cavity masking."""

from __future__ import annotations

from brdftab.models._shared.codes import V_CAVITY
from brdftab.models._shared.twin import single
from brdftab.models._shared.twin.single import SHAPE_PARAMS, value

__all__ = ["SHAPE_PARAMS", "shapes", "value"]


def shapes(static, p, d):
    """Return D G/(4 i_z o_z) in 1/sr and i.h, both (N,)."""
    return single.geometry(static, V_CAVITY, p, d)
