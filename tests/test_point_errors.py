"""Errors stated beside point values are no smaller than what is known of them, of components as of totals."""

import math

import pytest

from brdftab.evaluation import EPS, evaluate_point
from brdftab.models.setup import resolve


def point(model, degrees, tolerance=1e-9, components=False, **parameters):
    angles = [math.radians(a) for a in degrees]
    return evaluate_point(resolve(model, **parameters), *angles, 0.0, tolerance=tolerance, components=components)


@pytest.mark.parametrize("tolerance", [1e-9, 1e-11, 1e-12, 1e-14])
def test_rules_that_agree_by_chance_state_what_looser_ones_support(tolerance):
    """Rules from 1e-14 to 1e-8 have the same nodes here, and are 2.8e-10 off."""
    given = {"ndf": "beckmann", "alpha": 1.0, "material": "mirror", "max_bounces": 12}
    found = point("vgroove-nonsym", (60.1875, 60.1957, 160.2965), tolerance, **given)
    assert 2.8e-10 < found["error"] < 2e-8


@pytest.mark.parametrize("model", ["lambert", "smith", "cook-torrance"])
def test_closed_forms_state_rounding_alone(model):
    found = point(model, (30.0, 40.0, 100.0), components=True)
    assert found["error"] == EPS
    assert all(error["relative"] == EPS for error in found["component_errors"].values())


def test_components_state_their_own_errors():
    """The second order is 32 % off inside a total that holds 1e-7: 2.56e-7 here, 1.94e-7 at tighter tolerances."""
    given = {"ndf": "beckmann", "alpha": 0.7, "material": "mirror"}
    at = (55.43, 80.24, 23.6)
    found = point("smith-multi", at, 1e-7, True, **given)
    finer = point("smith-multi", at, 1e-9, True, **given)
    off = abs(found["components"]["order2"][0] / finer["components"]["order2"][0] - 1.0)
    stated = found["component_errors"]["order2"]
    assert stated["relative"] > 0.5 * off
    assert stated["absolute"] == pytest.approx(stated["relative"] * found["components"]["order2"][0], rel=1e-3)
    assert found["error"] < 1e-6
    assert found["run_time_s"] > 0.0
    assert found["error_time_s"] > 0.0
