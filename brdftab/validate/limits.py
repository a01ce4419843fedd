"""The table of known limits: where a model does not have a property, how far it is off, and why that is left so."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

from brdftab.models.resolve import resolve
from brdftab.validate.finding import ANGLES, Finding

TABLE = Path(__file__).with_name("limits.toml")


@dataclass(frozen=True)
class Limit:
    """One entry of the table.

    Attributes
    ----------
    name : str
        A few words.
    prop, model : str
        The property that fails, and whose.
    why : str
        What causes it and why it is left so.
    size : float
        The largest value that it explains, in the units of the property.
    where : dict
        Ranges ``[low, high]`` of parameters or directions (degrees) that it is confined to, or the word of a choice.
    example : dict
        ``parameters`` and ``directions`` (degrees: theta_i, theta_o, phi, phi_i) at which it occurs.
    """

    name: str
    prop: str
    model: str
    why: str
    size: float
    where: dict[str, Any] = field(default_factory=dict)
    example: dict[str, Any] = field(default_factory=dict)

    def covers(self, finding: Finding) -> bool:
        """Tell whether a failure is this limit: same property and model, within its confines, no larger."""
        if (finding.prop, finding.model) != (self.prop, self.model) or not finding.value <= self.size:
            return False
        return all(_within(finding, name, wanted) for name, wanted in self.where.items())


def _within(finding: Finding, name: str, wanted: Any) -> bool:
    """Tell whether a finding's parameter or direction is the word or within the range."""
    import math

    if name in ANGLES:
        value: Any = math.degrees(finding.angles[ANGLES.index(name)])
    elif name == "along":
        value = finding.along[0] if finding.along else ""
    else:
        setup = resolve(finding.model, **finding.parameters)
        value = setup.parameters.get(name, setup.values.get(name))
        if value is None and setup.model.ndfs and name == setup.model.roughness:
            value = max(setup.alpha_x, setup.alpha_y)
    if isinstance(wanted, str):
        return bool(value == wanted)
    entries = value if isinstance(value, list) else [value]
    return all(isinstance(v, int | float) and wanted[0] <= v <= wanted[1] for v in entries)


@cache
def limits() -> tuple[Limit, ...]:
    """Return all entries of the table."""
    entries = tomllib.loads(TABLE.read_text(encoding="utf-8")).get("limit", [])
    return tuple(Limit(prop=e["property"], **{k: v for k, v in e.items() if k != "property"}) for e in entries)


def marked(finding: Finding) -> Finding:
    """Return the finding, with the name of the limit that covers its failure if there is one."""
    if finding.holds:
        return finding
    known = next((limit for limit in limits() if limit.covers(finding)), None)
    return finding if known is None else replace(finding, limit=known.name)
