"""The table of cases is sound, and the library gives its values through the API and the command line."""

import json
import math

import numpy as np
import pytest
from cases import CASES, INTERFACED, REFERENCE, TAGS
from click.testing import CliRunner

import brdftab
from brdftab import models
from brdftab.cli import main

FLOOR = 1e-12


def test_table_is_sound():
    names = [case.name for case in CASES]
    assert len(set(names)) == len(names)
    for case in CASES:
        assert case.model in models.names(), case.name
        assert case.tags, case.name
        assert case.tags <= TAGS, case.name
        assert all(0.0 <= theta <= 180.0 for theta in case.angles[:2]), case.name
        assert all(math.isfinite(v) and v >= 0.0 for v in case.value), case.name
        assert 0.0 < case.rtol <= 1e-7, case.name
        assert all(len(part) == len(case.value) for part in case.parts.values()), case.name
        assert case.source, case.name


def test_every_model_and_tag_has_a_case():
    assert {case.model for case in CASES} >= set(models.names())
    assert set().union(*(case.tags for case in CASES)) == TAGS
    assert len(REFERENCE) == 10
    assert len(INTERFACED) == 8
    assert any(case.tags >= {"reference", "anisotropic"} and case.phi_i != 0.0 for case in CASES)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_api_gives_the_value(case):
    angles = [math.radians(a) for a in case.angles]
    more = {"phi_i": math.radians(case.phi_i), **case.parameters}
    value = brdftab.evaluate(case.model, *angles, **more)
    assert value.shape == (len(case.value),)
    assert np.allclose(value, case.value, rtol=case.rtol, atol=FLOOR)
    parts = brdftab.evaluate(case.model, *angles, components=True, **more)
    for name, expected in case.parts.items():
        assert np.allclose(parts[name], expected, rtol=case.rtol, atol=FLOOR), name


def option(model, name, value):
    """Return one parameter as the words of a command line, which takes degrees."""
    turn = math.degrees if models.spec(model).param(name).unit == "rad" else (lambda x: x)
    values = value if isinstance(value, list) else [value]
    return [f"--{name.replace('_', '-')}", ",".join(v if isinstance(v, str) else repr(turn(v)) for v in values)]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_command_line_gives_the_value(case):
    words = ["eval", "--model", case.model, "--json", "--components"]
    for name, angle in zip(("theta-i", "theta-o", "phi"), case.angles, strict=True):
        words += [f"--{name}", repr(angle)]
    words += ["--phi-i", repr(case.phi_i)]
    for name, value in case.parameters.items():
        words += option(case.model, name, value)
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    names = ["model", "parameters", "channels", "value", "components", "component_errors", "delta", "unreached"]
    assert list(found) == [*names, "error", "spectral", "run_time_s", "error_time_s"]
    assert np.allclose(found["value"], case.value, rtol=case.rtol, atol=FLOOR)
    for name, expected in case.parts.items():
        assert np.allclose(found["components"][name], expected, rtol=case.rtol, atol=FLOOR), name
    assert np.allclose(np.sum(list(found["components"].values()), axis=0), found["value"], rtol=1e-12, atol=FLOOR)
    assert len(found["channels"]) == len(case.value)
    assert 0.0 < found["error"] <= 1e-7
    assert found["run_time_s"] > 0.0
