"""Mitsuba 3 on the same directions, for models whose folder says which plugin computes the same."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdftab import models
from brdftab.bench.measures import all_angles
from brdftab.bench.methods import Kernel, Method
from brdftab.errors import BrdftabError
from brdftab.models.resolve import Setup
from brdftab.tables.grid import Grid

FOLDERS = ("/usr/lib/x86_64-linux-gnu", "/usr/lib/aarch64-linux-gnu", "/usr/lib/llvm-19/lib", "/usr/lib64", "/usr/lib")
LLVM, SCALAR = "llvm_ad_rgb", "scalar_rgb"


def find_llvm() -> str | None:
    """Return the library that Mitsuba's LLVM variants need, major version 19, or None."""
    given = os.environ.get("DRJIT_LIBLLVM_PATH")
    found = [str(p) for folder in FOLDERS for p in sorted(Path(folder).glob("libLLVM*19*"))]
    return given or (found[0] if found else None)


def _plugin(setup: Setup) -> dict[str, Any] | str | None:
    """Return the plugin of a setup, why there is none, or None for a model that has nothing to do with Mitsuba."""
    module = models.mitsuba(setup.model.name)
    return None if module is None else module.plugin(setup)


def missing(setup: Setup) -> list[dict[str, str]]:
    """Return one line for each variant that cannot take part, with the reason."""
    plugin = _plugin(setup)
    if plugin is None:
        return []
    reason = plugin if isinstance(plugin, str) else ""
    if importlib.util.find_spec("mitsuba") is None:
        reason = "mitsuba is not installed; pip install mitsuba"
    if reason:
        return [{"name": f"mitsuba {LLVM}, {SCALAR}", "reason": reason}]
    if find_llvm() is None:
        return [{"name": f"mitsuba {LLVM}", "reason": "libLLVM 19 was not found; set DRJIT_LIBLLVM_PATH to it"}]
    return []


def methods(setup: Setup, grid: Grid) -> list[Method]:
    """Return Mitsuba's variants that can run here; their values are copied to NumPy, without the cosine."""
    plugin = _plugin(setup)
    if not isinstance(plugin, dict) or importlib.util.find_spec("mitsuba") is None:
        return []
    library = find_llvm()
    if library is not None:
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", library)
    made = {SCALAR: _scalar} | ({LLVM: _vector} if library is not None else {})
    return [
        Method(
            f"mitsuba {variant}",
            f"mitsuba {variant}",
            {"plugin": plugin["type"], "variant": variant, "dtype": "float32"},
            make(setup, grid, plugin),
        )
        for variant, make in made.items()
    ]


def _vectors(grid: Grid) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float64]]:
    """Return unit vectors (3, N) of light and view in float32, and 1 / cos(theta_o) of these (*grid, 1)."""
    ti, to, phi, az = all_angles(grid)
    light = np.stack([np.sin(ti) * np.cos(az), np.sin(ti) * np.sin(az), np.cos(ti)]).astype(np.float32)
    view = np.stack([np.sin(to) * np.cos(az + phi), np.sin(to) * np.sin(az + phi), np.cos(to)]).astype(np.float32)
    return light, view, (1.0 / view[2].astype(np.float64)).reshape(*grid.shape, 1)


def _vector(setup: Setup, grid: Grid, plugin: dict[str, Any]) -> Callable[[], Kernel]:
    """Return what loads the plugin in the LLVM variant and gives a kernel for all pairs at once."""
    count = len(setup.channels)

    def make() -> Kernel:
        import drjit as dr
        import mitsuba as mi

        try:
            mi.set_variant(LLVM)
        except ImportError as error:
            library = os.environ.get("DRJIT_LIBLLVM_PATH")
            raise BrdftabError(
                f"DRJIT_LIBLLVM_PATH = {library} does not serve Mitsuba; set it to libLLVM 19"
            ) from error
        bsdf = mi.load_dict(plugin)
        light, view, inverse = _vectors(grid)
        si = dr.zeros(mi.SurfaceInteraction3f, light.shape[1])
        si.wi, outgoing = mi.Vector3f(light), mi.Vector3f(view)
        dr.eval(si, outgoing)
        context = mi.BSDFContext()

        def work() -> NDArray[Any]:
            values = np.array(bsdf.eval(context, si, outgoing)).T
            return values.reshape(*grid.shape, 3)[..., :count] * inverse

        return work

    return make


def _scalar(setup: Setup, grid: Grid, plugin: dict[str, Any]) -> Callable[[], Kernel]:
    """Return what loads the plugin in the scalar variant and gives a kernel that calls it pair by pair."""
    count = len(setup.channels)

    def make() -> Kernel:
        import mitsuba as mi

        mi.set_variant(SCALAR)
        bsdf = mi.load_dict(plugin)
        light, view, inverse = _vectors(grid)
        lights, views = light.T.tolist(), view.T.tolist()
        context = mi.BSDFContext()

        def work() -> NDArray[Any]:
            si = mi.SurfaceInteraction3f()
            values = np.empty((len(lights), 3))
            for n, (i, o) in enumerate(zip(lights, views, strict=True)):
                si.wi = mi.Vector3f(*i)
                values[n] = bsdf.eval(context, si, mi.Vector3f(*o))
            return values.reshape(*grid.shape, 3)[..., :count] * inverse

        return work

    return make
