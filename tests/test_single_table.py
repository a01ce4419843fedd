"""The fast product-grid tables of the single-bounce models against exact evaluation of the same directions."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from brdftab import models
from brdftab.materials import fresnel as builders
from brdftab.models._shared.fresnel.reflectance_fit import fit
from brdftab.models._shared.single_bounce import streaming
from brdftab.models.resolve import resolve

POLAR = np.radians([0.0, 1e-3, 4.0, 31.0, 58.0, 60.0, 77.0, 88.0, 89.9, 89.999])
AZIMUTHS = np.radians([0.0, 1e-4, 20.0, 90.0, 150.0, 170.0, 179.0, 179.9, 179.999, 180.0, 30.0, 60.0, 100.0])
ALPHAS = (1e-4, 1e-2, 0.3, 1.0, 3.0, 10.0)
MODELS = [
    *(("smith", {"masking": m}) for m in ("separable", "height-correlated", "smith-walter")),
    ("cook-torrance", {}),
]
# measured: 6.8e-7 in float32 (rounding, and the polynomials of gold) and 5e-13 in float64
RTOL = {"float32": 1e-6, "float64": 1e-12}
# exact evaluation rounds (theta_i + theta_o)/2, which at grazing angles costs 2e-11 of exp(-58); the table does not
NARROW = 3e-11
# float32 cannot hold less
FLOOR = {"float32": 1e-37, "float64": 1e-290}


def table(setup, polar, azimuths, dtype, *, view=None, tolerance=1e-3):
    prepared = models.kernel(setup.model.name).prepare(setup, tolerance)
    assert prepared is not None
    view = polar if view is None else view
    out = np.full((polar.size, view.size, azimuths.size, len(setup.channels)), np.nan, dtype)
    prepared.fill(polar, view, azimuths, view is polar, out[None])
    return out


def exact(setup, polar, azimuths, view=None):
    view = polar if view is None else view
    i, o, p = (x.ravel() for x in np.meshgrid(polar, view, azimuths, indexing="ij"))
    values = models.kernel(setup.model.name).points(setup, i, o, p, np.zeros_like(p), orders=0, tolerance=1e-3)
    return values.reshape(polar.size, view.size, azimuths.size, -1)


def worst(got, want, floor):
    """Return the largest relative difference, with an absolute floor."""
    return float((np.abs(got.astype(np.float64) - want) / np.maximum(np.abs(want), floor)).max())


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("ndf", ["beckmann", "ggx", "phong"])
def test_tables_equal_exact_evaluation(ndf, dtype):
    for (model, options), alpha in itertools.product(MODELS, ALPHAS):
        setup = resolve(model, ndf=ndf, alpha=alpha, **options)
        got = table(setup, POLAR, AZIMUTHS, dtype)
        error = worst(got, exact(setup, POLAR, AZIMUTHS), FLOOR[dtype] / RTOL[dtype])
        assert error <= (RTOL[dtype] if alpha > 1e-4 else max(RTOL[dtype], NARROW)), (model, options, alpha, error)
        assert np.array_equal(got, got.swapaxes(0, 1))
        assert (got >= 0.0).all()


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_a_tight_tolerance_is_computed_in_float64(dtype):
    setup = resolve("smith", ndf="ggx", alpha=0.3)
    got = table(setup, POLAR, AZIMUTHS, dtype, tolerance=1e-7)
    # rounding to float32 alone: 2^-24
    assert worst(got, exact(setup, POLAR, AZIMUTHS), 1e-30) <= (6e-8 if dtype == "float32" else 1e-12)


@pytest.mark.parametrize(
    "reflectance",
    [
        {"material": "mirror"},
        {"material": "Al"},
        {"material": "Cu2O", "wavelengths": [450.0, 500.0, 600.0, 700.0]},
        {"eta": [0.14, 0.37, 1.44], "k": [3.98, 2.38, 1.6]},
        {"ior": 1.5},
        {"f0": [0.04, 0.5, 1.0]},
    ],
    ids=str,
)
def test_every_kind_and_count_of_channels(reflectance):
    setup = resolve("smith", ndf="ggx", alpha=0.4, **reflectance)
    for dtype in ("float32", "float64"):
        got = table(setup, POLAR, AZIMUTHS, dtype)
        assert worst(got, exact(setup, POLAR, AZIMUTHS), 1e-30) <= RTOL[dtype], dtype


def test_a_grid_that_is_not_square_and_rows_of_every_alignment():
    setup = resolve("cook-torrance", ndf="ggx", alpha=0.5)
    light, rng = np.radians([10.0, 50.0, 85.0]), np.random.default_rng(1)
    for count, dtype in itertools.product((1, 2, 3, 16, 17, 33), ("float32", "float64")):
        azimuths = np.sort(rng.uniform(0.0, np.pi, count))
        got = table(setup, light, azimuths, dtype, view=POLAR)
        assert worst(got, exact(setup, light, azimuths, POLAR), 1e-30) <= RTOL[dtype]


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_streamed_rows_of_any_alignment_equal_plain_ones(dtype, monkeypatch):
    setup = resolve("smith", ndf="ggx", alpha=0.5)
    prepared = models.kernel("smith").prepare(setup, 1e-3)
    polar, azimuths = np.linspace(0.0, 1.57, 9), np.linspace(0.0, np.pi, 7)
    buffer = np.zeros(9 * 9 * 7 * 3 + 16, dtype)
    tables = []
    for limit, shifts in ((1 << 40, (0,)), (0, range(6))):
        monkeypatch.setattr(streaming, "WORTHWHILE", limit)
        for shift in shifts:
            buffer[:] = -1.0
            out = buffer[shift : shift + 9 * 9 * 7 * 3].reshape(9, 9, 7, 3)
            assert (streaming.stream_phase(out) < 0) == (limit > 0)
            prepared.fill(polar, polar, azimuths, True, out[None])
            tables.append(out.copy())
            assert (np.delete(buffer, np.s_[shift : shift + out.size]) == -1.0).all()
    assert all(np.array_equal(t, tables[0]) for t in tables)


def test_the_horizon_and_below_are_zero():
    polar = np.radians([30.0, 90.0])
    for ndf, dtype in itertools.product(("beckmann", "ggx", "phong"), ("float32", "float64")):
        got = table(resolve("smith", ndf=ndf, alpha=0.5), polar, AZIMUTHS, dtype)
        assert (got[0, 0] > 0.0).all()
        assert (got[1] == 0.0).all()
        assert (got[:, 1] == 0.0).all()


def test_what_polynomials_cannot_hold_is_left_to_exact_evaluation():
    for reflectance in ({"ior": 1.0001}, {"f0": 0.0}):
        assert models.kernel("smith").prepare(resolve("smith", ndf="ggx", alpha=0.5, **reflectance), 1e-3) is None
    assert models.kernel("smith").prepare(resolve("smith", ndf="ggx", alpha_x=0.5, alpha_y=0.2), 1e-3) is None


def test_the_reflectance_fit_states_its_error():
    for term in (builders.metal("Au"), builders.metal("Al"), builders.dielectric(1.5), builders.schlick(0.04)):
        found = fit(term, 2e-13, np.float64)
        assert found.error <= 2e-13
        # error between the samples on which it was measured
        for zone, start in enumerate(found.starts):
            cosine = np.random.default_rng(2).uniform(start, 1.0, 500)
            m1, m0, d1, d0 = found.maps[zone]
            x = (m1 * cosine + m0) / (d1 * cosine + d0)
            assert np.abs(x).max() <= 1.0 + 1e-12
            for channel, want in enumerate((builders.reflectance(term, cosine) @ term.weights).T):
                powers = found.coefficients[zone, channel, : found.degrees[zone] + 1]
                assert np.abs(np.polyval(powers, x) / want - 1.0).max() <= 3e-13
