"""The V-grooves against a mirror tracer, a Monte Carlo of grooves, brute-force integrals and the paper's tables."""

import importlib
import json
import math
from pathlib import Path

import numpy as np
import pytest
from oracles import groove_integral, groove_mc
from oracles.groove_tracer import beams_grid

import brdftab
from benchmarks.papers import lee
from benchmarks.papers.grooves import closed_nonsymmetric, closed_symmetric
from brdftab import models
from brdftab.models.resolve import resolve

DEGREE = math.pi / 180.0
GROOVES = ("vgroove-sym", "vgroove-nonsym")
REFERENCE = json.loads((Path(__file__).parent / "reference" / "vgroove.json").read_text())["points"]


# ---------------------------------------------------------------- one groove in its plane (Table 1)


def _errors(closed, traced):
    """L1 error over facets and orders as a fraction of the opening, and the largest error of an outgoing angle."""
    widths, angles, seen = traced
    l1 = np.abs(closed[0] - widths[:, :, : closed[0].shape[2]]).sum((1, 2)) / seen
    real = widths / seen[:, None, None] > 1e-9
    assert not real[:, :, closed[0].shape[2] :].any(), "the tracer found more bounces than were compared"
    turn = (closed[1] - angles[:, :, : closed[1].shape[2]])[real[:, :, : closed[1].shape[2]]]
    return l1, np.abs((turn + np.pi) % (2.0 * np.pi) - np.pi).max()


def test_symmetric_groove_matches_tracer_on_table_1_grid():
    theta_i, aperture = np.meshgrid(np.arange(-89, 90) * DEGREE, np.arange(1, 181, 5) * DEGREE, indexing="ij")
    theta_i, tilt = theta_i.ravel(), 0.5 * (math.pi - aperture.ravel())
    assert theta_i.size == 6444
    l1, turn = _errors(closed_symmetric(theta_i, tilt, 190), beams_grid(theta_i, tilt, tilt, 200))
    # measured 3e-12, from 180 bounces in the aperture of one degree
    assert l1.max() <= 1e-10
    assert turn <= 1e-11


def test_nonsymmetric_groove_matches_tracer_on_table_1_grid():
    tilts = np.arange(5, 91, 5) * DEGREE
    theta_i, left, right = np.meshgrid(np.arange(-89, 90) * DEGREE, tilts, tilts, indexing="ij")
    theta_i, left, right = theta_i.ravel(), left.ravel(), right.ravel()
    assert theta_i.size == 179 * 324
    open_ = left + right < math.pi - 1e-9  # two parallel walls (90, 90) let no light in
    theta_i, left, right = theta_i[open_], left[open_], right[open_]
    l1, turn = _errors(closed_nonsymmetric(theta_i, left, right, 44), beams_grid(theta_i, left, right, 48))
    assert l1.max() <= 1e-10
    assert turn <= 1e-11


def test_tracer_accounts_for_all_light_and_is_reciprocal():
    rng = np.random.default_rng(5)
    theta_i = rng.uniform(-1.5, 1.5, 400)
    left, right = rng.uniform(0.05, 1.55, (2, 400))
    widths, angles, seen = beams_grid(theta_i, left, right, 200)
    assert np.abs(widths.sum((1, 2)) / seen - 1.0).max() < 1e-13
    n, facet, k = np.nonzero(widths > 1e-6)
    back, _, _ = beams_grid(angles[n, facet, k], left[n], right[n], 200)
    # backwards the beam meets the facets in reverse order
    last = np.where(k % 2 == 1, facet, 1 - facet)
    assert np.allclose(back[np.arange(n.size), last, k], widths[n, facet, k], rtol=1e-9, atol=1e-11)
    for m in np.flatnonzero(facet == 0)[:200]:
        angle, _ = groove_integral.follow(theta_i[n[m]], left[n[m]], right[n[m]], k[m], 1.0, -1.0, 0.0)
        turn = angle - angles[n[m], 0, k[m]]
        assert abs(math.remainder(turn, 2.0 * math.pi)) < 1e-12


# ---------------------------------------------------------------- how many bounces a distribution needs (Table 2)


@pytest.mark.parametrize(("ndf", "alpha"), lee.TABLE_2)
def test_table_2_bounces_at_percentiles(ndf, alpha):
    bounces, norm = lee.bounces_at(ndf, alpha)
    # the trapezoidal sum must also show that D is normalised
    assert norm == pytest.approx(1.0, abs=1e-6)
    assert bounces == lee.TABLE_2[ndf, alpha]


# ---------------------------------------------------------------- points in space


def _roughness(point):
    if point["ndf"] == "phong":
        return {"alpha": point["alpha_x"]}
    return {"alpha_x": point["alpha_x"], "alpha_y": point["alpha_y"]}


def _angles(point):
    phi_i = point["phi_i_deg"] * DEGREE
    return (point["theta_i_deg"] * DEGREE, point["theta_o_deg"] * DEGREE, point["phi_o_deg"] * DEGREE - phi_i), phi_i


def _name(point):
    return f"{point['model']}-{point['ndf']}-{point['theta_i_deg']}-{point['theta_o_deg']}"


@pytest.mark.parametrize("point", REFERENCE, ids=_name)
def test_reference_points(point):
    angles, phi_i = _angles(point)
    given_ = {"ndf": point["ndf"], "material": "mirror", "tolerance": 1e-8, **_roughness(point)}
    total = brdftab.evaluate(point["model"], *angles, phi_i=phi_i, **given_)
    parts = brdftab.evaluate(point["model"], *angles, phi_i=phi_i, components=True, **given_)
    assert np.allclose(total, point["total"], rtol=1e-7, atol=1e-12)
    for k, expected in enumerate(point["orders"], start=1):
        value = parts[f"order{k}"] if f"order{k}" in parts else np.zeros(1)
        assert np.allclose(value, expected, rtol=1e-7, atol=1e-12), f"order {k}"
    assert np.allclose(sum(parts.values()), total, rtol=1e-9, atol=1e-14)


# gold at 450, 550 and 650 nm (rounded): absorbing, the Brewster-like dip, and nearly perfect
METALS = ((1.50, 1.88), (0.43, 2.46), (0.15, 3.50))
# directions in and off the plane of incidence, near the mirror direction, towards grazing
DIRECTIONS = ((30, 20, 40, 0), (40, 40, 175, 25), (70, 60, 180, 0), (80, 35, 120, 60), (5, 65, 90, 10))


ROUGH = (
    ("ggx", 0.5, 0.5), ("ggx", 1.0, 0.4), ("ggx", 4.0, 1.5), ("ggx", 0.05, 0.05),
    ("beckmann", 0.2, 0.2), ("beckmann", 0.7, 1.0), ("beckmann", 3.0, 3.0), ("phong", 0.8, 0.8),
)  # fmt: skip


@pytest.mark.parametrize("direction", range(len(DIRECTIONS)))
@pytest.mark.parametrize(("ndf", "alpha_x", "alpha_y"), ROUGH)
@pytest.mark.parametrize("model", GROOVES)
def test_orders_with_metal_match_traced_integral(model, ndf, alpha_x, alpha_y, direction):
    theta_i, theta_o, phi, phi_i = np.array(DIRECTIONS[direction]) * DEGREE
    eta, kappa = METALS[direction % len(METALS)]
    rough = {"alpha_x": alpha_x, "alpha_y": alpha_y} if alpha_x != alpha_y else {"alpha": alpha_x}
    parts = brdftab.evaluate(
        model, theta_i, theta_o, phi, phi_i=phi_i, components=True, ndf=ndf, eta=eta, k=kappa, tolerance=1e-9, **rough
    )
    total = sum(parts.values())
    for k in range(1, 7):
        expected, doubt = groove_integral.order(
            k, theta_i, theta_o, phi, symmetric=model == "vgroove-sym", ndf=ndf, alpha_x=alpha_x, alpha_y=alpha_y,
            phi_i=phi_i, eta=eta, kappa=kappa,
        )  # fmt: skip
        # an order need not be exact to digits that vanish in the sum
        floor = 1e-12 + 1e-10 * float(total[0]) + 10.0 * doubt
        assert np.allclose(parts[f"order{k}"], expected, rtol=1e-7, atol=floor), f"order {k}"


@pytest.mark.parametrize("direction", [(60, 75, 150, 0), *DIRECTIONS])
@pytest.mark.parametrize("alpha", [1.05, 1.1, 1.2, 1.3, 1.4, 1.41, 1.4142])
def test_vertical_facets_of_broad_phong_lobes_match_traced_integral(alpha, direction):
    """D ~ cos^n with n from -.19 to -.99996: nearly all opposite facets stand upright at the end."""
    theta_i, theta_o, phi = np.array(direction[:3]) * DEGREE
    parts = {
        tolerance: brdftab.evaluate(
            "vgroove-nonsym", theta_i, theta_o, phi, components=True, ndf="phong", alpha=alpha, eta=0.43, k=2.46,
            tolerance=tolerance,
        )
        for tolerance in (1e-3, 1e-5, 1e-8)
    }  # fmt: skip
    total = float(sum(parts[1e-8].values())[0])
    for k in range(2, 6):
        expected, doubt = groove_integral.order(
            k, theta_i, theta_o, phi, symmetric=False, ndf="phong", alpha_x=alpha, eta=0.43, kappa=2.46
        )
        for tolerance, found in parts.items():
            floor = 1e-12 + 10.0 * doubt + 0.1 * tolerance * total
            # QUADPACK halves intervals down to kinks of the beam: it stops at 1e-7 of an order there
            assert np.allclose(found[f"order{k}"], expected, rtol=max(tolerance, 1e-6), atol=floor), (k, tolerance)


@pytest.mark.parametrize("model", GROOVES)
def test_spectra_are_projected_after_the_product_over_bounces(model):
    angles = tuple(x * DEGREE for x in (50.0, 40.0, 172.0))
    parts = brdftab.evaluate(model, *angles, components=True, ndf="ggx", alpha=0.6, material="Au", tolerance=1e-9)
    optics = resolve(model, ndf="ggx", alpha=0.6, material="Au").fresnel
    for k in range(1, 4):
        spectral = [
            groove_integral.order(
                k, *angles, symmetric=model == "vgroove-sym", ndf="ggx", alpha_x=0.6, eta=eta, kappa=kappa
            )[0]
            for eta, kappa in zip(optics.a, optics.b, strict=True)
        ]
        assert np.allclose(parts[f"order{k}"], spectral @ optics.weights, rtol=1e-7, atol=1e-10), f"order {k}"


@pytest.mark.parametrize("model", GROOVES)
def test_total_is_the_sum_of_all_traced_orders(model):
    # 5 degrees from the mirror direction: dozens of orders, then exactly none
    angles = tuple(x * DEGREE for x in (50.0, 44.0, 177.0))
    total, silent, k = 0.0, 0, 0
    while silent < 8:
        k += 1
        value, _ = groove_integral.order(
            k, *angles, symmetric=model == "vgroove-sym", ndf="ggx", alpha_x=1.0, rtol=1e-8
        )
        total += value
        silent = silent + 1 if value == 0.0 else 0
    assert k >= 20
    value = brdftab.evaluate(model, *angles, ndf="ggx", alpha=1.0, material="mirror", tolerance=1e-9)
    assert np.allclose(value, total, rtol=1e-7)


@pytest.mark.parametrize("model", GROOVES)
@pytest.mark.parametrize(("ndf", "alpha"), [("beckmann", 0.5), ("ggx", 0.7), ("ggx", 1.0)])
@pytest.mark.parametrize("theta_i", [30, 70])
def test_half_vector_bins_match_monte_carlo(model, ndf, alpha, theta_i):
    theta_i = theta_i * DEGREE
    bins = groove_mc.sample(theta_i, symmetric=model == "vgroove-sym", ndf=ndf, alpha=alpha, samples=500_000, seed=7)
    theta_o, phi, weight = groove_mc.half_vector_nodes(theta_i)
    parts = brdftab.evaluate(
        model, theta_i, theta_o, phi, components=True, ndf=ndf, alpha=alpha, material="mirror", tolerance=1e-4
    )
    zero = np.zeros(theta_o.shape)
    orders = [parts.get(f"order{k}", zero[..., None])[..., 0] for k in range(1, 4)]
    orders.append(sum((v[..., 0] for name, v in parts.items() if name not in {"order1", "order2", "order3"}), zero))
    expected = np.stack([(np.where(weight > 0.0, f, 0.0) * weight).sum((2, 3)) for f in orders])
    z = groove_mc.z_scores(bins, expected)
    assert z.size >= 15
    assert math.sqrt(np.mean(z**2)) <= 1.3
    # nothing may hide in the bins that are too thin for a score
    assert abs(expected.sum() - bins.albedo) <= 4.0 * bins.albedo_error + 2e-3


def test_monte_carlo_needs_no_special_variates():
    cdf = groove_mc.tilt_table(lambda r: 1.0 / (np.cos(r) ** 2 + np.sin(r) ** 2 / 0.25) ** 2)
    a = groove_mc.sample(0.6, symmetric=False, ndf="ggx", alpha=0.5, samples=300_000, seed=2, table=cdf)
    b = groove_mc.sample(0.6, symmetric=False, ndf="ggx", alpha=0.5, samples=300_000, seed=3)
    good = (a.counted >= 200) & (b.counted >= 200)
    z = (a.mean - b.mean)[good] / np.hypot(a.error, b.error)[good]
    assert math.sqrt(np.mean(z**2)) <= 1.3
    assert abs(a.albedo - 1.0) <= 4.0 * a.albedo_error


# ---------------------------------------------------------------- symmetries and extremes


@pytest.mark.parametrize(
    ("model", "ndf", "alpha", "long"),
    [
        *(("vgroove-sym", "ggx", alpha, (20_000, 64)) for alpha in (0.5, 2.0, 10.0)),
        *(("vgroove-sym", "phong", alpha, (20_000, 64)) for alpha in (0.9, 1.4, 3.0, 10.0)),
        *(("vgroove-nonsym", "ggx", alpha, (1024, 16, 16, True)) for alpha in (0.5, 2.0, 10.0)),
        *(("vgroove-nonsym", "phong", alpha, (4096, 16, 16, True)) for alpha in (0.9, 1.1, 1.2, 1.3, 1.4, 1.4142)),
    ],
)
def test_tails_beside_the_mirror_direction_keep_the_tolerance(monkeypatch, model, ndf, alpha, long):
    """A thousand orders and more summed one by one against the integral that stands for most of them."""
    module = models.kernel(model)
    setup = resolve(model, ndf=ndf, alpha=alpha, material="mirror")
    # the last are no mirror direction: at equal polar angles odd orders do not end
    degrees = [
        [89.999, 45.0, 1e-8, 30.0, 60.0, 45.0, 45.0, 70.0, 89.9, 40.0],
        [89.999, 45.0, 0.0, 30.5, 60.1, 44.0, 44.9, 70.01, 89.9, 40.0],
        [179.99999994, 179.9999, 90, 180, 180, 179, 179.9, 180, 35.4378, 60.0],
    ]
    if (model, ndf) == ("vgroove-nonsym", "phong") and alpha >= 1.4:
        # a known limit: a groove's aperture of 1e-11 after a billion bounces
        degrees = np.delete(degrees, 8, axis=1)
    theta_i, theta_o, phi = np.radians(degrees)
    found = {
        t: module.points(setup, theta_i, theta_o, phi, 0.0 * phi, orders=0, tolerance=t)
        for t in (1e-3, 1e-4, 1e-5, 1e-6)
    }
    monkeypatch.setattr(importlib.import_module(f"{module.__package__}.rules"), "RULES", ((0.0, long),))
    exact = module.points(setup, theta_i, theta_o, phi, 0.0 * phi, orders=0, tolerance=1e-9)
    for tolerance, values in found.items():
        np.testing.assert_allclose(values, exact, rtol=tolerance)


@pytest.mark.parametrize("model", GROOVES)
@pytest.mark.parametrize(
    "rough",
    [
        {"ndf": "beckmann", "alpha": 0.3}, {"ndf": "beckmann", "alpha_x": 1.0, "alpha_y": 0.2},
        {"ndf": "ggx", "alpha": 0.1}, {"ndf": "ggx", "alpha": 1.0}, {"ndf": "ggx", "alpha_x": 0.2, "alpha_y": 0.9},
        {"ndf": "phong", "alpha": 0.7},
    ],
    ids=str,
)  # fmt: skip
@pytest.mark.parametrize("optics", [{"material": "mirror"}, {"eta": 0.43, "k": 2.46}], ids=["mirror", "metal"])
def test_reciprocity(model, rough, optics):
    rng = np.random.default_rng(11)
    theta_i, theta_o = np.arccos(rng.uniform(0.01, 1.0, (2, 300)))
    phi, phi_i = rng.uniform(-math.pi, math.pi, (2, 300))
    there = brdftab.evaluate(model, theta_i, theta_o, phi, phi_i=phi_i, **rough, **optics)
    back = brdftab.evaluate(model, theta_o, theta_i, -phi, phi_i=phi_i + phi, **rough, **optics)
    assert (there > 0.0).any()
    # measured 5e-13, deep in a Gaussian tail; 6e-14 where light arrives
    assert (np.abs(there - back) <= 1e-11 * np.maximum(there, back) + 1e-300).all()
