"""What each exponential of the reflectance makes of the Beckmann kernel of a row of pairs (see beckmann.py)."""

from __future__ import annotations

import math

from brdftab.jit import kernel
from brdftab.models._shared.fresnel.fresnel import reflectance
from brdftab.models.smith_multi.volterra.bessel import SPLIT

# pairs below exp(-FAINTEST) are nothing, and products of three such numbers still are normal numbers
FAINTEST = 200.0


@kernel
def pair(beta_a, beta_b):
    """Return B = 2 cos cos', dz^2 and tan^2(mid) of a pair; dz = 0 where z does not rise."""
    cm = math.cos(0.5 * (beta_a + beta_b))
    dz = 2.0 * cm * math.sin(0.5 * (beta_b - beta_a))
    c2 = cm * cm
    rise = dz * dz if math.sin(beta_b) > math.sin(beta_a) else 0.0
    return 2.0 * math.cos(beta_a) * math.cos(beta_b), rise, (1.0 - c2) / c2


@kernel
def global_term(y, coefficients, alpha, depth, cross, dz2, tilt, kappa, a2, branch, front):
    """Fill what a term exp(-y X) of the reflectance needs: kappa, alpha^2 with it, all factors but the modes (W, B).

    branch: 0 where the term does not count, 1 where kappa < 25, 2 above.
    """
    wide = 1.0 / (alpha * alpha)
    for b in range(cross.size):
        branch[b] = 0
        lost = y * dz2[b]
        narrow = wide + lost
        e = tilt[b] * narrow + lost
        if dz2[b] > 0.0 and lost < depth and e < FAINTEST:
            a2[b] = 1.0 / narrow
            kappa[b] = cross[b] * narrow / dz2[b]
            scale = math.exp(-e) * wide / (4.0 * math.pi)
            for w in range(coefficients.size):
                front[w, b] = coefficients[w] * scale
            branch[b] = 2 if kappa[b] >= SPLIT else 1


@kernel
def local_values(times, kind, fa, fb, alpha, cross, dz2, tilt, values):
    """Fill values (K, W, B) with reflectance times all factors but the modes, at X of each pair for K times."""
    wide = 1.0 / (alpha * alpha)
    for b in range(cross.size):
        e = tilt[b] * wide
        if dz2[b] == 0.0 or e >= FAINTEST:
            continue
        scale = math.exp(-e) * wide / (4.0 * math.pi)
        for k in range(times.size):
            cosine = 0.5 * math.sqrt(dz2[b] * (1.0 + tilt[b] + times[k] / wide))
            for w in range(fa.size):
                values[k, w, b] = scale * reflectance(kind, fa[w], fb[w], cosine)


@kernel
def local_term(rate, matrix, alpha, cross, dz2, tilt, values, kappa, a2, branch, front):
    """Do as `global_term` for a term exp(-rate t), t = kappa (1 - cos phi)."""
    wide = 1.0 / (alpha * alpha)
    narrow = wide * (1.0 + rate)
    for b in range(cross.size):
        branch[b] = 0
        if dz2[b] > 0.0 and tilt[b] * wide < FAINTEST:
            a2[b] = 1.0 / narrow
            kappa[b] = cross[b] * narrow / dz2[b]
            for w in range(front.shape[0]):
                total = 0.0
                for k in range(matrix.size):
                    total += matrix[k] * values[k, w, b]
                front[w, b] = total
            branch[b] = 2 if kappa[b] >= SPLIT else 1
