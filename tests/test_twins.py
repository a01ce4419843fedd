"""The JAX twins beside the compiled kernels: same values, derivatives of the same function, finite everywhere."""

import ast
import math
import subprocess
import sys
from functools import partial
from pathlib import Path

import jax
import numba
import numpy as np
import pytest
import sweep

import brdftab
from brdftab import models
from brdftab.errors import ParameterError
from brdftab.models import twins
from brdftab.models._shared.facets import masking as compiled_masking
from brdftab.models._shared.facets import ndf as compiled_ndf
from brdftab.models._shared.facets.frame import groove_plane
from brdftab.models._shared.fresnel import fresnel as compiled_fresnel
from brdftab.models._shared.twin import frame, fresnel, masking, ndf
from brdftab.models._shared.twin.static import WEIGHTS
from brdftab.models.resolve import resolve

PACKAGE = Path(brdftab.__file__).parent
TWINNED = [n for n in models.names() if models.has_twin(n)]
# sums over bounces take long to compile: few variants here, the rest and all derivatives in test_vgroove_twins.py
BOUNCING = {name for name in TWINNED if models.spec(name).has("max_bounces")}


def chosen(name, pairs):
    """Return the variants of a model that this module tests."""
    found = sweep.variants(name, pairs=pairs and name not in BOUNCING)
    return [v for v in found if name not in BOUNCING or dict(v.given)["max_bounces"] is not None]


# of twins that solve, whose values test_smith_twin.py compares, only the interface is tested here
SUMMED = [name for name in TWINNED if name not in sweep.SOLVED]
VARIANTS = [pytest.param(v, id=str(v)) for name in SUMMED for v in chosen(name, True)]
# a derivative takes longest to compile
FEWER = [pytest.param(v, id=str(v)) for name in TWINNED if name not in BOUNCING for v in chosen(name, False)]
TOLERANCE = 1e-9
# of models that sum as many nodes as the tolerance asks for: few nodes are the same sum as many
NODES_TOLERANCE = 1e-2
# measured 3.7e-12: Beckmann's exp(-e) with e up to 700 carries e times the rounding of e
PARITY = 1e-11
# grazing V-grooves: 1 - share and pi/2 - angle cancel in kernel and twin alike; measured 7e-8, at one value in 100
GRAZING, USUAL = 1e-7, 0.98
# below this, exp underflows or the sums of wavelengths cancel to it
FLOOR = 1e-250
# derivatives: multiples of the differences' own error estimate, and of (|f'| + |f|/x); measured 0.1 of both together
SPREADS, GRADIENT = 10.0, 1e-9


@pytest.fixture(autouse=True, scope="module")
def _cheap():
    """Compile quickly (many variants, few values) and keep the kernels on one thread."""
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    jax.config.update("jax_disable_most_optimizations", True)
    yield
    jax.config.update("jax_disable_most_optimizations", False)
    numba.set_num_threads(threads)


def tolerance_of(setup):
    """Return the tolerance at which a model's twin and kernel are compared."""
    coarse = sweep.has_nodes(setup.model.name) or setup.model.name in sweep.SOLVED
    return NODES_TOLERANCE if coarse else TOLERANCE


def numbers(setup):
    """Return the names that a twin can be differentiated by and how many entries each has."""
    _, params = twins.split(setup, TOLERANCE)
    return {k: v.size for k, v in params.items() if k != WEIGHTS and not (k == "alpha_y" and setup.isotropic)}


# ---------------------------------------------------------------- all models


def test_fitted_models_have_twins():
    fitted = {"lambert", "oren-nayar", "cook-torrance", "smith", "smith-multi", "ilm", "ilm-approx"}
    fitted |= {"vgroove-sym", "vgroove-nonsym"}
    assert fitted <= set(TWINNED)


@pytest.mark.parametrize("variant", VARIANTS)
def test_values_equal_the_kernels(variant):
    rng = sweep.seeded(variant)
    lit = 0
    for setup, _ in sweep.setups(variant):
        angles = sweep.directions(setup, rng)
        tolerance = tolerance_of(setup)
        mine, theirs = twins.evaluate(setup, *angles, tolerance), sweep.kernel_values(setup, angles, tolerance)
        assert mine.shape == theirs.shape
        assert np.isfinite(mine).all()
        worst = np.abs(mine - theirs) / (np.abs(theirs) + FLOOR)
        bouncing = setup.model.name in BOUNCING
        assert worst.max() <= (GRAZING if bouncing else PARITY), (setup.parameters, worst.max())
        assert np.mean(worst <= PARITY) >= (USUAL if bouncing else 1.0), setup.parameters
        below = np.minimum(np.cos(angles[0]), np.cos(angles[1])) < 1e-15
        assert below.sum() >= 5
        assert not mine[below].any()
        lit += np.count_nonzero(theirs > 0.0) / theirs.size
    # kd = 0 and highlights of alpha = 1e-4 are dark; the sweep as a whole is not
    assert lit > 4.0


@pytest.mark.parametrize("variant", FEWER)
def test_derivatives_equal_differences_of_the_kernels(variant):
    rng = sweep.seeded(variant)
    settled = []
    for setup, is_corner in sweep.setups(variant, interior=4):
        angles = sweep.directions(setup, rng)
        below = np.minimum(np.cos(angles[0]), np.cos(angles[1])) < 1e-15
        tolerance = tolerance_of(setup)
        for name, size in numbers(setup).items():
            channel = int(rng.integers(size))
            slope = twins.derivative(setup, name, *angles, tolerance, channel=channel)
            assert np.isfinite(slope).all(), (name, setup.parameters)
            assert not slope[below].any()
            if is_corner:
                continue
            # nodes that cross a kink with the roughness bend the sum: a short reach meets few of them
            kinked = sweep.has_nodes(setup.model.name)
            reach = 1e-3 if kinked else 0.02
            expected, spread, _ = sweep.differences(setup, name, channel, angles, tolerance, reach)
            value = np.abs(sweep.kernel_values(setup, angles, tolerance))
            scale = np.abs(expected) + value / abs(sweep.entry(setup, name, channel)) + FLOOR
            wrong = np.abs(slope - expected) / (SPREADS * spread + GRADIENT * scale)
            share = (wrong <= 1.0).mean()
            assert share >= (0.98 if kinked else 1.0), (name, channel, setup.parameters, wrong.max(), share)
            settled.append(np.mean(spread <= 1e-7 * scale))
    # the differences themselves are good, but for kinks, cut-offs and the far flank of narrow highlights
    if settled:
        assert np.mean(settled) > 0.9
    else:
        assert variant.free == ()


@pytest.mark.parametrize("name", TWINNED)
def test_twin_says_what_its_shapes_depend_on(name):
    module = models.twin(name)
    variant = sweep.variants(name)[0]
    setup, _ = sweep.setups(variant)[-1]
    static, params = twins.split(setup, TOLERANCE)
    assert hash(static) == hash(twins.split(setup, TOLERANCE)[0])
    assert module.__doc__
    shared = {k: v[0] for k, v in params.items() if k != WEIGHTS}
    d = frame.directions(*sweep.directions(setup, np.random.default_rng(1)))
    shapes = jax.eval_shape(lambda p: module.shapes(static, p, d), shared)
    assert all(s.shape == d.phi.shape for s in shapes)

    # what is not named has no influence on the shapes, and shapes and value need nothing else
    needed = {k: shared[k] for k in module.SHAPE_PARAMS if k in shared}
    assert jax.eval_shape(lambda p: module.shapes(static, p, d), needed) == shapes


@pytest.mark.parametrize("name", TWINNED)
def test_full_optimisation_gives_the_same_values(name):
    setup = resolve(name)
    angles = sweep.directions(setup, np.random.default_rng(5))
    plain = twins.evaluate(setup, *angles, tolerance_of(setup))
    jax.config.update("jax_disable_most_optimizations", False)
    try:
        angles = [np.append(a, a[:1]) for a in angles]
        optimised = twins.evaluate(setup, *angles, tolerance_of(setup))[:-1]
    finally:
        jax.config.update("jax_disable_most_optimizations", True)
    # measured 2e-13, from fused exponentials
    assert np.allclose(optimised, plain, rtol=1e-11, atol=FLOOR)


# ---------------------------------------------------------------- the shared pieces


def grid(*axes):
    return [a.reshape(-1) for a in np.meshgrid(*(np.asarray(a, dtype=np.float64) for a in axes), indexing="ij")]


def slopes(function, *arguments):
    """Return the derivatives of an elementwise function by each of its arguments."""

    @jax.jit
    def along(tangents):
        return jax.jvp(function, arguments, tangents)[1]

    ones, zeros = np.ones_like(arguments[0]), np.zeros_like(arguments[0])
    count = range(len(arguments))
    return [np.asarray(along(tuple(ones if n == m else zeros for m in count))) for n in count]


def compare(mine, kernel, *columns, rtol=1e-12, atol=0.0):
    """Compare a twin's function on arrays with the kernel's, called on each row."""
    theirs = np.array([kernel(*row) for row in zip(*(c.tolist() for c in columns), strict=True)])
    assert np.isfinite(theirs).all()
    assert np.allclose(np.asarray(mine).T, theirs, rtol=rtol, atol=atol)


def test_groove_plane_equals_the_kernels():
    ti, to, ph = grid([0.0, 1e-9, 0.3, 1.1, 1.57], [0.0, 0.3, 0.3 + 1e-10, 1.57], [0.0, 1.0, 3.0, math.pi])
    d = frame.directions(ti, to, ph, 0.0)
    # in-plane sines near 0 are differences of sums of order 1
    compare(np.stack(jax.jit(frame.groove_plane)(d)), groove_plane, *d[4:11], atol=1e-15)


@pytest.mark.parametrize("code", [0, 1, 2])
def test_distributions_equal_the_kernels(code):
    shape, tilt = grid(
        [1e-4, 0.3, 10.0] if code != 2 else [-1.98, 0.5, 40.0, 2e8], [0.0, 1e-4, 0.4, 0.6, 1.2, 1.57, 2.0]
    )
    c, s = np.cos(tilt), np.sin(tilt)
    codes = np.full(c.size, code)
    mine = jax.jit(partial(ndf.density, code))(shape, c, s)
    compare(mine, compiled_ndf.density, codes, shape, c, s, rtol=1e-11, atol=1e-290)
    assert all(np.isfinite(slope).all() for slope in slopes(partial(ndf.density, code), shape, c, s))
    kept = shape > -1.0
    norm = jax.jit(partial(ndf.opposite_norm, code))(shape[kept])
    compare(norm, compiled_ndf.opposite_norm, codes[kept], shape[kept])
    assert np.isfinite(slopes(partial(ndf.opposite_norm, code), shape[kept])[0]).all()


@pytest.mark.parametrize("walter", [False, True])
@pytest.mark.parametrize("code", [0, 1])
def test_lambda_equals_the_kernels_and_has_finite_derivatives(code, walter):
    alpha, tangent = grid([1e-4, 0.1, 0.625, 1.0, 10.0], [0.0, 1e-300, 1e-9, 0.3846, 0.4, 1.0, 6.0, 600.0, 1e15])
    columns = (np.full(alpha.size, code), alpha, tangent, np.full(alpha.size, walter))

    def mine(x):
        return masking.smith_lambda(code, x, tangent, walter)

    # Lambda is the difference of two terms of order 1/x exp(-1/x^2)
    compare(jax.jit(mine)(alpha), compiled_masking.smith_lambda, *columns, atol=1e-15)
    (slope,) = slopes(mine, alpha)
    assert np.isfinite(slope).all()
    assert not slope[tangent == 0.0].any()


@pytest.mark.parametrize(
    ("kind", "a", "b"),
    [
        (0, [1.0], [0.0]),
        (1, [1e-6, 0.3, 1.0, 1e4], [0.0, 1e-9, 1e-3, 3.0, 1e4]),
        (2, [1.0, 1.0 + 1e-12, 1.5, 1e4], [0.0]),
        (3, [0.0, 0.04, 1.0], [0.0]),
        (4, [0.1, 0.5], [0.0, 3.0]),
    ],
)
def test_reflectance_equals_the_kernels_and_has_finite_derivatives(kind, a, b):
    n, k, c = grid(a, b, [-0.1, 0.0, 0.1, 0.5, 0.9, 1.0, 1.1])
    # an interface that is not there is 0/0 for the kernel at grazing, which no direction above the horizon reaches
    n, k, c = np.stack([n, k, c])[:, (kind != 1) | (n != 1.0) | (k > 0.0) | (c > 0.0)]
    columns = (np.full(n.size, kind), n, k, c)
    # where F vanishes (n = 1, k -> 0), the kernel subtracts numbers of order 1
    atol = 1e-15 if kind == 1 else 0.0
    mine = jax.jit(partial(fresnel.reflectance, kind))(n, k, c)
    compare(mine, compiled_fresnel.reflectance, *columns, rtol=1e-11, atol=atol)
    for slope in slopes(partial(fresnel.reflectance, kind), *grid(a, b, [-0.1, 0.0, 1e-9, 0.1, 0.5, 0.9, 1.0, 1.1])):
        assert np.isfinite(slope).all()


def test_reflectance_of_a_conductor_is_exact_at_the_ends():
    # total reflection at grazing, nothing from an index of 1, ((1 - n)/(1 + n))^2 = 1 - 4 n + 8 n^2 at normal incidence
    n, c = np.array([1e-6, 0.3, 1.0, 1.0, 1.0, 1e-6]), np.array([0.0, 0.0, 0.0, 1e-9, 1e-4, 1.0])
    found = jax.jit(partial(fresnel.reflectance, 1))(n, np.zeros(6), c)
    assert np.allclose(found, [1.0, 1.0, 0.0, 0.0, 0.0, 1.0 - 4e-6 + 8e-12], rtol=1e-15, atol=0.0)


def test_total_reflection_has_a_slope_at_vanishing_absorption():
    # for n < sin and small k, 1 - F is linear in k: its slope there is the limit of the slopes beside it
    n, k, c = np.full(2, 0.5), np.array([0.0, 1e-9]), np.full(2, 0.4)
    _, at_zero, _ = slopes(partial(fresnel.reflectance, 1), n, k, c)
    assert at_zero[0] < -0.1
    assert at_zero[0] == pytest.approx(at_zero[1], rel=1e-7)


def test_index_one_reflects_nothing_and_is_stationary():
    n, c = np.ones(3), np.array([0.0, 0.3, 1.0])
    assert not np.asarray(jax.jit(partial(fresnel.reflectance, 2, b=None))(n, cosine=c)).any()
    assert not np.asarray(slopes(lambda x, y: fresnel.reflectance(2, x, None, y), n, c)[0]).any()


# ---------------------------------------------------------------- the interface


def test_split_tells_choices_from_numbers():
    static, params = twins.split(resolve("smith", material="Cu", alpha_x=0.1, alpha_y=0.3), 1e-6)
    assert (static.model, static.fresnel, static.isotropic, static.tolerance) == ("smith", 1, False, 1e-6)
    assert static.option("masking") == "height-correlated"
    assert params[WEIGHTS].shape == (params["a"].size, 3)
    assert (params["alpha_x"].tolist(), params["alpha_y"].tolist()) == ([0.1], [0.3])
    static, params = twins.split(resolve("oren-nayar", kd=[0.1, 0.2, 0.3]))
    assert {k: v.shape for k, v in params.items()} == {"kd": (3,), "sigma": (1,)}
    assert (static.fresnel, static.ndf) == (-1, -1)
    # with wavelengths as channels nothing is projected
    _, params = twins.split(resolve("smith", material="Cu", wavelengths=[450.0, 550.0]))
    assert params["a"].shape == (2,)
    assert WEIGHTS not in params


def test_derivative_names_what_can_be_asked():
    setup = resolve("smith", ior=1.5)
    with pytest.raises(ParameterError, match="kd is not a number of smith here; choose one of alpha_x, alpha_y, a"):
        twins.derivative(setup, "kd", 0.1, 0.2, 0.3, 0.0)
    with pytest.raises(ParameterError, match=r"channel = 1 is outside \[0, 0\]; a has 1 entries"):
        twins.derivative(setup, "a", 0.1, 0.2, 0.3, 0.0, channel=1)


def test_all_channels_move_together_by_default():
    setup = resolve("lambert", kd=[0.1, 0.2, 0.3])
    assert np.allclose(twins.derivative(setup, "kd", 0.1, 0.2, 0.3, 0.0), 1.0 / math.pi)
    assert np.allclose(twins.derivative(setup, "kd", 0.1, 0.2, 0.3, 0.0, channel=1), [0.0, 1.0 / math.pi, 0.0])


def test_model_without_a_twin_is_named(monkeypatch):
    monkeypatch.setattr(models, "has", lambda name, part: name == "smith")
    with pytest.raises(ParameterError, match=r"lambert has no twin in JAX; choose one of smith$"):
        models.twin("lambert")
    with pytest.raises(ParameterError, match="model = nonsense is not known"):
        models.twin("nonsense")


# ---------------------------------------------------------------- who loads JAX


def loaded(code):
    """Return the top-level modules that a fresh process holds after running `code`."""
    code += "\nimport sys\nprint(*{name.split('.')[0] for name in sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_evaluation_loads_no_jax():
    found = loaded("import brdftab\nbrdftab.evaluate('lambert', 0.1, 0.2, 0.3)\nbrdftab.tabulate('lambert', '2x2x2')")
    assert "numba" in found
    assert not {"jax", "jaxlib", "optimistix", "equinox"} & found


def test_a_twin_needs_no_numba():
    found = loaded(
        "from brdftab.models import twins\nfrom brdftab.models.resolve import resolve\n"
        "twins.evaluate(resolve('lambert'), 0.1, 0.2, 0.3, 0.0)"
    )
    assert "jax" in found
    assert "numba" not in found


def test_twins_and_fits_alone_import_jax():
    allowed = ("models/_shared/twin/", "fit", "validate/condition")
    wrong = []
    for path in sorted(PACKAGE.rglob("*.py")):
        name = path.relative_to(PACKAGE).as_posix()
        if name.startswith(allowed) or path.stem.startswith("twin") or path.parent.name == "twin":
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            found = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            found += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            wrong += [f"{name} imports {n}" for n in found if n.split(".")[0] in {"jax", "optimistix", "equinox"}]
    assert not wrong
