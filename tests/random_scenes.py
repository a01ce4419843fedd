"""Random materials of random scenes, drawn from the registry's declarations: no list of models."""

import math

import numpy as np

from brdftab import models
from brdftab.errors import ParameterError
from brdftab.evaluation.points import is_stochastic
from brdftab.materials.indices import names as metals
from brdftab.models.resolve import resolve
from brdftab.scene import parse


def _reflectance(spec, rng):
    """Return one source of the facets' reflectance."""
    grey = bool(rng.random() < 0.25)

    def three(low, high):
        return [float(rng.uniform(low, high))] * 3 if grey else [float(x) for x in rng.uniform(low, high, 3)]

    sources = []
    if spec.has("material"):
        sources += [{"material": str(rng.choice(metals()))}] * 3 + [{"material": "mirror"}]
    if spec.has("eta"):
        sources.append({"eta": three(0.2, 3.0), "k": three(0.5, 5.0)})
    if spec.has("f0"):
        sources.append({"f0": three(0.05, 0.95) if spec.has("material") else float(rng.uniform(0.02, 0.2))})
    if spec.has("ior"):
        sources.append({"ior": float(rng.uniform(1.1, 2.5))})
    return sources[rng.integers(len(sources))] if sources else {}


def _parameters(spec, rng, anisotropic):
    given = _reflectance(spec, rng)
    if spec.ndfs:
        given["ndf"] = str(rng.choice(spec.ndfs))
        rough = float(math.exp(rng.uniform(math.log(0.08), 0.0)))
        both = given["ndf"] in ("beckmann", "ggx") and anisotropic
        one = spec.roughness
        given |= {f"{one}_x": rough, f"{one}_y": float(rough * rng.uniform(1.2, 2.0))} if both else {one: rough}
    if spec.has("kd"):
        scale = 1.0 if rng.random() < 0.7 else 1e-7
        kd = float(rng.uniform(0.05, 0.9)) * scale
        given["kd"] = [kd, kd, kd] if rng.random() < 0.5 else [float(x) for x in kd * rng.uniform(0.3, 1.0, 3)]
    for param in spec.params:
        if param.kind == "choice" and param.name not in ("ndf", "material", "estimator", *given):
            given[param.name] = str(rng.choice(param.choices))
    # narrow lobes and long traces cost time and show nothing more here
    given |= {n: v for n, v in {"bins": 32, "rays": 128, "psi": 20.0, "nu": 20.0, "nv": 5.0}.items() if spec.has(n)}
    return given


def _ranges(rng, below):
    """Return what lights and a camera see, degrees."""
    light, low, width = rng.uniform(40.0, 90.0), rng.uniform(0.0, 50.0), rng.uniform(20.0, 60.0)
    if below:
        # a pane: lights from above
        return [0.0, float(light)], [0.0, 180.0]
    return [0.0, float(light)], [float(low), float(min(90.0, low + width))]


def _keys(name, given, rng, below, grid):
    theta_i, theta_o = _ranges(rng, below)
    return {
        "model": name,
        "parameters": given,
        "theta_i": theta_i,
        "theta_o": theta_o,
        "quantity": str(rng.choice(["rgb", "rgb", "luminance", "albedo"])),
        "tolerance": float(math.exp(rng.uniform(math.log(3e-3), math.log(5e-2)))),
        "floor": float(rng.choice([1e-9, 1e-9, 1e-3])),
        "grid": grid,
    }


def draw(rng, names, grids, grooves):
    """Return a random material without noise: grids of three and four axes, and one that reaches below."""
    while True:
        spec = models.spec(str(rng.choice(names)))
        anisotropic = bool(spec.ndfs) and (grooves or not spec.singular) and rng.random() < 0.25
        given = _parameters(spec, rng, anisotropic)
        try:
            setup = resolve(spec.name, **{n: math.radians(v) if n == "psi" else v for n, v in given.items()})
            if is_stochastic(setup):
                continue
            grid = grids[1] if not setup.isotropic else grids[2] if setup.transmits else grids[0]
            return parse({"material": [_keys(spec.name, given, rng, setup.transmits, grid)]}).materials[0]
        except ParameterError:
            continue


def scenes(count, seed, grids=("16x16x32", "6x8x6x8", "8x8+8x16"), names=None, grooves=True):
    """Yield random materials, the same ones for a seed; `grooves`: anisotropic ones of singular models, too."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield draw(rng, names or models.names(), grids, grooves)
