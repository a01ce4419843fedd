"""What one measurement of a property found: a number, what it may be at most, and what makes it."""

from __future__ import annotations

import math
import shlex
from dataclasses import dataclass, field
from typing import Any

from brdftab import models

ANGLES = ("theta_i", "theta_o", "phi", "phi_i")


@dataclass(frozen=True)
class Finding:
    """A measured number beside its bound.

    Attributes
    ----------
    prop, model : str
        Names of the property and of the model.
    value, bound : float
        What was measured, and what it may be at most.
    parameters : dict
        Canonical parameters of the model.
    angles : tuple of float
        theta_i, theta_o, phi, phi_i in radians.
    detail : str
        What else belongs to the case, in words.
    along : tuple or None
        Of a jump: the coordinate or parameter that is varied, and its two neighbouring values (radians).
    limit : str
        Name of the known limit that covers it; empty for none.
    """

    prop: str
    model: str
    value: float
    bound: float
    parameters: dict[str, Any]
    angles: tuple[float, float, float, float]
    detail: str = ""
    along: tuple[str, float, float] | None = None
    limit: str = field(default="")

    @property
    def holds(self) -> bool:
        """Tell whether the number is within its bound; NaN is not."""
        return self.value <= self.bound

    @property
    def ratio(self) -> float:
        """Return the number over its bound, infinite where nothing is allowed and something was found."""
        if not math.isfinite(self.value):
            return math.inf
        if self.bound > 0.0:
            return self.value / self.bound
        return 0.0 if self.holds else math.inf

    def command(self) -> str:
        """Return the command line that evaluates the model there."""
        words = ["brdftab", "eval", "--model", self.model]
        spec = models.spec(self.model)
        for name, value in self.parameters.items():
            turn = math.degrees if spec.param(name).unit == "rad" else (lambda x: x)
            entries = value if isinstance(value, list) else [value]
            words.append("--" + name.replace("_", "-"))
            words.append(",".join(v if isinstance(v, str) else f"{turn(v):.17g}" for v in entries))
        for name, angle in zip(ANGLES, self.angles, strict=True):
            if name != "phi_i" or angle:
                words += ["--" + name.replace("_", "-"), f"{math.degrees(angle):.17g}"]
        return shlex.join(words)

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON; numbers that are not finite as words."""
        shown = self.value if math.isfinite(self.value) else str(self.value)
        along = self.along and {"name": self.along[0], "below": self.along[1], "above": self.along[2]}
        return {
            "value": shown,
            "bound": self.bound,
            "holds": self.holds,
            "parameters": self.parameters,
            "directions_degrees": {n: math.degrees(a) for n, a in zip(ANGLES, self.angles, strict=True)},
            "detail": self.detail,
            "along": along,
            "limit": self.limit or None,
            "command": self.command(),
        }
