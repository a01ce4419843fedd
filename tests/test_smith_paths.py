"""Estimators of multi-bounce Smith surfaces: random numbers, visible normals, unbiasedness, and how noisy they are."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from scipy.special import erfc

import brdftab
from benchmarks.papers.wang import PAIRS
from brdftab.models._shared.codes import CORRELATED
from brdftab.models._shared.random_walk import estimates as counts
from brdftab.models._shared.random_walk.exits import mean_exit, walks
from brdftab.models._shared.random_walk.normals import turn, visible_normal
from brdftab.models._shared.random_walk.reflecting import reflecting
from brdftab.models._shared.random_walk.refracting import transmitting
from brdftab.models._shared.random_walk.rng import philox, uniforms
from brdftab.models._shared.random_walk.sampling_plan import at_points
from brdftab.models._shared.random_walk.terms import beckmann_lambda, segment
from brdftab.models._shared.single_bounce.single import evaluate_points
from brdftab.models.resolve import resolve
from brdftab.models.smith_multi import montecarlo
from brdftab.models.smith_multi.montecarlo.second import second_bounces
from brdftab.models.smith_walk import kernel as walk_model

REFERENCE = json.loads((Path(__file__).parent / "reference" / "smith.json").read_text())["points"]
GOLD = {"eta": [0.143, 0.375, 1.442], "k": [3.983, 2.386, 1.603]}


def radians(*pairs: tuple[float, ...]) -> list[np.ndarray]:
    """Return theta_i, theta_o, phi, phi_i (N,) of pairs in degrees; phi_i is 0 if not given."""
    full = [(*pair, 0.0)[:4] for pair in pairs]
    return [np.radians(np.array(column, dtype=float)) for column in zip(*full, strict=True)]


def multi(estimator: str = "pt", **given: Any) -> Any:
    return resolve("smith-multi", **{"ndf": "ggx", "alpha": 0.5, "material": "mirror", "estimator": estimator, **given})


def vector(theta: float, phi: float) -> np.ndarray:
    t, p = math.radians(theta), math.radians(phi)
    return np.array([math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), math.cos(t)])


# ---------------------------------------------------------------- pieces


@pytest.mark.parametrize(
    ("words", "known"),
    [
        ([0] * 6, [0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8]),
        ([0xFFFFFFFF] * 6, [0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD]),
        (
            [0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344, 0xA4093822, 0x299F31D0],
            [0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1],
        ),
    ],
)
def test_philox_gives_the_published_words(words: list[int], known: list[int]) -> None:
    assert [int(x) for x in philox(*map(np.uint64, words))] == known


def test_uniforms_depend_on_every_part_of_their_name() -> None:
    named = [
        (5, 7, 9, 2),
        (6, 7, 9, 2),
        (5, 8, 9, 2),
        (5, 7, 10, 2),
        (5, 7, 9, 3),
        (5 + 2**40, 7, 9, 2),
        (5, 7 + 2**40, 9, 2),
    ]
    drawn = [uniforms(*name) for name in named]
    assert len(set(drawn)) == len(drawn)
    many = np.array([uniforms(1, 0, n, 0) for n in range(20000)])
    assert np.all((many > 0) & (many < 1))
    # standard deviation of the mean of 80000 uniforms: 1e-3
    assert abs(many.mean() - 0.5) < 4e-3


def test_uniforms_are_the_centres_of_their_words() -> None:
    # counter: block, path, cell; key: seed
    words = philox(*map(np.uint64, (2, 9, 7, 0, 5, 0)))
    assert uniforms(5, 7, 9, 2) == tuple((int(word) + 0.5) / 2**32 for word in words)


def test_turn_is_cosine_and_sine() -> None:
    u = np.concatenate([np.linspace(0, 1, 41), np.random.default_rng(1).random(200)])
    found = np.array([turn(x) for x in u])
    np.testing.assert_allclose(found, np.stack([np.cos(2 * np.pi * u), np.sin(2 * np.pi * u)], axis=1), atol=4e-15)


def test_beckmann_lambda_keeps_its_digits() -> None:
    # int_v^inf (t - v) exp(-t^2) dt / (v sqrt(pi)), by substitution and Gauss-Laguerre-like panels
    x, w = leggauss(60)
    for v in (0.05, 0.7, 3.0, 4.49, 4.51, 6.0, 12.0, 25.0):
        s = 0.5 * (x + 1) * min(9.0, 20.0 / v)
        scaled = np.sum(w * s * np.exp(-2 * v * s - s * s)) * 0.5 * min(9.0, 20.0 / v) / (v * math.sqrt(math.pi))
        # worst 1e-9, just below the change of formula
        assert beckmann_lambda(v) == pytest.approx(scaled * math.exp(-v * v), rel=1e-8)


@pytest.mark.parametrize("ndf", [0, 1])
@pytest.mark.parametrize("w", [(20, 40), (85, 200), (105, 30), (130, 300)])
def test_visible_normals_and_their_area(ndf: int, w: tuple[float, float]) -> None:
    """Moments of drawn normals against a quadrature of D (w.m)+ over slopes, also from below."""
    ax, ay = 0.4, 0.9
    x, y, z = vector(*w)
    # slopes p = alpha tan(t) (cos, sin): D m_z dm = P22 dp; visible: P22 (w.m)/m_z
    u, weight = leggauss(400)
    # denser towards steep slopes, which are many for GGX
    share, weight = 1 - (0.5 - 0.5 * u) ** 3, 3 * weight * (0.5 - 0.5 * u) ** 2
    r = np.sqrt(-np.log1p(-share)) if ndf == 0 else np.sqrt(share / (1 - share))
    angle = (np.arange(720) + 0.5) / 720 * 2 * math.pi
    px, py = ax * r[:, None] * np.cos(angle), ay * r[:, None] * np.sin(angle)
    seen = np.maximum(x * px + y * py + z, 0.0) * (0.5 * weight[:, None] / 720)
    area = seen.sum()
    factor, chance = segment(ndf, ax, ay, x, y, z)
    exact = 1.0 / factor if z > 0 else chance / factor
    # the edge of visibility is a kink
    assert area == pytest.approx(exact, rel=1e-3)
    m = np.stack(np.broadcast_arrays(px, py, np.ones_like(px)), -1)
    m /= np.linalg.norm(m, axis=-1, keepdims=True)
    rng = np.random.default_rng(4)
    drawn = np.array([visible_normal(ndf, ax, ay, x, y, z, *row) for row in rng.random((20000, 3))])
    assert np.all(drawn @ np.array([x, y, z]) > -1e-12)
    for moment in (lambda m: m[..., 0], lambda m: m[..., 1] * m[..., 2], lambda m: m[..., 2] ** 2):
        values = moment(drawn)
        expected = (moment(m) * seen).sum() / area
        assert abs(values.mean() - expected) < 4 * values.std() / math.sqrt(20000) + 1e-3


# ---------------------------------------------------------------- values


@pytest.mark.parametrize(("estimator", "samples"), [("pt", 40000), ("bdpt", 20000)])
@pytest.mark.parametrize("channels", [slice(0, 1), slice(1, 4)], ids=["mirror", "gold"])
def test_estimators_meet_the_reference(estimator: str, samples: int, channels: slice) -> None:
    scores = []
    for point in REFERENCE:
        rough = {f"alpha_{a}": point[f"alpha_{a}"] for a in "xy"}
        optics = {"material": "mirror"} if channels.start == 0 else {"material": None, **GOLD}
        setup = multi(estimator, ndf=point["ndf"], alpha=None, samples=samples, seed=11, **rough, **optics)
        angles = (
            point["theta_i_deg"],
            point["theta_o_deg"],
            point["phi_o_deg"] - point["phi_i_deg"],
            point["phi_i_deg"],
        )
        found = montecarlo.estimates(setup, *radians(angles), orders=8, tolerance=1e-9)
        np.testing.assert_allclose(found.values[0, 0], point["single"][channels], rtol=1e-9)
        known = point.get("multi", point["pt"])
        spread = np.hypot(found.standard_error[0], 0.0 if "multi" in point else point["pt_se"][channels])
        scores.append((found.values[0, 1:].sum(axis=0) - known[channels]) / spread)
    assert np.abs(scores).max() < 4


@pytest.mark.parametrize("estimator", ["pt", "bdpt"])
def test_standard_errors_are_true(estimator: str) -> None:
    """Repeated seeds scatter as their standard errors say."""
    runs = [
        montecarlo.estimates(multi(estimator, samples=512, seed=s), *radians(*PAIRS), orders=0, tolerance=1e-3)
        for s in range(40)
    ]
    values, errors = np.array([r.values[:, 0, 0] for r in runs]), np.array([r.standard_error[:, 0] for r in runs])
    z = (values - values.mean(axis=0)) / errors
    # 8 * 39 degrees of freedom: standard deviation .08, and heavy tails
    assert np.mean(z * z) * 40 / 39 == pytest.approx(1.0, abs=0.3)


def test_roulette_shortens_walks_and_keeps_the_mean() -> None:
    for estimator in ("pt", "bdpt"):
        a, b = (
            montecarlo.estimates(
                multi(estimator, alpha=1.0, samples=20000, roulette=r, seed=2),
                *radians(*PAIRS),
                orders=0,
                tolerance=1e-3,
            )
            for r in ("off", "on")
        )
        gap = (a.values[:, 0, 0] - b.values[:, 0, 0]) / np.hypot(a.standard_error[:, 0], b.standard_error[:, 0])
        assert np.abs(gap).max() < 4
        assert np.any(gap != 0)


def test_components_add_up_and_the_cap_leaves_out() -> None:
    angles = radians(*PAIRS)
    for estimator in ("pt", "bdpt", "hybrid"):
        whole = montecarlo.estimates(multi(estimator, samples=300), *angles, orders=0, tolerance=1e-3)
        parts = montecarlo.estimates(multi(estimator, samples=300), *angles, orders=8, tolerance=1e-3)
        two = montecarlo.estimates(multi(estimator, samples=300, max_bounces=2), *angles, orders=0, tolerance=1e-3)
        one = montecarlo.estimates(multi(estimator, samples=300, max_bounces=1), *angles, orders=8, tolerance=1e-3)
        np.testing.assert_allclose(parts.values.sum(axis=1), whole.values[:, 0], rtol=1e-12)
        np.testing.assert_allclose(two.values[:, 0], parts.values[:, :2].sum(axis=1), rtol=1e-12)
        np.testing.assert_array_equal(one.values[:, 0], parts.values[:, 0])
        assert not one.standard_error.any()


def smooth_second(ndf: int, ax: float, ay: float, i: np.ndarray, o: np.ndarray, f0: float) -> float:
    """Integrate the second bounce over panels graded dyadically towards every edge and corner, in NumPy."""

    def d(h: np.ndarray) -> np.ndarray:
        e, z2 = (h[..., 0] / ax) ** 2 + (h[..., 1] / ay) ** 2, h[..., 2] ** 2
        n2 = np.sum(h * h, axis=-1)
        if ndf:
            return np.where(h[..., 2] > 0, n2**2 / (math.pi * ax * ay * (e + z2) ** 2), 0.0)
        return np.where(h[..., 2] > 0, np.exp(-e / z2) * n2**2 / (math.pi * ax * ay * z2**2), 0.0)

    def w(v: np.ndarray) -> np.ndarray:
        z = np.abs(v[..., 2])
        a = z / np.hypot(ax * v[..., 0], ay * v[..., 1])
        big = (np.sqrt(1 + a**-2) - 1) / 2 if ndf else (np.exp(-a * a) / (a * math.sqrt(math.pi)) - erfc(a)) / 2
        return 1.0 / (z * (1 + big))

    def rule(marks: list[float], low: float, high: float, most: float) -> tuple[np.ndarray, np.ndarray]:
        edges = {m + s * most * 0.5**k for m in marks for k in range(26) for s in (-1, 0, 1)} | {low, high}
        e = np.array(sorted(x for x in edges if low <= x <= high))
        e = e[np.concatenate([[True], np.diff(e) > 1e-14])]
        g, weight = leggauss(8)
        mid, half = 0.5 * (e[1:] + e[:-1])[:, None], 0.5 * np.diff(e)[:, None]
        return (mid + half * g).reshape(-1), (half * weight).reshape(-1)

    def schlick(h: np.ndarray) -> np.ndarray:
        return f0 + (1 - f0) * (1 - 0.5 * np.linalg.norm(h, axis=-1)) ** 5

    bi, bo = math.asin(i[2]), math.asin(o[2])
    start = math.atan2(-i[1], -i[0])
    to = (math.atan2(o[1], o[0]) - start) % (2 * math.pi)
    beta, wb = rule([-bi, -bo, 0.0, bi, bo], -bi, bo, 1.0)
    phi, wp = rule([0.0, to, 2 * math.pi], 0.0, 2 * math.pi, 2.0)
    total = 0.0
    for b, weight in zip(beta, wb, strict=True):
        v = np.stack(
            [math.cos(b) * np.cos(start + phi), math.cos(b) * np.sin(start + phi), np.full_like(phi, math.sin(b))], -1
        )
        f = d(i + v) * d(o - v) / 16.0 * schlick(i + v) * schlick(o - v) * w(v)
        total += weight * math.cos(b) * float(np.sum(wp * f))
    return total * float(w(i) * w(o))


@pytest.mark.parametrize(
    ("ndf", "ax", "ay", "pair"),
    [(1, 0.5, 0.5, (60, 75, 190, 0)), (1, 0.4, 0.9, (30, 50, 200, 20)), (0, 0.5, 0.8, (70, 40, 100, 30))],
)
def test_second_bounce_by_quadrature(ndf: int, ax: float, ay: float, pair: tuple[float, ...]) -> None:
    i, o = vector(pair[0], pair[3]), vector(pair[1], pair[3] + pair[2])
    known = smooth_second(ndf, ax, ay, i, o, 0.3)
    out = np.empty((1, 1))
    schlick = (3, np.array([0.3]), np.zeros(1), np.empty((1, 0)))
    for tolerance in (1e-3, 3e-8):
        second_bounces(ndf, ax, ay, i[None], o[None], *schlick, np.zeros(1), tolerance, out)
        assert out[0, 0] == pytest.approx(known, rel=max(tolerance, 1e-7))


def test_hybrid_agrees_with_bdpt_and_has_less_noise() -> None:
    rough = {"alpha": None, "alpha_x": 0.3, "alpha_y": 0.8, "samples": 4000}
    angles = radians((30, 50, 200, 20), (70, 60, 170, 80), (20, 75, 60, 140))
    a, b = (montecarlo.estimates(multi(e, **rough), *angles, orders=8, tolerance=1e-4) for e in ("hybrid", "bdpt"))
    gap = a.values.sum(axis=1) - b.values.sum(axis=1)
    assert np.all(np.abs(gap) < 4 * np.hypot(a.standard_error, b.standard_error))
    assert np.all(a.standard_error < 0.7 * b.standard_error)


def test_bdpt_beats_the_random_walk() -> None:
    """Mean squared error at equal samples, all orders by the walk (Wang et al. 2022, Fig. 8)."""
    for alpha in (1.0, 0.5):
        given = {"alpha": alpha, "samples": 4000}
        b = montecarlo.estimates(multi("bdpt", **given), *radians(*PAIRS), orders=0, tolerance=1e-3)
        setup = resolve("smith-walk", ndf="ggx", material="mirror", **given)
        path_sampler = reflecting(setup, 1e-3, heights=True, least=1)
        # walks start at the light, as the paper's do, and not at the more grazing direction
        w = at_points(setup, [replace(path_sampler, shared=False)], tuple(radians(*PAIRS)), 0, 1e-3)
        assert np.mean(w.standard_error**2) > 5 * np.mean(b.standard_error**2)


# ---------------------------------------------------------------- walks with heights


def test_single_bounces_of_walks_are_height_correlated() -> None:
    """The walk's own first order has the closed form as its expectation, in transmission too."""
    angles = radians(*PAIRS)
    for ndf in ("ggx", "beckmann"):
        setup = resolve("smith-walk", ndf=ndf, alpha=0.7, material="mirror", samples=30000, max_bounces=1)
        drawn = at_points(setup, [reflecting(setup, 1e-3, heights=True, least=1)], tuple(angles), 0, 1e-3)
        exact = evaluate_points(setup, CORRELATED, *angles)
        assert np.all(np.abs(drawn.values - exact)[:, 0] < 4 * drawn.standard_error + 1e-12)
    through = resolve("smith-walk", ndf="ggx", alpha=0.7, ior=1.5, samples=30000, max_bounces=1)
    angles = radians((40, 140, 180), (60, 150, 170), (150, 40, 170), (50, 30, 200))
    drawn = at_points(through, transmitting(through, heights=True, least=1), tuple(angles), 0, 1e-3)
    exact = walk_model.points(through, *angles, orders=0, tolerance=1e-3)
    assert np.all(exact > 0)
    assert np.abs((drawn.values - exact)[:, 0] / drawn.standard_error).max() < 4


@pytest.mark.parametrize("model", ["smith-multi", "smith-walk"])
def test_nothing_is_lost(model: str) -> None:
    for optics in ({"material": "mirror"}, {"ior": [1.4, 1.7] * 1 + [2.0]}):
        setup = resolve(
            model, ndf="ggx", alpha_x=0.3, alpha_y=0.9, **optics, **({"estimator": "pt"} if "multi" in model else {})
        )
        for theta in (20.0, 85.0) + ((130.0,) if setup.transmits else ()):
            _, weight, bounces = walks(setup, math.radians(theta), 0.4, model == "smith-walk", 3000, 3)
            assert bounces.min() > 0
            np.testing.assert_allclose(weight.mean(axis=0), 1.0, rtol=1e-12)
    dim = replace(setup, max_bounces=1)
    assert np.any(walks(dim, 1.2, 0.0, model == "smith-walk", 3000, 3)[2] == 0)


@pytest.mark.parametrize(
    ("model", "optics", "light"),
    [
        ("smith-multi", {"material": "mirror"}, 60.0),
        ("smith-walk", {"material": "mirror"}, 60.0),
        ("smith-multi", {"ior": 1.5}, 130.0),
        ("smith-walk", {"ior": 1.5}, 50.0),
    ],
)
def test_samples_follow_the_estimates(model: str, optics: dict[str, Any], light: float) -> None:
    """Histograms of exits after two or more bounces against estimates integrated over the same boxes."""
    given = {"estimator": "pt"} if model == "smith-multi" else {}
    setup = resolve(model, ndf="ggx", alpha_x=0.8, alpha_y=0.5, samples=4000, seed=5, **optics, **given)
    count = 60000
    ways, _, bounces = walks(setup, math.radians(light), 0.0, model == "smith-walk", count, 1)
    top = 180.0 if setup.transmits else 90.0
    boxes, inner = (6, 6), 4
    x, w = leggauss(inner)
    edges = [np.linspace(0, np.radians(t), n + 1) for t, n in ((top, boxes[0]), (360.0, boxes[1]))]
    nodes = [(e[:-1, None] + 0.5 * (x + 1) * np.diff(e)[:, None]).reshape(-1) for e in edges]
    weights = [(0.5 * w * np.diff(e)[:, None]).reshape(-1) for e in edges]
    axes = dict(theta_i=np.radians([light]), phi_i=np.zeros(1), theta_o=nodes[0], phi_o=nodes[1])
    module: Any = montecarlo if model == "smith-multi" else walk_model
    table = module.estimate_table(setup, axes, orders=8, tolerance=1e-3).values[1:, 0, 0, ..., 0].sum(axis=0)
    density = table * (np.abs(np.cos(nodes[0])) * np.sin(nodes[0]) * weights[0])[:, None] * weights[1]
    expected = density.reshape(boxes[0], inner, boxes[1], inner).sum(axis=(1, 3))
    many = bounces > 1
    at = np.arccos(ways[many, 2]), np.mod(np.arctan2(ways[many, 1], ways[many, 0]), 2 * np.pi)
    share = np.histogram2d(*at, bins=edges)[0] / count
    # next events are at most as noisy as exits of as many walks
    z = (share - expected) / np.sqrt(np.maximum(share, 1e-4) * (1 / count + 1 / 4000))
    assert np.abs(z).max() < 4.5
    assert expected.sum() == pytest.approx(many.mean(), rel=0.05)


# ---------------------------------------------------------------- tables


def axes_of(count: int, steps: int, top: float = 90.0) -> dict[str, np.ndarray]:
    theta = np.radians((np.arange(count) + 0.5) * top / count)
    return {"theta_i": theta, "theta_o": theta, "phi": np.radians(np.linspace(0, 180, steps))}


@pytest.mark.parametrize("estimator", ["pt", "bdpt"])
def test_tables_do_not_depend_on_threads_or_batches(estimator: str, monkeypatch: pytest.MonkeyPatch) -> None:
    setup, axes = multi(estimator, samples=60, seed=9), axes_of(6, 7)
    table = montecarlo.estimate_table(setup, axes, orders=8, tolerance=1e-3)
    assert np.array_equal(table.values, table.values.swapaxes(1, 2))
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        monkeypatch.setattr(counts, "_ROOM", 50)
        shares: list[float] = []
        again = montecarlo.estimate_table(setup, axes, orders=8, tolerance=1e-3, progress=shares.append)
    finally:
        numba.set_num_threads(before)
    assert np.array_equal(table.values, again.values)
    assert np.array_equal(table.standard_error, again.standard_error)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    other = montecarlo.estimate_table(
        replace(setup, values={**setup.values, "seed": 10}), axes, orders=8, tolerance=1e-3
    )
    assert not np.array_equal(table.values, other.values)


def test_table_equals_points_within_errors() -> None:
    for setup, axes in (
        (multi(samples=3000), axes_of(4, 5)),
        (resolve("smith-multi", ndf="ggx", alpha=0.6, ior=1.5, estimator="pt", samples=3000), axes_of(6, 3, 180.0)),
    ):
        table = montecarlo.estimate_table(setup, axes, orders=0, tolerance=1e-3)
        grid = np.meshgrid(axes["theta_i"], axes["theta_o"], axes["phi"], indexing="ij")
        flat = [a.reshape(-1) for a in grid]
        points = montecarlo.estimates(setup, *flat, 0.0 * flat[0], orders=0, tolerance=1e-3)
        gap = table.values[0].reshape(-1) - points.values[:, 0, 0]
        z = gap / np.maximum(np.hypot(table.standard_error.reshape(-1), points.standard_error[:, 0]), 1e-12)
        # heavy tails: a few cells in a hundred have not met their bright paths
        assert np.mean(np.abs(z) < 3) > 0.97
        if setup.transmits:
            index = np.where(axes["theta_i"] < 0.5 * np.pi, 1.0, 1.5**2)
            scaled = table.values[0, ..., 0] / index[:, None]
            np.testing.assert_allclose(scaled, scaled.swapaxes(0, 1), rtol=1e-14)


def test_adaptive_tables_stop_where_they_should() -> None:
    axes = axes_of(4, 5)
    table = montecarlo.estimate_table(multi("bdpt"), axes, orders=0, tolerance=0.02)
    relative = table.standard_error[..., 0] / table.values[0, ..., 0]
    met = relative <= 0.02
    assert np.all(met | (table.samples == counts.MOST_PATHS))
    assert table.samples.min() < table.samples.max()
    assert set(np.unique(table.samples)) <= {counts.FIRST_ROUND << k for k in range(10)}


# ---------------------------------------------------------------- sampling


def test_sampling_of_walks() -> None:
    gold = {"ndf": "beckmann", "alpha": 0.6, "material": "Au", "estimator": "pt"}
    drawn = brdftab.sample("smith-multi", 0.9, 4000, seed=3, **gold)
    error = drawn.weight.std(axis=0) / math.sqrt(4000)
    exact = mean_exit(resolve("smith-multi", **gold), 0.9, 0.0, False, 5e-4)
    assert np.all(np.abs(drawn.weight.mean(axis=0) - exact) < 4 * error + 2e-3)
    assert drawn.valid.all()
    capped = brdftab.sample("smith-walk", 1.3, 4000, seed=3, ndf="ggx", alpha=1.0, max_bounces=2)
    assert 0.0 < np.mean(~capped.valid) < 0.5
    assert not capped.weight[~capped.valid].any()
    assert not capped.pdf[~capped.valid].any()
    glass = brdftab.sample("smith-multi", 2.4, 4000, phi_i=0.3, seed=3, ndf="ggx", alpha=0.5, ior=1.5, estimator="pt")
    assert np.all(glass.weight == 1.0)
    assert 0.1 < np.mean(glass.theta_o > 0.5 * np.pi) < 0.9


def test_densities_integrate_to_one() -> None:
    x, w = leggauss(100)
    theta, weight = 0.25 * math.pi * (x + 1), 0.25 * math.pi * w
    phi = (np.arange(200) + 0.5) / 200 * 2 * math.pi
    for model, given in (
        ("smith-multi", {"ndf": "ggx", "alpha": 0.7, "material": "mirror", "estimator": "pt"}),
        ("smith-walk", {"ndf": "beckmann", "alpha_x": 0.5, "alpha_y": 0.9, "ior": 1.5}),
    ):
        t = np.concatenate([theta, theta + 0.5 * math.pi]) if "ior" in given else theta
        whole = np.tile(weight, len(t) // len(theta)) * np.sin(t)
        density = brdftab.pdf(model, 0.9, t[:, None], phi, phi_i=0.3, **given)
        # the lattice behind the missing share is good to 1e-3
        assert (density * whole[:, None]).sum() * 2 * math.pi / 200 == pytest.approx(1.0, abs=2e-3)
