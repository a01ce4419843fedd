"""The light around a sphere, made in code: a dim room, and windows and strips that are far brighter."""

from __future__ import annotations

import math

import numpy as np

from brdftab.jit import kernel

# azimuth, elevation, half widths of both (degrees), radiance, warmth
LIGHTS = np.array(
    [
        [-52.0, 28.0, 9.0, 26.0, 5.0, 0.10],
        [62.0, 20.0, 5.0, 32.0, 4.0, -0.12],
        [8.0, 66.0, 28.0, 7.0, 4.5, 0.0],
        [-128.0, 5.0, 14.0, 20.0, 2.5, 0.15],
        [140.0, 15.0, 18.0, 15.0, 2.0, -0.1],
    ]
)
# over how many degrees a window's edge fades
EDGE = 1.5


@kernel
def _inside(x, half):
    """Return 1 within half a width, 0 beyond, with a soft edge."""
    t = (half - abs(x)) / EDGE + 0.5
    t = min(max(t, 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


@kernel
def add_radiance(x, y, z, weight, lights, out):
    """Add weight (3,) times the RGB radiance from direction (x, y up, z towards the viewer) to out (3,)."""
    elevation = math.degrees(math.asin(min(max(y, -1.0), 1.0)))
    azimuth = math.degrees(math.atan2(x, z))
    # a grey room: darker floor, a glow along the horizon
    glow = math.exp(-((elevation / 18.0) ** 2))
    up = 0.5 + 0.5 * y
    red = 0.03 + 0.10 * up + 0.10 * glow
    green = 0.03 + 0.115 * up + 0.095 * glow
    blue = 0.035 + 0.14 * up + 0.085 * glow
    if y < 0.0:
        floor = 1.0 + 0.6 * y
        red, green, blue = red * floor, green * floor, blue * floor
    for n in range(lights.shape[0]):
        turn = azimuth - lights[n, 0]
        turn -= 360.0 * math.floor(turn / 360.0 + 0.5)
        lit = _inside(elevation - lights[n, 1], lights[n, 3])
        if lit > 0.0:
            lit *= _inside(turn, lights[n, 2]) * lights[n, 4]
            red += lit * (1.0 + lights[n, 5])
            green += lit
            blue += lit * (1.0 - lights[n, 5])
    out[0] += weight[0] * red
    out[1] += weight[1] * green
    out[2] += weight[2] * blue
