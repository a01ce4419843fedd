"""The twin of smith-multi: all bounces in JAX beside the compiled solver and brute force, and fits with it."""

import itertools
import json
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from click.testing import CliRunner

import brdftab
from brdftab.cli import main
from brdftab.errors import ParameterError
from brdftab.fit import normal_equations, program
from brdftab.fit.data import Dataset
from brdftab.fit.losses import transform
from brdftab.fit.parameters import parse
from brdftab.fit.stages import Fitter, Options
from brdftab.fit.verdict import fit_points
from brdftab.models import twins
from brdftab.models._shared.twin.fresnel import reflectance
from brdftab.models.resolve import resolve
from brdftab.models.smith_multi.twin import rules

COLOURED = {"f0": [1.0, 0.77, 0.34]}
METALS = {"eta": [0.15, 1.5, 3.0], "k": [3.6, 2.0, 0.5]}


@pytest.fixture(autouse=True, scope="module")
def _compiler():
    """Compile without XLA's costly passes: every program runs a few times."""
    jax.config.update("jax_disable_most_optimizations", True)
    yield
    jax.config.update("jax_disable_most_optimizations", False)


def product(theta, phi):
    """Return theta_i, theta_o, phi of all combinations, each (N,)."""
    return [v.ravel() for v in np.meshgrid(theta, theta, phi, indexing="ij")]


GRID = product(np.radians([2.5, 25.0, 50.0, 70.0, 87.5]), np.linspace(0.0, math.pi, 5))


def setup_of(alpha, **given):
    return resolve("smith-multi", ndf="ggx", alpha=alpha, **given)


def solver_values(setup, angles, tolerance):
    from brdftab.models.smith_multi import volterra

    return volterra.points(setup, *angles, 0.0 * angles[0], orders=0, tolerance=tolerance)[:, 0]


# ---------------------------------------------------------------- values


@pytest.mark.parametrize(
    ("given", "bounds"),
    [
        # the solver and the twin fit poles to the reflectance, each its own; measured 2.1e-6, 4e-7, 2.1e-8
        (COLOURED, (4e-6, 3e-5)),
        (METALS, (2e-6, 3e-5)),
        ({"material": "mirror"}, (2e-7, 2e-5)),
        ({"f0": 0.5, "max_bounces": 3}, (4e-6, 3e-5)),
    ],
    ids=["schlick", "conductor", "mirror", "three"],
)
def test_values_equal_the_solver(given, bounds):
    for alpha, bound in zip((0.6, 0.2), bounds, strict=True):
        setup = setup_of(alpha, **given)
        mine, theirs = twins.evaluate(setup, *GRID, 0.0, 1e-6), solver_values(setup, GRID, 1e-8)
        assert np.abs(mine / theirs - 1.0).max() < bound, alpha


def two_bounces(alpha, f0, theta_i, theta_o, phi, elevations, azimuths):
    """Return the light of exactly two bounces by brute force over the direction between them (Wang et al. 2022, Eq. 2).

    Each vertex gives F D/(4 |cos| |cos|), each way 1/(1 + Lambda); Gauss in elevation between both ends, midpoints in
    azimuth. No modes, no poles.
    """

    def shadow(z):
        return 0.5 * (np.sqrt(1.0 + alpha**2 * (1.0 / z**2 - 1.0)) - 1.0)

    def vertex(d, e):
        h = e - d
        length = np.linalg.norm(h, axis=-1)
        cosine = 0.5 * length
        slope = (length / h[..., 2]) ** 2 - 1.0
        density = np.where(h[..., 2] > 0.0, (length / h[..., 2]) ** 4, 0.0) / (
            math.pi * alpha**2 * (1.0 + slope / alpha**2) ** 2
        )
        f = f0 + (1.0 - f0) * (1.0 - cosine) ** 5
        return f * density / (4.0 * np.abs(d[..., 2] * e[..., 2]))

    def way(theta, phi):
        return np.stack(
            np.broadcast_arrays(np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)), axis=-1
        )

    first, last = -way(theta_i, 0.0), way(theta_o, phi)
    total = 0.0
    x, w = np.polynomial.legendre.leggauss(elevations)
    turn = (np.arange(azimuths) + 0.5) * (2.0 * math.pi / azimuths)
    for low, high in ((theta_i - 0.5 * math.pi, 0.0), (0.0, 0.5 * math.pi - theta_o)):
        beta = low + 0.5 * (high - low) * (1.0 + x)
        between = way(0.5 * math.pi - beta[:, None], turn)
        t = np.abs(np.sin(beta))
        measure = 0.5 * (high - low) * w * np.cos(beta) * t / (1.0 + shadow(t)) * (2.0 * math.pi / azimuths)
        total += np.sum(measure[:, None] * vertex(first, between) * vertex(between, last))
    ends = (1.0 + shadow(np.cos(theta_i))) * (1.0 + shadow(np.cos(theta_o)))
    return total / ends


def test_second_bounce_equals_brute_force():
    angles = np.array([[0.2, 0.9, 1.2], [0.7, 0.9, 0.4], [3.0, 1.0, 0.3]])
    both, one = (twins.evaluate(setup_of(0.8, f0=0.3, max_bounces=k), *angles, 0.0, 1e-6)[:, 0] for k in (2, 1))
    for n in range(3):
        direct = two_bounces(0.8, 0.3, *angles[:, n], 60, 400)
        # F's slope at grazing incidence, where brute force converges slowly; measured 2e-6
        assert both[n] - one[n] == pytest.approx(direct, rel=2e-5)


def test_one_bounce_is_that_of_smith():
    setup = resolve("smith", ndf="ggx", alpha=0.4, masking="separable", **METALS)
    one = twins.evaluate(setup_of(0.4, max_bounces=1, **METALS), *GRID, 0.0)
    assert np.allclose(one, twins.evaluate(setup, *GRID, 0.0), rtol=1e-13)


def test_mirror_loses_nothing():
    x, w = np.polynomial.legendre.leggauss(32)
    theta = 0.25 * math.pi * (1.0 + x)
    phi = (np.arange(64) + 0.5) * (math.pi / 64)
    angles = product(theta, phi)
    f = twins.evaluate(setup_of(0.6, material="mirror"), *angles, 0.0, 1e-4).reshape(32, 32, 64)
    reflected = (f.mean(axis=2) * 2.0 * math.pi) @ (0.25 * math.pi * w * np.cos(theta) * np.sin(theta))
    # 32 solved angles are more than the data's own may be: these are interpolated
    assert np.abs(reflected[theta < 1.3] - 1.0).max() < 1e-5


def test_many_angles_give_the_values_of_few():
    few = [np.array(v) for v in ([0.3, 1.0, 1.3, 0.0], [0.9, 1.05, 0.2, 1.2], [2.0, 3.1, 0.5, 1.0])]
    rng = np.random.default_rng(0)
    more = [np.concatenate([v, rng.uniform(0.0, top, 300)]) for v, top in zip(few, (1.3, 1.3, math.pi), strict=True)]
    assert np.unique(more[0]).size > 2 * rules.LEVELS[-2].polar
    setup = setup_of(0.5, f0=0.77)
    own, interpolated = (twins.evaluate(setup, *angles, 0.0, 1e-2) for angles in (few, more))
    exact = twins.evaluate(setup, *few, 0.0, 1e-6)
    # measured 2e-6
    assert np.abs(interpolated[:4] / exact - 1.0).max() < 1e-5
    assert np.abs(own / exact - 1.0).max() < 1e-5


def test_pole_fit_follows_the_reflectance():
    for poles, bound in ((rules.LEVELS[0].poles, 2e-3), (rules.LEVELS[-1].poles, 1e-5)):
        x, _, fit = rules.pole_fit(poles)
        cosine = np.linspace(0.03, 1.0, 50)
        for n, k in ((0.15, 3.6), (3.0, 0.5), (1.5, 0.0)):
            found = fit @ np.asarray(reflectance(1, n, k, rules.pole_fit(poles)[1]))
            mine = found[0] + (found[1:] / (4.0 * cosine[:, None] ** 2 + x)).sum(axis=1)
            assert np.abs(mine - np.asarray(reflectance(1, n, k, jnp.array(cosine)))).max() < bound


# ---------------------------------------------------------------- derivatives


@pytest.mark.parametrize(
    ("given", "name"),
    [(COLOURED, "alpha_x"), (COLOURED, "a"), (METALS, "alpha_x"), (METALS, "a"), (METALS, "b")],
    ids=["schlick alpha", "f0", "conductor alpha", "eta", "k"],
)
def test_derivatives_equal_differences(given, name):
    angles = [a[::3] for a in GRID]
    inside = {k: [0.6, 0.5, 0.3] for k in given} if given is COLOURED else given
    setup = setup_of(0.5, **inside)
    slope = twins.derivative(setup, name, *angles, 0.0, 1e-2)

    def moved(by):
        if name == "alpha_x":
            return setup_of(0.5 + by, **inside)
        key = {"a": "f0" if given is COLOURED else "eta", "b": "k"}[name]
        return setup_of(0.5, **{**inside, key: [v + by for v in inside[key]]})

    rows = []
    for step in (0.02, 0.01, 0.005):
        up, down = (twins.evaluate(moved(s), *angles, 0.0, 1e-2) for s in (step, -step))
        rows.append((up - down) / (2.0 * step))
    once = [(4.0 * b - a) / 3.0 for a, b in itertools.pairwise(rows)]
    expected = (16.0 * once[1] - once[0]) / 15.0
    scale = np.abs(expected) + np.abs(twins.evaluate(setup, *angles, 0.0, 1e-2))
    assert np.abs((slope - expected) / scale).max() < 1e-7


@pytest.mark.parametrize("given", [{"f0": [0.0, 0.5, 1.0]}, {"eta": [1e-6, 1.0, 5.0], "k": [0.0, 0.0, 8.0]}])
def test_derivatives_are_finite_at_the_ends(given):
    angles = product(np.array([0.0, 0.5, math.radians(89.9), 0.5 * math.pi, 2.0]), [0.0, 1.0, math.pi])
    below = np.minimum(np.cos(angles[0]), np.cos(angles[1])) < 1e-15
    for alpha in (0.01, 2.0):
        setup = setup_of(alpha, **given)
        for name in ("alpha_x", "a", "b")[: 1 + len(given)]:
            slope = twins.derivative(setup, name, *angles, 0.0, 1e-2)
            assert np.isfinite(slope).all()
            assert not slope[below].any()
            assert slope[~below].any()


# ---------------------------------------------------------------- fits


def dataset(angles, values):
    channels = ("R", "G", "B") if values.shape[1] == 3 else ("Y",)
    flags = np.zeros(values.shape, bool)
    return Dataset(*angles, values, values > 0.0, channels, {}, flags, "grid", "made here")


def noisy(values, seed=0, noise=0.02):
    return values * np.exp(noise * np.random.default_rng(seed).standard_normal(values.shape))


@pytest.fixture(scope="module")
def gold():
    """Return angles and values of gold-like facets, alpha 0.6, from the compiled solver."""
    angles = product(np.radians(np.linspace(2.5, 87.5, 10)), np.linspace(0.0, math.pi, 10))
    return angles, solver_values(setup_of(0.6, **COLOURED), angles, 1e-6)


def test_sums_have_the_gradient_of_their_cost(gold):
    angles, values = gold
    data = dataset(angles, noisy(values) + 0.1)
    fitter = Fitter(parse("smith-multi+lambert", None, {}), data, Options())
    made, fixed = program.problem(fitter.total, "log", False, 1e-2)
    fixed = program.channel_fixed(fixed, 3), program.rules(made, 1e-2, fitter.angles)
    x = np.array([math.log(0.5), 0.8, 0.2, 0.6, 0.1, 0.4, 0.3])

    def sums(u):
        return np.asarray(
            normal_equations.sums(
                made, jnp.asarray(u), fixed, normal_equations.Scales(1.0, fitter.floor), fitter.small, 1
            ).gram
        )

    fitted = np.asarray(
        normal_equations.predict(made, x, fixed, normal_equations.directions(*angles, 0.0 * angles[0]))
    ).T
    residual = transform("log", fitted, 1.0, fitter.floor) - transform("log", data.values, 1.0, fitter.floor)
    found = sums(x)
    assert found[-1, -1] == pytest.approx((residual**2).sum(), rel=1e-12)
    step = 1e-4
    for n, push in enumerate(step * np.eye(x.size)):
        slope = 0.25 * (sums(x + push)[-1, -1] - sums(x - push)[-1, -1]) / step
        # central differences of a sum near 1000
        assert found[n, -1] == pytest.approx(slope, rel=1e-5, abs=1e-5)


def test_fit_recovers_all_parameters_where_one_bounce_does_not(gold):
    angles, values = gold
    data = dataset(angles, noisy(values))
    full = fit_points(parse("smith-multi", None, {}), data, Options(starts=2))
    assert abs(full.values["alpha"] - 0.6) < 4.0 * full.stderr["alpha"] < 2e-3
    assert np.abs(full.values["f0"] - COLOURED["f0"]).max() < 2e-3
    # chi^2 per value
    assert 2.0 * full.cost / full.points["residuals"] / 0.02**2 == pytest.approx(1.0, abs=0.1)
    one = fit_points(parse("smith", None, {"ndf": "ggx", "masking": "separable"}), data, Options(starts=2))
    assert one.values["alpha"] - 0.6 < -0.005
    assert one.values["f0"][2] - 0.34 > 0.03
    assert one.cost > 20.0 * full.cost


def test_fit_takes_directions_at_random_and_a_body():
    rng = np.random.default_rng(3)
    angles = [*rng.uniform(0.0, 1.3, (2, 900)), rng.uniform(0.0, math.pi, 900)]
    values = twins.evaluate(setup_of(0.4, f0=0.5), *angles, 0.0, 1e-4) + 0.2 / math.pi
    found = fit_points(parse("smith-multi+lambert", None, {}), dataset(angles, noisy(values)), Options(starts=2))
    assert abs(found.values["alpha"] - 0.4) < 4.0 * found.stderr["alpha"]
    assert abs(found.values["f0"][0] - 0.5) < 4.0 * found.stderr["f0"][0]
    assert abs(found.values["kd"][0] - 0.2) < 4.0 * found.stderr["kd"][0]


def test_fit_of_a_conductor(gold):
    angles = [a[::7] for a in gold[0]]
    values = twins.evaluate(setup_of(0.5, eta=1.5, k=2.0), *angles, 0.0, 1e-4)
    data = dataset(angles, noisy(values, noise=1e-3))
    found = fit_points(parse("smith-multi", ["alpha", "eta", "k"], {}), data, Options(starts=2))
    assert abs(found.values["alpha"] - 0.5) < 1e-3
    assert np.allclose([found.values["eta"][0], found.values["k"][0]], [1.5, 2.0], rtol=0.02)


def test_metal_by_name_is_projected_after_all_bounces(gold):
    angles = [a[::7] for a in gold[0]]
    copper = {"material": "Cu", "spectral_samples": 3}
    made, fixed = program.problem(parse("smith-multi", ["alpha"], copper), "log", False, 1e-2)
    fixed = program.channel_fixed(fixed, 3), program.rules(made, 1e-2, angles)
    d = normal_equations.directions(*angles, 0.0 * angles[0])
    found = np.asarray(normal_equations.predict(made, np.array([math.log(0.5)]), fixed, d)).T
    assert np.allclose(found, twins.evaluate(setup_of(0.5, **copper), *angles, 0.0, 1e-2), rtol=1e-12)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"ndf": "beckmann"}, "ndf = beckmann of smith-multi has no twin to fit with; fit with ggx"),
        ({"estimator": "pt"}, "estimator = pt of smith-multi has noise and no derivatives; fit with solver"),
        ({"ior": 1.5}, "ior of smith-multi lets light through"),
    ],
)
def test_what_has_no_twin_is_refused_in_one_line(gold, given, words, tmp_path):
    angles, values = gold
    with pytest.raises(ParameterError, match=words):
        fit_points(parse("smith-multi", ["alpha"], given), dataset(angles, values), Options())
    path = tmp_path / "matte.npz"
    brdftab.write(brdftab.tabulate("lambert", "4x4x4"), path)
    options = [f"--{k}={v}" if k in ("ndf", "ior") else f"--fix={k}={v}" for k, v in given.items()]
    done = CliRunner().invoke(main, ["fit", str(path), "--model", "smith-multi", "--free", "alpha", *options])
    assert done.exit_code == 2
    assert words in " ".join(done.output.split())


def test_roughness_stays_where_the_solver_is_accurate():
    total = parse("smith-multi", None, {})
    low, high = total.bounds(1)
    assert np.allclose(np.exp([low[0], high[0]]), [0.01, 2.0])
    assert json.dumps(total.labels(("Y",))) == '["alpha", "f0[Y]"]'
