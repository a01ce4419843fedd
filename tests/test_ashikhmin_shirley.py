"""Ashikhmin and Shirley's highlight: limits, energy, sampling, and what it refuses."""

import itertools
import math

import chisquare
import numpy as np
import pytest

import brdftab
from brdftab import models
from brdftab.errors import ParameterError
from brdftab.models.resolve import resolve

NAME = "ashikhmin-shirley"
# nu, nv, theta_i and phi_i in degrees, more
LOBES = [
    (200, 20, 10, 0, {}),
    (200, 20, 70, 65, {}),
    (1e4, 2, 60, 30, {}),
    (0, 0, 40, 0, {}),
    (5, 500, 85, 200, {}),
    (50, 50, 45, 0, {"f0": 0.1, "kd": 0.8}),
]


def angles(count=40):
    rng = np.random.default_rng(1)
    return [rng.uniform(0.0, top, count) for top in (1.56, 1.56, 2.0 * math.pi, 2.0 * math.pi)]


@pytest.mark.parametrize("exponent", [0.0, 10.0, 3000.0])
def test_equal_exponents_are_phong(exponent):
    ti, to, phi, phi_i = angles()
    cos_i, cos_o = np.cos(ti), np.cos(to)
    i_o = np.sin(ti) * np.sin(to) * np.cos(phi) + cos_i * cos_o
    i_h = np.sqrt(0.5 * (1.0 + i_o))
    cos_h = 0.5 * (cos_i + cos_o) / i_h
    written = (exponent + 1.0) / (8.0 * math.pi) * cos_h**exponent / (i_h * np.maximum(cos_i, cos_o))
    value = brdftab.evaluate(NAME, ti, to, phi, phi_i=phi_i, nu=exponent, nv=exponent, material="mirror")[:, 0]
    # the written form loses digits as cos_h^3000
    assert np.allclose(value, written, rtol=1e-12 * max(exponent, 1.0), atol=1e-300)


def test_axes_change_places_with_the_exponents():
    ti, to, phi, phi_i = angles()
    one = brdftab.evaluate(NAME, ti, to, phi, phi_i=phi_i, nu=300.0, nv=7.0, f0=0.2)
    other = brdftab.evaluate(NAME, ti, to, phi, phi_i=phi_i - 0.5 * math.pi, nu=7.0, nv=300.0, f0=0.2)
    assert np.allclose(one, other, rtol=1e-11)


@pytest.mark.parametrize("case", LOBES, ids=str)
def test_density_integrates_to_the_valid_share(case):
    nu, nv, theta_i, phi_i, more = case
    ti, azimuth = math.radians(theta_i), math.radians(phi_i)
    given = {"nu": nu, "nv": nv, **(more or {"material": "mirror"})}

    def density(theta_h, phi_h):
        def of_view(theta_o, phi_o):
            return brdftab.pdf(NAME, ti, theta_o, phi_o - azimuth, phi_i=azimuth, **given)

        return chisquare.in_half_space(of_view, ti, azimuth)(theta_h, phi_h)

    marks = np.concatenate([[0.0], 0.5 * math.pi * 2.0 ** np.arange(-10.0, 1.0)])
    turns = np.linspace(0.0, 2.0 * math.pi, 17)
    boxes = np.array(
        [(*polar, *azimuths) for polar in itertools.pairwise(marks) for azimuths in itertools.pairwise(turns)]
    )
    total = chisquare.integrate(density, boxes, 1e-6, rounds=8).sum()
    drawn = brdftab.sample(NAME, ti, 200_000, phi_i=azimuth, seed=3, **given)
    valid = drawn.valid.mean()
    assert abs(total - valid) <= 4.0 * math.sqrt(valid * (1.0 - valid) / 200_000) + 1e-4, (total, valid)


@pytest.mark.parametrize("case", LOBES, ids=str)
def test_weights_of_the_highlight_are_at_most_one(case):
    nu, nv, theta_i, phi_i, _ = case
    drawn = brdftab.sample(
        NAME, math.radians(theta_i), 20_000, phi_i=math.radians(phi_i), nu=nu, nv=nv, material="mirror"
    )
    # F min(1, o_z/i_z): this, and not a measurement, is why the highlight never reflects more than F
    ratio = np.minimum(1.0, np.cos(drawn.theta_o) / math.cos(math.radians(theta_i)))
    assert np.allclose(drawn.weight[drawn.valid, 0], ratio[drawn.valid], rtol=1e-9)


@pytest.mark.parametrize("f0", [0.0, 0.04, 0.5, 1.0])
@pytest.mark.parametrize("exponents", [(0.0, 0.0), (10.0, 1000.0), (1e6, 1e6)])
def test_highlight_and_white_base_keep_energy(f0, exponents):
    theta = np.radians([0.0, 20.0, 45.0, 70.0, 85.0, 89.5])
    found = brdftab.albedo(NAME, theta, phi_i=0.3, nu=exponents[0], nv=exponents[1], f0=f0, kd=1.0)
    # the most is 31/32 at normal incidence for a narrow highlight with F = 0, and 1 for a mirror
    assert (found <= 1.0 + 1e-5).all(), found.max()


def test_albedo_of_the_base_is_its_closed_form():
    theta = np.radians([0.0, 40.0, 80.0])
    # without a step of the index there is no highlight
    found = brdftab.albedo(NAME, theta, ior=1.0, kd=[0.2, 0.5, 1.0])
    expected = (1.0 - (1.0 - 0.5 * np.cos(theta)) ** 5)[:, None] * [0.2, 0.5, 1.0]
    assert np.allclose(found, expected, rtol=1e-5)


@pytest.mark.parametrize(("nu", "nv"), [(1e4, 2.0), (1e6, 0.0), (200.0, 20.0)])
def test_albedo_of_narrow_highlights_equals_the_samples(nu, nv):
    given = {"nu": nu, "nv": nv, "material": "mirror"}
    drawn = brdftab.sample(NAME, 0.9, 400_000, phi_i=0.4, seed=5, **given)
    spread = drawn.weight.std() / math.sqrt(400_000)
    assert abs(drawn.weight.mean() - brdftab.albedo(NAME, 0.9, phi_i=0.4, **given)[0]) <= 4.0 * spread


def test_a_base_of_three_colours_needs_no_spectrum():
    setup = resolve(NAME, kd=[0.1, 0.2, 0.3], f0=0.04)
    assert setup.channels == ("R", "G", "B")
    with pytest.raises(ParameterError, match="kd has 3 values where the channels are 450nm, 650nm") as caught:
        resolve(NAME, kd=[0.1, 0.2, 0.3], wavelengths=[450.0, 650.0])
    assert "\n" not in str(caught.value)
    with pytest.raises(ParameterError, match="no twin"):
        models.twin(NAME)
