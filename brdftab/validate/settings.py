"""Settings of a model at the ends of what it declares, and at numbers that have broken such formulas before."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

from brdftab import models
from brdftab.errors import BrdftabError, ParameterError
from brdftab.evaluation.points import is_stochastic
from brdftab.models.common_params import FRESNEL_PARAMS
from brdftab.models.declaration import Param
from brdftab.models.resolve import Setup, resolve

Given = dict[str, Any]
# estimators draw so many paths, unless their own bound is tighter
PATHS = 64
SOURCES = frozenset(p.name for p in FRESNEL_PARAMS)


def corners(param: Param) -> list[Any]:
    """Return values of one parameter that span its declaration: words, both bounds and a middle."""
    if param.kind == "text":
        return [param.default]
    if param.kind == "choice":
        return list(param.choices) or [param.default]
    assert param.bounds is not None
    low, high = param.bounds
    if param.kind == "int":
        return [int(low), 2, 5, 8, int(high)]
    middle = math.sqrt(low * high) if low > 0.0 and high > 100.0 * low else 0.5 * (low + high)
    if param.kind == "channels":
        return [low, middle, high, [low, middle, middle]]
    return [low, middle, high]


def extremes(param: Param) -> list[Any]:
    """Return the corners of one parameter and the extremes that it declares within its bounds."""
    if param.kind in ("text", "choice") or param.bounds is None:
        return corners(param)
    low, high = param.bounds
    listed = [x for x in param.extremes if low <= x <= high]
    found = [*corners(param), *(int(x) if param.kind == "int" else x for x in listed)]
    return [x for n, x in enumerate(found) if x not in found[:n]]


def refusal(model: str, given: Given) -> str | None:
    """Return the line with which a set of parameters is refused, or None; a mirror where no reflectance is given."""
    # the wavelengths of a metal are expensive to set up, and are never what is refused
    mirror = models.spec(model).shares("material") and not SOURCES & set(given)
    try:
        resolve(model, **given, **({"material": "mirror"} if mirror else {}))
    except ParameterError as error:
        return str(error)
    return None


def spanning(model: str, values: Callable[[Param], list[Any]] = corners) -> list[Given]:
    """Return the default and, for every parameter, its accepted values, with a partner where one is needed.

    Parameters
    ----------
    model : str
        Registry name.
    values : callable, optional
        What to take of one parameter.
    """
    spec = models.spec(model)
    found: list[Given] = [{}]
    for param in spec.params:
        for value in values(param):
            if refusal(model, {param.name: value}) is None:
                found.append({param.name: value})
                continue
            for other in spec.params:
                pairs = ({param.name: value, other.name: v} for v in corners(other))
                fitting = next((p for p in pairs if refusal(model, p) is None), None)
                if other.name != param.name and fitting is not None:
                    found.append(fitting)
                    break
    return found


def ends(param: Param) -> list[Any]:
    """Return the words of one parameter, or both its declared bounds."""
    if param.kind in ("text", "choice") or param.bounds is None:
        return corners(param)
    return [int(x) if param.kind == "int" else x for x in param.bounds]


def by_distribution(model: str) -> list[Given]:
    """Return every distribution with every extreme roughness that it takes, also along one axis only."""
    spec, rough = models.spec(model), models.spec(model).roughness
    if not spec.ndfs:
        return []
    values = [x for x in extremes(spec.param(rough)) if isinstance(x, float)]
    found = [{"ndf": ndf, rough: value} for ndf in spec.ndfs for value in values]
    if spec.shares(f"{rough}_x"):
        ends = [x for x in (min(v for v in values if v > 0.0), 0.5, max(values)) if x > 0.0]
        pairs = [(a, b) for a in ends for b in ends if a != b]
        found += [{"ndf": ndf, f"{rough}_x": a, f"{rough}_y": b} for ndf in spec.ndfs for a, b in pairs]
    return [given for given in found if refusal(model, given) is None]


def thrifty(model: str, given: Given) -> Given:
    """Return the same parameters, cheaper: mirrors for facets without a reflectance, few paths, few rays."""
    spec, own = models.spec(model), models.checks(model)
    given = {**{k: v for k, v in own.cheap.items() if k not in given}, **given}
    if spec.shares("material") and not SOURCES & set(given):
        given = {**given, "material": "mirror"}
    if is_stochastic(resolve(model, **given)):
        given = {**given, "samples": min(given.get("samples", PATHS), PATHS)}
    return {**given, **{n: min(given[n], most) for n, most in own.at_most.items() if given.get(n) is not None}}


def setups(model: str, *, fast: bool = False) -> list[Setup]:
    """Return the checked setups of a model at its default, bounds and extremes, and what its folder adds.

    With `fast` an even choice of the extremes, or of `thin` of them where the folder says that they are expensive. The
    default, the folder's own settings, and every word and both bounds of each parameter are never left out.
    """
    own = models.checks(model)
    kept, named = everything(model)
    step = own.thin.get("fast" if fast else "full", 5 if fast else 1)
    return kept[:named] + kept[named::step]


@cache
def everything(model: str) -> tuple[list[Setup], int]:
    """Return all setups of `setups` in its order, and how many of them come before those that may be left out."""
    own = models.checks(model)
    # the default as it is: a metal with its wavelengths
    found = [resolve(model, **own.cheap)]
    always = [*own.settings, *spanning(model, ends)]
    found += [_resolved(model, given) for given in always]
    named = len({repr(s.parameters) for s in found})
    found += [_resolved(model, given) for given in [*by_distribution(model), *spanning(model, extremes)]]
    return list({repr(s.parameters): s for s in found}.values()), named


def _resolved(model: str, given: Given) -> Setup:
    """Return the setup of some parameters, the cheap ones of its kind where they go with it."""
    try:
        return resolve(model, **thrifty(model, given))
    except BrdftabError:
        # the cheap settings do not go with this one
        return resolve(model, **given)
