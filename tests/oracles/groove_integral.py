"""The V-groove BRDF of one pair of directions by brute force: traced beams, reflected angles, adaptive quadrature.

What the closed forms derive is found here by other means: the outgoing angle by reflecting directions one by one, the
facet tilt that reaches theta_o by solving that (affine) chain, its derivative by a difference, the beam's width by
`groove_tracer.beams`, and the constant of P(r) by quadrature. The integral over r bisects around its kinks until it has
converged (Gauss-Kronrod 7-15).

Energy balance behind it: a facet m of tilt l (density D(m) cos(theta_m) of macroscopic area, cot(l) wide per groove
length) sends the beam of width w, so the flux w L / (i_z cot l), to the in-plane angle theta_o;
theta_h = (theta_i + theta_o)/2 and do = 4 (i.h) sin(theta_h) dtheta_h dphi turn that into a radiance.
"""

import itertools
import math

import numpy as np
from numba import njit
from scipy import integrate, special

from oracles.groove_tracer import beams

BECKMANN, GGX, PHONG = 0, 1, 2
NDFS = {"beckmann": BECKMANN, "ggx": GGX, "phong": PHONG}
KRONROD = np.array([
    0.991455371120812639206854697526329, 0.949107912342758524526189684047851, 0.864864423359769072789712788640926,
    0.741531185599394439863864773280788, 0.586087235467691130294144691693013, 0.405845151377397166906606412076961,
    0.207784955007898467600689403773245, 0.0,
])  # fmt: skip
WEIGHT15 = np.array([
    0.022935322010529224963732008058970, 0.063092092629978553290700663189204, 0.104790010322250183839876322541518,
    0.140653259715525918745189590510238, 0.169004726639267902826583426598550, 0.190350578064785409913256402421014,
    0.204432940075298892414161999234649, 0.209482141084727828012999174891714,
])  # fmt: skip
WEIGHT7 = np.array([
    0.0, 0.129484966168869693270611432679082, 0.0, 0.279705391489276667901467771423780,
    0.0, 0.381830050505118944950369775488975, 0.0, 0.417959183673469387755102040816327,
])  # fmt: skip


@njit
def density(ndf, tilt, alpha, alpha_x, alpha_y):
    """D of a facet of this tilt in an azimuth where the roughness is `alpha`."""
    c, s = math.cos(tilt), math.sin(tilt)
    if ndf == PHONG:
        n = 2.0 / alpha**2 - 2.0
        return (n + 2.0) / (2.0 * math.pi) * c**n
    if ndf == GGX:
        return alpha**4 / (math.pi * alpha_x * alpha_y * (alpha * alpha * c * c + s * s) ** 2)
    t2 = (s / (c * alpha)) ** 2
    return math.exp(-t2) / (math.pi * alpha_x * alpha_y * c**4) if t2 < 700.0 else 0.0


@njit
def fresnel(cosine, eta, kappa):
    """Unpolarised reflectance of a medium of complex index eta + i kappa, from the complex amplitudes."""
    if eta < 0.0:
        return 1.0
    n = complex(eta, kappa)
    inside = np.sqrt(1.0 - (1.0 - cosine * cosine) / (n * n))
    rs = (cosine - n * inside) / (cosine + n * inside)
    rp = (n * cosine - inside) / (n * cosine + inside)
    return 0.5 * (abs(rs) ** 2 + abs(rp) ** 2)


@njit
def follow(theta_i, left, right, k, length, eta, kappa):
    """Reflect a direction k times, left facet first; returns (outgoing angle, product of reflectances)."""
    angle, product = theta_i, 1.0
    for j in range(k):
        normal = -left if j % 2 == 0 else right
        product *= fresnel(min(1.0, abs(length * math.cos(normal - angle))), eta, kappa)
        # leaving direction of this bounce; seen from the next facet the light comes from the opposite one
        angle = 2.0 * normal - angle
        if j < k - 1:
            angle += math.pi
    return angle, product


@njit
def _integrand(r, case, widths, angles):
    """Sum over all left tilts that send k bounces to theta_o (both tilts equal where symmetric) of D sin^2 w F.../ J.

    `case` is (symmetric, in-plane theta_i and theta_o, k, in-plane length, NDF code, alpha, alpha_x, alpha_y, eta, k).
    """
    symmetric, ti, to, k, length, ndf, alpha, alpha_x, alpha_y, eta, kappa = case
    at0, _ = follow(ti, 0.0, 0.0 if symmetric else r, k, length, -1.0, 0.0)
    at1, _ = follow(ti, 1.0, 1.0 if symmetric else r, k, length, -1.0, 0.0)
    slope = at1 - at0
    total = 0.0
    for turn in range(-k - 1, k + 2):
        left = (to - at0 + 2.0 * math.pi * turn) / slope
        if not 1e-12 < left < 0.5 * math.pi - 1e-12:
            continue
        right = left if symmetric else r
        beams(ti, left, right, widths, angles)
        w = widths[0, k]
        if w > 0.0:
            _, product = follow(ti, left, right, k, length, eta, kappa)
            total += density(ndf, left, alpha, alpha_x, alpha_y) * math.sin(left) ** 2 * w * product * 2.0 / abs(slope)
    if symmetric:
        return total
    return total * density(ndf, r, alpha, alpha, alpha) * math.sin(r) ** 2


@njit
def _rule(a, b, case, widths, angles):
    """Gauss-Kronrod 7-15 on one panel: (integral, difference of the two rules)."""
    mid, half = 0.5 * (a + b), 0.5 * (b - a)
    fine, coarse = 0.0, 0.0
    for j in range(15):
        node = j if j < 8 else 14 - j
        sign = -1.0 if j < 8 else 1.0
        v = _integrand(mid + sign * half * KRONROD[node], case, widths, angles)
        fine += WEIGHT15[node] * v
        coarse += WEIGHT7[node] * v
    return fine * half, abs(fine - coarse) * half


@njit
def _adaptive(case, rtol, panels):
    """Integrate over r in (0, pi/2): `panels` first, then the worst is halved until the error estimate is small."""
    cap, k = panels + 3000, case[3]
    widths, angles = np.empty((2, k + 2)), np.empty((2, k + 2))
    left, right = np.empty(cap), np.empty(cap)
    value, error = np.zeros(cap), np.zeros(cap)
    n = panels
    for p in range(n):
        # graded towards 0, where narrow distributions live
        left[p], right[p] = 0.5 * math.pi * (p / n) ** 2, 0.5 * math.pi * ((p + 1) / n) ** 2
        value[p], error[p] = _rule(left[p], right[p], case, widths, angles)
    while n < cap:
        worst = int(np.argmax(error[:n]))
        if error[:n].sum() <= rtol * value[:n].sum() or error[worst] == 0.0:
            break
        mid = 0.5 * (left[worst] + right[worst])
        left[n], right[n], right[worst] = mid, right[worst], mid
        value[n], error[n] = _rule(left[n], right[n], case, widths, angles)
        value[worst], error[worst] = _rule(left[worst], mid, case, widths, angles)
        n += 1
    return value[:n].sum(), error[:n].sum()


@njit
def _norm(ndf, alpha):
    """Integral of D sin^2 over [0, pi/2] by the midpoint rule in log tan, where it converges geometrically."""
    total, step = 0.0, 1e-3
    for j in range(-40_000, 40_001):
        t = math.exp(j * step)
        r = math.atan(t)
        total += density(ndf, r, alpha, alpha, alpha) * math.sin(r) ** 2 * t / (1.0 + t * t) * step
    return total


def _singular(case, exponent, rtol):
    """Integrate over r in (0, pi/2) where either facet's vertical is a singularity gap^exponent: QAWS on every side."""
    _, ti, to, k, *_ = case
    work = np.empty((2, k + 2)), np.empty((2, k + 2))
    walls = [0.5 * math.pi]
    for turn in range(-k - 1, k + 2):
        # the left facet stands upright where the chain, affine in r, reaches theta_o with l = pi/2
        at0, at1 = (follow(ti, 0.5 * math.pi, r, k, 1.0, -1.0, 0.0)[0] - to - 2.0 * math.pi * turn for r in (0.0, 1.0))
        r = at0 / (at0 - at1) if at0 != at1 else -1.0
        if 1e-9 < r < 0.5 * math.pi - 1e-9:
            walls.append(r)
    ends = [0.0, *sorted(walls)]
    total, error = 0.0, 0.0
    for start, stop in itertools.pairwise(ends):
        half = 0.5 * (stop - start)
        for wall, sign in ((start, 1.0), (stop, -1.0)):
            power = 0.0 if wall == 0.0 else exponent

            def smooth(gap, wall=wall, sign=sign, power=power):
                # QAWS looks at the wall itself, too
                gap = max(gap, 1e-9)
                return _integrand(wall + sign * gap, case, *work) * gap**-power

            def whole(gap, wall=wall, sign=sign):
                return _integrand(wall + sign * gap, case, *work)

            # beams that open far from the wall are not to be missed, nor their kinks to share an interval with it
            cuts = half * 2.0 ** -np.arange(13.0)
            parts = [
                integrate.quad(whole, a, b, epsabs=1e-14, epsrel=rtol, limit=100)[:2]
                for b, a in itertools.pairwise(cuts)
            ]
            parts.append(
                integrate.quad(smooth, 0.0, cuts[-1], weight="alg", wvar=(power, 0.0), epsabs=1e-14, epsrel=rtol)[:2]
            )
            total, error = total + sum(p[0] for p in parts), error + sum(p[1] for p in parts)
    return total, error


def _steep_norm(alpha):
    """Integral of D sin^2 over [0, pi/2], a beta function."""
    n = 2.0 / alpha**2 - 2.0
    return (n + 2.0) / (2.0 * math.pi) * 0.5 * special.beta(0.5 * (n + 1.0), 1.5)


def order(
    k,
    theta_i,
    theta_o,
    phi,
    *,
    symmetric,
    ndf,
    alpha_x,
    alpha_y=None,
    phi_i=0.0,
    eta=None,
    kappa=0.0,
    rtol=1e-9,
    panels=192,
):
    """Bounce order k of the BRDF (1/sr) for one pair of directions in radians; returns (value, estimated error).

    `eta` and `kappa` are one wavelength's index; None is a perfect mirror. A beam seen by no node of the first `panels`
    is missed without notice (1e-5 of an order at some directions); 2500 panels left nothing above 1e-10. Phong lobes
    with alpha > 1 grow without bound at vertical facets: QUADPACK's rule for such ends (QAWS) takes them.
    """
    alpha_y = alpha_x if alpha_y is None else alpha_y
    eta = -1.0 if eta is None else eta
    phi_o = phi_i + phi
    i = np.array([math.sin(theta_i) * math.cos(phi_i), math.sin(theta_i) * math.sin(phi_i), math.cos(theta_i)])
    o = np.array([math.sin(theta_o) * math.cos(phi_o), math.sin(theta_o) * math.sin(phi_o), math.cos(theta_o)])
    h = (i + o) / np.linalg.norm(i + o)
    sin_h = math.hypot(h[0], h[1])
    t = np.array([h[0], h[1], 0.0]) / sin_h
    ti, to = math.atan2(-(i @ t), i[2]), math.atan2(-(o @ t), o[2])
    length = math.hypot(i @ t, i[2])
    alpha = 1.0 / math.sqrt((t[0] / alpha_x) ** 2 + (t[1] / alpha_y) ** 2)
    code = NDFS[ndf]
    value, error = 0.0, 0.0
    for side in (1.0, -1.0):
        case = (symmetric, side * ti, side * to, k, length, code, alpha, alpha_x, alpha_y, float(eta), float(kappa))
        if symmetric:
            value += _integrand(0.0, case, np.empty((2, k + 2)), np.empty((2, k + 2)))
        elif code == PHONG and alpha > 1.0:
            v, e = _singular(case, 2.0 / alpha**2 - 2.0, rtol)
            value, error = value + v, error + e
        else:
            v, e = _adaptive(case, rtol, panels)
            value, error = value + v, error + e
    if not symmetric:
        steep = code == PHONG and alpha > 1.0
        norm = _steep_norm(alpha) if steep else _norm(code, alpha)
        value, error = value / norm, error / norm
    scale = length / (4.0 * (i @ h) * i[2] * o[2] * sin_h)
    return value * scale, error * scale
