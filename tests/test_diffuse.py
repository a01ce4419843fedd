"""Lambert and Oren-Nayar: limits, energy, and the V-cavity integral that the 1994 formulas were fitted to."""

import math

import numpy as np
import pytest

import brdftab

RHO = 0.9


def _cavity_integral(sigma, theta_i, theta_o, phi, count=400):
    """Direct part by quadrature over facets: Gaussian tilt, uniform azimuth, V-cavity masking, no interreflection."""
    tilt = (np.arange(count) + 0.5) * (0.5 * math.pi / count)
    turn = (np.arange(count) + 0.5) * (2.0 * math.pi / count)
    a, b = np.meshgrid(tilt, turn, indexing="ij")
    density = np.exp(-0.5 * (a / sigma) ** 2) * np.sin(a)
    density /= density.sum()
    n_z = np.cos(a)
    s = np.sin(theta_i) * np.sin(a) * np.cos(b) + np.cos(theta_i) * n_z
    v = np.sin(theta_o) * np.sin(a) * np.cos(b - phi) + np.cos(theta_o) * n_z
    s, v = np.maximum(s, 0.0), np.maximum(v, 0.0)
    with np.errstate(divide="ignore"):
        masking = np.minimum(1.0, np.minimum(2.0 * np.cos(theta_i) * n_z / s, 2.0 * np.cos(theta_o) * n_z / v))
    masking = np.maximum(np.nan_to_num(masking), 0.0)
    return RHO / math.pi * np.sum(density * s * v * masking / (np.cos(theta_i) * np.cos(theta_o) * n_z))


@pytest.mark.parametrize("degrees", [10.0, 20.0, 30.0])
def test_oren_nayar_follows_the_cavity_integral(degrees):
    # the functional fit is good to 5 % up to 60 degrees; a factor wrong by 10 % in any of C1, C2 fails here
    sigma = math.radians(degrees)
    for theta_i, theta_o, phi in (
        (0.0, 0.5, 0.0),
        (0.6, 0.6, 0.0),
        (0.9, 0.5, 0.3),
        (1.0, 1.0, math.pi),
        (1.0, 0.2, 2.0),
    ):
        fit = brdftab.evaluate("oren-nayar", theta_i, theta_o, phi, kd=RHO, sigma=sigma, components=True)["direct"][0]
        assert fit == pytest.approx(_cavity_integral(sigma, theta_i, theta_o, phi), rel=0.06)


@pytest.mark.parametrize("variant", ["full", "qualitative"])
def test_oren_nayar_limits(variant):
    angles = (0.7, 0.4, 2.0)
    smooth = brdftab.evaluate("oren-nayar", *angles, kd=[0.2, 0.5, 0.8], sigma=0.0, variant=variant)
    assert smooth == pytest.approx(np.array([0.2, 0.5, 0.8]) / math.pi, rel=1e-14)
    rough = brdftab.evaluate("oren-nayar", 0.8, 0.8, 0.0, sigma=0.5, variant=variant)
    mirror = brdftab.evaluate("oren-nayar", 0.8, 0.8, math.pi, sigma=0.5, variant=variant)
    assert rough > 1.3 * mirror


def test_oren_nayar_printed_value():
    """Eqs. 27 to 29 by hand at sigma = 0.3, theta_i = 60, theta_o = 30, phi = 120 degrees, rho = 0.8."""
    alpha, beta, cos_phi, s2, rho = math.pi / 3, math.pi / 6, -0.5, 0.09, 0.8
    c1 = 1.0 - 0.5 * s2 / 0.42
    c2 = 0.45 * 0.5 * (math.sin(alpha) - (1.0 / 3.0) ** 3)
    c3 = 0.125 * 0.5 * (2.0 / 9.0) ** 2
    direct = rho / math.pi * (c1 + cos_phi * c2 * math.tan(beta) + 0.5 * c3 * math.tan(math.pi / 4))
    inter = 0.17 * rho**2 / math.pi * s2 / 0.22 * (1.0 + 0.5 / 9.0)
    found = brdftab.evaluate("oren-nayar", alpha, beta, 2 * math.pi / 3, kd=rho, sigma=0.3, components=True)
    assert found["direct"][0] == pytest.approx(direct, rel=1e-13)
    assert found["interreflection"][0] == pytest.approx(inter, rel=1e-13)


def test_oren_nayar_stays_positive_and_loses_no_more_than_it_gets():
    theta = np.radians([0.0, 45.0, 80.0, 89.0, 89.9])
    ti, to, phi = np.meshgrid(theta, theta, np.radians([0.0, 60.0, 90.0, 120.0, 180.0]), indexing="ij")
    for sigma in (0.1, 0.7, math.pi / 2):
        assert (brdftab.evaluate("oren-nayar", ti, to, phi, kd=1.0, sigma=sigma) >= 0.0).all()
    # the fit keeps energy up to 60 degrees; beyond, its direct part alone exceeds 1 by a few per cent
    assert (brdftab.albedo("oren-nayar", np.radians([0.0, 30.0, 60.0]), kd=1.0, sigma=0.35) < 1.02).all()


def test_lambert_is_constant_and_black_below_the_horizon():
    assert brdftab.evaluate("lambert", 0.3, 1.2, 2.0, kd=0.6)[0] == pytest.approx(0.6 / math.pi, rel=1e-15)
    assert brdftab.evaluate("lambert", 0.3, 1.7, 2.0, kd=0.6)[0] == 0.0
