"""Fast tables of the symmetric groove: they keep the tolerance of direct evaluation and are exactly reciprocal."""

import json
import math
from functools import cache

import numpy as np
import pytest

from brdftab.errors import ParameterError
from brdftab.materials.fresnel import reflectance
from brdftab.models.resolve import resolve
from brdftab.models.vgroove_sym import chains, kernel, simd_rows
from brdftab.models.vgroove_sym.table import GrooveEvaluator, prepare

DEGREE = math.pi / 180.0
COUNT = 300
SURFACES = {"mirror": {"material": "mirror"}, "gold": {"material": "Au"}, "glass": {"ior": 1.5}}
# values below this are at the end of float64's range
FAINT = 1e-290


@cache
def directions():
    """Pairs of directions (3, N): random, the nodes of a table, next to mirror and retro direction, grazing."""
    rng = np.random.default_rng(7)

    def uniform(low, high):
        return rng.uniform(low, high, COUNT)

    near = uniform(2.0, 87.0)
    close = uniform(5.0, 85.0)
    retro = uniform(2.0, 87.0)
    step = rng.choice([-1.0, 0.0, 1.0], COUNT)
    sets = [
        (np.degrees(np.arccos(uniform(0, 1))), np.degrees(np.arccos(uniform(0, 1))), uniform(0, 180)),
        tuple(np.floor(uniform(0, n)) + 0.5 for n in (90, 90, 180)),
        (near, near + step, np.full(COUNT, 179.5)),
        (close, close + 10.0 ** uniform(-2, 0), 180.0 - 10.0 ** uniform(-2, 0)),
        (retro, np.abs(retro + step), np.full(COUNT, 0.5)),
        (uniform(85, 89.9), uniform(0, 89.9), uniform(0, 180)),
    ]
    return np.concatenate(sets, axis=1) * DEGREE


@cache
def exact_values(parameters):
    """Return what direct evaluation gives at `directions`; parameters as JSON, since several tolerances ask for it."""
    theta_i, theta_o, phi = directions()
    setup = resolve("vgroove-sym", **json.loads(parameters))
    return kernel.points(setup, theta_i, theta_o, phi, 0.0 * phi, orders=0, tolerance=1e-9)[:, 0]


def errors(setup, tolerance):
    """Largest difference of a channel against the largest channel, where that is not at the end of float64's range."""
    theta_i, theta_o, phi = directions()
    fast = prepare(setup, tolerance)
    assert isinstance(fast, GrooveEvaluator)
    found = fast.points(theta_i, theta_o, phi, 0.0 * phi)[:, 0]
    exact = exact_values(json.dumps(setup.parameters))
    assert np.isfinite(found).all()
    size = exact.max(axis=1)
    assert (found[size <= FAINT] <= 2.0 * FAINT).all()
    seen = size > FAINT
    return np.abs(found - exact).max(axis=1)[seen] / size[seen]


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-5])
@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize("ndf", ["beckmann", "ggx", "phong"])
def test_tolerance_is_kept(ndf, surface, tolerance):
    for alpha in (0.1, 0.3, 1.0):
        setup = resolve("vgroove-sym", ndf=ndf, alpha=alpha, **SURFACES[surface])
        assert errors(setup, tolerance).max() <= tolerance, alpha


@pytest.mark.parametrize("alpha", [1e-3, 0.1, 0.3, 1.0])
def test_beckmann_of_mirrors_is_exact(alpha):
    # measured 4e-8 at worst, close to the mirror direction, where terms far below the first order are left out
    assert errors(resolve("vgroove-sym", ndf="beckmann", alpha=alpha, material="mirror"), 1e-5).max() <= 2e-7


@pytest.mark.parametrize("max_bounces", [1, 2, 3, 6, 25, 60])
@pytest.mark.parametrize("surface", ["mirror", "gold"])
def test_cap_is_kept(surface, max_bounces):
    setup = resolve("vgroove-sym", ndf="ggx", alpha=0.6, max_bounces=max_bounces, **SURFACES[surface])
    assert errors(setup, 1e-4).max() <= 1e-4


@pytest.mark.parametrize(
    "given",
    [
        {"material": "Ag"},
        {"material": "Al"},
        {"material": "Cu2O"},
        {"f0": 0.04},
        {"f0": 1.0},
        {"ior": 1.05},
        {"eta": [0.2, 0.4, 1.4], "k": [4.0, 3.0, 2.0]},
        {"material": "Au", "wavelengths": list(range(400, 701, 20))},
    ],
)
def test_other_reflectances(given):
    setup = resolve("vgroove-sym", ndf="ggx", alpha=0.5, **given)
    assert errors(setup, 1e-3).max() <= 1e-3


@pytest.mark.parametrize("ndf", ["beckmann", "ggx"])
@pytest.mark.parametrize("alpha", [1e-4, 2.0, 10.0])
def test_extreme_roughness(ndf, alpha):
    for surface in ("mirror", "gold"):
        assert errors(resolve("vgroove-sym", ndf=ndf, alpha=alpha, **SURFACES[surface]), 1e-3).max() <= 1e-3


AXIS = (np.arange(12) + 0.5) * 7.5 * DEGREE
AZIMUTHS = (np.arange(200) + 0.5) * 0.9 * DEGREE


def filled(setup, theta_i, theta_o, square, dtype=np.float64):
    out = np.full((theta_i.size, theta_o.size, AZIMUTHS.size, len(setup.channels)), np.nan, dtype)
    prepare(setup, 1e-4).fill(theta_i, theta_o, AZIMUTHS, square, out[None])
    return out


@pytest.mark.parametrize("surface", ["mirror", "gold"])
def test_square_tables_are_exactly_reciprocal(surface):
    setup = resolve("vgroove-sym", ndf="ggx", alpha=0.3, **SURFACES[surface])
    table = filled(setup, AXIS, AXIS, True)
    assert np.isfinite(table).all()
    assert np.array_equal(table, table.swapaxes(0, 1))
    # the other triangle, computed by itself, differs by rounding alone
    assert np.allclose(filled(setup, AXIS, AXIS, False), table, rtol=1e-12, atol=0.0)


def test_tables_are_the_points():
    setup = resolve("vgroove-sym", ndf="ggx", alpha=0.3, material="Au")
    table = filled(setup, AXIS, AXIS[:5], False)
    i, o, p = (x.ravel() for x in np.meshgrid(AXIS, AXIS[:5], AZIMUTHS, indexing="ij"))
    points = prepare(setup, 1e-4).points(i, o, p, 0.0 * p)
    assert points.shape == (i.size, 1, 3)
    # which terms a chunk leaves to its neighbours in a batch does not matter: rounding alone
    assert np.allclose(table.reshape(-1, 3), points[:, 0], rtol=1e-12, atol=0.0)


def test_single_precision_is_a_cast():
    setup = resolve("vgroove-sym", ndf="beckmann", alpha=0.5, material="Au")
    single = filled(setup, AXIS, AXIS, True, np.float32)
    assert np.array_equal(single, filled(setup, AXIS, AXIS, True).astype(np.float32))


@pytest.mark.parametrize("surface", ["mirror", "gold"])
def test_nothing_at_and_below_the_horizon(surface):
    setup = resolve("vgroove-sym", ndf="ggx", alpha=0.5, **SURFACES[surface])
    axis = np.array([0.0, 30.0, 60.0, 90.0]) * DEGREE
    table = filled(setup, axis, axis, True)
    assert (table[:, 3] == 0.0).all()
    assert (table[3] == 0.0).all()
    assert (table[:3, :3] > 0.0).all()
    below = np.array([100.0, 30.0]) * DEGREE
    assert (prepare(setup, 1e-4).points(below, below[::-1], below, below) == 0.0).all()


def test_direct_evaluation_where_it_must_be():
    gold = resolve("vgroove-sym", ndf="ggx", alpha=0.3, material="Au")
    assert prepare(gold, 1e-6) is None
    assert prepare(resolve("vgroove-sym", ndf="ggx", alpha_x=0.2, alpha_y=0.4, material="Au"), 1e-3) is None
    assert prepare(resolve("vgroove-sym", ndf="phong", alpha=1.2, material="mirror"), 1e-3) is None
    # log F of aluminium turns too sharply near grazing for its polynomial
    assert prepare(resolve("vgroove-sym", ndf="ggx", alpha=0.3, material="Al"), 1e-4) is None
    with pytest.raises(ParameterError):
        resolve("vgroove-sym", ndf="ggx", alpha=-1.0)


def test_pieces():
    x = -np.concatenate([np.linspace(0.0, 5.0, 50), np.linspace(5.0, 700.0, 50)])
    assert np.allclose([simd_rows.small_exp(v) for v in x], np.exp(x), rtol=2e-11, atol=0.0)
    angle = np.linspace(-1.5707, 1.5707, 101)
    found = [simd_rows.angle(math.sin(t), math.cos(t)) for t in angle]
    # the series' remainder at 90 degrees is 4e-13
    assert np.allclose(found, angle, rtol=0.0, atol=1e-12)
    gold = resolve("vgroove-sym", material="Au").fresnel
    cosine = np.linspace(0.0, 1.0, 333)
    rows = chains.log_polynomial(gold, 1e-5)
    assert rows.shape == (gold.a.size, chains.DEGREE)
    series = cosine[:, None] ** np.arange(1, chains.DEGREE + 1) @ rows.T
    # measured 8e-7
    assert np.allclose(np.exp(series), reflectance(gold, cosine), rtol=2e-6, atol=0.0)
    assert chains.log_polynomial(gold, 1e-9) is None
