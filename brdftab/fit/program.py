"""What a fit is compiled for, and the numbers that the compiled program takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from brdftab.fit.parameters import Sum
from brdftab.models import twin
from brdftab.models._shared.twin.static import WEIGHTS, Static
from brdftab.models.protocols import HasRuleNodes
from brdftab.models.twins import numbers as angle_numbers
from brdftab.models.twins import split
from brdftab.typing import Array


class Slot(NamedTuple):
    """Where an entry of a vector goes: term, canonical names, whether it is a logarithm, and an f0 meant as index."""

    term: int
    names: tuple[str, ...]
    log: bool
    as_index: bool


@dataclass(frozen=True)
class Problem:
    """All that is fixed when the residual is compiled; hashable."""

    statics: tuple[Static, ...]
    shared: tuple[Slot, ...]
    own: tuple[Slot, ...]
    loss: str
    robust: bool

    @property
    def moving(self) -> tuple[int, ...]:
        """Shared entries that some model's shapes depend on."""
        return tuple(n for n, slot in enumerate(self.shared) if self._shapes(slot))

    @property
    def common(self) -> bool:
        """True when no channel's own parameter enters the shapes."""
        return not any(self._shapes(slot) for slot in self.own)

    def _shapes(self, slot: Slot) -> bool:
        needed = twin(self.statics[slot.term].model).SHAPE_PARAMS
        return any(name in needed for name in slot.names)


def problem(total: Sum, loss: str, robust: bool, tolerance: float) -> tuple[Problem, tuple[dict[str, Array], ...]]:
    """Return what is compiled, and the fixed numbers of each term by canonical name, (1,) or (C,); weights (W, C).

    `tolerance` chooses the nodes of models that fix them when they are compiled.
    """
    statics, fixed = [], []
    for at, term in enumerate(total.terms):
        middle = {v.param: max(v.low, min(0.5, v.high)) if not v.log else 0.3 for v in total.variables if v.term == at}
        if "ior" in middle and term.model.shares("ior"):
            middle["ior"] = 1.5
        movable = isinstance(twin(term.model.name), HasRuleNodes)
        static, params = split(term.setup(middle), 1e-2 if movable else tolerance)
        statics.append(static)
        fixed.append(params)

    def slot(variable: Any) -> Slot:
        term = total.terms[variable.term]
        index = variable.param == "f0" and term.model.shares("f0") and not term.model.shares("material")
        return Slot(variable.term, term.canonical(variable.param), variable.log, index)

    made = Problem(tuple(statics), tuple(map(slot, total.shared)), tuple(map(slot, total.own)), loss, robust)
    return made, tuple(fixed)


def rules(made: Problem, tolerance: float, angles: Sequence[Array] = ()) -> tuple[dict[str, Any], ...]:
    """Return the nodes of each term that takes them as numbers: one compiled program serves every tolerance.

    `angles` are the data's theta_i, theta_o and phi, (N,) in radians, from which terms that solve choose where.
    """
    found = []
    for static in made.statics:
        module = twin(static.model)
        fixed = module.rule_nodes(static, tolerance) if isinstance(module, HasRuleNodes) else {}
        found.append({**fixed, **(angle_numbers(static, *angles) if len(angles) else {})})
    return tuple(found)


def channel_fixed(fixed: Sequence[dict[str, Array]], channels: int) -> tuple[dict[str, Array], ...]:
    """Return the fixed numbers with a leading axis of channels; spectra become (C, W) with their weights."""
    made = []
    for params in fixed:
        weights = params.get(WEIGHTS)
        term = {}
        for name, value in params.items():
            if weights is not None and name in ("a", "b"):
                term[name] = np.broadcast_to(value, (channels, weights.shape[0])).copy()
            elif name == WEIGHTS:
                term[name] = value.T.copy()
            else:
                term[name] = np.broadcast_to(value, (channels,)).copy()
        made.append(term)
    return tuple(made)
