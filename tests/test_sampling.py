"""Samples follow their density (chi-square at a million), weights average to the albedo, grooves are traced right."""

from __future__ import annotations

import math
import zlib
from typing import Any

import chisquare
import numpy as np
import pytest
from scipy import integrate, special

import brdftab
from brdftab import models
from brdftab.errors import ParameterError
from brdftab.models._shared.sampling.sampling import leave_groove, visible_slope
from brdftab.models.declaration import Model
from brdftab.models.resolve import resolve

# a density 2 % wrong stands out with the first, 3 % with the second
MILLION, SWEPT = 1_000_000, 400_000
LEVEL = 0.01

# ndf, roughness, theta_i and phi_i in degrees: small and large roughness, near normal to grazing, both anisotropies
FACETS: list[tuple[dict[str, Any], float, float]] = [
    ({"ndf": "beckmann", "alpha": 0.1}, 60, 0),
    ({"ndf": "beckmann", "alpha": 0.5}, 10, 0),
    ({"ndf": "beckmann", "alpha": 1.0}, 80, 70),
    ({"ndf": "beckmann", "alpha_x": 0.5, "alpha_y": 0.1}, 60, 25),
    ({"ndf": "ggx", "alpha": 0.1}, 80, 0),
    ({"ndf": "ggx", "alpha": 0.5}, 10, 0),
    ({"ndf": "ggx", "alpha": 1.0}, 60, 200),
    ({"ndf": "ggx", "alpha_x": 0.2, "alpha_y": 0.6}, 60, 40),
    ({"ndf": "phong", "alpha": 0.5}, 60, 0),
    ({"ndf": "gaussian", "alpha": 0.3}, 60, 0),
    ({"ndf": "gaussian", "alpha": 2.0}, 40, 10),
]


def own(spec: Model, facets: dict[str, Any], material: str = "mirror") -> dict[str, Any]:
    """Return facets under the model's own names, of a material where the model takes one."""
    named = {name.replace("alpha", spec.roughness): value for name, value in facets.items()}
    return {**named, "material": material} if spec.has("material") else named


def cases() -> list[Any]:
    """Every registered model whose density is exact, with the settings that it takes."""
    found = []
    for name in models.names():
        spec = models.spec(name)
        if spec.has("samples"):
            # walks have no density in closed form: test_smith_tables.py holds them against the solver
            continue
        settings = [(own(spec, s[0]), *s[1:]) for s in FACETS if s[0]["ndf"] in spec.ndfs]
        # a model may be isotropic only
        settings = [s for s in settings if all(spec.has(parameter) for parameter in s[0])]
        settings = settings or [({}, 10, 0), ({}, 80, 30)]
        for parameters, theta_i, phi_i in settings:
            words = "-".join(str(v) for v in parameters.values() if v != "mirror")
            found.append(pytest.param(name, parameters, theta_i, phi_i, id=f"{name}-{words}-{theta_i}"))
    return found


CASES = cases()


def draw(model: str, parameters: dict[str, Any], theta_i: float, phi_i: float, n: int, seed: int) -> Any:
    """Draw without the weights; the seed is the case's own, so that cases are independent."""
    seed = zlib.crc32(repr((model, parameters, theta_i, phi_i, seed)).encode())
    rng = np.random.Generator(np.random.PCG64(seed))
    return models.sampler(model).sample(resolve(model, **parameters), theta_i, phi_i, n, rng)


def verdict(
    model: str,
    parameters: dict[str, Any],
    theta_i: float,
    phi_i: float,
    perturb: Any = lambda theta_o, phi: 1.0,
    expected: dict[str, Any] | None = None,
    count: int = MILLION,
) -> chisquare.Verdict:
    """Run one chi-square test; `perturb` scales the density and `expected` replaces its parameters."""
    ti, pi_ = math.radians(theta_i), math.radians(phi_i)
    singular, grain = models.spec(model).singular, models.spec(model).grain

    def density(theta_o: np.ndarray, phi_o: np.ndarray) -> np.ndarray:
        phi = phi_o - pi_
        return brdftab.pdf(model, ti, theta_o, phi, phi_i=pi_, **(expected or parameters)) * perturb(theta_o, phi)

    sets = []
    for seed, n in ((1, 20_000), (2, count)):
        theta_o, phi_o, valid = draw(model, parameters, ti, pi_, n, seed)
        assert np.all(theta_o[valid] < 0.5 * np.pi)
        assert np.all((phi_o >= 0) & (phi_o < 2 * np.pi))
        points = (theta_o[valid], phi_o[valid])
        if grain:
            points = chisquare.grain_angles(*points)
        sets.append(chisquare.half_angles(ti, pi_, *points) if singular else points)
    top = 0.5 * (ti + 0.5 * math.pi) if singular else math.pi if grain else 0.5 * math.pi
    jumps = int(resolve(model, **parameters).values.get("bins", 1))
    if grain:
        density = chisquare.in_grain_space(density)
    if singular:
        density = chisquare.in_half_space(density, ti, pi_)
    return chisquare.check(sets[0], sets[1], count - len(sets[1][0]), density, top, jumps=jumps)


@pytest.mark.parametrize(("model", "parameters", "theta_i", "phi_i"), CASES)
def test_samples_follow_the_pdf(model: str, parameters: dict[str, Any], theta_i: float, phi_i: float) -> None:
    result = verdict(model, parameters, theta_i, phi_i, count=SWEPT)
    assert result.p_value > chisquare.sidak(LEVEL, len(CASES)), result
    assert result.integral <= 1 + 1e-3, result


@pytest.mark.parametrize("model", ["smith", "vgroove-sym"])
def test_a_density_two_percent_wrong_is_caught(model: str) -> None:
    parameters = {"ndf": "ggx", "alpha": 0.5, "material": "mirror"}
    tilted = verdict(model, parameters, 40, 0, perturb=lambda theta_o, phi: 1 + 0.02 * np.sign(np.sin(phi)))
    assert tilted.p_value < 1e-6, tilted
    rougher = verdict(model, parameters, 40, 0, expected={**parameters, "alpha": 0.51})
    assert rougher.p_value < 1e-6, rougher


def test_density_printed_in_section_6_fails() -> None:
    # one bounce only, where Lee et al. print D(h) cos(theta_h) G and the samples follow D G / (4 i_z)
    parameters = {"ndf": "ggx", "alpha": 0.5, "material": "mirror", "max_bounces": 1}
    ti = math.radians(40)

    def printed(theta_o: np.ndarray, phi: np.ndarray) -> np.ndarray:
        return 4 * math.cos(ti) * np.cos(chisquare.half_angles(ti, 0.0, theta_o, phi)[0])

    assert verdict("vgroove-sym", parameters, 40, 0).p_value > LEVEL
    assert verdict("vgroove-sym", parameters, 40, 0, perturb=printed).p_value < 1e-300


def test_chi_square_of_known_counts() -> None:
    rng = np.random.default_rng(3)
    share = rng.random(300)
    share /= share.sum()
    p = [chisquare.chi_square(rng.multinomial(100_000, share), share)[2] for _ in range(400)]
    # p-values of the truth are uniform: Kolmogorov distance of 400 of them is below 0.1 but for one time in 2000
    assert np.max(np.abs(np.sort(p) - (np.arange(400) + 0.5) / 400)) < 0.1


def test_chi_square_integrates_kinks_and_jumps() -> None:
    def cut(theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
        return np.where(np.sin(theta) * np.cos(phi) > 0.25, 1.0, 0.0)

    found = chisquare.integrate(cut, np.array([[0.0, 0.5 * np.pi, 0.0, 2 * np.pi]]), 1e-6, rounds=10)[0]
    # a cap of height 3/4 on the side of x, of which the upper half counts: pi (1 - 1/4)
    assert abs(found - 0.75 * np.pi) < 1e-3


@pytest.mark.parametrize("name", models.names())
def test_mean_weight_is_the_albedo(name: str) -> None:
    spec = models.spec(name)
    parameters = (
        own(spec, {"ndf": "ggx" if "ggx" in spec.ndfs else "beckmann", "alpha": 0.4}, "Au") if spec.ndfs else {}
    )
    theta_i = math.radians(50)
    drawn = brdftab.sample(name, theta_i, 4000, seed=7, **parameters)
    assert drawn.weight.shape == (4000, drawn.weight.shape[1])
    assert np.all(np.isfinite(drawn.weight))
    assert not np.any(drawn.weight[~drawn.valid])
    error = drawn.weight.std(axis=0, ddof=1) / math.sqrt(4000)
    exact = np.asarray(brdftab.albedo(name, theta_i, **parameters)).reshape(-1)
    # a constant weight (Lambert) has no spread: leave room for the albedo's own quadrature error
    assert np.all(np.abs(drawn.weight.mean(axis=0) - exact) <= 4 * error + 1e-4), (drawn.weight.mean(axis=0), exact)


@pytest.mark.parametrize("name", models.names())
def test_samples_are_reproducible_and_consistent_with_pdf(name: str) -> None:
    a, b = (brdftab.sample(name, 0.7, 200, phi_i=0.3, seed=5) for _ in range(2))
    other = brdftab.sample(name, 0.7, 200, phi_i=0.3, seed=6)
    np.testing.assert_array_equal(a.theta_o, b.theta_o)
    np.testing.assert_array_equal(a.weight, b.weight)
    assert not np.array_equal(a.theta_o, other.theta_o)
    again = brdftab.pdf(name, 0.7, a.theta_o, a.phi_o - 0.3, phi_i=0.3)
    np.testing.assert_allclose(np.where(a.valid, again, 0.0), a.pdf, rtol=1e-12)


def test_white_furnace_weights_are_one() -> None:
    for name in ("vgroove-sym", "vgroove-nonsym"):
        drawn = brdftab.sample(name, 1.0, 500, ndf="beckmann", alpha=0.5, material="mirror")
        assert drawn.valid.all()
        np.testing.assert_allclose(drawn.weight, 1.0, rtol=1e-9)


def test_cap_of_bounces_makes_longer_paths_invalid() -> None:
    parameters = {"ndf": "ggx", "alpha": 1.0, "material": "mirror", "max_bounces": 2}
    drawn = brdftab.sample("vgroove-sym", 1.0, 4000, seed=2, **parameters)
    kept = drawn.valid.mean()
    albedo = float(np.ravel(brdftab.albedo("vgroove-sym", 1.0, **parameters))[0])
    assert 0 < kept < 1
    assert abs(kept - albedo) <= 4 * math.sqrt(kept * (1 - kept) / 4000) + 1e-3


def test_pdf_broadcasts_and_vanishes_below_the_horizon() -> None:
    theta_o = np.array([0.1, 1.0, 0.5 * np.pi, 2.0])
    found = brdftab.pdf("lambert", 0.3, theta_o[:, None], np.linspace(0, 3, 5))
    assert found.shape == (4, 5)
    np.testing.assert_allclose(found[:2], np.cos(theta_o[:2, None]) / np.pi * np.ones(5), rtol=1e-15)
    assert not np.any(found[2:])


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda: brdftab.sample("lambert", 1.6, 10), "theta_i"),
        (lambda: brdftab.sample("lambert", math.nan, 10), "theta_i"),
        (lambda: brdftab.sample("lambert", 0.3, 0), "n = 0"),
        (lambda: brdftab.sample("lambert", 0.3, 10, seed=-1), "seed"),
        (lambda: brdftab.sample("lambert", np.zeros(3), 10), "theta_i"),  # type: ignore[arg-type]
        (lambda: brdftab.pdf("lambert", 0.3, -0.1, 0.0), "theta_o"),
        (lambda: brdftab.pdf("lambert", 0.3, 0.1, math.inf), "phi"),
    ],
)
def test_errors_name_the_parameter(call: Any, word: str) -> None:
    with pytest.raises(ParameterError, match=word) as caught:
        call()
    assert "\n" not in str(caught.value)


def trace(ti: float, left: float, right: float, where: float) -> tuple[int, float]:
    """Follow a ray by intersecting segments and mirroring vectors: nothing shared with the unfolding."""
    p = np.array([-1 / math.tan(left) + where * (1 / math.tan(left) + 1 / math.tan(right)), 1.0])
    d = -np.array([math.sin(ti), math.cos(ti)])
    ends = {0: np.array([-1 / math.tan(left), 1.0]), 1: np.array([1 / math.tan(right), 1.0])}
    facing = {0: np.array([math.sin(left), math.cos(left)]), 1: np.array([-math.sin(right), math.cos(right)])}
    bounces, last = 0, -1
    while True:
        for side in (0, 1):
            along = d @ facing[side]
            if side == last or along >= 0:
                continue
            hit = p - d * (p @ facing[side]) / along
            if 0 <= hit @ ends[side] <= ends[side] @ ends[side]:
                p, d, last = hit, d - 2 * along * facing[side], side
                bounces += 1
                break
        else:
            return bounces, math.atan2(d[0], d[1])


def test_unfolded_groove_equals_a_segment_tracer() -> None:
    rng = np.random.default_rng(11)
    longest = 0
    for _ in range(4000):
        ti = rng.uniform(-1.55, 1.55)
        left, right = 0.5 * math.pi * rng.random(2) ** rng.choice([0.05, 1.0, 3.0], 2)
        where = rng.random()
        bounces, to = trace(ti, left, right, where)
        k, found = leave_groove(ti, 0.5 * math.pi - left, 0.5 * math.pi - right, where)
        assert k == bounces, (ti, left, right, where)
        # the tracer's rounding grows with the number of bounces; worst seen 2e-13
        assert abs(found - to) < 1e-11
        longest = max(longest, bounces)
    assert longest > 20


def test_groove_without_bottom_or_height_ends() -> None:
    for a, b in ((0.0, 0.0), (0.5 * math.pi, 0.5 * math.pi), (1e-9, 0.3), (1e-12, 1e-12), (0.0, 0.5 * math.pi)):
        k, to = leave_groove(0.4, a, b, 0.3)
        assert k >= 1
        assert math.isfinite(to)


@pytest.mark.parametrize("c", [1e-4, 9e-3, 0.3, 1.0, 5.0, 40.0, 1e3, 1e8])
def test_visible_slope_inverts_its_distribution(c: float) -> None:
    low = -min(c, 9.0)

    def mass(u: float) -> float:
        return integrate.quad(lambda t: (1 + t / c) * math.exp(-t * t), low, u, epsabs=1e-14, limit=200)[0]

    whole = mass(0.0) + integrate.quad(lambda t: (1 + t / c) * math.exp(-t * t), 0.0, 9.0, epsabs=1e-14)[0]
    for uniform in (0.0, 1e-9, 1e-3, 0.2, 0.5, 0.9, 0.999, 1 - 1e-9, 1 - 2**-53):
        u = visible_slope(c, uniform)
        assert low - 1e-12 <= u < 6.71
        assert abs(mass(u) / whole - uniform) < 1e-12, (c, uniform)


def test_visible_slope_from_above_is_gaussian() -> None:
    # c = inf: the surface is seen from above and the slope's law is the error function's
    for uniform in (0.01, 0.4, 0.99):
        assert abs(visible_slope(math.inf, uniform) - special.erfinv(2 * uniform - 1)) < 1e-13
