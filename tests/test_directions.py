"""Angles, vectors and the half/difference frame."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brdftab.directions import from_vector, half_difference, in_out, relative_azimuth, to_vector, wrap

THETA = st.floats(0.0, np.pi / 2, allow_subnormal=False)
PHI = st.floats(0.0, 2 * np.pi, exclude_max=True, allow_subnormal=False)

# a handful of roundings of numbers up to 2 pi; measured worst 1.2e-15 over 1e6 random pairs
TIGHT = 4e-15


@pytest.mark.parametrize(
    ("theta", "phi", "vector"),
    [
        (0.0, 0.0, (0, 0, 1)),
        (np.pi / 2, 0.0, (1, 0, 0)),
        (np.pi / 2, np.pi / 2, (0, 1, 0)),
        (np.pi / 4, np.pi, (-(0.5**0.5), 0, 0.5**0.5)),
    ],
)
def test_known_vectors(theta, phi, vector):
    assert np.allclose(to_vector(theta, phi), vector, rtol=0, atol=TIGHT)
    found = from_vector(vector)
    assert np.allclose(found, (theta, phi), rtol=0, atol=TIGHT)


@settings(max_examples=300, deadline=None)
@given(st.floats(1e-300, np.pi / 2), PHI)
def test_angles_survive_the_round_trip_near_the_pole(theta, phi):
    back, azimuth = from_vector(to_vector(theta, phi))
    # relative, not absolute: acos(z) would return 0 for theta below 1e-8
    assert back == pytest.approx(theta, rel=TIGHT, abs=0)
    assert abs(relative_azimuth(azimuth, phi)) <= TIGHT


@settings(max_examples=300, deadline=None)
@given(THETA, PHI, THETA, PHI)
def test_half_difference_is_inverted(theta_i, phi_i, theta_o, phi_o):
    light, view = to_vector(theta_i, phi_i), to_vector(theta_o, phi_o)
    if np.linalg.norm(light + view) < 1e-6:
        return  # opposite grazing directions have no half vector
    theta_h, phi_h, theta_d, phi_d = half_difference(theta_i, phi_i, theta_o, phi_o)
    assert 0 <= theta_h <= np.pi / 2 + TIGHT
    assert 0 <= theta_d <= np.pi / 2
    assert 0 <= phi_h < 2 * np.pi
    assert 0 <= phi_d < 2 * np.pi
    back = in_out(theta_h, phi_h, theta_d, phi_d)
    # the azimuth of a half vector of length 1e-6 carries 1e-16/1e-6 of rounding
    bound = TIGHT + 4e-16 / np.linalg.norm(light + view)
    assert np.allclose(to_vector(*back[:2]), light, rtol=0, atol=bound)
    assert np.allclose(to_vector(*back[2:]), view, rtol=0, atol=bound)


def test_half_difference_by_hand():
    # mirror pair at 30 degrees: half vector is the normal, the difference angle 30 degrees at the light's azimuth
    theta_h, phi_h, theta_d, phi_d = half_difference(np.pi / 6, 0.0, np.pi / 6, np.pi)
    assert theta_h == pytest.approx(0, abs=TIGHT)
    assert theta_d == pytest.approx(np.pi / 6, abs=TIGHT)
    # phi_h is free at the pole; only its sum with phi_d has a meaning
    assert relative_azimuth(phi_h + phi_d, 0.0) == pytest.approx(0, abs=TIGHT)
    # retro pair: no difference
    assert half_difference(0.3, 1.0, 0.3, 1.0)[2] == 0.0
    # swapping light and view turns phi_d by pi (reciprocity in this frame)
    one, two = half_difference(0.3, 0.1, 0.9, 1.3), half_difference(0.9, 1.3, 0.3, 0.1)
    assert np.allclose(one[:3], two[:3], rtol=0, atol=TIGHT)
    assert relative_azimuth(one[3], two[3]) == pytest.approx(np.pi, abs=TIGHT)


@given(PHI, PHI, st.integers(-3, 3))
def test_relative_azimuth_is_folded(phi_i, phi_o, turns):
    folded = relative_azimuth(phi_i, phi_o)
    assert 0 <= folded <= np.pi
    # adding whole turns costs the roundings of numbers up to 6 pi
    assert np.cos(folded) == pytest.approx(np.cos(phi_o - phi_i), abs=TIGHT)
    assert relative_azimuth(phi_i + 2 * np.pi * turns, phi_o) == pytest.approx(folded, abs=2e-14)
    assert relative_azimuth(phi_o, phi_i) == folded


def test_wrap_ends():
    assert wrap(-1e-20) == 0.0
    assert not np.signbit(wrap(-0.0))
    assert wrap(2 * np.pi) == 0.0
    assert np.array_equal(wrap([1.0, -np.pi]), [1.0, np.pi])


def test_broadcasting():
    assert to_vector(np.zeros((4, 1)), np.zeros(3)).shape == (4, 3, 3)
    shapes = {a.shape for a in half_difference(np.full((4, 1), 0.2), 0.0, np.full(3, 0.5), 1.0)}
    assert shapes == {(4, 3)}
