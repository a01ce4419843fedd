"""The approximate body of interfaced Lambertian facets: limits, error, the written map, the shader."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

import brdftab
from brdftab import models
from brdftab.errors import ParameterError
from brdftab.models.ilm_approx import error_map, fit_coefficients, glsl
from brdftab.models.ilm_approx.approximation import body
from brdftab.models.ilm_approx.coefficients import COSINE, LAMBERT
from brdftab.models.microfacet.interface import external_reflectance

ROOT = Path(__file__).resolve().parents[1]
rng = np.random.default_rng(5)
COUNT = 200
ANGLES = rng.uniform(0.0, 1.57, COUNT), rng.uniform(0.0, 1.57, COUNT), rng.uniform(-4.0, 4.0, COUNT)


def parts(name, angles, **given):
    return brdftab.evaluate(name, *angles, components=True, tolerance=1e-4, **given)


@pytest.mark.parametrize("n", [1.0, 1.2, 1.5, 3.0])
def test_flat_surface_is_exact(n):
    given = {"sigma": 0.0, "ior": n, "kd": [0.2, 0.6, 1.0]}
    assert np.allclose(parts("ilm-approx", ANGLES, **given)["body"], parts("ilm", ANGLES, **given)["body"], rtol=1e-14)


def test_small_roughness_is_continuous():
    flat, rough = (parts("ilm-approx", ANGLES, sigma=s, kd=0.5)["body"] for s in (0.0, 1e-9))
    # x = sigma tan(theta) reaches 4e-7 here
    assert np.allclose(rough, flat, rtol=1e-5)


def test_specular_part_is_that_of_ilm():
    given = {"sigma": 0.4, "ior": [1.2, 1.5, 2.0], "kd": 0.0}
    approximate, exact = parts("ilm-approx", ANGLES, **given), parts("ilm", ANGLES, **given)
    assert np.allclose(approximate["specular"], exact["specular"], rtol=1e-12)
    assert not approximate["body"].any()


@pytest.mark.parametrize("sigma", [0.0, 0.1, 2.0])
def test_reciprocity_is_exact(sigma):
    theta_i, theta_o, phi = ANGLES
    there = brdftab.evaluate("ilm-approx", theta_i, theta_o, phi, sigma=sigma)
    assert np.array_equal(there, brdftab.evaluate("ilm-approx", theta_o, theta_i, -phi, sigma=sigma))


def test_without_interface_only_the_lambertian_factor_is_left():
    ti, to, phi = ANGLES
    found = parts("ilm-approx", ANGLES, ior=1.0, sigma=0.5, kd=1.0)["body"][:, 0]
    x, z = (0.5 * np.sin(t) / (np.cos(t) + 0.5 * np.sin(t)) for t in (ti, to))
    y, c = 0.25 / 1.25, np.cos(phi)
    log = sum(
        v * c**m * y**k * (x**p * z**q + (x**q * z**p if p != q else 0.0)) for p, q, m, k, v in LAMBERT
    )  # fmt: skip
    assert np.allclose(found, np.exp(log) / math.pi, rtol=1e-12)


@pytest.mark.parametrize(
    ("sigma", "rms", "largest"), [(0.1, 0.005, 0.03), (0.3, 0.012, 0.12), (1.0, 0.05, 0.5), (2.0, 0.08, 1.0)]
)
def test_error_below_75_degrees(sigma, rms, largest):
    angles = error_map.grid()
    kept = tuple(a[angles[0] <= math.radians(75.1)][::3] for a in angles)
    for n in (1.0, 1.5, 3.0):
        error = error_map.relative_errors(sigma, n, kept)
        assert math.sqrt(np.mean(error**2)) < rms
        assert np.abs(error).max() < largest


def test_written_map_is_what_the_script_finds():
    text = (ROOT / "docs" / "ilm-approx.md").read_text()
    assert text.startswith(error_map.HEAD)
    rows = [line.split("|")[1:-1] for line in text.splitlines() if re.match(r"\| [0-9.]+ \|", line)]
    assert len(rows) == len(error_map.RANGES) * len(error_map.SIGMAS)
    found = error_map.table((0.3,), (1.5,))
    column, row = 1 + error_map.INDICES.index(1.5), error_map.SIGMAS.index(0.3)
    for r in range(len(error_map.RANGES)):
        written = [float(v) for v in rows[r * len(error_map.SIGMAS) + row][column].split("/")]
        # two digits are written
        assert np.allclose(written, 100.0 * found[r, 0, 0], rtol=0.06)


def test_fit_is_reproducible(monkeypatch):
    # a tenth of the data: the same polynomial to within what its own error allows
    monkeypatch.setattr(fit_coefficients, "PAIRS", 60)
    data = fit_coefficients.Data((1.0,), 1, fit_coefficients.SIGMAS[::2])
    again = fit_coefficients.fit_lambert(data)
    written = np.array([row[4] for row in LAMBERT])
    assert [row[:4] for row in LAMBERT] == fit_coefficients.lambert_terms()
    assert [row[:4] for row in COSINE] == fit_coefficients.cosine_terms()
    low = data.steepest < fit_coefficients.STEEP
    ours, theirs = (fit_coefficients.log_lambert(data, c)[low] for c in (again, written))
    # measured: 0.008
    assert math.sqrt(np.mean((ours - theirs) ** 2)) < 0.02
    text = fit_coefficients.source(written, np.array([row[4] for row in COSINE]))
    package = Path(fit_coefficients.__file__).with_name("coefficients.py")
    assert text == package.read_text()


# ---------------------------------------------------------------- the shader


def python_of(name, text):
    """Translate one scalar GLSL function into Python: its statements differ by types and semicolons only."""
    found = re.search(rf"float {name}\((.*?)\) \{{\n(.*?)\n\}}", text, re.DOTALL)
    arguments = ", ".join(a.split()[-1] for a in found.group(1).split(","))
    lines = [re.sub(r"^float ", "", line.strip()).rstrip(";") for line in found.group(2).splitlines()]
    return f"def {name}({arguments}):\n" + "".join(f"    {line}\n" for line in lines)


def shader():
    """Return the namespace of the translated functions."""
    text = glsl.source()
    space = {"sqrt": math.sqrt, "exp": math.exp, "log": math.log, "max": max, "min": min}
    space["ILM_PI"] = float(re.search(r"ILM_PI = ([0-9.]+);", text).group(1))
    for name in ("ilm_transmission", "ilm_external", "ilm_body", "ilm_specular"):
        exec(python_of(name, text), space)
    return space


def test_shader_gives_the_kernels_values():
    space = shader()
    for n in (1.0, 1.001, 1.2, 1.5, 2.0, 3.0):
        # 28 terms leave 2e-9 at n = 3
        assert math.isclose(space["ilm_external"](n), external_reflectance(n), rel_tol=2e-8, abs_tol=1e-15)
    for ti, to, phi in list(zip(*ANGLES, strict=True))[:60]:
        sc = math.sin(ti), math.cos(ti), math.sin(to), math.cos(to), math.cos(phi)
        for sigma, n in ((0.01, 1.0001), (0.3, 1.5), (2.0, 3.0)):
            assert math.isclose(space["ilm_body"](sigma, n, *sc), body(sigma, n, *sc), rel_tol=1e-8)


def test_shader_gives_the_specular_part():
    space = shader()
    ti, to, phi = 0.5, 0.8, 2.7
    i, o = (
        np.array([math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), math.cos(t)]) for t, p in ((ti, 0), (to, phi))
    )
    h = (i + o) / np.linalg.norm(i + o)
    found = space["ilm_specular"](0.3, 1.5, math.cos(ti), math.cos(to), h[2], float(i @ h))
    expected = brdftab.evaluate("ilm-approx", ti, to, phi, sigma=0.3, ior=1.5, kd=0.0)[0]
    # the reflectance is 1 - T there, and pi has 15 digits
    assert math.isclose(found, expected, rel_tol=1e-12)


def test_shader_is_well_formed():
    text = glsl.source()
    assert text.count("{") == text.count("}")
    assert text.count("(") == text.count(")")
    assert text.isascii()
    # numbers of GLSL need a point or an exponent to be floats
    code = re.sub(r"//.*", "", text)
    assert not re.findall(r"(?<![\w.])\d+(?![\w.])", code)
    for name in ("ilm_transmission", "ilm_external", "ilm_body", "ilm_specular", "ilm_approx"):
        assert len(re.findall(rf"(?:float|vec3) {name}\(", text)) == 1


# ---------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ({"ndf": "ggx"}, "ndf = ggx"),
        ({"masking": "smith"}, "masking = smith"),
        ({"sigma": 2.5}, "sigma = 2.5"),
        ({"ior": 4.0}, "ior = 4"),
        ({"sigma_x": 0.2}, "sigma_x"),
        ({"bounces": "2"}, "bounces"),
    ],
)
def test_what_it_cannot_serve_is_refused(given, word):
    with pytest.raises(ParameterError, match=word) as caught:
        brdftab.evaluate("ilm-approx", 0.1, 0.2, 0.3, **given)
    assert "\n" not in str(caught.value)


def test_f0_reaches_as_far_as_ior():
    by_f0, by_ior = (brdftab.evaluate("ilm-approx", 0.3, 0.4, 2.0, **g) for g in ({"f0": 0.25}, {"ior": 3.0}))
    assert np.allclose(by_f0, by_ior, rtol=1e-14)
    assert models.spec("ilm-approx").param("f0").bounds[1] == 0.25
