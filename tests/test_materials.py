"""Materials: indices, projection to sRGB, wavelength quadratures, Fresnel terms."""

from __future__ import annotations

import subprocess
import sys
import warnings

import numpy as np
import pytest

from brdftab.errors import ParameterError
from brdftab.materials import formulas, fresnel, indices, quadrature, spectra

METALS = ["Ag", "Al", "Au", "Cu", "Cu2O", "CuO", "Fe"]


def amplitudes(index: complex | np.ndarray, cos: np.ndarray) -> np.ndarray:
    """Reflectance from the complex amplitudes of s and p light, the textbook way."""
    index = np.asarray(index, dtype=complex)
    inside = np.sqrt(1.0 - (1.0 - cos * cos) / index**2)
    s = (cos - index * inside) / (cos + index * inside)
    p = (index * cos - inside) / (index * cos + inside)
    return 0.5 * (abs(s) ** 2 + abs(p) ** 2)


def normal(name: str) -> np.ndarray:
    """Spectrum at normal incidence on the 5 nm grid."""
    n, k = indices.at(name, spectra.wavelengths())
    return ((n - 1) ** 2 + k**2) / ((n + 1) ** 2 + k**2)


# indices


def test_names_load_no_numpy():
    code = "import sys; from brdftab.materials.indices import names; print(*names()); assert 'numpy' not in sys.modules"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == METALS


@pytest.mark.parametrize("name", METALS)
def test_data_file(name):
    wavelength, n, k = indices.load(name)
    assert wavelength[0] <= 360.0
    assert wavelength[-1] >= 830.0
    assert (np.diff(wavelength) > 0).all()
    assert (n > 0).all()
    assert (k >= 0).all()
    head = indices.header(name)
    assert {"title", "source", "licence", "taken from"} <= set(head)


def test_at_is_linear_and_exact_at_the_data():
    wavelength, n, k = indices.load("Fe")
    assert np.array_equal(indices.at("Fe", wavelength), (n, k))
    # Johnson and Christy 1974: (2.94, 2.99) at 582 nm, (2.88, 3.05) at 617 nm
    assert np.allclose(indices.at("Fe", 599.5), (2.91, 3.02), rtol=1e-14)


@pytest.mark.parametrize("value", [100.0, 5000.0, np.nan, np.inf])
def test_at_refuses_extrapolation(value):
    with pytest.raises(ParameterError, match=r"wavelengths = .* outside the data of Au, 187.9 to 1937 nm; choose"):
        indices.at("Au", [500.0, value])


def test_unknown_metal_lists_the_known_ones():
    with pytest.raises(ParameterError, match="metal = Xx is not known; choose one of Ag, Al, Au, Cu, Cu2O, CuO, Fe"):
        fresnel.metal("Xx")


# projection


def test_white_is_exactly_one():
    # 81 products are added: a few units in the last place
    assert abs(spectra.to_rgb(np.ones(81)) - 1.0).max() <= 1e-15
    assert abs(spectra.weights().sum(axis=0) - 1.0).max() <= 3e-16


@pytest.mark.parametrize("name", METALS)
def test_projection_against_colour_science(name):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # colour-science warns of its optional dependencies
        import colour

        spectrum = colour.SpectralDistribution(dict(zip(spectra.wavelengths(), normal(name), strict=True)))
        observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
        light = colour.SDS_ILLUMINANTS["D65"]
        xyz = colour.sd_to_XYZ(spectrum, observer, light, method="Integration") / 100.0
        expected = colour.XYZ_to_sRGB(xyz, apply_cctf_encoding=False)
    # its matrix is rounded to four digits and its white is (0.3127, 0.3290): 3.7e-4 apart at worst (Ag, blue)
    assert abs(spectra.to_rgb(normal(name)) - expected).max() < 5e-4


def test_gold_at_normal_incidence():
    # 1.038, 0.729, 0.365 by another program from the same data at 10 nm
    rgb = spectra.to_rgb(normal("Au"))
    assert np.allclose(rgb, [1.03758, 0.72834, 0.36460], atol=5e-6)
    n, k = (values @ spectra.weights() for values in indices.at("Au", spectra.wavelengths()))
    averaged = ((n - 1) ** 2 + k**2) / ((n + 1) ** 2 + k**2)
    assert abs(averaged - rgb).max() > 0.01  # averaging n and k first is a different, wrong number


def test_channels_are_not_clamped():
    powers = np.array([normal("Au") ** bounce for bounce in range(1, 9)])
    rgb = spectra.to_rgb(powers)
    assert rgb[0, 0] > 1.0
    assert rgb[-1, 2] < 0.0


def test_projection_refuses_another_length():
    with pytest.raises(ParameterError, match=r"spectrum of shape \(80,\) needs 81 values"):
        spectra.to_rgb(np.ones(80))


# quadrature


@pytest.mark.parametrize("name", METALS)
def test_stated_error_is_reproduced(name):
    errors = []
    for count in quadrature.counts(name):
        rule = quadrature.rule(name, count)
        assert len(rule.wavelengths) == count
        assert abs(rule.weights.sum(axis=0) - 1.0).max() <= 5e-16
        # the file keeps three digits; rounding of the products is 1e-15
        assert quadrature.measure(name, rule.wavelengths, rule.weights) == pytest.approx(
            (rule.single, rule.error), rel=6e-3
        )
        errors.append(rule.error)
    assert quadrature.counts(name) == list(range(3, 11))
    assert errors[-1] < errors[0] / 50
    default = quadrature.rule(name)
    assert default.error <= quadrature.TARGET
    assert len(default.wavelengths) <= 8


@pytest.mark.parametrize("name", METALS)
def test_default_rule_on_independent_products(name):
    random = np.random.default_rng(99)
    cos = random.random((5000, quadrature.BOUNCES))
    used = np.arange(quadrature.BOUNCES) < random.integers(1, quadrature.BOUNCES + 1, (5000, 1))
    term, full = fresnel.metal(name), fresnel.metal(name, samples=81)
    product = [
        np.where(used[..., None], fresnel.reflectance(f, cos), 1.0).prod(axis=1) @ f.weights for f in (term, full)
    ]
    gap = abs(product[0] - product[1]).max(axis=1) / product[1].max(axis=1)
    # a measured maximum: other random products exceeded it by up to 10 % (CuO)
    assert gap.max() <= 1.15 * term.spectral_error
    assert full.spectral_error == 0.0


def test_quadrature_refuses_a_count_without_rule():
    with pytest.raises(ParameterError, match=r"samples = 2 is outside 3 to 10 \(or 81\) for Au; choose"):
        fresnel.metal("Au", samples=2)


def test_uniform_alternative_keeps_white():
    nodes, weights = quadrature.uniform(16)
    assert nodes.shape == (16,)
    assert abs(weights.sum(axis=0) - 1.0).max() <= 5e-16


def test_report_marks_one_default_a_metal(monkeypatch):
    monkeypatch.setattr(quadrature, "measure", lambda *rule: (1e-6, 1e-5))  # the true one is tested above
    lines = list(quadrature.report())
    assert "".join(lines).count("*") == len(METALS)
    assert lines[0] == "| N | " + " | ".join(METALS) + " |"


# Fresnel terms

COS = np.concatenate([np.linspace(0.0, 1.0, 401), [1e-12, 1e-6, 1 - 1e-9]])


@pytest.mark.parametrize("index", [0.05 + 4j, 0.2 + 3j, 2.91 + 3.09j, 1.5 + 0.1j, 3.0 + 0j, 1.0 + 1e-3j, 0.5 + 1e-6j])
def test_conductor_against_amplitudes(index):
    exact = amplitudes(index, COS)
    assert abs(formulas.conductor(index.real, index.imag, COS) - exact).max() < 2e-14


@pytest.mark.parametrize("ior", [1.0, 1.0001, 1.33, 1.5, 2.4, 10.0])
def test_dielectric(ior):
    values = formulas.dielectric(ior, COS)
    if ior > 1:
        # near ior = 1 the amplitudes themselves cancel: 6e-14
        assert abs(values - amplitudes(ior, COS)).max() < 1e-13
    # a conductor that does not absorb is a dielectric
    assert abs(formulas.conductor(ior, 0.0, COS) - values).max() < 2e-14
    assert formulas.dielectric(ior, 1.0) == pytest.approx(((ior - 1) / (ior + 1)) ** 2, rel=1e-13, abs=1e-300)


def test_normal_and_grazing_incidence():
    n, k = np.array([0.05, 0.2, 1.4, 2.91]), np.array([4.2, 3.0, 1.6, 3.09])
    assert np.allclose(formulas.conductor(n, k, 1.0), ((n - 1) ** 2 + k**2) / ((n + 1) ** 2 + k**2), rtol=1e-14)
    assert np.array_equal(formulas.conductor(n, k, 0.0), np.ones(4))
    assert formulas.dielectric(1.5, 0.0) == pytest.approx(1.0, abs=1e-15)
    assert formulas.schlick(0.3, 0.0) == 1.0
    assert formulas.schlick(0.3, 1.0) == 0.3


# root mean square over the cosine: Schlick's error, and what the dip's term leaves of it
DIPS = {(2.91, 3.09): (0.0843, 0.0070), (1.558, 7.712): (0.0580, 0.0086), (0.1556, 3.6025): (0.0088, 0.0028)}


@pytest.mark.parametrize("index", DIPS)
def test_lazanyi_follows_the_dip_of_metals(index):
    cos = (np.arange(4000) + 0.5) / 4000
    exact, cheap = (fresnel.reflectance(term(*index), cos)[:, 0] for term in (fresnel.conductor, fresnel.lazanyi))
    f0 = formulas.conductor(*index, 1.0)
    errors = [np.sqrt(np.mean((f - exact) ** 2)) for f in (formulas.schlick(f0, cos), cheap)]
    assert errors == pytest.approx(DIPS[index], rel=0.02)
    # the formula as printed, with n and k in place of f0
    n, k = index
    dip = formulas.lazanyi_dip(n, k)
    printed = ((n - 1) ** 2 + k * k + 4 * n * (1 - cos) ** 5) / ((n + 1) ** 2 + k * k) - dip * cos * (1 - cos) ** 6
    assert np.allclose(cheap, printed, rtol=1e-13)


def test_approximations_keep_wavelengths_and_projection():
    gold = fresnel.metal("Au")
    for how, kind in (("schlick", fresnel.SCHLICK), ("lazanyi", fresnel.LAZANYI)):
        term = fresnel.approximated(gold, how)
        assert (term.kind, term.channels, term.wavelengths) == (kind, gold.channels, gold.wavelengths)
        assert np.allclose(fresnel.reflectance(term, 1.0), fresnel.reflectance(gold, 1.0), rtol=1e-14)
    assert fresnel.approximated(gold, "exact") is gold
    assert fresnel.approximated(fresnel.mirror(), "schlick").kind == fresnel.MIRROR
    glass = fresnel.approximated(fresnel.dielectric(1.5), "schlick")
    assert glass.a[0] == pytest.approx(0.04, rel=1e-14)
    with pytest.raises(ParameterError, match="fresnel = cheap is not known; choose one of exact, schlick, lazanyi"):
        fresnel.approximated(gold, "cheap")


def test_reflectance_clips_and_shapes():
    terms = (fresnel.mirror(), fresnel.metal("Au"), fresnel.dielectric(1.5), fresnel.schlick([0.1, 0.2, 0.3]))
    for term in (*terms, fresnel.lazanyi(2.91, 3.09)):
        values = fresnel.reflectance(term, [[0.5, 1.0 + 1e-15, -1e-17]])
        assert values.shape == (1, 3, len(term.a))
        assert ((values >= 0) & (values <= 1)).all()
        assert abs(values[0, 2] - 1.0).max() < 1e-15


def test_builders_settle_channels():
    assert fresnel.mirror().channels == ("Y",)
    three = fresnel.conductor([0.2, 0.9, 1.1], 3.0)
    assert three.channels == ("R", "G", "B")
    assert np.array_equal(three.b, [3.0, 3.0, 3.0])
    assert np.array_equal(three.weights, np.eye(3))
    spectral = fresnel.conductor([0.2, 0.9], [3.0, 2.0], wavelengths=[450, 632.8])
    assert (spectral.channels, spectral.wavelengths) == (("450nm", "632.8nm"), (450.0, 632.8))
    iron = fresnel.metal("Fe", wavelengths=[450, 550, 650])
    assert iron.channels == ("450nm", "550nm", "650nm")
    assert iron.spectral_error == 0.0
    assert np.array_equal(iron.weights, np.eye(3))
    assert np.array_equal((iron.a, iron.b), indices.at("Fe", [450, 550, 650]))
    gold = fresnel.metal("Au")
    assert (gold.kind, gold.channels, gold.weights.shape) == (1, ("R", "G", "B"), (len(gold.a), 3))
    assert "Johnson" in gold.source
    assert "CC0" in gold.source


def test_compiled_conductor_without_contrast_reflects_nothing():
    """Found by `brdftab check`: 0/0 along the surface made albedos of V-grooves NaN."""
    from brdftab.models._shared.fresnel.fresnel import reflectance

    for cosine in (0.0, 1e-300, 1e-17, 1e-8, 0.3, 1.0):
        assert reflectance(1, 1.0, 0.0, cosine) == 0.0
        assert reflectance(1, 1.0, 1e-3, cosine) == pytest.approx(
            fresnel.formulas.conductor(1.0, 1e-3, cosine), rel=1e-9
        )


REFUSED = [
    (lambda: fresnel.conductor(0.0, 1.0), "eta = 0 is outside positive numbers"),
    (lambda: fresnel.conductor(float("nan"), 1.0), "eta = nan is outside"),
    (lambda: fresnel.conductor(1.0, -1.0), r"k = -1 is outside \[0, inf\)"),
    (lambda: fresnel.conductor([1, 2, 3], [1, 2]), "k has 2 values where 3 are needed"),
    (lambda: fresnel.conductor([1, 2], [1, 2]), r"eta has 2 values; give 1 \(Y\) or 3"),
    (lambda: fresnel.conductor([1, 2, 3], 1, wavelengths=[450, 550]), "eta has 3 values where 2 are needed"),
    (lambda: fresnel.conductor("gold", 1), "eta = 'gold' is not a number"),
    (lambda: fresnel.conductor([], 1), r"eta of shape \(0,\)"),
    (lambda: fresnel.conductor(1, 1, wavelengths=[550, 450]), "wavelengths = 550,450 are not strictly increasing"),
    (lambda: fresnel.dielectric(0.9), r"ior = 0.9 is outside \[1, inf\)"),
    (lambda: fresnel.schlick([0.1, 0.2, 1.2]), r"f0 = 1.2 is outside \[0, 1\]"),
    (lambda: fresnel.metal("Au", wavelengths=[100]), "wavelengths = 100 nm is outside the data of Au"),
    (lambda: fresnel.metal("Au", wavelengths=[-5]), "wavelengths = -5 is outside positive numbers in nm"),
    (lambda: fresnel.metal("Au", samples=6, wavelengths=[500]), "samples = 6 does not go with wavelengths"),
]


@pytest.mark.parametrize(("build", "message"), REFUSED)
def test_refusals_are_one_clear_line(build, message):
    with pytest.raises(ParameterError, match=message) as caught:
        build()
    assert "\n" not in str(caught.value)
