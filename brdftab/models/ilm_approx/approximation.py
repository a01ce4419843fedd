"""The body integral in closed form: I = L T(c_i) T(c_o)/pi, in the spirit of Meneveaux et al. 2018, Eqs. 32 and 33.

Without m_z, which differs from 1 by sigma^2, what V-cavities of Lambertian facets reflect depends on roughness and
direction only through the stretched slopes nu = sigma tan theta and on the azimuth. So ln L is a polynomial of
x = nu/(1 + nu) of both directions, of cos phi and of y = sigma^2/(1 + sigma^2). The interface is taken at the cosine
c = (cos theta + sigma sin theta) exp(Q) at which the facets that count are met, with another polynomial Q. Both
polynomials vanish for sigma = 0, where the flat surface comes out exactly, and T = 1 for n = 1 leaves L/pi.

Coefficients are fitted by fit_coefficients.py; glsl.py writes them out for a shader.
"""

from __future__ import annotations

import math

import numpy as np

from brdftab.jit import kernel
from brdftab.models.ilm_approx.coefficients import COSINE, LAMBERT
from brdftab.models.microfacet.interface import transmission

_LAMBERT, _COSINE = np.array(LAMBERT), np.array(COSINE)
# highest power of x in either polynomial, and of cos phi and y
POWERS, FEW = 4, 2


@kernel
def _term(row, u, v, c, y):
    """Return one term u^p v^q c^m y^k without its coefficient; arguments are rows of powers."""
    return u[int(row[0])] * v[int(row[1])] * c[int(row[2])] * y[int(row[3])]


@kernel
def body(sigma, n, si, ci, so, co, cos_phi):
    """Return the approximate body integral (1/sr) of directions above the horizon, the same for both orders of them.

    Parameters
    ----------
    sigma, n : float
        Roughness in [0, 2] and refractive index in [1, 3].
    si, ci, so, co : float
        Sines and cosines of the polar angles.
    cos_phi : float
        Cosine of phi_o - phi_i; -1 is the mirror side.
    """
    wi, wo = ci + sigma * si, co + sigma * so
    x, z = np.ones(POWERS + 1), np.ones(POWERS + 1)
    c, y = np.ones(FEW + 1), np.ones(FEW + 1)
    for p in range(POWERS):
        x[p + 1] = x[p] * (sigma * si / wi)
        z[p + 1] = z[p] * (sigma * so / wo)
    for p in range(FEW):
        c[p + 1] = c[p] * cos_phi
        y[p + 1] = y[p] * (sigma * sigma / (1.0 + sigma * sigma))
    log = 0.0
    for k in range(_LAMBERT.shape[0]):
        row = _LAMBERT[k]
        both = _term(row, x, z, c, y)
        if row[0] != row[1]:
            both += _term(row, z, x, c, y)
        log += row[4] * both
    at_i, at_o = 0.0, 0.0
    for k in range(_COSINE.shape[0]):
        at_i += _COSINE[k, 4] * _term(_COSINE[k], x, z, c, y)
        at_o += _COSINE[k, 4] * _term(_COSINE[k], z, x, c, y)
    passed = transmission(n, min(1.0, wi * math.exp(at_i))) * transmission(n, min(1.0, wo * math.exp(at_o)))
    return math.exp(log) * passed / math.pi
