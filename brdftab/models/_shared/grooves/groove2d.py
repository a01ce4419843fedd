"""One V groove in its plane: the width of the beam that leaves after k bounces, in closed form (Lee 2018, Sec. 4).

Angles are counter-clockwise positive from the surface normal; the left facet's normal stands at -l, the right one's at
+r. A beam is measured across its rays and hits the left facet first; mirror (theta, l, r) -> (-theta, r, l) for the
other one. Only the two ends (t inside, q or u outside) appear, so that reciprocity is manifest; the printed Eqs. 6 and
9 lack clamps and are not used.
"""

from __future__ import annotations

import math

from brdftab.jit import kernel

PI = math.pi


@kernel
def beam_symmetric(sin_y, cos_y, sin_t, cos_t, sin_q, cos_q):
    """Return the beam of a symmetric groove with facets of length 1.

    y = pi/2 - tilt is half the step between bounces, t the incoming angle, q = -(-1)^k times the outgoing one.
    """
    p1 = sin_y * cos_t
    p2 = cos_y * sin_t
    p3 = sin_y * cos_q
    p4 = cos_y * sin_q
    return min(p1 - p2, p3 - p4) - max(0.0, max(-(p1 + p2), -(p3 + p4)))


@kernel
def beam_even(sl, cl, sr, cr, st, ct, su, cu):
    """Return sin(l) sin(r) times the beam of a groove of height 1 after an even number of bounces; t in, u out."""
    top = min(sr * (cl * ct - sl * st), sl * (cr * cu + sr * su))
    bottom = max(0.0, max(-sl * (cr * ct + sr * st), -sr * (cl * cu - sl * su)))
    return top - bottom


@kernel
def beam_odd(sl, cl, sr, cr, s_max, c_max, s_min, c_min):
    """Return sin(l) sin(r) times the beam after an odd number of bounces >= 3; larger and smaller of both angles."""
    c_lm = cl * c_max - sl * s_max
    s_lm = sl * c_max + cl * s_max
    top = min(sr * c_lm, -sl * ((cl * cr - sl * sr) * c_lm - (sl * cr + cl * sr) * s_lm))
    return top - max(0.0, -sl * (cr * c_min + sr * s_min))


@kernel
def width_symmetric(theta_i, tilt, k):
    """Return the width (groove of height 1) that leaves after k bounces, and the outgoing angle.

    Parameters
    ----------
    theta_i : float
        In-plane incoming angle, radians in (-pi/2, pi/2).
    tilt : float
        Facet tilt, radians in (0, pi/2).
    k : int
        Number of bounces.
    """
    y = 0.5 * PI - tilt
    sign = 1.0 if k % 2 == 0 else -1.0
    theta_o = sign * (PI + theta_i - 2.0 * k * y)
    if abs(theta_o) >= 0.5 * PI:
        return 0.0, theta_o
    q = -sign * theta_o
    beam = beam_symmetric(math.sin(y), math.cos(y), math.sin(theta_i), math.cos(theta_i), math.sin(q), math.cos(q))
    return max(beam, 0.0) / math.sin(tilt), theta_o


@kernel
def width_nonsymmetric(theta_i, left, right, k):
    """Return the width (groove of height 1) that leaves after k bounces, and the outgoing angle; radians."""
    sl, cl, sr, cr = math.sin(left), math.cos(left), math.sin(right), math.cos(right)
    if k % 2 == 0:
        theta_o = PI + theta_i - k * (PI - left - right)
    else:
        theta_o = (k - 1) * (PI - right) - (k + 1) * left - theta_i
    if abs(theta_o) >= 0.5 * PI:
        return 0.0, theta_o
    if k % 2 == 0:
        beam = beam_even(sl, cl, sr, cr, math.sin(theta_i), math.cos(theta_i), math.sin(theta_o), math.cos(theta_o))
    else:
        high, low = max(theta_i, theta_o), min(theta_i, theta_o)
        if k == 1:
            beam = sr * math.cos(left + high) - max(0.0, -sl * math.cos(right - low))
        else:
            beam = beam_odd(sl, cl, sr, cr, math.sin(high), math.cos(high), math.sin(low), math.cos(low))
    return max(beam, 0.0) / (sl * sr), theta_o
