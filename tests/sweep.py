"""A seeded sweep of a model's declared parameters, and derivatives of its kernel by differences: no list of models."""

import importlib
import itertools
import math
import zlib
from dataclasses import dataclass, replace

import numpy as np

from brdftab import models
from brdftab.errors import ParameterError
from brdftab.evaluation import singular
from brdftab.models import twins
from brdftab.models.setup import resolve

FRESNEL_SOURCES = {"material", "eta", "k", "ior", "f0", "wavelengths", "spectral_samples"}
METAL = "Cu"
ISOTROPIC, ANISOTROPIC = "isotropic", "anisotropic"
GRAZING = math.radians(89.9)
COUNT = 160
LEVELS = 6
# twins that solve equations where the data have their angles: they and the compiled solver agree to what either's nodes
# resolve (2e-6 at alpha 0.6, test_smith_twin.py), and random directions would cost the solver minutes
SOLVED = frozenset({"smith-multi"})


@dataclass(frozen=True)
class Variant:
    """The choices that a twin is compiled for: `given` goes to `resolve`, `free` are the numbers to draw."""

    model: str
    given: tuple[tuple[str, object], ...]
    free: tuple[str, ...]

    def __str__(self):
        return " ".join([self.model, *(f"{k}={v}" for k, v in self.given if v is not None), *self.free])


# ---------------------------------------------------------------- choices


def axes(spec):
    """Return the choices of a model: for each, the list of (given, free) that it allows."""
    found = [[({p.name: c}, ()) for c in p.choices] for p in spec.params if p.kind == "choice" and p.name != "material"]
    if spec.ndfs:
        one = spec.roughness
        found.append([({}, (one,)), ({}, (f"{one}_x", f"{one}_y"))])
    if spec.has("material"):
        found.append([({}, ("eta", "k")), ({}, ("ior",)), ({}, ("f0",))])
        found[-1] += [({"material": METAL}, ()), ({"material": "mirror"}, ())]
    elif spec.has("ior"):
        found.append([({}, ("ior",)), *([({}, ("f0",))] if spec.has("f0") else [])])
    if spec.has("max_bounces"):
        found.append([({"max_bounces": n}, ()) for n in (None, 1, 3)])
    return found


def variants(model, *, pairs=True):
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

    def covers(combination):
        marks = {(n, i) for n, i in enumerate(combination)}
        shape = [m for m in sorted(marks) if m[0] != fresnel]
        return marks | (set(itertools.combinations(shape, 2)) if pairs else set())

    missing = set().union(*(covers(c) for c, _ in allowed))
    used = dict.fromkeys(range(9), 0)
    chosen = [] if missing else [allowed[0][1]]
    while missing:
        # of equal gain, the source of reflectance taken least often
        best = max(allowed, key=lambda a: (len(covers(a[0]) & missing), -used[a[0][fresnel]] if fresnel else 0))
        chosen.append(best[1])
        missing -= covers(best[0])
        if fresnel is not None:
            used[best[0][fresnel]] += 1
    return chosen


def is_special(spec, name):
    """Tell whether a number belongs to the reflectance or the roughness, which `axes` deals with."""
    one = spec.roughness if spec.ndfs else ""
    return spec.ndfs and name in {*FRESNEL_SOURCES, "exponent", one, f"{one}_x", f"{one}_y"}


def has_nodes(model):
    """Tell whether a model's twin sums fixed nodes that follow from the tolerance."""
    return hasattr(models.twin(model), "rule_nodes")


def accepted(variant):
    """Tell whether the choices go together, and have a twin: that of ilm follows single bounces."""
    if dict(variant.given).get("bounces", "1") != "1":
        return False
    setup = attempt(variant, np.random.default_rng(0), {})
    if setup is None:
        return False
    try:
        getattr(models.twin(variant.model), "check", lambda static: None)(twins.split(setup)[0])
    except ParameterError:
        return False
    return True


# ---------------------------------------------------------------- numbers


def draw(param, rng):
    """Return a value inside the bounds of one parameter, evenly in the logarithm where they span decades."""
    low, high = param.bounds
    if low >= 1.0:
        # an index: at 1 the interface vanishes
        return low + math.exp(rng.uniform(math.log(1e-3), math.log(high - low)))
    if high >= 10.0:
        return math.exp(rng.uniform(math.log(max(low, 1e-4)), math.log(high)))
    return rng.uniform(low, high)


def drawn(variant, rng, fixed):
    """Return a setup with the free numbers drawn, `fixed` ones (by name: 0 lower, 1 upper bound) apart."""
    spec = models.spec(variant.model)
    numbers = {}
    for name in variant.free:
        param = spec.param(name)
        size = 3 if param.kind == "channels" else 1
        picked = [param.bounds[fixed[name]] if name in fixed else draw(param, rng) for _ in range(size)]
        inside = [min(max(x, param.bounds[0]), param.bounds[1]) for x in picked]
        numbers[name] = inside if size == 3 else inside[0]
    return resolve(variant.model, **{k: v for k, v in variant.given if v is not None}, **numbers)


def attempt(variant, rng, fixed):
    """Return a setup, or None where 10 draws are all refused: a choice may leave only a part of a number's range."""
    for _ in range(10):
        try:
            return drawn(variant, rng, fixed)
        except ParameterError:
            continue
    return None


def seeded(variant):
    """Return a generator that depends on the variant alone."""
    return np.random.default_rng(zlib.crc32(str(variant).encode()))


def setups(variant, interior=12):
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


# ---------------------------------------------------------------- directions


def directions(setup, rng, count=COUNT):
    """Return theta_i, theta_o, phi, phi_i (count,): corners, the whole hemisphere, and the width of the highlight.

    The corners reach from normal incidence to 89.9 degrees and below the horizon; a pair at which a singular model has
    no value is replaced.
    """
    ends = [0.0, 1e-3, 0.6, GRAZING]
    corners = [(i, o, p) for i in ends for o in ends for p in (0.0, 1.3, math.pi)]
    corners += [(0.4, o, 2.0) for o in (0.5 * math.pi, 1.8, math.pi)] + [
        (o, 0.4, 2.0) for o in (0.5 * math.pi, math.pi)
    ]
    rest = count - len(corners)
    assert rest > 60
    ti, to = np.arccos(rng.uniform(math.cos(GRAZING), 1.0, (2, rest)))
    ph, az = rng.uniform(-math.pi, 2.0 * math.pi, rest), rng.uniform(0.0, 2.0 * math.pi, count)
    # half of them: facets of likely slopes, reflected about
    near = rest // 2
    slope = rng.normal(0.0, 1.0, (2, near)) * np.array([[setup.alpha_x], [setup.alpha_y]])
    half = np.stack([-slope[0], -slope[1], np.ones(near)]) / np.sqrt(1.0 + (slope**2).sum(axis=0))
    azimuth = az[len(corners) : len(corners) + near]
    i = np.stack([np.sin(ti[:near]) * np.cos(azimuth), np.sin(ti[:near]) * np.sin(azimuth), np.cos(ti[:near])])
    o = 2.0 * (i * half).sum(axis=0) * half - i
    to[:near] = np.arctan2(np.hypot(o[0], o[1]), o[2])
    ph[:near] = np.arctan2(o[1], o[0]) - azimuth
    angles = [np.concatenate([np.array(c), r]) for c, r in zip(zip(*corners, strict=True), (ti, to, ph), strict=True)]
    bad = singular(setup, *angles, az)
    angles[1][bad] = 0.3
    angles[2][bad] = 1.0
    return (*angles, az)


# ---------------------------------------------------------------- the kernel and its derivatives


def kernel_values(setup, angles, tolerance):
    """Return the compiled kernel's values (N, C); a model that integrates does so at the twin's nodes."""
    if has_nodes(setup.model.name):
        folder = setup.model.name.replace("-", "_")
        return importlib.import_module(f"brdftab.models.{folder}.fixed").points(setup, *angles, tolerance)
    return models.kernel(setup.model.name).points(setup, *angles, orders=0, tolerance=tolerance)[:, 0]


def entry(setup, name, channel):
    """Return a number of a setup by its canonical name."""
    if name in ("alpha_x", "alpha_y"):
        return getattr(setup, name)
    return float(np.atleast_1d(getattr(setup.fresnel, name) if name in "ab" else setup.values[name])[channel])


def moved(setup, name, channel, value):
    """Return the setup with one number replaced, unchecked."""
    if name in ("alpha_x", "alpha_y"):
        both = {"alpha_x": value, "alpha_y": value}
        return replace(setup, **(both if setup.isotropic else {name: value}))
    old = getattr(setup.fresnel, name) if name in "ab" else setup.values[name]
    new = np.array(old, dtype=np.float64)
    new[channel if new.ndim else ()] = value
    if name in "ab":
        return replace(setup, fresnel=replace(setup.fresnel, **{name: new}))
    return replace(setup, values={**setup.values, name: new if np.ndim(old) else value})


def bounds_of(setup, name):
    """Return the declared bounds of a canonical number; an index from f0 is bounded as an index."""
    spec = setup.model
    if name in ("alpha_x", "alpha_y"):
        return spec.param(spec.roughness).bounds
    if name == "b":
        return spec.param("k").bounds
    if name == "a":
        return spec.param({1: "eta", 2: "ior", 3: "f0"}[setup.fresnel.kind]).bounds
    return spec.param(name).bounds


def differences(setup, name, channel, angles, tolerance, reach=0.02):
    """Return the kernel's derivative by central differences, extrapolated to step 0, and its estimated error.

    Of the extrapolation table each entry takes the one whose neighbours agree best.

    Returns
    -------
    tuple
        (N, C), (N, C) and the first step; None where the number stands at its bound.
    """
    x = entry(setup, name, channel)
    low, high = bounds_of(setup, name)
    step = min(reach * abs(x), 0.5 * (x - low), 0.5 * (high - x))
    if step <= 1e-6 * abs(x):
        return None
    best = error = None
    previous: list = []
    for level in range(LEVELS):
        # the step as it is after rounding
        up, down = x + step / 2**level, x - step / 2**level
        values = [kernel_values(moved(setup, name, channel, v), angles, tolerance) for v in (up, down)]
        row = [(values[0] - values[1]) / (up - down)]
        for j, older in enumerate(previous):
            row.append(row[j] + (row[j] - older) / (4.0 ** (j + 1) - 1.0))
            spread = np.maximum(np.abs(row[-1] - row[j]), np.abs(row[-1] - older))
            if best is None:
                best, error = row[-1], spread
            else:
                best, error = np.where(spread < error, row[-1], best), np.minimum(spread, error)
        previous = row
    return best, error, step
