"""What single-bounce models make of a scratch: they know how often each slope occurs, not where.

In the plane across, D(m) dm is the length of walls whose normal stands at m, over the aperture's length. Light
from p_i that meets such a wall leaves at p_o = 2 m - p_i, so that with a masking term G

    rho(p_o, p_i) = G D(m) cos((p_o - p_i)/2)/(2 cos p_i cos p_o),  m = (p_i + p_o)/2.

Fresnel multiplies it at the cosine cos t |cos((p_o - p_i)/2)|. The traced scratch replaces G by what really happens.
"""

from __future__ import annotations

import numba
import numpy as np

from brdftab.errors import ParameterError
from brdftab.jit import parallel_kernel
from brdftab.models.scratch.flux import aperture, edges
from brdftab.models.scratch.profiles import Profile
from brdftab.typing import Array

MASKINGS = ("none", "v-cavity", "smith")
# walls that stand for the profile, and angles that stand for a bin
WALLS, ANGLES = 8192, 8


def walls(profile: Profile, count: int = WALLS) -> tuple[Array, Array]:
    """Return angles m (N,) of walls' normals, radians, and their lengths (N,) over the aperture's.

    Their sum of length times cos m is 1, and of length times sin m is 0, but for profiles that end at other heights.
    """
    x = -1.0 + 2.0 * (np.arange(count) + 0.5) / count
    m = -np.arctan(profile.at(x)[1])
    return m, 1.0 / (count * np.cos(m))


@parallel_kernel
def _deposit(m, length, p, masked, v_cavity, out):
    """Add to out (M, M) by incident and exit bin; p (M, A) are angles of each bin, masked (M, A) their Smith G1."""
    bins, angles = p.shape
    for j in numba.prange(bins):
        for a in range(angles):
            for n in range(m.size):
                seen = np.cos(p[j, a] - m[n])
                exit_angle = 2.0 * m[n] - p[j, a]
                if seen <= 0.0 or abs(exit_angle) >= 0.5 * np.pi:
                    continue
                at = (exit_angle / np.pi + 0.5) * bins
                k = min(int(at), bins - 1)
                g = 1.0
                if v_cavity:
                    g = 2.0 * np.cos(m[n]) * min(np.cos(p[j, a]), np.cos(exit_angle)) / seen
                    g = min(1.0, g)
                else:
                    b = min(int((at - k) * angles), angles - 1)
                    g = masked[j, a] * masked[k, b]
                out[j, k] += g * seen * length[n]


def smith_visible(m: Array, length: Array, p: Array) -> Array:
    """Return Smith's G1 of walls at angles p (...): the light that arrives over what walls that face it would take."""
    facing = np.maximum(np.cos(p[..., None] - m), 0.0) @ length
    return np.cos(p) / facing


def single_bounce_rho(profile: Profile, bins: int, masking: str = "smith") -> Array:
    """Return rho (M, M) in 1/rad, by exit and incident bin, of a single-bounce model with the profile's slopes, F = 1.

    Parameters
    ----------
    profile : Profile
        The cross-section.
    bins : int
        Bins of angle across the scratch.
    masking : {"smith", "v-cavity", "none"}
        Smith's G1 of both directions with the profile's own distribution, min(1, 2 cos m cos p/cos(p - m)) of both, or
        1, which makes energy at steep walls.

    Raises
    ------
    ParameterError
        If there is no such masking.
    """
    if masking not in MASKINGS:
        raise ParameterError.not_known("masking", masking, MASKINGS)
    m, length = walls(profile)
    low = edges(bins)[:-1, None]
    p = low + np.pi / bins * (np.arange(ANGLES) + 0.5) / ANGLES
    masked = smith_visible(m, length, p) if masking == "smith" else np.ones_like(p)
    flux = np.zeros((bins, bins))
    _deposit(m, length, p, masked, masking == "v-cavity", flux)
    # a path and its reverse carry the same; sums over walls and angles differ by where they lie in their bins
    flux = 0.5 * (flux + flux.T) * np.pi / (bins * ANGLES)
    share = aperture(bins)
    return flux / (share[:, None] * share)
