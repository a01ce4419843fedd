"""`smith` against Mitsuba 3's `roughconductor`: an implementation that shares no line with ours."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys

import numpy as np
import pytest

import brdftab
from brdftab.bench.peers import find_llvm

ETA, K = [0.143, 0.375, 1.442], [3.983, 2.386, 1.603]

pytestmark = pytest.mark.skipif(importlib.util.find_spec("mitsuba") is None, reason="mitsuba is not installed")

# Mitsuba takes float32 vectors; it runs in a process of its own, as a variant is set once for all
SCRIPT = """
import json, sys
import numpy as np
import mitsuba as mi
given = json.load(sys.stdin)
mi.set_variant(given["variant"])
rgb = lambda value: {"type": "rgb", "value": value}
bsdf = mi.load_dict({"type": "roughconductor", "eta": rgb(given["eta"]), "k": rgb(given["k"]), **given["options"]})
light, view = np.array(given["light"], np.float32), np.array(given["view"], np.float32)
context = mi.BSDFContext()
if given["variant"].startswith("scalar"):
    values = []
    for i, o in zip(light, view):
        si = mi.SurfaceInteraction3f()
        si.wi = mi.Vector3f(*map(float, i))
        values.append(list(bsdf.eval(context, si, mi.Vector3f(*map(float, o)))))
else:
    import drjit as dr
    si = dr.zeros(mi.SurfaceInteraction3f, len(light))
    si.wi = mi.Vector3f(light.T)
    values = np.array(bsdf.eval(context, si, mi.Vector3f(view.T))).T.tolist()
json.dump(values, sys.stdout)
"""


def directions(count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Return unit vectors (N, 3) of light and view, rounded to float32, from retro to mirror, up to 85 degrees."""
    rng = np.random.default_rng(5)
    theta_i, theta_o = np.radians(rng.uniform(0.5, 85.0, (2, count)))
    theta_o[::3] = theta_i[::3]
    phi = np.pi * rng.uniform(0.0, 1.0, count) ** 0.3
    zero = np.zeros(count)
    light = np.stack([np.sin(theta_i), zero, np.cos(theta_i)], 1)
    view = np.stack([np.sin(theta_o) * np.cos(phi), np.sin(theta_o) * np.sin(phi), np.cos(theta_o)], 1)
    return light.astype(np.float32), view.astype(np.float32)


def mitsuba(variant: str, options: dict[str, object], light: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Return Mitsuba's f cos(theta_o), (N, 3), or skip the test where LLVM is missing."""
    environment = dict(os.environ)
    if variant.startswith("llvm"):
        library = find_llvm()
        if library is None:
            pytest.skip("Mitsuba's LLVM variants need libLLVM 19 (Debian: libllvm19); set DRJIT_LIBLLVM_PATH to it")
        environment["DRJIT_LIBLLVM_PATH"] = library
    given = {"variant": variant, "eta": ETA, "k": K, "options": options, "light": light.tolist(), "view": view.tolist()}
    run = subprocess.run(
        [sys.executable, "-c", SCRIPT], input=json.dumps(given), capture_output=True, text=True, env=environment
    )
    assert run.returncode == 0, run.stderr
    return np.array(json.loads(run.stdout))


def ours(light: np.ndarray, view: np.ndarray, **parameters: object) -> np.ndarray:
    """Return f cos(theta_o), (N, 3), in float64 at the very vectors that Mitsuba got."""
    i, o = light.astype(np.float64), view.astype(np.float64)
    theta_i, theta_o = np.arctan2(np.hypot(i[:, 0], i[:, 1]), i[:, 2]), np.arctan2(np.hypot(o[:, 0], o[:, 1]), o[:, 2])
    phi_i = np.arctan2(i[:, 1], i[:, 0])
    phi = np.arctan2(o[:, 1], o[:, 0]) - phi_i
    values = brdftab.evaluate("smith", theta_i, theta_o, phi, phi_i=phi_i, eta=ETA, k=K, **parameters)
    return values * np.cos(theta_o)[:, None]


# Mitsuba computes in float32: measured 1.3e-6 (GGX) and 6.2e-6 (Beckmann). The error of exp(-e) grows with e, and D cos
# below 1e-20 is cut to 0 there, so Beckmann values below 1e-8 of the peak are judged by that
@pytest.mark.parametrize("variant", ["scalar_rgb", "llvm_ad_rgb"])
@pytest.mark.parametrize("alpha", [(0.3,), (0.8,), (0.25, 0.6)], ids=str)
@pytest.mark.parametrize(
    ("ndf", "masking", "bound", "floor"), [("ggx", "separable", 2e-6, 0.0), ("beckmann", "smith-walter", 1e-5, 1e-8)]
)
def test_smith_equals_roughconductor(variant, ndf, masking, alpha, bound, floor):
    light, view = directions()
    names = (("alpha",), ("alpha",)) if len(alpha) == 1 else (("alpha_u", "alpha_v"), ("alpha_x", "alpha_y"))
    theirs = mitsuba(variant, {"distribution": ndf, **dict(zip(names[0], alpha, strict=True))}, light, view)
    mine = ours(light, view, ndf=ndf, masking=masking, **dict(zip(names[1], alpha, strict=True)))
    assert mine.max() > 0.1
    error = np.abs(theirs - mine) / np.maximum(mine, floor * mine.max())
    assert error.max() <= bound


def test_the_default_masking_is_another_one():
    light, view = directions(50)
    theirs = mitsuba("scalar_rgb", {"distribution": "ggx", "alpha": 0.8}, light, view)
    assert np.abs(theirs / ours(light, view, ndf="ggx", alpha=0.8) - 1.0).max() > 1e-2
