"""Fast tables of interfaced Lambertian facets against the split rule of the same directions."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from brdftab import models
from brdftab.models._shared.facets.gaussian import gaussian_norm
from brdftab.models._shared.facets.masking import smith_lambda
from brdftab.models._shared.fresnel.interface import body_factor
from brdftab.models.ilm.single_bounce import cells, masking_corrections, table
from brdftab.models.ilm.single_bounce.azimuth_modes import rings
from brdftab.models.resolve import resolve
from brdftab.quadrature import unit_gauss

POLAR = np.radians([0.0, 0.5, 31.0, 60.0, 77.5, 85.5, 88.5, 89.5])
AZIMUTHS = np.radians([0.0, 0.5, 15.5, 60.5, 121.5, 164.5, 175.5, 179.5, 180.0])
SIGMAS = (0.05, 0.3, 1.5)
NDFS = ("beckmann", "ggx", "gaussian")
KD = (0.9, 0.5, 0.0)


def body(setup, n, polar, view, azimuths):
    """Return I (K,) of a grid with its masking, by the split rule with 14 nodes a panel (20 agree to 1e-9)."""
    sigma, masking = setup.alpha_x, 0 if setup.values["masking"] == "smith" else 10
    norm = gaussian_norm(sigma) if setup.ndf == 3 else 1.0
    lights, views = (cells.axis(masking, setup.ndf, sigma, side) for side in (polar, view))
    at = np.argwhere(np.ones((polar.size, view.size, azimuths.size)))
    waves = np.cos(0.5 * azimuths), np.sin(azimuths)
    surface = (masking, setup.ndf, sigma, norm, float(n), *waves, np.ones(1), 5e-8)
    out = np.empty(len(at))
    cells.exact(at, azimuths, lights, views, unit_gauss(14), surface, out)
    return out / math.pi


def specular(setup, n, ti, to, phi):
    """Return F D G/(4 i_z o_z), written out with vectors."""
    i = np.stack([np.sin(ti), 0.0 * ti, np.cos(ti)])
    o = np.stack([np.sin(to) * np.cos(phi), np.sin(to) * np.sin(phi), np.cos(to)])
    h = i + o
    h /= np.sqrt((h * h).sum(axis=0))
    c, sigma = np.clip((i * h).sum(axis=0), 0.0, 1.0), setup.alpha_x
    g = np.sqrt(n * n - 1.0 + c * c)
    f = (
        0.5 * ((g - c) / (g + c)) ** 2 * (1.0 + ((c * (g + c) - 1.0) / (c * (g - c) + 1.0)) ** 2)
        if n > 1.0
        else 0.0 * c
    )
    tangent = np.hypot(h[0], h[1]) / h[2]
    if setup.ndf == 0:
        d = np.exp(-((tangent / sigma) ** 2)) / (math.pi * sigma**2 * h[2] ** 4)
    elif setup.ndf == 1:
        d = 1.0 / (math.pi * sigma**2 * h[2] ** 4 * (1.0 + (tangent / sigma) ** 2) ** 2)
    else:
        d = gaussian_norm(sigma) / (2.0 * math.pi * sigma**2 * h[2]) * np.exp(-0.5 * (np.arctan(tangent) / sigma) ** 2)
    if setup.values["masking"] == "smith":
        g = np.ones_like(c)
        for theta in (ti, to):
            g /= 1.0 + np.array([smith_lambda(setup.ndf, sigma, math.tan(t), False) for t in theta])
    else:
        g = np.minimum(1.0, 2.0 * h[2] * np.minimum(i[2], o[2]) / c)
    return f * d * g / (4.0 * i[2] * o[2])


def exact(setup, polar, azimuths, view=None):
    view = polar if view is None else view
    angles = [x.ravel() for x in np.meshgrid(polar, view, azimuths, indexing="ij")]
    count = len(setup.channels)
    index, kd = (np.broadcast_to(v, count) for v in (setup.fresnel.a, setup.values["kd"]))
    out = np.empty((angles[0].size, count))
    for n in np.unique(index):
        mirrored, inside = specular(setup, n, *angles), body(setup, n, polar, view, azimuths)
        for c in np.flatnonzero(index == n):
            out[:, c] = mirrored + body_factor(kd[c], n) * inside
    return out.reshape(polar.size, view.size, azimuths.size, count)


def tabulated(setup, polar, azimuths, tolerance, *, view=None, dtype=np.float64):
    prepared = table.prepare(setup, tolerance)
    assert prepared is not None
    view = polar if view is None else view
    out = np.full((polar.size, view.size, azimuths.size, len(setup.channels)), np.nan, dtype)
    prepared.fill(polar, view, azimuths, view is polar, out[None])
    return out


def worst(got, want):
    return float((np.abs(got - want) / np.maximum(np.abs(want), 1e-300)).max())


@pytest.mark.parametrize("masking", ["smith", "torrance-sparrow"])
@pytest.mark.parametrize("ndf", NDFS)
def test_every_cell_holds_the_tolerance(ndf, masking):
    if (ndf, masking) == ("gaussian", "smith"):
        pytest.skip("the Gaussian has no Smith masking: its mean slope is infinite")
    for sigma in SIGMAS:
        setup = resolve("ilm", ndf=ndf, sigma=sigma, ior=1.5, kd=list(KD), masking=masking)
        want = exact(setup, POLAR, AZIMUTHS)
        for tolerance in (1e-3, 1e-5):
            got = tabulated(setup, POLAR, AZIMUTHS, tolerance)
            assert worst(got, want) <= tolerance, (sigma, tolerance, worst(got, want))
            assert np.array_equal(got, got.swapaxes(0, 1))


@pytest.mark.parametrize("masking", ["smith", "torrance-sparrow"])
def test_extreme_surfaces(masking):
    # no interface, a weak one, one index a channel; nearly flat and very rough
    for ior, sigma, ndf in itertools.product((1.0, [1.001, 1.5, 2.4]), (1e-3, 10.0), ("beckmann", "ggx")):
        setup = resolve("ilm", ndf=ndf, sigma=sigma, ior=ior, kd=[0.3, 0.5, 1.0], masking=masking)
        polar, azimuths = POLAR[[1, 3, 5, 7]], AZIMUTHS[[0, 3, 6, 8]]
        error = worst(tabulated(setup, polar, azimuths, 1e-3), exact(setup, polar, azimuths))
        assert error <= 1e-3, (ior, sigma, ndf, error)


def test_unequal_axes_float32_and_the_horizon():
    setup = resolve("ilm", ndf="ggx", sigma=0.4, ior=1.3, kd=0.5)
    polar, view = np.append(POLAR[2:5], 0.5 * math.pi), np.append(POLAR[[5, 1, 7]], 2.0)
    got = tabulated(setup, polar, AZIMUTHS, 1e-4, view=view, dtype=np.float32)
    want = exact(setup, polar[:3], AZIMUTHS, view[:3])
    assert worst(got[:3, :3].astype(np.float64), want) <= 1e-4
    assert not got[3].any()
    assert not got[:, 3].any()
    other = tabulated(setup, polar, AZIMUTHS, 1e-4, view=view)
    # only the last rounding differs
    assert np.array_equal(other.astype(np.float32), got)


def test_flat_surface_is_the_limit_of_low_roughness():
    flat = tabulated(resolve("ilm", sigma=0.0, kd=[0.2, 0.9, 0.0], ior=1.4), POLAR[1:5], AZIMUTHS[:4], 1e-3)
    # 60 sigma aside of the mirror direction nothing is specular; the body differs by sigma^2
    rough = tabulated(resolve("ilm", sigma=1e-3, kd=[0.2, 0.9, 0.0], ior=1.4), POLAR[1:5], AZIMUTHS[:4], 1e-6)
    kept = np.add.outer(POLAR[1:5], POLAR[1:5]) > 0.3
    assert worst(flat[kept][..., :2], rough[kept][..., :2]) <= 3e-4
    assert not flat[..., 2].any()


def test_without_a_body_only_facets_reflect():
    setup = resolve("ilm", ndf="ggx", sigma=0.3, kd=0.0, ior=1.5)
    angles = [x.ravel() for x in np.meshgrid(POLAR, POLAR, AZIMUTHS, indexing="ij")]
    want = specular(setup, 1.5, *angles).reshape(8, 8, 9, 1)
    # rounding of the half vector at grazing angles
    assert worst(tabulated(setup, POLAR, AZIMUTHS, 1e-3), want) <= 1e-9


def test_what_the_fast_path_leaves_to_others():
    assert not isinstance(table.prepare(resolve("ilm", sigma=0.3, bounces="2"), 1e-3), table.BodyEvaluator)
    assert table.prepare(resolve("ilm", sigma=0.3), 1e-8) is None
    assert table.prepare(resolve("ilm", sigma_x=0.3, sigma_y=0.2), 1e-3) is None


def test_direct_evaluation_agrees():
    setup = resolve("ilm", sigma=0.3, ior=[1.3, 1.5, 1.5], kd=list(KD))
    got = tabulated(setup, POLAR[2:5], AZIMUTHS, 1e-4)
    angles = [x.ravel() for x in np.meshgrid(POLAR[2:5], POLAR[2:5], AZIMUTHS, indexing="ij")]
    angles.append(np.zeros_like(angles[0]))
    want = models.kernel("ilm").points(setup, *angles, orders=0, tolerance=1e-4)
    assert worst(got.reshape(want.shape), want) <= 2e-4
    assert np.array_equal(table.prepare(setup, 1e-4).points(*angles), want)


@pytest.mark.parametrize("ndf", [0, 1, 3])
def test_rings_hold_all_facets(ndf):
    for sigma in (1e-3, 0.3, 10.0):
        assert abs(rings(ndf, sigma, 48)[1].sum() - 1.0) <= 1e-9


def test_polynomial_sine_and_cosine():
    for x in np.linspace(-0.5 * math.pi, 0.5 * math.pi, 41):
        assert np.allclose(masking_corrections._turn(x), (math.sin(x), math.cos(x)), rtol=0.0, atol=1e-15)
