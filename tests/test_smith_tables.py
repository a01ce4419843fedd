"""All-bounce Smith from the user's side: tables with their stated error, samples, furnace, stand-ins, estimators."""

import math

import numpy as np
import pytest

import brdftab
from brdftab.errors import ParameterError
from brdftab.models.resolve import resolve


@pytest.mark.parametrize(("ndf", "alpha"), [("ggx", 0.1), ("ggx", 1.0), ("beckmann", 0.5)])
def test_stated_error_covers_the_true_one(ndf, alpha):
    """Every cell against a run at a thousandth of the tolerance; the estimate looks at a subset, hence the factor 3.

    Cells below 1e-9/sr are compared absolutely, as the estimate does.
    """
    coarse = brdftab.tabulate("smith-multi", "18x18x24", ndf=ndf, alpha=alpha, material="mirror", dtype="float64")
    fine = brdftab.tabulate(
        "smith-multi", "18x18x24", ndf=ndf, alpha=alpha, material="mirror", dtype="float64", tolerance=1e-6
    )
    error = np.abs(coarse.values - fine.values) / np.maximum(fine.values, 1e-9)
    assert error.max() < 1e-3
    assert error.max() < 3.0 * max(coarse.provenance["error"]["estimate"], 1e-7)
    assert coarse.provenance["error"]["met"]
    assert coarse.provenance["method"] == "prepared"


def test_components_add_up_and_a_cap_says_what_it_leaves_out():
    whole = brdftab.tabulate("smith-multi", "9x9x12", alpha=0.8, components=True, dtype="float64")
    assert list(whole.components) == [*(f"order{k}" for k in range(1, 9)), "higher"]
    np.testing.assert_allclose(sum(whole.components.values()), whole.values, rtol=1e-12)
    capped = brdftab.tabulate("smith-multi", "9x9x12", alpha=0.8, max_bounces=2, dtype="float64")
    both = whole.components["order1"] + whole.components["order2"]
    np.testing.assert_allclose(capped.values, both, rtol=1e-3)
    lost = np.array(capped.provenance["energy_left_out"]["values"])
    gap = np.array(whole.provenance["albedo"]["values"]) - np.array(capped.provenance["albedo"]["values"])
    np.testing.assert_allclose(lost, gap, atol=1e-5)
    assert (lost[:, 0] > 0.01).all()


def test_first_order_is_the_single_bounce_of_smith():
    angles = np.radians([10.0, 50.0, 85.0])[:, None], np.radians([20.0, 60.0, 88.0]), np.radians(160.0)
    first = brdftab.evaluate("smith-multi", *angles, ndf="beckmann", alpha=0.4, components=True, tolerance=1e-3)
    single = brdftab.evaluate("smith", *angles, ndf="beckmann", alpha=0.4, masking="separable")
    # Beckmann's Lambda by its asymptotic series on one side only
    np.testing.assert_allclose(first["order1"], single, rtol=1e-9)


def test_white_sphere_disappears_in_a_white_room():
    """Radiance of a mirror-like rough sphere, rendered from the table by summing its cells: 1 at every pixel.

    The rule of cell centres leaves 7.5e-5 on 45 x 45 x 60 cells at alpha 0.6; single bounces alone lack 31 to 41 %.
    """
    table = brdftab.tabulate("smith-multi", "45x45x60", ndf="ggx", alpha=0.6, material="mirror")
    edges = table.grid.edges["theta_i"]
    solid = np.diff(np.sin(edges) ** 2) / 2.0
    radiance = np.einsum("i,iop->o", solid, table.values[..., 0].astype(np.float64)) * 2.0 * math.pi / table.phi.size
    x = np.linspace(-0.98, 0.98, 31)
    disc = np.hypot(x[:, None], x)
    view = np.arcsin(disc[disc < 0.98])
    pixels = np.interp(view, table.theta_o, radiance)
    assert np.abs(pixels - 1.0).max() < 1.5e-4
    single = brdftab.tabulate("smith", "45x45x60", ndf="ggx", alpha=0.6, material="mirror", masking="separable")
    dark = np.einsum("i,iop->o", solid, single.values[..., 0].astype(np.float64)) * 2.0 * math.pi / table.phi.size
    assert np.interp(view, table.theta_o, dark).max() < 0.7


@pytest.mark.parametrize(("ndf", "alpha"), [("ggx", 0.7), ("beckmann", 0.4)])
def test_samples_follow_the_solver(ndf, alpha):
    """Counts of 200,000 walks in 12 x 12 bins against integrals of the solver's values, chi-square at 1e-3."""
    from scipy.stats import chi2

    theta_i, count = 0.9, 200_000
    drawn = brdftab.sample("smith-multi", theta_i, count, seed=11, ndf=ndf, alpha=alpha, material="mirror")
    assert drawn.valid.all()
    assert np.allclose(drawn.weight, 1.0)
    tops, turns = np.linspace(0.0, 0.5 * math.pi, 13), np.linspace(0.0, math.pi, 13)
    folded = np.abs(np.mod(drawn.phi_o + math.pi, 2.0 * math.pi) - math.pi)
    seen = np.histogram2d(drawn.theta_o, folded, [tops, turns])[0]
    x, w = np.polynomial.legendre.leggauss(6)
    theta_o = (0.5 * (tops[:-1, None] + tops[1:, None] + np.diff(tops)[:, None] * x)).reshape(-1)
    phi = (0.5 * (turns[:-1, None] + turns[1:, None] + np.diff(turns)[:, None] * x)).reshape(-1)
    grid = {"theta_i": [theta_i], "theta_o": theta_o, "phi": phi}
    given = {"ndf": ndf, "alpha": alpha, "material": "mirror", "dtype": "float64", "tolerance": 1e-4}
    f = brdftab.tabulate("smith-multi", grid, **given).values[0, :, :, 0]
    density = 2.0 * f * (np.sin(theta_o) * np.cos(theta_o))[:, None]
    blocks = density.reshape(12, 6, 12, 6)
    expected = count * np.einsum("iajb,a,b->ij", blocks, w, w) * np.diff(tops)[:, None] * np.diff(turns) / 4.0
    assert expected.sum() == pytest.approx(count, rel=1e-3)
    used = expected > 8.0
    statistic = float((((seen - expected) ** 2) / expected)[used].sum())
    assert chi2.sf(statistic, used.sum() - 1) > 1e-3


def test_cheap_stand_ins_miss_what_the_solver_knows():
    """Kulla-Conty's lobe has no azimuth and one colour, Turquin's the shape of a single bounce.

    Gold of alpha 1, root mean square over 12 x 12 x 18 cells: 7.7 % and 18 %, single bounces alone 50 % (measured).
    """
    gold = {"ndf": "ggx", "alpha": 1.0, "eta": [0.143, 0.375, 1.442], "k": [3.983, 2.386, 1.603]}
    truth = brdftab.tabulate("smith-multi", "12x12x18", **gold).values
    errors = {}
    for model in ("kulla-conty", "turquin"):
        found = brdftab.tabulate(model, "12x12x18", **gold).values
        errors[model] = float(np.sqrt(np.mean((found / truth - 1.0) ** 2)))
    single = brdftab.tabulate("smith", "12x12x18", masking="separable", **gold).values
    alone = float(np.sqrt(np.mean((single / truth - 1.0) ** 2)))
    assert errors["kulla-conty"] == pytest.approx(0.0774, rel=0.02)
    assert errors["turquin"] == pytest.approx(0.1832, rel=0.02)
    assert alone == pytest.approx(0.4999, rel=0.02)


def test_estimated_tables_carry_their_noise():
    given = {"ndf": "ggx", "alpha": 0.9, "material": "mirror", "dtype": "float64"}
    noisy = brdftab.tabulate("smith-multi", "6x6x9", estimator="pt", samples=200, seed=4, **given)
    truth = brdftab.tabulate("smith-multi", "6x6x9", **given)
    spread = noisy.components["standard_error"]
    z = (noisy.values - truth.values)[spread > 0.0] / spread[spread > 0.0]
    # paths are shared by the views of a light and by both halves: z scatters more than of independent cells
    assert 0.3 < float(np.sqrt(np.mean(z * z))) < 2.0
    error = noisy.provenance["error"]
    assert not error["met"]
    assert "samples = 200" in error["reason"]
    assert error["samples"]["total"] == 200 * noisy.grid.size
    again = brdftab.tabulate("smith-multi", "6x6x9", estimator="pt", samples=200, seed=4, threads=1, **given)
    assert again.values.tobytes() == noisy.values.tobytes()
    other = brdftab.tabulate("smith-multi", "6x6x9", estimator="pt", samples=200, seed=5, **given)
    assert other.values.tobytes() != noisy.values.tobytes()


def test_dielectric_tables_reach_below_the_surface():
    table = brdftab.tabulate("smith-multi", "8x8+8x12", ior=1.5, alpha=0.4, dtype="float64")
    assert table.grid.below
    assert "below" in table.convention
    solid = np.abs(np.diff(np.sin(table.grid.edges["theta_o"]) ** 2)) / 2.0
    total = np.einsum("o,iop->i", solid, table.values[..., 0]) * 2.0 * math.pi / table.phi.size
    # cell centres of 11 degrees are a coarse rule, 5 % off away from the normal
    np.testing.assert_allclose(total[1:6], 1.0, atol=0.06)
    np.testing.assert_allclose(np.array(table.provenance["albedo"]["values"]), 1.0, atol=1e-3)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"alpha_x": 0.1, "alpha_y": 0.2, "estimator": "solver"}, ("estimator = solver", "isotropic", "hybrid")),
        ({"ndf": "phong"}, ("phong", "Lambda")),
        ({"estimator": "pt", "samples": 0}, ("samples = 0", "[1,")),
        ({"ior": 0.67}, ("ior = 0.67", "swap the sides")),
        ({"ior": 1.5, "estimator": "bdpt"}, ("estimator = bdpt", "pt")),
        ({"alpha": 0.005}, ("alpha = 0.005", "[0.01, 2]")),
        ({"seed": 3}, ("seed = 3", "no paths")),
    ],
)
def test_refusals_say_what_to_change(given, words):
    with pytest.raises(ParameterError) as caught:
        resolve("smith-multi", **given)
    line = str(caught.value)
    assert all(word in line for word in words), line
    assert "\n" not in line


def test_grids_below_the_surface_need_a_surface_that_transmits():
    with pytest.raises(ParameterError, match="below the surface"):
        brdftab.tabulate("smith-multi", "4x4+4x4", alpha=0.5)
