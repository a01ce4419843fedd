"""Radiance that scratches and their base reflect towards a viewer, at many points of a surface at once."""

from __future__ import annotations

import math

import numba
import numpy as np

from brdftab.jit import kernel, parallel_kernel
from brdftab.models.scratch.balance import strength
from brdftab.models.scratch.blur import bin_of, kernel_value
from brdftab.scratch_layers.environment import add_radiance

LEAST = 1e-6


@kernel
def mixed(n, seed):
    """Return a number in [0, 1) for a counter: the finaliser of SplitMix64, masked to what integers hold."""
    z = (n * 0x9E3779B1 + seed * 0x85EBCA6B + 0x27D4EB2F) & 0xFFFFFFFF
    z = ((z ^ (z >> 16)) * 0x85EBCA6B) & 0xFFFFFFFF
    z = ((z ^ (z >> 13)) * 0xC2B2AE35) & 0xFFFFFFFF
    return (z ^ (z >> 16)) / 4294967296.0


@kernel
def _ratio(table, t, k, j, out):
    """Fill out (3,) with reflectance at |t| along the scratch, over that of a perfect mirror: linear in t."""
    x = abs(t) / (0.5 * math.pi) * (table.shape[0] - 1)
    low = min(int(x), table.shape[0] - 2)
    share = x - low
    for c in range(3):
        out[c] = (1.0 - share) * table[low, k, j, c] + share * table[low + 1, k, j, c]


@parallel_kernel
def add_cones(
    weight, axis, kinds, normal, tangent, view, light, power, psi, table, cumulative, ratio, rho, lights,
    count, seed, out,
):  # fmt: skip
    """Add what the scratches reflect to out (N, 3).

    weight (N, K); axis (K, 2) cosine and sine of each layer's angle; kinds (K,) index into the tables; normal, tangent,
    view, light (N, 3); power (N,) irradiance of the point light on a surface that faces it; psi and table as in
    `balance`; cumulative (P, M, M + 1), ratio (P, T, M, M, 3), rho (P, M, M). Cones are sampled by their own flux:
    binary search for the bin, evenly in sin p inside it, `count` directions shared among a point's layers by weight.
    """
    bins = rho.shape[1]
    step = math.pi / bins
    for n in numba.prange(weight.shape[0]):
        total = 0.0
        for k in range(weight.shape[1]):
            total += weight[n, k]
        if total < LEAST:
            continue
        found, each = out[n], np.empty(3)
        nx, ny, nz = normal[n, 0], normal[n, 1], normal[n, 2]
        ux, uy, uz = tangent[n, 0], tangent[n, 1], tangent[n, 2]
        vx, vy, vz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
        for k in range(weight.shape[1]):
            w = weight[n, k]
            if w < LEAST:
                continue
            c, s, kind = axis[k, 0], axis[k, 1], kinds[k]
            ax, ay, az = c * ux + s * vx, c * uy + s * vy, c * uz + s * vz
            bx, by, bz = c * vx - s * ux, c * vy - s * uy, c * vz - s * uz
            sine = min(max(view[n, 0] * ax + view[n, 1] * ay + view[n, 2] * az, -1.0), 1.0)
            across = view[n, 0] * bx + view[n, 1] * by + view[n, 2] * bz
            up = view[n, 0] * nx + view[n, 1] * ny + view[n, 2] * nz
            t, cosine = math.asin(sine), math.sqrt(max(1.0 - sine * sine, 0.0))
            row = bin_of(math.atan2(across, up), bins)
            sums = cumulative[kind, row]
            draws = max(1, math.ceil(count * w / total))
            start = mixed(n * 64 + k, seed)
            for m in range(draws):
                x = (m + start) / draws
                low, high = 0, bins
                while high - low > 1:
                    middle = (low + high) // 2
                    if sums[middle] <= x:
                        low = middle
                    else:
                        high = middle
                share = min(max((x - sums[low]) / max(sums[low + 1] - sums[low], 1e-30), 0.0), 1.0)
                left = math.sin(low * step - 0.5 * math.pi)
                right = math.sin((low + 1) * step - 0.5 * math.pi)
                sp = left + share * (right - left)
                cp = math.sqrt(max(1.0 - sp * sp, 0.0))
                _ratio(ratio[kind], t, row, low, each)
                for q in range(3):
                    each[q] *= w / draws
                dx = -sine * ax + cosine * (sp * bx + cp * nx)
                dy = -sine * ay + cosine * (sp * by + cp * ny)
                dz = -sine * az + cosine * (sp * bz + cp * nz)
                add_radiance(dx, dy, dz, each, lights, found)
            facing = light[n, 0] * nx + light[n, 1] * ny + light[n, 2] * nz
            if facing <= 0.0 or power[n] <= 0.0:
                continue
            along = min(max(light[n, 0] * ax + light[n, 1] * ay + light[n, 2] * az, -1.0), 1.0)
            blur = kernel_value(math.asin(along) + t, psi)
            if blur <= 0.0:
                continue
            other = light[n, 0] * bx + light[n, 1] * by + light[n, 2] * bz
            column = bin_of(math.atan2(other, facing), bins)
            _ratio(ratio[kind], t, row, column, each)
            f = rho[kind, row, column] * blur * strength(t, psi, table) * strength(math.asin(along), psi, table)
            for q in range(3):
                found[q] += w * f * each[q] * power[n] * facing


@parallel_kernel
def add_base(weight, normal, view, samples, weights, lights, count, seed, out):
    """Add what an isotropic base reflects of the surroundings to out (N, 3).

    samples (T, S, 3) are directions drawn for a viewer at T evenly spaced polar angles and azimuth 0, weights (T, S, 3)
    are f cos/pdf; each point takes `count` of them at random from the row nearest to it.
    """
    rows, many = samples.shape[0], samples.shape[1]
    for n in numba.prange(weight.size):
        if weight[n] < LEAST:
            continue
        nx, ny, nz = normal[n, 0], normal[n, 1], normal[n, 2]
        up = min(max(view[n, 0] * nx + view[n, 1] * ny + view[n, 2] * nz, 0.0), 1.0)
        tx, ty, tz = view[n, 0] - up * nx, view[n, 1] - up * ny, view[n, 2] - up * nz
        long = math.sqrt(tx * tx + ty * ty + tz * tz)
        if long < 1e-9:
            tx, ty, tz, long = 1.0 - nx * nx, -nx * ny, -nx * nz, math.sqrt(max(1.0 - nx * nx, 1e-12))
        tx, ty, tz = tx / long, ty / long, tz / long
        sx, sy, sz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        place = math.acos(up) / (0.5 * math.pi) * rows - 0.5 + mixed(n, seed + 1) - 0.5
        row = min(max(round(place), 0), rows - 1)
        # the row stands for an angle of its own: turn its directions by the rest, about the axis across
        turn = math.acos(up) - (row + 0.5) * 0.5 * math.pi / rows
        ct, st = math.cos(turn), math.sin(turn)
        each = np.empty(3)
        first = int(mixed(n, seed + 2) * many)
        for m in range(count):
            i = (first + m * 37) % many
            x, y, z = samples[row, i, 0], samples[row, i, 1], samples[row, i, 2]
            x, z = x * ct - z * st, z * ct + x * st
            if z <= 0.0:
                continue
            for q in range(3):
                each[q] = weight[n] * weights[row, i, q] / count
            add_radiance(
                x * tx + y * sx + z * nx, x * ty + y * sy + z * ny, x * tz + y * sz + z * nz, each, lights, out[n]
            )
