"""The kernels with the JIT off: what Python computes from the same source equals what Numba compiled."""

import importlib
import json
import math
import os
import pkgutil
import subprocess
import sys

import numpy as np
import pytest
from grids import cheap

import brdftab
from brdftab import models
from brdftab.models._shared.facets import masking, ndf
from brdftab.models._shared.facets.frame import groove_plane, pair
from brdftab.models._shared.fresnel import fresnel
from brdftab.models._shared.grooves import groove2d, tail
from brdftab.models._shared.single_bounce.single import geometry
from brdftab.models.vgroove_nonsym.first_order import masked_share, mean_masking
from brdftab.quadrature import unit_gauss

# compiled code contracts a*b + c and divides by reciprocals: some units in the last place
RTOL = 1e-12
GAUSS = unit_gauss(20)
ANGLES = [(0.3, 0.9, 2.0), (1.2, 0.2, 0.0), (0.7, 0.7, 3.0), (0.0, 0.4, 1.0), (1.5, 1.4, 2.9)]


def sc(angle):
    return math.sin(angle), math.cos(angle)


def calls():
    """Return (kernel, arguments) of the scalar kernels, a few points each."""
    found = []
    for code, shapes in ((0, (0.1, 0.5, 3.0)), (1, (0.1, 0.5, 3.0)), (2, (-1.0, 6.0, 2e4))):
        for shape in shapes:
            found += [(ndf.density, (code, shape, math.cos(t), math.sin(t))) for t in (0.0, 0.05, 0.6, 1.5, 2.0)]
            if code != 2 or shape > -1.0:
                found.append((ndf.opposite_norm, (code, shape)))
                found += [(masked_share, (code, shape, math.sin(m), math.cos(m), GAUSS)) for m in (0.0, 0.3, 1.2, 1.55)]
                found.append((mean_masking, (code, shape, 0.4, 0.8, *sc(0.9), GAUSS)))
            found.append((tail.tail_power, (code, shape)))
        found += [(ndf.shape_at, (code, ax, 0.5, *sc(0.4)[::-1])) for ax in (0.5, 0.2)]
        found += [(masking.smith_lambda, (code, 0.5, t, w)) for t in (0.0, 1e-3, 1.0, 50.0) for w in (False, True)]
        found += [(masking.projected_alpha, (code, ax, 0.5, *sc(0.4)[::-1])) for ax in (0.5, 0.2)]
    found += [(masking.v_cavity, (0.9, iz, 0.4, 0.7)) for iz in (0.1, 0.99)]
    found += [(masking.smith_g2, (m, 0.3, 1.4)) for m in (0, 1, 2)]
    for kind, a, b in ((0, 1.0, 0.0), (1, 0.4, 2.5), (2, 1.5, 0.0), (2, 1.0, 0.0), (3, 0.04, 0.0), (4, 0.5, 2.0)):
        found += [(fresnel.reflectance, (kind, a, b, c)) for c in (-0.1, 0.0, 0.02, 0.5, 1.0)]
    for theta_i, theta_o, phi in ANGLES:
        found.append((pair, (theta_i, theta_o, phi)))
        found.append((groove_plane, pair.py_func(theta_i, theta_o, phi)))
        for code in (0, 1, 2):
            found += [(geometry, (m, code, 0.3, 0.3, theta_i, theta_o, phi, 0.5)) for m in (0, 1, 2, 10)]
        found.append((geometry, (1, 1, 0.3, 0.6, theta_i, theta_o, phi, 0.5)))
    for t, u, left, right in ((0.3, -0.2, 0.5, 0.9), (-1.1, 0.4, 1.3, 0.2), (0.0, 0.0, 0.8, 0.8)):
        found.append((groove2d.beam_symmetric, (*sc(left), *sc(t), *sc(u))))
        found.append((groove2d.beam_even, (*sc(left), *sc(right), *sc(t), *sc(u))))
        found.append((groove2d.beam_odd, (*sc(left), *sc(right), *sc(max(t, u)), *sc(min(t, u)))))
        found += [(groove2d.width_symmetric, (t, left, k)) for k in (1, 2, 3)]
        found += [(groove2d.width_nonsymmetric, (t, left, right, k)) for k in (1, 2, 3)]
    found += [(tail.tail_node, (power, 0.1, 0.4, 0.3)) for power in (0.0, 1.0, 2.5)]
    found += [(tail.tail_panels, (power, 0.01, 0.4)) for power in (0.0, 2.5)]
    found += [(tail.tail_panel, (number, 3, 0.01, 0.4)) for number in range(3)]
    return found


def test_scalar_kernels_equal_their_python():
    found = calls()
    assert len(found) > 200
    seen = set()
    for kernel, arguments in found:
        seen.add(kernel)
        compiled = np.atleast_1d(kernel(*arguments))
        plain = np.atleast_1d(kernel.py_func(*arguments))
        # beams are differences of numbers near 1
        assert np.allclose(compiled, plain, rtol=RTOL, atol=1e-15), (kernel.__name__, arguments, compiled, plain)
    assert len(seen) >= 20


@pytest.mark.parametrize("kind", [0, 1, 2, 3, 4])
def test_reflectance_of_a_row_equals_its_python(kind):
    a, b = np.array([1.3, 0.4, 0.2])[: 1 if kind == 0 else 3], np.array([0.0, 2.5, 3.5])[: 1 if kind == 0 else 3]
    if kind == 2:
        a = a + 1.0
    table = np.empty((0, 0))
    rows = []
    for function in (fresnel.multiply, fresnel.multiply.py_func):
        row = np.full(a.size, 2.0)
        function(kind, a, b, table, 0.6, row)
        rows.append(row)
    assert np.allclose(*rows, rtol=RTOL)
    assert np.allclose(
        rows[0], [2.0 * fresnel.reflectance(kind, x, y, 0.6) for x, y in zip(a, b, strict=True)], rtol=RTOL
    )


# ---------------------------------------------------------------- whole models in a process without JIT

POINTS = ([0.5, 1.1], [0.9, 0.2], [2.2, 0.6], [0.3, 0.0])


def settings():
    """Return (model, parameters) for each model: its default, and colour, anisotropy and a cap where it takes them."""
    found = []
    for name in models.names():
        spec = models.spec(name)
        takes = {p.name for p in spec.params}
        if "samples" in takes:
            # all bounces of Smith facets take minutes without JIT, be they solved or drawn
            continue
        # rays take minutes without JIT, too: as few as are allowed
        least = {**cheap(name), **{n: int(spec.param(n).bounds[0]) for n in {"bins", "rays"} & takes}}
        found.append((name, least))
        if "ggx" in spec.ndfs and f"{spec.roughness}_x" in takes:
            rough = {f"{spec.roughness}_x": 0.3, f"{spec.roughness}_y": 0.6}
            found.append((name, {"ndf": "ggx", **rough, **({"eta": 0.4, "k": 2.5} if "eta" in takes else {})}))
        if "phong" in spec.ndfs:
            found.append((name, {"ndf": "phong", "alpha": 0.7, "ior": 1.5}))
        if "max_bounces" in takes:
            found.append((name, {**least, "max_bounces": 3, "f0": 0.6}))
    return found


SCRIPT = """
import json, sys
import numba
assert numba.config.DISABLE_JIT
import brdftab
points, settings = json.load(sys.stdin)
out = []
for name, given in settings:
    parts = brdftab.evaluate(name, *points[:3], phi_i=points[3], components=True, tolerance=1e-4, **given)
    total = brdftab.evaluate(name, *points[:3], phi_i=points[3], tolerance=1e-4, **given)
    out.append([{n: v.tolist() for n, v in parts.items()}, total.tolist()])
json.dump(out, sys.stdout)
"""


def test_models_without_jit_equal_the_compiled_ones():
    todo = settings()
    assert set(models.names()) - {name for name, _ in todo} == {"smith-multi", "smith-walk"}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        input=json.dumps([POINTS, todo]),
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    theta_i, theta_o, phi, phi_i = POINTS
    for (name, given), (parts, total) in zip(todo, json.loads(done.stdout), strict=True):
        compiled = brdftab.evaluate(name, theta_i, theta_o, phi, phi_i=phi_i, tolerance=1e-4, **given)
        assert np.allclose(total, compiled, rtol=RTOL, atol=1e-16), (name, given)
        layers = brdftab.evaluate(name, theta_i, theta_o, phi, phi_i=phi_i, components=True, tolerance=1e-4, **given)
        assert list(layers) == list(parts)
        for layer, value in layers.items():
            # single orders may be differences of numbers near the total
            assert np.allclose(parts[layer], value, rtol=1e-11, atol=1e-12 * compiled.max()), (name, given, layer)


def kernel_modules():
    """Return every module of the package that defines kernels."""
    found = []
    for info in pkgutil.walk_packages(brdftab.models.__path__, "brdftab.models."):
        module = importlib.import_module(info.name)
        if any(hasattr(value, "py_func") and value.__module__ == info.name for value in vars(module).values()):
            found.append(module)
    return found


def test_every_kernel_says_what_it_does():
    undocumented = [
        f"{module.__name__}.{name}"
        for module in kernel_modules()
        for name, value in vars(module).items()
        if hasattr(value, "py_func") and value.__module__ == module.__name__ and not name.startswith("_")
        and not value.py_func.__doc__
    ]  # fmt: skip
    assert len(kernel_modules()) >= 12
    assert not undocumented
