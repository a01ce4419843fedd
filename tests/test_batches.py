"""Values of a point do not depend on its neighbours: batches of every model are shuffled and split."""

import warnings

import numpy as np
import pytest

import brdftab
from brdftab import models
from brdftab.evaluation.points import is_stochastic
from brdftab.models.resolve import resolve

# light, view, phi, phi_i in degrees: plain ones, beside the horizon, at the mirror direction, against the light
PLACES = np.radians(
    [
        [20.0, 35.0, 140.0, 10.0],
        [62.0, 48.0, 30.0, 200.0],
        [5.0, 71.0, 90.0, 80.0],
        [89.9, 40.0, 170.0, 0.0],
        [86.0, 88.5, 175.0, 45.0],
        [35.0, 35.0, 180.0, 20.0],
        [70.0, 70.0, 180.0, 0.0],
        [55.0, 55.0, 0.0, 300.0],
        [20.0, 48.0, 100.0, 10.0],
    ]
)
BELOW = np.radians([[94.767, 93.651, 306.948, 0.0], [130.0, 20.0, 120.0, 0.0], [40.0, 175.0, 10.0, 0.0]])
TOLERANCE = 1e-2
# besides every model at its defaults: each path sampler to the values of one model
MORE = (
    ("smith-multi", {"ndf": "beckmann", "alpha": 0.02276, "ior": 10.0}),
    ("smith-multi", {"ndf": "ggx", "alpha": 0.5, "ior": 1.5}),
    ("smith-multi", {"ndf": "ggx", "alpha": 0.3, "ior": [1.4, 1.5, 1.4], "max_bounces": 4}),
    ("smith-multi", {"ndf": "ggx", "alpha": 0.1, "material": "Au"}),
    ("smith-multi", {"ndf": "beckmann", "alpha": 0.05, "f0": 0.04}),
    ("smith-multi", {"ndf": "ggx", "alpha": 0.5, "material": "mirror", "estimator": "bdpt", "samples": 256}),
    ("smith-multi", {"ndf": "ggx", "alpha": 0.5, "ior": 1.5, "estimator": "pt", "samples": 256}),
    ("smith", {"ndf": "ggx", "alpha_x": 0.2, "alpha_y": 0.5, "material": "Au"}),
    ("vgroove-sym", {"ndf": "beckmann", "alpha": 0.4, "material": "Au"}),
    ("vgroove-sym", {"ndf": "ggx", "alpha_x": 0.2, "alpha_y": 0.5}),
    ("ilm", {"ndf": "ggx", "sigma": 0.5, "kd": 0.8}),
)
CASES = [*((name, {}) for name in models.names()), *MORE]


def evaluated(setup, angles, orders=0):
    """Return values (N, C) with what they may differ by: bits of sums, or standard errors."""
    module = models.kernel(setup.model.name)
    angles = [np.ascontiguousarray(a) for a in angles.T]
    if is_stochastic(setup):
        found = module.estimates(setup, *angles, orders=orders, tolerance=TOLERANCE)
        return found.values.sum(axis=1), 6.0 * found.standard_error
    values = module.points(setup, *angles, orders=orders, tolerance=TOLERANCE).sum(axis=1)
    # matrix products round by their shapes: 1e-9 measured where a dielectric's value is 1e-12 of its peak
    return values, 3e-9 * np.abs(values)


@pytest.mark.parametrize(("name", "parameters"), CASES, ids=[f"{n}-{'-'.join(map(str, p.values()))}" for n, p in CASES])
def test_values_do_not_depend_on_their_neighbours(name, parameters):
    setup = resolve(name, **parameters)
    angles = np.concatenate([PLACES, BELOW]) if setup.transmits else PLACES
    if setup.model.singular:
        # no finite values at the mirror direction itself
        angles = angles + np.radians([0.0, 0.02, 0.0, 0.0])
    values, allowed = evaluated(setup, angles)
    assert np.isfinite(values).all()
    assert (values > 0.0).any()
    order = np.random.default_rng(4).permutation(len(angles))
    for some in (order, order[:4], order[4:], order[:1], order[-1:]):
        again, more = evaluated(setup, angles[some])
        assert (np.abs(again - values[some]) <= allowed[some] + more).all()


@pytest.mark.parametrize("name", models.names())
def test_single_directions_raise_no_warning(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        value = brdftab.evaluate(name, 0.3, 0.7, 2.0, tolerance=TOLERANCE)
    assert np.isfinite(value).all()
