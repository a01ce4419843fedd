"""Every model of the registry at extreme roughness and directions: finite and not negative, or refused with a line."""

import itertools
import math

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import brdftab
from brdftab.errors import ParameterError
from brdftab.models import names, spec
from brdftab.models.resolve import resolve

DEGREE = math.pi / 180.0


def _ndfs(model):
    """Return the distributions of mirror facets; other surfaces come with their defaults (extremes: test_ilm.py)."""
    return model.ndfs if model.ndfs and model.has("material") else (None,)


def _pairs():
    """Return (model, ndf or None) of the whole registry."""
    return [(name, ndf) for name in names() for ndf in _ndfs(spec(name))]


def _given(model, ndf, **rough):
    if ndf is None:
        return {}
    # paths are slow; few of them are as finite as many
    coarse = {"tolerance": 0.05} if spec(model).has("samples") else {}
    return {"ndf": ndf, "material": "mirror", **rough, **coarse}


def _largest_alpha(model, ndf):
    if ndf != "phong":
        return 10.0
    # the nonsymmetric groove has no Phong distribution of opposite facets from sqrt 2 on
    return 1.4142 if model == "vgroove-nonsym" else 10.0


def _served(model, ndf, **rough):
    """Tell whether the model takes this roughness; what it refuses with a line is not evaluated."""
    try:
        resolve(model, ndf=ndf, material="mirror", **rough)
    except ParameterError:
        return False
    return True


def _good(value):
    return bool(np.isfinite(value).all() and (value >= 0.0).all())


def _from_mirror(theta_i, theta_o, phi):
    """Angle (rad) between view and mirror direction where small; the grooves refuse less than 1e-14 of half vector."""
    theta_i, theta_o, phi = (math.radians(x) for x in (theta_i, theta_o, phi))
    return math.hypot(theta_i - theta_o, (math.pi - phi) * math.sqrt(math.sin(theta_i) * math.sin(theta_o)))


@settings(max_examples=150, deadline=None)
@given(
    pair=st.sampled_from(_pairs()),
    log_alpha=st.floats(-4.0, 1.0),
    theta=st.tuples(st.floats(0.0, 89.999), st.floats(0.0, 89.999)),
    phi=st.floats(0.0, 180.0),
)
def test_values_are_finite_and_not_negative(pair, log_alpha, theta, phi):
    model, ndf = pair
    # the mirror direction itself is a true singularity and is refused; the extremes below stand 1e-9 degrees aside
    assume(_from_mirror(*theta, phi) > 1e-13)
    alpha = min(10.0**log_alpha, _largest_alpha(model, ndf))
    assume(_served(model, ndf, alpha=alpha))
    given_ = _given(model, ndf, alpha=alpha)
    value = brdftab.evaluate(model, theta[0] * DEGREE, theta[1] * DEGREE, phi * DEGREE, **given_)
    assert _good(value), value


ALPHAS = (1e-4, 1e-3, 0.01, 0.1, 0.5, 1.0, 3.0, 10.0)
THETAS = (0.0, 1e-9, 1e-4, 1.0, 45.0, 45.0 + 1e-9, 80.0, 89.9, 89.999, 89.999 - 1e-9)
PHIS = (0.0, 1e-9, 1e-4, 60.0, 90.0, 179.9, 180.0 - 1e-9, 180.0)


def _rough(ax, ay):
    return {"alpha": ax} if ax == ay else {"alpha_x": ax, "alpha_y": ay}


def _extremes():
    """Return 10,000 fixed cases grouped by (model, ndf, alpha_x, alpha_y): products of extremes, evenly thinned."""
    settings_ = []
    for model, ndf in _pairs():
        if ndf is None:
            settings_.append((model, ndf, 1.0, 1.0))
            continue
        alphas = [a for a in ALPHAS if a <= _largest_alpha(model, ndf)]
        settings_ += [(model, ndf, a, a) for a in alphas]
        if ndf != "phong":
            settings_ += [(model, ndf, 1e-4, 10.0), (model, ndf, 10.0, 1e-4), (model, ndf, 0.01, 1.0)]
    settings_ = [(m, n, ax, ay) for m, n, ax, ay in settings_ if n is None or _served(m, n, **_rough(ax, ay))]
    assert {(model, ndf) for model, ndf, *_ in settings_} == set(_pairs())
    directions = [d for d in itertools.product(THETAS, THETAS, PHIS) if _from_mirror(*d) > 1e-13]
    chosen = np.random.default_rng(0).choice(len(settings_) * len(directions), 10_000, replace=False)
    groups: dict[tuple, list] = {}
    for n in np.sort(chosen):
        groups.setdefault(settings_[n // len(directions)], []).append(directions[n % len(directions)])
    return groups


def test_ten_thousand_extremes():
    groups = _extremes()
    assert sum(map(len, groups.values())) == 10_000
    bad = []
    for (model, ndf, ax, ay), directions in groups.items():
        theta_i, theta_o, phi = np.array(directions).T * DEGREE
        value = brdftab.evaluate(model, theta_i, theta_o, phi, **_given(model, ndf, **_rough(ax, ay)))
        wrong = ~(np.isfinite(value) & (value >= 0.0)).all(-1)
        bad += [(model, ndf, ax, ay, *directions[n], value[n]) for n in np.flatnonzero(wrong)]
    assert not bad, bad[:5]
