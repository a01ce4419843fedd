"""The fitting engine against scipy.optimize.least_squares on the same data, from the same twin by the same rule."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from brdftab import models
from brdftab.fit.data import Dataset
from brdftab.fit.parameters import parse
from brdftab.fit.stages import Options
from brdftab.fit.starts import guess_albedo, spread
from brdftab.fit.verdict import fit_points
from brdftab.io.merl import directions as merl_directions
from brdftab.models import twins
from brdftab.models._shared.twin.frame import Directions, directions
from brdftab.models.resolve import resolve

CHUNK = 8192
KD, IOR, SIGMA = (0.38, 0.34, 0.22), 1.12, 0.065
CHANNELS = ("R", "G", "B")


def make(count: int) -> Dataset:
    """Return up to `count` cells below 80 degrees with their noisy values."""
    theta_i, theta_o, phi = (x.reshape(-1) for x in merl_directions())
    top, rng = math.radians(80.0), np.random.default_rng(5)
    cells = np.flatnonzero((theta_i < top) & (theta_o < top))
    if count < cells.size:
        cells = rng.choice(cells, count, replace=False)
    angles = [x[cells] for x in (theta_i, theta_o, phi)]
    setup = resolve("ilm", ndf="beckmann", kd=list(KD), ior=IOR, sigma=SIGMA)
    flat, parts = np.zeros(2 * CHUNK), []
    for at in range(0, cells.size, 2 * CHUNK):
        ti, to, az = (np.resize(x[at : at + 2 * CHUNK], 2 * CHUNK) for x in angles)
        parts.append(twins.evaluate(setup, ti, to, az, flat, tolerance=1e-4))
    values = np.concatenate(parts)[: cells.size] * np.exp(0.01 * rng.standard_normal((cells.size, 3)))
    return packed(angles[0], angles[1], angles[2], values)


def packed(theta_i: Any, theta_o: Any, phi: Any, values: Any) -> Dataset:
    """Return points, all of them valid."""
    valid = np.ones(values.shape, bool)
    return Dataset(theta_i, theta_o, phi, values, valid, CHANNELS, {}, np.zeros_like(valid), "grid", "MERL-like", None)


def ours(data: Dataset) -> dict[str, Any]:
    """Fit with the engine."""
    found = fit_points(parse("ilm", None, {"ndf": "beckmann"}), data, Options())
    x = [found.values["sigma"], found.values["ior"], *found.values["kd"]]
    errors = [found.stderr["sigma"], found.stderr["ior"], *found.stderr["kd"]]
    return {"x": [float(v) for v in x], "errors": [float(v) for v in errors], "rule": found.solver["rule"],
            "steps": found.solver["steps"], "times": found.times}  # fmt: skip


@partial(jax.jit, static_argnums=0)
def chunks(static: Any, x: Any, d: Any, target: Any) -> tuple[Any, Any]:
    """Return residuals (B, CHUNK, 3) and their Jacobian (B, CHUNK, 3, 5) by ln sigma, n_i and kd."""
    module = models.twin("ilm")

    def one(part: Any) -> tuple[Any, Any]:
        d, target = Directions(*part[0]), part[1]

        def parameters(u: Any, kd: Any) -> dict[str, Any]:
            return {"alpha_x": jnp.exp(u[0]), "alpha_y": jnp.exp(u[0]), "a": u[1], "kd": kd}

        def push(t: Any) -> Any:
            return jax.jvp(lambda u: module.shapes(static, parameters(u, x[2]), d), (x[:2],), (t,))

        # what the channels share goes through the nodes once, with two tangents
        base, moved = jax.vmap(push, out_axes=(None, 0))(jnp.eye(2))

        def channel(kd: Any, c: Any) -> tuple[Any, Any]:
            def f(u: Any, k: Any, shapes: Any) -> Any:
                return jnp.log(jnp.maximum(module.value(static, parameters(u, k), shapes, d), 0.0) + 1e-9)

            still = jax.tree.map(jnp.zeros_like, base)
            rows = []
            for n in range(2):
                t = jax.tree.map(lambda m, n=n: m[n], moved)
                value, row = jax.jvp(f, (x[:2], kd, base), (jnp.eye(2)[n], jnp.zeros(()), t))
                rows.append(row)
            own = jax.jvp(f, (x[:2], kd, base), (jnp.zeros(2), jnp.ones(()), still))[1]
            rows += [own * (c == k) for k in range(3)]
            return value - target[:, c], jnp.stack(rows, -1)

        r, jac = zip(*(channel(x[2 + c], c) for c in range(3)), strict=True)
        return jnp.stack(r, 1), jnp.stack(jac, 1)

    return jax.lax.map(one, (d, target))


def theirs(data: Dataset, rule: float) -> Callable[[], dict[str, Any]]:
    """Return a call that fits with SciPy; packing is done here."""
    import scipy.optimize

    total = parse("ilm", None, {"ndf": "beckmann"})
    setup = resolve("ilm", ndf="beckmann", kd=list(KD), ior=IOR, sigma=SIGMA)
    static, _ = twins.split(setup, rule)
    count = data.theta_i.size
    padded = -(-count // CHUNK) * CHUNK
    ti, to, az = (np.resize(x, padded) for x in (data.theta_i, data.theta_o, data.phi))
    d = [x.reshape(-1, CHUNK) for x in directions(ti, to, az, np.zeros(padded))]
    target = np.log(np.resize(data.values, (padded, 3)) + 1e-9).reshape(-1, CHUNK, 3)
    low, high = total.bounds(3)
    names = [v.name for v in total.shared]
    # the engine's vector: shared parameters in the order of the declaration, then kd
    order = [names.index("sigma"), names.index("ior"), 2, 3, 4]
    start = spread(total, guess_albedo(data.values, data.valid), 1, 0, {})[0][order]
    kept: dict[bytes, Any] = {}

    def both(x: Any) -> Any:
        key = x.tobytes()
        if key not in kept:
            r, jac = chunks(static, x, d, target)
            kept.clear()
            kept[key] = np.asarray(r).reshape(-1, 3)[:count].ravel(), np.asarray(jac).reshape(-1, 15)[:count]
        return kept[key]

    def call() -> dict[str, Any]:
        kept.clear()
        found = scipy.optimize.least_squares(
            lambda x: both(x)[0],
            start,
            jac=lambda x: both(x)[1].reshape(-1, 5),
            bounds=(low[order], high[order]),
            method="trf",
            ftol=1e-9,
            xtol=1e-9,
            gtol=1e-12,
        )
        return {"x": [math.exp(found.x[0]), *found.x[1:].tolist()], "steps": int(found.nfev), "status": found.message}

    return call


def timed(call: Callable[[], dict[str, Any]]) -> tuple[float, float, dict[str, Any]]:
    """Return wall and process time of a call, and what it returned."""
    started, used = time.perf_counter(), time.process_time()
    found = call()
    return time.perf_counter() - started, time.process_time() - used, found


def compare(data: Dataset, repeats: int) -> dict[str, Any]:
    """Time both on the same data, in turn."""
    _, _, mine = timed(lambda: ours(data))
    call = theirs(data, mine["rule"])
    call()
    wall: dict[str, list[float]] = {"ours": [], "scipy": []}
    cpu: dict[str, list[float]] = {"ours": [], "scipy": []}
    for _ in range(repeats):
        for name, run in (("ours", lambda: ours(data)), ("scipy", call)):
            seconds, used, found = timed(run)
            wall[name].append(seconds)
            cpu[name].append(used)
            if name == "ours":
                mine = found
            else:
                other = found
    apart = [(a - b) / e for a, b, e in zip(mine["x"], other["x"], mine["errors"], strict=True)]
    return {
        "points": int(data.theta_i.size),
        "wall_s": {n: {"min": min(t), "median": statistics.median(t)} for n, t in wall.items()},
        "cpu_s": {n: min(t) for n, t in cpu.items()},
        "ratio": min(wall["scipy"]) / min(wall["ours"]),
        "apart_in_standard_errors": max(map(abs, apart)),
        "ours": mine,
        "scipy": other,
    }
