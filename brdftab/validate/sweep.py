"""A seeded sweep of a model's declared parameters: choices that a twin is compiled for, numbers drawn within bounds."""

from __future__ import annotations

import itertools
import math
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from brdftab import models
from brdftab.errors import ParameterError
from brdftab.models import twins
from brdftab.models.declaration import Model, Param
from brdftab.models.protocols import RefusesChoices
from brdftab.models.resolve import Setup, resolve

METAL = "Cu"
Choice = tuple[dict[str, Any], tuple[str, ...]]


@dataclass(frozen=True)
class Variant:
    """The choices that a twin is compiled for: `given` goes to `resolve`, `free` are the numbers to draw."""

    model: str
    given: tuple[tuple[str, object], ...]
    free: tuple[str, ...]

    def __str__(self) -> str:
        return " ".join([self.model, *(f"{k}={v}" for k, v in self.given if v is not None), *self.free])


# ---------------------------------------------------------------- choices


def axes(spec: Model) -> list[list[Choice]]:
    """Return the choices of a model: for each, the list of (given, free) that it allows."""
    found: list[list[Choice]] = [
        [({p.name: c}, ()) for c in p.choices] for p in spec.params if p.kind == "choice" and p.role != "optics"
    ]
    if spec.ndfs:
        one = spec.roughness
        found.append([({}, (one,)), *([({}, (f"{one}_x", f"{one}_y"))] if spec.shares(f"{one}_x") else [])])
    if spec.shares("material"):
        found.append([({}, ("eta", "k")), ({}, ("ior",)), ({}, ("f0",))])
        found[-1] += [({"material": METAL}, ()), ({"material": "mirror"}, ())]
    elif spec.shares("ior"):
        found.append([({}, ("ior",)), *([({}, ("f0",))] if spec.shares("f0") else [])])
    if spec.shares("max_bounces"):
        found.append([({"max_bounces": n}, ()) for n in (None, 1, 3)])
    return found


def variants(model: str, *, pairs: bool = True) -> list[Variant]:
    """Return variants in which every choice occurs, and with `pairs` every two choices of shape beside each other.

    The source of the reflectance changes along with them: it enters after the shape is known.
    """
    spec = models.spec(model)
    rest = tuple(p.name for p in spec.params if p.kind in ("float", "channels") and not is_special(spec, p.name))
    options = axes(spec)
    allowed = []
    for combination in itertools.product(*(range(len(o)) for o in options)):
        parts = [o[i] for o, i in zip(options, combination, strict=True)]
        given = {k: v for g, _ in parts for k, v in g.items()}
        made = Variant(model, tuple(sorted(given.items())), (*rest, *(n for _, f in parts for n in f)))
        if accepted(made):
            allowed.append((combination, made))
    fresnel = next((n for n, o in enumerate(options) if any(f in (("ior",), ("f0",)) for _, f in o)), None)

    def covers(combination: tuple[int, ...]) -> set[Any]:
        marks = {(n, i) for n, i in enumerate(combination)}
        shape = [m for m in sorted(marks) if m[0] != fresnel]
        return marks | (set(itertools.combinations(shape, 2)) if pairs else set())

    missing: set[Any] = set().union(*(covers(c) for c, _ in allowed))
    used = dict.fromkeys(range(9), 0)
    chosen = [] if missing else [allowed[0][1]]
    while missing:
        # of equal gain, the source of reflectance taken least often
        best = max(
            allowed,
            key=lambda a: (len(covers(a[0]) & missing), -used[a[0][fresnel]] if fresnel is not None else 0),
        )
        chosen.append(best[1])
        missing -= covers(best[0])
        if fresnel is not None:
            used[best[0][fresnel]] += 1
    return chosen


def is_special(spec: Model, name: str) -> bool:
    """Tell whether a number belongs to the reflectance or the roughness, which `axes` deals with."""
    return spec.has(name) and spec.param(name).role in ("optics", "roughness")


def accepted(variant: Variant) -> bool:
    """Tell whether the choices go together, and have a twin: that of ilm follows single bounces."""
    if models.spec(variant.model).shares("bounces") and dict(variant.given).get("bounces", "1") != "1":
        return False
    return attempt(variant, np.random.default_rng(0), {}) is not None


# ---------------------------------------------------------------- numbers


def draw(param: Param, rng: np.random.Generator) -> float:
    """Return a value inside the bounds of one parameter, evenly in the logarithm where they span decades."""
    assert param.bounds is not None
    low, high = param.bounds
    if low >= 1.0:
        # an index: at 1 the interface vanishes
        return low + math.exp(rng.uniform(math.log(1e-3), math.log(high - low)))
    if high >= 10.0:
        return math.exp(rng.uniform(math.log(max(low, 1e-4)), math.log(high)))
    return float(rng.uniform(low, high))


def drawn(variant: Variant, rng: np.random.Generator, fixed: dict[str, int]) -> Setup:
    """Return a setup with the free numbers drawn, `fixed` ones (by name: 0 lower, 1 upper bound) apart."""
    spec = models.spec(variant.model)
    numbers: dict[str, Any] = {}
    for name in variant.free:
        param = spec.param(name)
        assert param.bounds is not None
        size = 3 if param.kind == "channels" else 1
        picked = [param.bounds[fixed[name]] if name in fixed else draw(param, rng) for _ in range(size)]
        inside = [min(max(x, param.bounds[0]), param.bounds[1]) for x in picked]
        numbers[name] = inside if size == 3 else inside[0]
    return resolve(variant.model, **{k: v for k, v in variant.given if v is not None}, **numbers)


def attempt(variant: Variant, rng: np.random.Generator, fixed: dict[str, int]) -> Setup | None:
    """Return a setup, or None where 10 draws are all refused, by the model or its twin: a choice may leave a part."""
    module = models.twin(variant.model)
    for _ in range(10):
        try:
            setup = drawn(variant, rng, fixed)
            if isinstance(module, RefusesChoices):
                module.check(twins.split(setup)[0])
        except ParameterError:
            continue
        return setup
    return None


def seeded(variant: Variant) -> np.random.Generator:
    """Return a generator that depends on the variant alone."""
    return np.random.default_rng(zlib.crc32(str(variant).encode()))


def setups(variant: Variant, interior: int = 12) -> list[tuple[Setup, bool]]:
    """Return (setup, is_corner): every number at either bound, all at once and in turn, then `interior` random ones."""
    rng = seeded(variant)
    corners = [{name: end} for name in variant.free for end in (0, 1)]
    corners += [dict.fromkeys(variant.free, end) for end in (0, 1)]
    found = []
    for fixed in [*corners, *[{}] * interior]:
        setup = attempt(variant, rng, fixed)
        assert setup is not None or fixed, "the box has an inside"
        if setup is not None:
            found.append((setup, bool(fixed)))
    return found
