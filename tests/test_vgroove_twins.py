"""The JAX twins of both V-groove models beside their kernels, where the generic sweep of twins does not look."""

import itertools
import math

import jax
import jax.numpy as jnp
import numba
import numpy as np
import pytest

from brdftab import models
from brdftab.models import twins
from brdftab.models._shared.fresnel.fresnel import reflectance as compiled_reflectance
from brdftab.models._shared.grooves import groove2d as compiled_groove
from brdftab.models._shared.grooves.tail import tail_node as compiled_node
from brdftab.models._shared.grooves.tail import tail_panel as compiled_panel
from brdftab.models._shared.grooves.tail import tail_panels as compiled_count
from brdftab.models._shared.grooves.tail import tail_power as compiled_power
from brdftab.models._shared.twin import chains, groove2d, tail, tiles
from brdftab.models.resolve import resolve
from brdftab.models.vgroove_nonsym import first_order as compiled_first
from brdftab.models.vgroove_nonsym import panels as compiled_panels
from brdftab.models.vgroove_nonsym.twin import first as twin_first
from brdftab.models.vgroove_nonsym.twin import panels as twin_panels
from brdftab.quadrature import unit_gauss

BOTH = ("vgroove-sym", "vgroove-nonsym")
TIGHT = 1e-9
# each runs all numbers of one compiled variant: distribution, cap, reflectance, roughnesses
SWEEP = {
    "vgroove-sym": [
        ("beckmann", None, {"eta": 0.2, "k": 3.0}, [(1e-4,), (0.05,), (0.5,), (2.0,), (10.0,)]),
        ("ggx", None, {"ior": 1.5}, [(1e-4, 10.0), (10.0, 1e-4), (0.1, 0.5)]),
        ("phong", None, {"material": "mirror"}, [(1e-4,), (0.1,), (0.8,), (1.38,), (1.5,), (10.0,)]),
        ("ggx", 2, {"f0": [0.04, 0.5, 0.95]}, [(1e-4,), (10.0,)]),
        ("phong", 1, {"ior": 1.5}, [(1e-4,), (0.3,), (10.0,)]),
    ],
    "vgroove-nonsym": [
        ("beckmann", None, {"f0": 0.6}, [(1e-4, 10.0), (0.1, 0.5), (1.0, 2.0)]),
        ("ggx", 3, {"eta": 0.2, "k": 3.0}, [(1e-4,), (0.05,), (0.5,), (10.0,)]),
        ("phong", 2, {"ior": 1.5}, [(1e-4,), (0.1,), (0.8,), (1.3,)]),
        ("phong", 1, {"ior": 1.5}, [(0.3,), (1.4142,)]),
    ],
}
CASES = [(name, *case) for name in BOTH for case in SWEEP[name]]


@pytest.fixture(autouse=True, scope="module")
def _cheap():
    """Compile quickly (many variants, few values) and keep the kernels on one thread."""
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    jax.config.update("jax_disable_most_optimizations", True)
    yield
    jax.config.update("jax_disable_most_optimizations", False)
    numba.set_num_threads(threads)


def directions(seed, count=60):
    """Return random pairs, pairs next to the mirror direction and some at either end, (count + 22,) radians."""
    rng = np.random.default_rng(seed)
    ti, to = np.arccos(rng.uniform(0.02, 1.0, (2, count)))
    ph, az = rng.uniform(-math.pi, math.pi, count), rng.uniform(0.0, 2.0 * math.pi, count + 22)
    near = 10 ** rng.uniform(-5.0, -1.0, count // 4)
    to[: near.size], ph[: near.size] = np.minimum(ti[: near.size] + near, 1.5), math.pi + near
    ends = [(i, o, p) for i in (1e-9, 0.7, 1.5) for o in (1e-6, 0.9, 1.5) for p in (0.1, math.pi - 1e-6)]
    # at the mirror direction itself the first order stands alone; the last two are below the horizon
    ends += [(0.0, 0.0, 0.0), (0.6, 0.6, math.pi), (1.6, 0.4, 1.0), (0.4, 1.6, 1.0)]
    return [np.concatenate([a, b]) for a, b in zip((ti, to, ph), zip(*ends, strict=True), strict=True)] + [az]


def compiled(setup, angles, tolerance=TIGHT):
    return models.kernel(setup.model.name).points(setup, *angles, orders=0, tolerance=tolerance)[:, 0]


def built(name, ndf, cap, reflects, rough):
    alphas = {"alpha": rough[0]} if len(rough) == 1 else {"alpha_x": rough[0], "alpha_y": rough[1]}
    return resolve(name, ndf=ndf, max_bounces=cap, **reflects, **alphas)


panels = jax.jit(twin_panels.panel_edges, static_argnums=(3, 4, 6))
share = jax.jit(twin_first.masked_share, static_argnums=0)


# ---------------------------------------------------------------- whole models


@pytest.mark.parametrize(("name", "ndf", "cap", "reflects", "roughs"), CASES)
def test_values_equal_the_kernels(name, ndf, cap, reflects, roughs):
    angles = directions(3)
    for rough in roughs:
        setup = built(name, ndf, cap, reflects, rough)
        mine, theirs = twins.evaluate(setup, *angles, TIGHT), compiled(setup, angles)
        assert np.isfinite(mine).all()
        assert not mine[-2:].any()
        # the first order's 1 - E, beside E to 1e-16 (Phong: lgamma leaves 4e-12), is small at grazing: 4e-11 measured
        worst = 2e-10 if (name, ndf) == ("vgroove-nonsym", "phong") else 1e-11
        assert np.allclose(mine, theirs, rtol=worst, atol=1e-250), rough


@pytest.mark.parametrize(
    ("name", "ndf", "cap", "reflects", "rough"),
    [
        ("vgroove-sym", "ggx", None, {"eta": 1.4, "k": 1.9}, (0.2, 0.6)),
        ("vgroove-nonsym", "beckmann", None, {"ior": 1.5}, (0.7, 0.4)),
    ],
)
def test_derivatives_equal_differences_of_the_kernels(name, ndf, cap, reflects, rough):
    setup, angles = built(name, ndf, cap, reflects, rough), [a[10:50] for a in directions(4)]
    given = {"ndf": ndf, "max_bounces": cap, "alpha_x": rough[0], "alpha_y": rough[1], **reflects}
    names = {"alpha_x": "alpha_x", "alpha_y": "alpha_y"}
    names |= {"eta": "a", "k": "b"} if "eta" in reflects else {"ior": "a"}
    value = np.abs(compiled(setup, angles))
    for public, canonical in names.items():
        x, rows = given[public], []
        for step in (2e-3 * x, 1e-3 * x):
            ends = [compiled(resolve(name, **{**given, public: x + s}), angles) for s in (step, -step)]
            rows.append((ends[0] - ends[1]) / (2.0 * step))
        expected = (4.0 * rows[1] - rows[0]) / 3.0
        slope = twins.derivative(setup, canonical, *angles, TIGHT)
        assert np.isfinite(slope).all()
        # no kinks: where a beam opens does not depend on these numbers. Rounding over the step leaves 1e-12, the
        # extrapolation step^4 times a fifth derivative, large where exp(-tan^2/alpha^2) is tiny
        scale = np.abs(expected) + value / x
        steep = np.abs(expected) > 50.0 * value / x
        error = np.abs(slope - expected) / (scale + 1e-250)
        assert error[~steep].max() < 1e-6
        assert np.median(error) < 1e-9


def test_long_chains_by_gauss_keep_the_tolerance():
    # near the mirror direction long chains count most; here they are read off 16 nodes
    setup = resolve("vgroove-sym", ndf="ggx", alpha=0.5, eta=[0.15, 1.4, 5.0], k=[3.5, 1.9, 20.0])
    assert chains.chain_nodes(1e-6) == 16
    angles = directions(6, 40)
    assert np.allclose(twins.evaluate(setup, *angles, 1e-6), compiled(setup, angles, 1e-6), rtol=1e-6, atol=1e-250)


# ---------------------------------------------------------------- pieces


def test_beams_equal_the_kernels():
    x = np.random.default_rng(1).uniform(-1.5, 1.5, (200, 4))
    pairs = [f(x[:, j]) for j in range(4) for f in (np.sin, np.cos)]
    for name, count in (("beam_symmetric", 6), ("beam_even", 8), ("beam_odd", 8)):
        expected = [getattr(compiled_groove, name)(*row[:count]) for row in np.transpose(pairs).tolist()]
        assert np.allclose(getattr(groove2d, name)(*pairs[:count]), expected, rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("shape", [-0.99, -0.9, -0.5, 0.2, 1.0, 30.0])
def test_tail_nodes_equal_the_kernels(shape):
    s = np.array([0.01, 0.3, 0.99])
    for ndf in range(3):
        for low in (1e-9, 0.1, 0.18):
            ends = jnp.full(3, low), jnp.full(3, 0.2)
            power, powers = compiled_power(ndf, shape), tail.tail_power(ndf, jnp.full(3, shape))
            panels, count = compiled_count(power, low, 0.2), tail.tail_panels(powers, *ends)
            assert (count == panels).all()
            for number in {0, panels - 1}:
                expected = [compiled_node(power, *compiled_panel(number, panels, low, 0.2), x) for x in s]
                found = tail.tail_node(ndf, powers, count, jnp.full(3, number), *ends, s)
                assert np.allclose(np.transpose(found), expected, rtol=1e-12, atol=0.0)


@pytest.mark.parametrize("nodes", [12, 16, 24])
def test_gram_rules_sum_polynomials_over_whole_numbers(nodes):
    places, weights = chains.gram_rules(100, nodes)
    for k in (nodes + 1, 2 * nodes, 100):
        points = (np.arange(k) - 0.5 * (k - 1.0)) / k
        for degree in range(0, 2 * nodes, 2):
            exact = (points**degree).sum()
            assert 2.0 * (weights[k] * (places[k] / k) ** degree).sum() == pytest.approx(exact, rel=1e-11)


def test_chains_multiply_every_bounce():
    first, step = np.array([0.1, 0.4]), np.array([0.11, 0.09])
    for count in (2, 12, 20):
        expected = np.ones(2)
        for j in range(count):
            x = 0.8 * np.sin(first + j * step)
            expected *= [compiled_reflectance(2, 1.5, 0.0, v) for v in x]
        for rules in ((), tuple(jnp.asarray(r) for r in chains.gram_rules(30, 12))):
            found = chains.chain(2, jnp.array(1.5), None, 0.8, first, step, jnp.array(count), rules)
            assert np.allclose(found, expected, rtol=1e-7 if rules else 1e-13, atol=0.0)


def test_tiles_keep_the_order():
    x = jnp.asarray(np.random.default_rng(2).normal(size=37))
    assert np.array_equal(tiles.by_tiles(lambda p: p["x"] ** 2, tiles.ranking(x), {"x": x}, 8), x**2)


@pytest.mark.parametrize(("ndf", "shape"), [(0, 0.05), (0, 8.0), (1, 1e-3), (1, 5.0), (2, -0.999), (2, 3.0), (2, 2e4)])
def test_hidden_share_equals_the_kernel_and_has_finite_derivatives(ndf, shape):
    m = np.array([-0.3, 0.0, 1e-9, 0.01, 0.4, 1.2, 1.57, 0.5 * math.pi])
    s, c = np.sin(m), np.cos(m)
    expected = [compiled_first.masked_share(ndf, shape, *x, unit_gauss(20)) for x in zip(s, c, strict=True)]
    found, slope = jax.jvp(lambda x: share(ndf, jnp.full(m.shape, x), s, c), (shape,), (1.0,))
    # Phong's constant is a difference of two lgamma
    assert np.allclose(found, expected, rtol=1e-13 if ndf < 2 else 2e-11, atol=1e-16)
    assert np.isfinite(slope).all()


@pytest.mark.parametrize(("ndf", "shapes"), [(0, (0.02, 0.8, 3.0)), (1, (0.3, 2.0)), (2, (-0.5, 3.0, 500.0))])
def test_panels_equal_the_kernels(ndf, shapes):
    rng = np.random.default_rng(8)
    big = rng.uniform(0.0, 1.5, 40)
    small = big * rng.uniform(-1.0, 1.0, 40)
    depth = np.full(40, 1e6)
    cuts, edges = np.empty(compiled_panels.CUTS), np.empty(compiled_panels.CUTS)
    opened, fine = 0, ndf != 1
    orders = ((False, 2.0), (False, 4.7), (True, 3.0), (True, 5.0), (True, 9.3))
    for shape, (odd, k) in itertools.product(shapes, orders):
        for t, u in ((big, small), (-big, -small)):
            found, counts = panels(t, u, np.full(40, k), odd, ndf, np.full(40, shape), fine, depth)
            found, counts = np.asarray(found), np.asarray(counts)
            for n in range(40):
                count = compiled_panels.panel_edges(t[n], u[n], k, odd, ndf, shape, fine, 1e6, cuts, edges)
                assert max(count - 1, 0) == counts[n]
                # the crossings are sought to 1e-13 of a function that may be flat
                assert np.allclose(found[:count, n], edges[:count], rtol=0.0, atol=1e-9)
                opened += count > 0
    assert opened > 300
