"""Every model that the registry holds, tested from its own declaration: a new model needs no list here."""

import dataclasses
import itertools
import json
import math
from functools import cache

import numpy as np
import pytest
from click.testing import CliRunner
from grids import evaluated, grid_of, swapped

import brdftab
from brdftab import models
from brdftab.cli import main
from brdftab.commands.options import declared
from brdftab.errors import ParameterError
from brdftab.evaluation.points import is_stochastic
from brdftab.models.declaration import Model
from brdftab.models.resolve import component_names, resolve

NAMES = models.names()
# light, view and relative azimuth in radians: in and off the plane of incidence, near the mirror side, towards grazing
THETA_I = np.array([0.0, 0.3, 0.8, 1.2, 1.5, 0.05])
THETA_O = np.array([0.4, 0.9, 0.6, 1.3, 0.2, 1.55])
PHI = np.array([0.0, 3.0, 1.2, 2.5, 0.4, 3.14])
PHI_I = np.array([0.0, 0.5, 2.0, 4.0, 5.5, 1.0])
# for surfaces with a direction of their own: pairs (along, across) of angles of light and view, where they mirror it
GRAIN = ((0.3, 0.4, -0.3, -0.6), (-0.9, 0.1, 0.9, 0.1), (0.0, -0.7, 0.004, 0.2))
# no model's sum of rounding errors came near: reciprocity was measured at 5e-13
RTOL = 1e-10
# samples of the estimators, and rays of what is traced once
PATHS, RAYS = 4, 2048
# pairs of directions where light passes the surface, whose solver is the slowest
PASSING = 2


def directions(name):
    """Return theta_i, theta_o, phi, phi_i at which a model is looked at."""
    if not models.spec(name).grain:
        return THETA_I, THETA_O, PHI, PHI_I
    ti, pi, to, po = np.array(GRAIN).T
    # angle along the grain t = asin(sin theta cos azimuth), across it p = atan2(sin theta sin azimuth, cos theta)
    theta, azimuth = (
        [f(t, p) for t, p in ((ti, pi), (to, po))]
        for f in (
            lambda t, p: np.arccos(np.cos(t) * np.cos(p)),
            lambda t, p: np.arctan2(np.cos(t) * np.sin(p), np.sin(t)),
        )
    )
    more = theta[0], theta[1], azimuth[1] - azimuth[0], azimuth[0]
    return tuple(np.concatenate(pair) for pair in zip((THETA_I, THETA_O, PHI, PHI_I), more, strict=True))


def corners(param):
    """Return values of one parameter that span its declaration."""
    if param.kind == "text":
        return [param.default]
    if param.kind == "choice":
        return list(param.choices) or [param.default]
    low, high = param.bounds
    if param.kind == "int":
        return [int(low), 2, 5, 8, int(high)]
    middle = math.sqrt(low * high) if low > 0.0 and high > 100.0 * low else 0.5 * (low + high)
    if param.kind == "channels":
        # the bounds stand alone: an index of 1.01 costs the solver of smith-multi a minute
        return [low, middle, high, [middle, high, high]]
    return [low, middle, high]


def accepted(model, given):
    """Tell whether a set of parameters resolves."""
    return refusal(model, given) is None


def refusal(model, given):
    """Return the line with which a set of parameters is refused, or None."""
    try:
        resolve(model, **given)
    except ParameterError as error:
        return str(error)
    return None


@cache
def settings(model):
    """Return the default and, for every parameter, its accepted corners, with a partner where one is needed."""
    spec = models.spec(model)
    found = [{}]
    for param in spec.params:
        mine = []
        for value in corners(param):
            if accepted(model, {param.name: value}):
                mine.append({param.name: value})
                continue
            for other in spec.params:
                extra = next((v for v in corners(other) if accepted(model, {param.name: value, other.name: v})), None)
                if other.name != param.name and extra is not None:
                    mine.append({param.name: value, other.name: extra})
                    break
        assert mine, f"no value of {param.name} is accepted by {model}"
        found += mine
    for ndf in spec.ndfs:
        sets = [{"ndf": ndf, spec.roughness: rough} for rough in (1e-4, 0.5, 10.0)]
        found += [given for given in sets if accepted(model, given)]
    return found


def physical(model, given):
    """Return the same parameters with perfect mirrors where the model has facets and no other reflectance is given."""
    sources = {"material", "eta", "ior", "f0", "wavelengths", "spectral_samples"}
    if any(p.name == "material" for p in models.spec(model).params) and not sources & set(given):
        given = {**given, "material": "mirror"}
    if is_stochastic(resolve(model, **given)):
        # as many paths as the declaration allows would take days
        given = {**given, "samples": min(given.get("samples", PATHS), PATHS)}
    if "rays" in given:
        given = {**given, "rays": min(given["rays"], RAYS)}
    return given


CASES = [pytest.param(name, given, id=f"{name} {given}") for name in NAMES for given in settings(name)]


def test_registry_is_not_empty():
    assert {"lambert", "oren-nayar", "cook-torrance", "smith", "vgroove-sym", "vgroove-nonsym", "ilm"} <= set(NAMES)
    assert [spec.name for spec in brdftab.list_models()] == NAMES == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_declaration_is_complete(name):
    spec = models.spec(name)
    assert spec.name == name
    for text in (spec.title, spec.summary, spec.citation, spec.variant):
        assert text
        assert "\n" not in text
    # a model that is older than DOIs says so by an empty one
    assert spec.doi == "" or spec.doi.startswith("10.")
    assert spec.components
    assert len({p.name for p in spec.params}) == len(spec.params)
    for param in spec.params:
        assert param.doc
        assert param.kind in {"float", "int", "channels", "choice", "text"}, param.name
        if param.kind == "text":
            assert isinstance(param.default, str), param.name
        elif param.kind != "choice":
            low, high = param.bounds
            assert low < high, param.name
            assert param.default is None or low <= param.default <= high, param.name
        elif param.choices:
            assert param.default in param.choices, param.name


@pytest.mark.parametrize("name", NAMES)
def test_every_parameter_is_an_option_with_its_text(name):
    help_ = CliRunner().invoke(main, ["tabulate", "--help"]).stdout
    flat = " ".join(help_.split())
    for param in models.spec(name).params:
        assert f"--{param.name.replace('_', '-')} " in flat
        assert param.name in declared()
    described = CliRunner().invoke(main, ["models", name]).stdout
    for param in models.spec(name).params:
        assert f"--{param.name.replace('_', '-')} " in described
    assert models.spec(name).citation.split(":")[0] in described


def test_shared_names_mean_the_same():
    for one, other in itertools.combinations(NAMES, 2):
        mine, theirs = ({p.name: p for p in models.spec(n).params} for n in (one, other))
        for name in set(mine) & set(theirs):
            a, b = mine[name], theirs[name]
            # units, choices and defaults may be a model's own, and the help then says whose they are
            assert a.kind == b.kind, (one, other, name)
    for name, variants in declared().items():
        users = [user for _, models_ in variants for user in models_]
        assert sorted(users) == [n for n in NAMES if models.spec(n).has(name)], name
        assert len({param.kind for param, _ in variants}) == 1, name


@pytest.mark.parametrize(("name", "given"), CASES)
def test_values_are_sound(name, given):
    given = physical(name, given)
    setup = resolve(name, **given)
    # below the surface and back the solver costs seconds a point below 1e-3
    tolerance = 1e-2 if setup.transmits else 1e-9
    some = slice(PASSING if setup.transmits else None)
    theta_i, theta_o, phi, phi_i = (a[some] for a in directions(name))
    count = theta_i.size
    # there and back in one call: solvers prepare once
    there_and_back = [(theta_i, theta_o), (theta_o, theta_i), (phi, -phi), (phi_i, phi_i + phi)]
    *pair, azimuth = map(np.concatenate, there_and_back)
    both = brdftab.evaluate(name, *pair, phi_i=azimuth, tolerance=tolerance, **given)
    assert both.shape == (2 * count, len(setup.channels))
    assert np.isfinite(both).all()
    if setup.channels != ("R", "G", "B"):
        # projected spectra may leave the gamut of sRGB; a single channel may not
        assert (both >= 0.0).all()
    value, back = both[:count], both[count:]
    if setup.model.reciprocal and not is_stochastic(setup):
        # through an interface of 1.01 values of 1e-5/sr, six orders below the peak, differ by 6 % at this tolerance
        assert np.allclose(back, value, rtol=0.1 if setup.transmits else RTOL, atol=1e-30)
    parts = brdftab.evaluate(name, *pair, phi_i=azimuth, components=True, tolerance=tolerance, **given)
    assert tuple(parts) == component_names(setup, 8)
    assert np.allclose(sum(parts.values()), both, rtol=1e-9, atol=1e-14)


@pytest.mark.parametrize(("name", "given"), CASES)
def test_parameters_survive_json(name, given):
    given = physical(name, given)
    setup = resolve(name, **given)
    again = resolve(name, **json.loads(json.dumps(setup.parameters, allow_nan=False)))
    # equal in every field that a kernel sees, to the last bit
    assert fields_of(again) == fields_of(setup)


def fields_of(setup):
    """Return a setup, or a reflectance in it, as plain values; arrays as their type and bytes."""
    if isinstance(setup, np.ndarray):
        return setup.dtype.str, setup.shape, setup.tobytes()
    if isinstance(setup, dict):
        return {name: fields_of(value) for name, value in setup.items()}
    if dataclasses.is_dataclass(setup) and not isinstance(setup, Model):
        return {field.name: fields_of(getattr(setup, field.name)) for field in dataclasses.fields(setup)}
    return setup


@pytest.mark.parametrize("name", NAMES)
def test_isotropic_values_depend_on_the_relative_azimuth_only(name):
    given = physical(name, {})
    theta_i, theta_o, phi, phi_i = directions(name)
    value = brdftab.evaluate(name, theta_i, theta_o, phi, phi_i=phi_i, **given)
    if models.spec(name).grain:
        assert value.any()
        assert not np.allclose(value, brdftab.evaluate(name, theta_i, theta_o, phi, **given), rtol=0.1)
        # what is behind is as what is ahead
        back = brdftab.evaluate(name, theta_i, theta_o, -phi, phi_i=math.pi - phi_i, **given)
        assert np.allclose(value, back, rtol=1e-9, atol=1e-12)
        return
    assert np.array_equal(value, brdftab.evaluate(name, THETA_I, THETA_O, PHI, **given))
    if not is_stochastic(resolve(name, **given)):
        assert np.allclose(value, brdftab.evaluate(name, THETA_I, THETA_O, -PHI, **given), rtol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_values_below_the_horizon_are_zero(name):
    assert not brdftab.evaluate(name, 0.3, [0.5 * math.pi, 2.0, math.pi], 1.0).any()
    assert not brdftab.evaluate(name, [0.5 * math.pi, 2.0], 0.3, 1.0).any()


@pytest.mark.parametrize("name", NAMES)
def test_refusals_name_the_parameter(name):
    for param in models.spec(name).params:
        for value in corners(param):
            line = refusal(name, {param.name: value})
            assert line is None or (param.name in line and "\n" not in line), line


@pytest.mark.parametrize("name", NAMES)
def test_unknown_and_malformed_parameters_are_refused(name):
    with pytest.raises(ParameterError, match="nonsense is not a parameter"):
        resolve(name, nonsense=1.0)
    for param in models.spec(name).params:
        words = param.kind in ("choice", "text")
        wrong = ["nonsense", [], {}] if words else ["nonsense", math.nan, math.inf, -1e9, [], [[1.0]], {}]
        for value in wrong:
            with pytest.raises(ParameterError, match=param.name) as caught:
                resolve(name, **{param.name: value})
            assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_table_holds_the_values_of_its_cells(name, dtype):
    if is_stochastic(resolve(name)):
        pytest.skip("cells and points draw different paths; test_smith_paths.py holds them against each other")
    table = brdftab.tabulate(name, grid_of(name, "4x4x6", "4x6x4x6"), dtype=dtype, tolerance=1e-6)
    value = evaluated(name, table, tolerance=1e-9)
    plain = np.ones(table.grid.shape, bool)
    if models.spec(name).singular:
        plain[tuple(table.grid.mirror_cells().T)] = False
    assert plain.sum() >= plain.size - 4
    assert np.allclose(table.values[plain], value[plain], rtol=2e-6, atol=1e-12)
    if models.spec(name).reciprocal:
        assert np.array_equal(table.values, swapped(table))
    error = table.provenance["error"]
    assert error["met"] == (error["estimate"] <= 1e-6) == (not error["reason"])
    # averages of mirror cells 22 degrees wide are the one thing that a coarse grid makes hard, and the estimate says so
    assert error["met"] or (models.spec(name).singular and error["estimate"] < 1e-2)
    assert table.provenance["model"] == name
    for key in ("parameters", "kernel_time_s", "total_time_s", "cells_per_s", "citation", "variant", "machine"):
        assert key in table.provenance
