"""The azimuth modes of the Beckmann kernel: Bessel functions against scipy, modes against quadrature over azimuth."""

import math

import numpy as np
import pytest
from scipy.special import ive

from brdftab.materials import formulas
from brdftab.models._shared.facets.masking import smith_lambda
from brdftab.models._shared.facets.ndf import density
from brdftab.models.smith_multi.volterra import beckmann, bessel

MIRROR = beckmann.fit(0, np.ones(1), np.zeros(1), 1e-14)
GOLD = np.array([0.143, 0.375, 1.442]), np.array([3.983, 2.386, 1.603])


def scaled(order, kappa):
    """Return J, u1, u2 (3, N) of one order by the path sampler that `beckmann` takes."""
    kappa = np.asarray(kappa, dtype=np.float64)
    out = np.zeros((3, kappa.size))
    if order >= bessel.SPLIT or kappa.min() >= bessel.SPLIT:
        series, width, _ = bessel.order_series((float(order),))
        bend = tuple(float(c) for c in bessel.exponent_series())
        bessel.debye(float(order), series[0], width[0], bend, kappa, 0, kappa.size, *out)
    elif order == int(order):
        ratio, rows = np.zeros((2, int(order) + 2, kappa.size))
        bessel.miller(kappa, 0, kappa.size, int(order), ratio, rows)
        bessel.integer_order(int(order), kappa, 0, kappa.size, rows, *out)
    else:
        out[:] = np.array([bessel.small(float(order), float(k)) for k in kappa]).T
    return out


@pytest.mark.parametrize("order", [0, 1, 7, 24, 31, 0.3, 11.5, 24.9, 25.2, 40.7, 200.5, 5000.0])
def test_bessel_functions_equal_scipy(order):
    low = float(bessel.lowest_kappa(np.array(float(order))))
    for first, last in ((max(low, 1e-6), 24.999), (max(low, 25.0), 1e9)):
        if first >= last:
            continue
        kappa = np.geomspace(first, last, 60)
        value, slope, curve = scaled(order, kappa)
        j0 = ive(0.0, kappa)
        assert np.abs(value / j0 - ive(order, kappa) / j0).max() < 2e-13
        # scipy's differences lose the digits of kappa, so that derivatives are compared below 1e4 only
        near = kappa < 1e4
        exact = kappa * (ive(order, kappa) * (1.0 - order / kappa) - ive(order + 1.0, kappa))
        assert np.abs((slope - exact) / j0)[near].max(initial=0.0) < 1e-10
        # Bessel's equation, which multiplies the error of the slope by 2 kappa
        bent = (2.0 * kappa + 1.0) * slope - (kappa - order**2) * value
        assert np.abs((curve - bent) / j0)[near].max(initial=0.0) < 2e-9


@pytest.mark.parametrize(("order", "kappa"), [(3, 1e9), (40, 1e9), (2000, 1e9), (0, 1e12), (1e5, 1e10), (3e4, 1e12)])
def test_derivatives_at_large_arguments(order, kappa):
    # exp(-kappa (1 - cos phi)) is there a Gaussian of variance 1/kappa: moments of cos(m phi), next order below 1e-8
    q = order**2 / kappa
    gauss = math.exp(-0.5 * q) / math.sqrt(2.0 * math.pi * kappa)
    exact = gauss * np.array([1.0, 0.5 * (1.0 - q), 0.25 * (3.0 - 6.0 * q + q * q)])
    j0 = 1.0 / math.sqrt(2.0 * math.pi * kappa)
    # next term of the exponent is order^4/(24 kappa^3)
    assert np.abs(scaled(order, [kappa])[:, 0] - exact).max() < j0 * (2e-9 + order**4 / kappa**3)


def test_orders_continue_each_other():
    # around kappa = 25 and order 25 one path sampler takes over from another
    for order in (3, 3.5, 24.5, 24.999999, 25.0):
        below, above = scaled(order, [25.0 - 1e-9]), scaled(order, [25.0 + 1e-9])
        assert np.abs(below - above).max() < 1e-9
    low, high = scaled(24.9999999, [12.0]), scaled(25.0, [12.0])
    assert np.abs(low - high).max() < 1e-6 * scaled(0, [12.0])[0, 0]


def quadrature(a, b, order, alpha, reflect=None):
    """Return K_m and the integral of |K| by Gauss panels over azimuth, straight from the half vector."""
    count = int(6 + order / 6) * 4
    middle = math.cos(0.5 * (a + b))
    rise = 2.0 * middle * math.sin(0.5 * (b - a))
    flat = -2.0 * math.sin(0.5 * (a + b)) * math.sin(0.5 * (b - a))
    across = math.cos(a) * math.cos(b)
    end = min(math.pi, 14.0 * alpha * rise / math.sqrt(2.0 * across))
    x, w = np.polynomial.legendre.leggauss(16)
    edges = np.linspace(0.0, end, count + 1)
    half = 0.5 * np.diff(edges)[:, None]
    phi, w = (edges[:-1, None] + half * (1.0 + x)).ravel(), (half * w).ravel()
    level2 = flat**2 + 4.0 * across * np.sin(0.5 * phi) ** 2
    length = np.sqrt(rise**2 + level2)
    value = np.array([density(0, alpha, rise / n, math.sqrt(s) / n) for n, s in zip(length, level2, strict=True)]) / 4.0
    if reflect is not None:
        value = value * reflect(0.5 * length)
    return (value * np.cos(order * phi) * w).sum() / math.pi, (value * w).sum() / math.pi


PAIRS = [
    (-1.2, -0.4),
    (-0.7, 0.75),
    (-0.02, 0.5),
    (0.3, 0.32),
    (0.3, 1.5),
    (-1e-4, 1e-4),
    (-1.57, 0.9),
    (0.9, 0.9000001),
]
ORDERS = np.array([0.0, 1.0, 2.0, 7.0, 20.0, 31.0, 32.0, 50.0, 90.0])


@pytest.mark.parametrize("alpha", [0.01, 0.1, 0.5, 1.0, 2.0])
def test_modes_equal_quadrature_over_azimuth(alpha):
    out = np.empty((1, ORDERS.size, len(PAIRS)))
    a, b = np.array(PAIRS).T.copy()
    beckmann.pairs(a, b, ORDERS, alpha, MIRROR, out)
    for n, pair in enumerate(PAIRS):
        for m, order in enumerate(ORDERS):
            exact, whole = quadrature(*pair, order, alpha)
            # rounding of tan(mid)/alpha at alpha .01 and of the derivatives at alpha 2
            assert abs(out[0, m, n] - exact) <= 5e-12 * whole + 1e-80


def test_tables_and_pairs_agree_and_only_rising_directions_scatter():
    beta = np.linspace(-1.5, 1.5, 41)
    fitted = beckmann.fit(1, *GOLD, 1e-3)
    table = np.full((3, ORDERS.size, 41, 41), np.nan)
    beckmann.modes(beta, beta, ORDERS, 0.4, fitted, table)
    a, b = (x.ravel() for x in np.meshgrid(beta, beta, indexing="ij"))
    listed = np.empty((3, ORDERS.size, a.size))
    beckmann.pairs(a, b, ORDERS, 0.4, fitted, listed)
    assert np.allclose(table.reshape(listed.shape), listed, rtol=1e-12, atol=1e-18)
    assert np.all(table[:, :, b.reshape(41, 41) <= a.reshape(41, 41)] == 0.0)
    # reciprocity: d -> d' and -d' -> -d
    assert np.allclose(table, np.swapaxes(table, 2, 3)[:, :, ::-1, ::-1], rtol=1e-11, atol=1e-16)


@pytest.mark.parametrize(
    ("alpha", "tolerance", "rates"), [(0.1, 1e-5, 2), (0.2, 1e-4, 3), (0.5, 1e-3, 3), (0.5, 1e-5, 0), (1.0, 1e-4, 0)]
)
def test_modes_with_reflectance(alpha, tolerance, rates):
    fitted = beckmann.fit(1, *GOLD, tolerance)
    assert fitted.error <= tolerance
    # few exponentials of a pair's own where they serve, else those for all X
    assert beckmann.local(fitted, alpha).rates.size == rates
    a, b = np.array(PAIRS[:5]).T.copy()
    out = np.empty((3, 3, a.size))
    beckmann.pairs(a, b, ORDERS[:3], alpha, fitted, out)
    for n, pair in enumerate(PAIRS[:5]):
        for m in range(3):
            for w in range(3):
                exact, whole = quadrature(
                    *pair, ORDERS[m], alpha, lambda c, w=w: formulas.conductor(GOLD[0][w], GOLD[1][w], c)
                )
                assert abs(out[w, m, n] - exact) <= 1.01 * tolerance * max(whole, 1e-80)


def test_fits_of_schlick_and_metals_reach_their_tolerance():
    cosine = np.linspace(0.0, 1.0, 777)
    f0 = np.array([0.04, 0.5, 0.97])
    for kind, a, b, exact in (
        (3, f0, np.zeros(3), formulas.schlick(f0, cosine[:, None])),
        (1, *GOLD, formulas.conductor(*GOLD, cosine[:, None])),
    ):
        for tolerance in (1e-2, 1e-3, 1e-4, 1e-5):
            found = beckmann.fit(kind, a, b, tolerance)
            x = 4.0 * cosine**2
            value = found.constant + np.exp(-np.outer(x, found.scales)) @ found.coefficients.T
            assert np.abs(value - exact).max() <= found.error + 1e-12 <= tolerance


def test_extremes_stay_finite():
    beta = np.array([-0.5 * math.pi, -1.5707, -1e-4, -1e-7, 0.0, 1e-7, 1e-4, 0.3, 0.3 + 1e-13, 1.5707, 0.5 * math.pi])
    orders = np.array([0.0, 1.0, 15.7, 31.0, 1e3, 1e5, 3e6])
    fitted = beckmann.fit(1, *GOLD, 1e-3)
    for alpha in (0.01, 0.1, 2.0):
        out = np.full((3, orders.size, beta.size, beta.size), np.nan)
        beckmann.modes(beta, beta, orders, alpha, fitted, out)
        assert np.isfinite(out).all()
        assert np.all(out[:, 0] >= 0.0)


@pytest.mark.parametrize("alpha", [0.1, 0.5, 1.0])
def test_reach_bounds_the_modes(alpha):
    down, up = np.array([0.02, 0.3, 0.9]), np.array([0.03, 0.2, 1.2])
    for decay in (14.0, 28.0):
        order = beckmann.reach(alpha, down, up, decay)
        for n in range(3):
            out = np.empty((1, 2, 1))
            beckmann.pairs(-down[n : n + 1], up[n : n + 1], np.array([0.0, order[n]]), alpha, MIRROR, out)
            # factors of the derivatives, decay^2 at most
            assert abs(out[0, 1, 0]) <= decay**2 * math.exp(-decay) * out[0, 0, 0] + 1e-80
    assert beckmann.largest_mode(alpha, 0.02, 14.0) == pytest.approx(beckmann.reach(alpha, 0.02, 0.02, 14.0))


def test_weight_is_masking_over_the_cosine():
    for alpha in (0.05, 0.5, 2.0):
        for beta in (0.02, 0.4, 1.2, 1.5):
            masking = smith_lambda(0, alpha, 1.0 / math.tan(beta), False)
            exact = 1.0 / (math.sin(beta) * (1.0 + masking))
            assert beckmann.weight(np.array([beta, -beta]), alpha) == pytest.approx([exact, exact], rel=1e-13)
        # at the horizon Lambda grows like alpha/(2 sqrt(pi) |d_z|)
        assert beckmann.weight(np.array([0.0]), alpha)[0] == pytest.approx(2.0 * math.sqrt(math.pi) / alpha, rel=1e-14)


def test_mean_over_azimuth_conserves_energy():
    # the phase function of a facet integrates to 1, so that K of a direction adds up to its |d_z| (1 + Lambda)
    x, w = np.polynomial.legendre.leggauss(40)
    for alpha in (0.2, 1.0):
        for a in (-1.2, -0.5, 0.4):
            edges = np.linspace(a, 0.5 * math.pi, 41)
            half = 0.5 * np.diff(edges)[:, None]
            b, size = (edges[:-1, None] + half * (1.0 + x)).ravel(), (half * w).ravel()
            out = np.empty((1, 1, 1, b.size))
            beckmann.modes(np.array([a]), b, np.zeros(1), alpha, MIRROR, out)
            total = 2.0 * math.pi * (out[0, 0, 0] * np.cos(b) * size).sum()
            gain = 1.0 / beckmann.weight(np.array([a]), alpha)[0]
            # light on its way up meets facets from below: Lambda in place of 1 + Lambda
            exact = gain if a < 0.0 else gain - math.sin(a)
            assert total == pytest.approx(exact, rel=1e-10)
