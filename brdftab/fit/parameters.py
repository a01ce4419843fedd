"""What is fitted: a sum of models, which of their parameters are free, and in which coordinates they are moved."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from brdftab.errors import ParameterError, proposal
from brdftab.fit.held import of_data, optics_of_data
from brdftab.models import spec, twin
from brdftab.models.declaration import Model
from brdftab.models.protocols import NarrowsRoughness
from brdftab.models.resolve import Setup, resolve
from brdftab.typing import Array

# the least roughness of a fit: below it a lobe is narrower than any measured table resolves
ROUGHNESS_FLOOR = 1e-4


@dataclass(frozen=True)
class Variable:
    """One free parameter.

    Attributes
    ----------
    name : str
        As the user says it: ``kd``, or ``smith2.alpha`` where several terms have one.
    term : int
        Which term of the sum.
    param : str
        Name in the registry.
    channels : bool
        True for one value a channel.
    low, high : float
        Bounds in API units.
    log : bool
        True when the logarithm is moved.
    """

    name: str
    term: int
    param: str
    channels: bool
    low: float
    high: float
    log: bool

    def inner(self, value: Any) -> Any:
        """Return the coordinate that the solver moves."""
        return np.log(value) if self.log else np.asarray(value, dtype=np.float64)

    def outer(self, inner: Any) -> Any:
        """Return the parameter of a coordinate, exactly within the bounds: exp(log(10)) is above 10."""
        if not self.log:
            return np.clip(inner, self.low, self.high)
        ends = np.log(self.low), np.log(self.high)
        return np.select([inner <= ends[0], inner >= ends[1]], [self.low, self.high], np.exp(inner))

    def slope(self, value: Any) -> Any:
        """Return d parameter / d coordinate."""
        return value if self.log else np.ones_like(value)


@dataclass(frozen=True)
class Term:
    """One model of the sum with its fixed parameters; `label` tells it apart from its twins.

    `carried` names the fixed parameters that come from the data's own provenance.
    """

    label: str
    model: Model
    fixed: dict[str, Any]
    free: tuple[str, ...]
    carried: tuple[str, ...] = ()

    def canonical(self, param: str) -> tuple[str, ...]:
        """Return the canonical names of a parameter in the twin."""
        if is_roughness(self.model, param):
            return ("alpha_x", "alpha_y")
        return self.model.param(param).canonical or (param,)

    def setup(self, values: Mapping[str, Any]) -> Setup:
        """Return the setup with the free parameters put in, one channel."""
        return resolve(self.model.name, **{**self.fixed, **values})


@dataclass(frozen=True)
class Sum:
    """A sum of models.

    Attributes
    ----------
    name : str
        As written, such as ``smith+lambert``.
    terms : tuple of Term
        Its models.
    variables : tuple of Variable
        The free parameters, shared ones first.
    """

    name: str
    terms: tuple[Term, ...]
    variables: tuple[Variable, ...]

    @property
    def shared(self) -> tuple[Variable, ...]:
        """Variables with one value for all channels."""
        return tuple(v for v in self.variables if not v.channels)

    @property
    def own(self) -> tuple[Variable, ...]:
        """Variables with one value a channel."""
        return tuple(v for v in self.variables if v.channels)

    def size(self, channels: int) -> int:
        """Return how many numbers are free."""
        return len(self.shared) + channels * len(self.own)

    def pack(self, values: Mapping[str, Any], channels: int) -> Array:
        """Return the solver's vector: shared coordinates, then all of channel 0, of channel 1, ..."""
        shared = [float(v.inner(values[v.name])) for v in self.shared]
        own = [np.broadcast_to(v.inner(values[v.name]), (channels,)) for v in self.own]
        return np.concatenate([np.array(shared), np.array(own).reshape(len(own), channels).T.reshape(-1)])

    def unpack(self, x: Array, channels: int) -> dict[str, Any]:
        """Return the parameters of a vector: floats, and arrays (C,) where a channel has its own."""
        ns = len(self.shared)
        values: dict[str, Any] = {v.name: float(v.outer(x[n])) for n, v in enumerate(self.shared)}
        block = np.asarray(x[ns:]).reshape(channels, len(self.own))
        values |= {v.name: np.array(v.outer(block[:, n])) for n, v in enumerate(self.own)}
        return {v.name: values[v.name] for v in self.variables}

    def bounds(self, channels: int) -> tuple[Array, Array]:
        """Return lower and upper bounds of the vector."""
        low = self.pack({v.name: v.low for v in self.variables}, channels)
        high = self.pack({v.name: v.high for v in self.variables}, channels)
        return low, high

    def labels(self, channels: Sequence[str]) -> list[str]:
        """Return a name for every entry of the vector, as ``sigma`` and ``kd[R]``."""
        return [v.name for v in self.shared] + [f"{v.name}[{c}]" for c in channels for v in self.own]


def shares(models: str, given: Mapping[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Return each model of a list separated by commas with those of the given parameters that it knows.

    Raises
    ------
    ParameterError
        For an unknown model, or a parameter that none of several models has.
    """
    listed = [n.strip() for n in models.split(",")]
    if len(listed) == 1:
        return [(listed[0], dict(given))]
    found = []
    for model in listed:
        labels, names = (list(part) for part in zip(*term_labels(model), strict=True))
        specs = [spec(n) for n in names]
        found.append((model, {n: v for n, v in given.items() if _terms_with(n, labels, specs)}))
    for name in given:
        if not any(name in part for _, part in found):
            raise ParameterError(f"{name} is not a parameter of any of {', '.join(listed)}; leave it out")
    return found


def term_labels(model: str) -> list[tuple[str, str]]:
    """Return label and registry name of every term of a sum: the second smith is smith2."""
    names = [n.strip() for n in model.split("+")]
    seen: dict[str, int] = {}
    labels = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        labels.append(name if seen[name] == 1 else f"{name}{seen[name]}")
    return list(zip(labels, names, strict=True))


def optics(model: Model) -> tuple[str, ...]:
    """Return the parameters that say what a model's facets reflect; of other models such names are their own."""
    return model.of_role("optics")


def is_roughness(model: Model, param: str) -> bool:
    """Tell whether a parameter is the width of a distribution of facets."""
    return param == model.roughness and model.param(param).role == "roughness"


def fittable(model: Model) -> tuple[str, ...]:
    """Return the parameters of a model that can be free: numbers within finite bounds."""
    # other names of the roughness, and of what is no number of a surface
    leave = {"wavelengths"} & set(optics(model)) | (set(model.of_role("roughness")) - {model.roughness})
    bounded = [p for p in model.params if p.kind in ("float", "channels") and np.isfinite(p.bounds or math.inf).all()]
    return tuple(p.name for p in bounded if p.name not in leave)


def default_free(model: Model, fixed: Mapping[str, Any], made: Sequence[str] = ()) -> tuple[str, ...]:
    """Return what is free unless the user says otherwise: all but fixed ones, and one source of reflectance.

    That is `made`, what the data were made with, if it is known; else ior under an interface, f0 a channel for facets.
    """
    sources = optics(model)
    free = [n for n in fittable(model) if n not in sources]
    if sources and not any(o in fixed for o in sources):
        usual = ("ior", "f0") if model.shares("kd") else ("f0", "ior")
        free += [n for n in made if n in sources] or [n for n in usual if n in sources][:1]
    elif sources and "eta" in fixed and "k" not in fixed:
        free.append("k")
    elif sources and "k" in fixed and "eta" not in fixed:
        free.append("eta")
    return tuple(n for n in free if n not in fixed)


def _check_optics(model: Model, free: Sequence[str], fixed: Mapping[str, Any]) -> None:
    """Refuse free parameters that exclude each other or a fixed one."""
    if not optics(model):
        return
    chosen = {o for o in ("ior", "f0", "eta") if o in free or o in fixed} | ({"material"} & set(fixed))
    if "k" in free and "eta" not in free and "eta" not in fixed:
        raise ParameterError(f"free = k of {model.name} needs eta beside it; give both, or f0")
    if "eta" in free and "k" not in free and "k" not in fixed:
        raise ParameterError(f"free = eta of {model.name} needs k beside it; give both, or f0")
    if len(chosen) > 1:
        raise ParameterError(
            f"{' and '.join(sorted(chosen))} of {model.name} exclude each other; free or fix one source of reflectance"
        )


def _variable(name: str, term: int, model: Model, param: str, ndf: str | None) -> Variable:
    """Return the free parameter with the bounds of its declaration, narrower where its twin says so."""
    declared = model.param(param)
    low, high = declared.bounds or (-math.inf, math.inf)
    rough = is_roughness(model, param)
    if rough:
        module = twin(model.name)
        least, most = low, high
        if ndf is not None and isinstance(module, NarrowsRoughness):
            least, most = module.roughness_bounds(ndf)
        low, high = max(low, least, ROUGHNESS_FLOOR), min(high, most)
    channels = declared.kind == "channels" and not declared.shared
    return Variable(name, term, param, channels, low, high, rough or declared.scale == "log")


def parse(
    model: str, free: Sequence[str] | None, fixed: Mapping[str, Any], made: Mapping[str, Any] | None = None
) -> Sum:
    """Read a sum of models.

    Parameters
    ----------
    model : str
        Registry names joined by ``+``.
    free : sequence of str or None
        Free parameters by name, qualified as ``smith.alpha`` where several terms have one; None for the default.
    fixed : mapping
        Fixed parameters by the same names, in API units. A plain name goes to every term that takes it.
    made : mapping, optional
        Provenance of the data: choices in it hold where nothing else is said.

    Returns
    -------
    Sum

    Raises
    ------
    ParameterError
        For unknown models or parameters, models without a twin, and parameters that exclude each other.
    """
    labels, names = (list(part) for part in zip(*term_labels(model), strict=True))
    specs = [spec(n) for n in names]
    for n in names:
        twin(n)
    given: list[dict[str, Any]] = [{} for _ in names]
    for name, value in fixed.items():
        for at in _owners(name, labels, specs):
            given[at][name.rpartition(".")[2]] = value
    wanted: list[list[str] | None] = [None] * len(names)
    if free is not None:
        wanted = [[] for _ in names]
        for name in free:
            for at in _owners(name, labels, specs):
                param = name.rpartition(".")[2]
                if param not in fittable(specs[at]):
                    raise ParameterError(
                        f"free = {name} cannot be fitted; {names[at]} fits {', '.join(fittable(specs[at]))}"
                    )
                wanted[at].append(param)  # type: ignore[union-attr]
    carried = [_carry(*each, made or {}) for each in zip(labels, specs, given, wanted, strict=True)]
    terms, variables = [], []
    sources = [optics_of_data(label, s, made or {}) for label, s in zip(labels, specs, strict=True)]
    picked = [
        tuple(w) if w is not None else default_free(s, g, known)
        for w, s, g, known in zip(wanted, specs, given, sources, strict=True)
    ]
    for at, (label, one, fix, chosen) in enumerate(zip(labels, specs, given, picked, strict=True)):
        both = sorted(set(chosen) & set(fix))
        if both:
            raise ParameterError(f"{both[0]} of {one.name} is both free and fixed; leave one of them out")
        _check_optics(one, chosen, fix)
        terms.append(Term(label, one, fix, chosen, carried[at]))
        ndf = fix.get("ndf", one.param("ndf").default) if one.ndfs else None
        for param in chosen:
            clash = sum(param in p for p in picked) > 1
            variables.append(_variable(f"{label}.{param}" if clash else param, at, one, param, ndf))
    if not variables:
        raise ParameterError(f"free is empty for {model}; name at least one parameter, as kd")
    ordered = [v for v in variables if not v.channels] + [v for v in variables if v.channels]
    return Sum(model, tuple(terms), tuple(ordered))


def _carry(
    label: str, model: Model, given: dict[str, Any], wanted: Sequence[str] | None, made: Mapping[str, Any]
) -> tuple[str, ...]:
    """Put what the data's provenance settles into what is given, unless the user says otherwise; return the names."""
    found = of_data(label, model, made)
    sources = optics(model)
    if any(n in given or n in (wanted or ()) for n in sources):
        found = {n: v for n, v in found.items() if n not in sources}
    found = {n: v for n, v in found.items() if n not in given and n not in (wanted or ())}
    given.update(found)
    return tuple(found)


def _owners(name: str, labels: Sequence[str], specs: Sequence[Model]) -> list[int]:
    """Return the terms that a parameter name means."""
    at = _terms_with(name, labels, specs)
    if not at:
        known = sorted({p.name for s in specs for p in s.params})
        near = proposal(name.rpartition(".")[2], known)
        raise ParameterError(
            f"{name} is not a parameter of {' + '.join(labels)}; {near}{'T' if near else 't'}hey take "
            f"{', '.join(known)}"
        )
    return at


def _terms_with(name: str, labels: Sequence[str], specs: Sequence[Model]) -> list[int]:
    """Return the terms that have a parameter, which may be qualified."""
    label, dot, param = name.rpartition(".")
    return [n for n, s in enumerate(specs) if s.has(param) and (not dot or labels[n] == label)]
