"""The second bounce as a quadrature over the direction d between both facets, without noise.

    f2 = w(i) w(o) int K(i, d) w(d) K(-d, o) domega,  K = F D/4,  w = 1/(|z| (1 + Lambda))

over elevations -i_z < d_z < o_z (Wang et al. 2022, Eqs. 1-4 with two vertices). K depends on the direction from which d
approaches -i and o, jumps at both ends (GGX), and peaks over a width alpha where d mirrors i or o. So the rectangles of
elevation and azimuth start with edges at these places, graded down to alpha, and are halved where the error is.

References
----------
- [GM80] Genz, Malik: An adaptive algorithm for numerical integration over an N-dimensional rectangular region, 1980.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.directions import HORIZON
from brdftab.jit import kernel, parallel_kernel
from brdftab.materials.fresnel import MIRROR
from brdftab.models._shared.fresnel.fresnel import multiply
from brdftab.models._shared.random_walk.terms import facet, segment

# the rule of degree 7 with 17 points on [-1, 1]^2: abscissas, weights and those of the embedded rule of degree 5 [GM80]
_A, _B, _C = math.sqrt(9.0 / 70.0), math.sqrt(0.9), math.sqrt(9.0 / 19.0)
_X = np.array([0, _A, -_A, 0, 0, _B, -_B, 0, 0, _B, _B, -_B, -_B, _C, _C, -_C, -_C])
_Y = np.array([0, 0, 0, _A, -_A, 0, 0, _B, -_B, _B, -_B, _B, -_B, _C, -_C, _C, -_C])
_W7 = np.repeat(np.array([-3816.0, 2940.0, 1020.0, 200.0, 1714.75]) / 19683.0, [1, 4, 4, 4, 4])
_W5 = np.repeat(
    np.array([-971.0, 735.0 / 2.0, 65.0 / 2.0, 25.0, 0.0]) / [729.0, 729.0, 729.0, 729.0, 1.0], [1, 4, 4, 4, 4]
)
# rectangles of one cell; the graded start takes some hundreds
_ROOM = 1 << 14
# edges of one coordinate
_EDGES = 512


@kernel
def _integrand(ndf, alpha_x, alpha_y, i, o, beta, phi, kind, fa, fb, table, row):
    """Fill row (W,) with K w K cos(beta) at one direction, and return the factor without F."""
    cb, dz = math.cos(beta), math.sin(beta)
    dx, dy = cb * math.cos(phi), cb * math.sin(phi)
    ax, ay, az = i[0] + dx, i[1] + dy, i[2] + dz
    bx, by, bz = o[0] - dx, o[1] - dy, o[2] - dz
    value = facet(ndf, alpha_x, alpha_y, ax, ay, az) * facet(ndf, alpha_x, alpha_y, bx, by, bz) * cb
    if value > 0.0:
        value *= segment(ndf, alpha_x, alpha_y, dx, dy, dz)[0]
    for w in range(row.size):
        row[w] = value
    if value > 0.0 and kind != MIRROR:
        multiply(kind, fa, fb, table, 0.5 * math.sqrt(ax * ax + ay * ay + az * az), row)
        multiply(kind, fa, fb, table, 0.5 * math.sqrt(bx * bx + by * by + bz * bz), row)
    return value


@kernel
def _rule(ndf, alpha_x, alpha_y, i, o, box, kind, fa, fb, table, row, whole):
    """Integrate over a box (middle and half width of beta, then of phi) into whole (W,).

    Returns the largest difference to the embedded rule, and the coordinate along which the integrand bends most.
    """
    size = row.size
    area = 4.0 * box[1] * box[3]
    rough = np.zeros(size)
    whole[:] = 0.0
    bend_b, bend_p, centre = 0.0, 0.0, 0.0
    for n in range(17):
        beta, phi = box[0] + box[1] * _X[n], box[2] + box[3] * _Y[n]
        value = _integrand(ndf, alpha_x, alpha_y, i, o, beta, phi, kind, fa, fb, table, row)
        for w in range(size):
            whole[w] += area * _W7[n] * row[w]
            rough[w] += area * _W5[n] * row[w]
        # fourth differences along both axes
        if n == 0:
            centre = value
        elif n <= 2:
            bend_b += value - centre
        elif n <= 4:
            bend_p += value - centre
        elif n <= 6:
            bend_b -= (value - centre) / 7.0
        elif n <= 8:
            bend_p -= (value - centre) / 7.0
    error = 0.0
    for w in range(size):
        error = max(error, abs(whole[w] - rough[w]))
    along = 1.0 if abs(bend_b) >= abs(bend_p) else 3.0
    # a corner where the integrand has no tangent plane must not be cut into ever thinner slices
    if max(box[1], box[3]) > 8.0 * min(box[1], box[3]):
        along = 1.0 if box[1] > box[3] else 3.0
    return error, along


@kernel
def _insert(edges, count, edge):
    """Put an edge in its place between the first and the last of `count`, if it is new; returns how many there are."""
    at = count
    while at > 0 and edges[at - 1] > edge - 1e-12:
        at -= 1
    if at == 0 or at == count or edges[at] < edge + 1e-12 or count == edges.size:
        return count
    for n in range(count, at, -1):
        edges[n] = edges[n - 1]
    edges[at] = edge
    return count + 1


@kernel
def _graded(marks, scale, low, high):
    """Return the edges of intervals between `low` and `high`: the marks, distances growing from `scale`, no wide gap.

    Away from the marks ridges of width `scale` may hide, where light leaves the plane of incidence.
    """
    edges = np.empty(_EDGES)
    edges[0], edges[1] = low, high
    count = 2
    widest = min(max(4.0 * scale, 0.1), 0.8)
    for mark in marks:
        count = _insert(edges, count, mark)
        step = scale
        while step < high - low:
            count = _insert(edges, count, mark - step)
            count = _insert(edges, count, mark + step)
            step *= 3.0
    # from the last interval on, so that those before keep their places
    for n in range(count - 2, -1, -1):
        left, gap = edges[n], edges[n + 1] - edges[n]
        parts = int(gap / widest) + 1
        for k in range(1, parts):
            count = _insert(edges, count, left + gap * k / parts)
    return edges[:count]


@kernel
def second_bounce(ndf, alpha_x, alpha_y, i, o, kind, fa, fb, table, floor, tolerance, out):
    """Compute the second bounce between unit vectors i and o (3,), both above the horizon, in 1/sr.

    Parameters
    ----------
    ndf, alpha_x, alpha_y, kind, fa, fb, table
        Distribution, roughness and reflectance of W wavelengths.
    i, o : ndarray (3,)
        Directions away from the surface.
    floor, tolerance : float
        The error wanted is `tolerance` times the larger of the result and `floor` (1/sr).
    out : ndarray (W,)
        Filled with the result.

    Returns
    -------
    float
        The estimated error, 1/sr; above what was wanted only where 16384 rectangles do not suffice.
    """
    size = out.size
    ends = segment(ndf, alpha_x, alpha_y, i[0], i[1], i[2])[0] * segment(ndf, alpha_x, alpha_y, o[0], o[1], o[2])[0]
    bi, bo = math.asin(min(i[2], 1.0)), math.asin(min(o[2], 1.0))
    behind = math.atan2(-i[1], -i[0])
    scale = min(max(min(alpha_x, alpha_y), 1e-5), 1.0)
    beta = _graded(np.array([-bi, -bo, 0.0, bi, bo]), scale, -bi, bo)
    turn = 2.0 * math.pi
    beyond = (math.atan2(o[1], o[0]) - behind) % turn
    phi = _graded(np.array([0.0, beyond, turn]), scale, 0.0, turn)
    boxes, values, errors = np.empty((_ROOM, 5)), np.empty((_ROOM, size)), np.empty(_ROOM)
    row, total = np.empty(size), np.zeros(size)
    count, left = 0, 0.0
    for a in range(len(beta) - 1):
        for b in range(len(phi) - 1):
            if count == _ROOM:
                break
            boxes[count, 0], boxes[count, 1] = 0.5 * (beta[a] + beta[a + 1]), 0.5 * (beta[a + 1] - beta[a])
            boxes[count, 2], boxes[count, 3] = behind + 0.5 * (phi[b] + phi[b + 1]), 0.5 * (phi[b + 1] - phi[b])
            count += 1
    errors[:count] = -1.0
    while True:
        left = 0.0
        total[:] = 0.0
        for n in range(count):
            # what is new, or was halved
            if errors[n] < 0.0:
                errors[n], boxes[n, 4] = _rule(
                    ndf, alpha_x, alpha_y, i, o, boxes[n], kind, fa, fb, table, row, values[n]
                )
            left += errors[n]
            for w in range(size):
                total[w] += values[n, w]
        largest = floor / ends
        for w in range(size):
            largest = max(largest, abs(total[w]))
        if left <= tolerance * largest or count == _ROOM:
            break
        # halves of what errs more than its share: one in place, one at the end
        share = 0.5 * tolerance * largest / count
        for n in range(count):
            if errors[n] > share and count < _ROOM:
                axis = int(boxes[n, 4])
                boxes[n, axis] *= 0.5
                for c in range(4):
                    boxes[count, c] = boxes[n, c]
                boxes[n, axis - 1] -= boxes[n, axis]
                boxes[count, axis - 1] += boxes[n, axis]
                errors[n] = errors[count] = -1.0
                count += 1
    for w in range(size):
        out[w] = ends * total[w]
    return ends * left


@parallel_kernel
def second_bounces(ndf, alpha_x, alpha_y, incoming, outgoing, kind, fa, fb, table, floor, tolerance, out):
    """Apply `second_bounce` to N pairs (N, 3) with floors (N,); fills out (N, W), 0 at and below the horizon."""
    for n in numba.prange(incoming.shape[0]):
        if min(incoming[n, 2], outgoing[n, 2]) > HORIZON:
            second_bounce(
                ndf, alpha_x, alpha_y, incoming[n], outgoing[n], kind, fa, fb, table, floor[n], tolerance, out[n]
            )
        else:
            out[n] = 0.0
