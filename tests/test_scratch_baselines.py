"""Single-bounce models of a scratch beside the traced one, and the Fresnel slices of the comparison."""

import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest

import brdftab
from brdftab.errors import ParameterError
from brdftab.materials import fresnel
from brdftab.models.scratch.flux import aperture
from brdftab.models.scratch.ndf import MASKINGS, single_bounce_rho, smith_visible, walls
from brdftab.models.scratch.profiles import parse

BINS = 64


@pytest.mark.parametrize("text", ["quartic:1", "quartic:0.05", "v:30", "ellipse:0.5", "u:0.3"])
def test_walls_cover_the_aperture(text):
    m, length = walls(parse(text))
    assert (length * np.cos(m)).sum() == pytest.approx(1.0, rel=1e-12)
    assert (length * np.sin(m)).sum() == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("masking", MASKINGS)
def test_single_bounce_is_reciprocal(masking):
    rho = single_bounce_rho(parse("quartic:1"), BINS, masking)
    assert np.array_equal(rho, rho.T)
    assert (rho >= 0.0).all()


@pytest.mark.parametrize(("depth", "apart"), [(0.05, 0.0023), (0.01, 0.0031)])
def test_shallow_profiles_without_masking_are_the_first_order(depth, apart):
    """Share of the light that goes elsewhere, within 60 degrees of the normal: measured 0.0022 and 0.0030."""
    profile = f"quartic:{depth}"
    traced = brdftab.trace_scratch(profile, bins=BINS).flux[0]
    share = aperture(BINS)
    cheap = single_bounce_rho(parse(profile), BINS, "none") * share[:, None] * share
    inner = slice(BINS // 6, BINS - BINS // 6)
    assert np.abs(cheap - traced)[:, inner].sum() / traced[:, inner].sum() < apart
    # without masking and with all walls in sight, energy is kept
    assert np.allclose(cheap[:, inner].sum(axis=0), share[inner], rtol=1e-3)


def test_vee_is_two_walls():
    """Smith's G1 of a V in closed form: cos p over the walls that face p, each half the aperture over sin(half)."""
    half = math.radians(30.0)
    m, length = walls(parse("v:30"))
    p = np.radians([0.0, 10.0, 29.0, 50.0, 80.0])
    facing = sum(np.maximum(np.cos(p - side * (0.5 * math.pi - half)), 0.0) for side in (-1.0, 1.0))
    assert np.allclose(smith_visible(m, length, p), np.cos(p) / (facing * 0.5 / math.sin(half)), rtol=1e-12)


@pytest.mark.parametrize("text", ["v:30", "v:40", "v:60", "v:80"])
def test_cavities_mask_a_vee_as_rays_find_it(text):
    """Torrance and Sparrow's factor is exact for two walls: light of the first bounce by incident bin, and in all.

    Measured 2.4e-3 of the largest bin, and 3.6e-5; exit bins differ where an edge lies on a mirrored bin.
    """
    traced = brdftab.trace_scratch(text, bins=BINS).flux[0]
    share = aperture(BINS)
    found = single_bounce_rho(parse(text), BINS, "v-cavity") * share[:, None] * share
    assert np.abs(found.sum(axis=0) - traced.sum(axis=0)).max() < 3e-3 * traced.sum(axis=0).max()
    assert found.sum() == pytest.approx(traced.sum(), rel=6e-5)


def test_unknown_masking_is_refused():
    with pytest.raises(ParameterError, match="masking = walter is not known; choose one of none, v-cavity, smith"):
        single_bounce_rho(parse("v:45"), 16, "walter")


@pytest.fixture(scope="module")
def benchmark():
    """Return the benchmark that makes the tables of docs/scratch-baselines.md."""
    path = Path(__file__).parents[1] / "benchmarks" / "scratch_baselines.py"
    spec = importlib.util.spec_from_file_location("scratch_baselines", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_reference_of_the_benchmark(benchmark):
    """Albedos of a right-angled V by unfolding: .42576 at t = 0 and .41404 at 60 degrees, iron."""
    iron = fresnel.conductor(*benchmark.IRON)
    flux = benchmark.simulated("v:45", 64, 8192, [(iron, 0.0), (iron, 60.0), (iron, 90.0)], 0.0)
    # measured 2e-6, 2e-6 and 1e-15
    assert flux.sum(axis=(1, 2)) / 2.0 == pytest.approx([0.42576, 0.41404, 1.0], abs=1e-5)


def test_route_by_gamma_meets_its_slices(benchmark):
    rng = np.random.default_rng(2)
    mirror, share, ratio = rng.uniform(0.1, 1.0, (3, 8, 8))
    normal = share * mirror
    middle = normal + ratio * (mirror - normal)
    slices = [normal, middle, mirror]
    for t, expected in zip(benchmark.SLICES, slices, strict=True):
        found, broken = benchmark.routed(slices, t)
        assert broken == 0.0
        assert np.allclose(found, expected, rtol=1e-12)
    # a dip below normal incidence has no exponent
    middle[0, :3] = 0.9 * normal[0, :3]
    found, broken = benchmark.routed(slices, 80.0)
    assert broken == 3.0 / 64.0
    assert np.array_equal(found[0, :3], normal[0, :3])
