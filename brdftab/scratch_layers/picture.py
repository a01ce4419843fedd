"""Pictures of spheres of scratched material under a room with windows and a point light.

The camera looks along -z from far away. Texture coordinates are conformal, so that scratches keep their angles:
Mercator's around the vertical axis (turned on a lathe), or stereographic from the front. The viewer's and the light's
parts of a cone are those of `brdftab.scratch_layers.cones`; the base is sampled by its own model.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brdftab.errors import ParameterError
from brdftab.evaluation.importance_sampling import sample
from brdftab.models.resolve import Setup
from brdftab.models.scratch.balance import balanced
from brdftab.models.scratch.profiles import parse as parse_profile
from brdftab.models.scratch.trace import trace
from brdftab.scratch_layers.combine import weights
from brdftab.scratch_layers.cones import add_base, add_cones
from brdftab.scratch_layers.environment import LIGHTS
from brdftab.scratch_layers.layers import Layered, parse
from brdftab.scratch_layers.maps import AlphaMaps, alpha_maps
from brdftab.scratch_layers.shading import BASE, values
from brdftab.typing import Array

BINS, RAYS = 128, 512
# slices along the scratch of the reflectance; rows and samples of the base
SLICES, ROWS, SAMPLES = 17, 45, 256
# of the point light: direction from the spheres, distance in radii, radiant power
LIGHT, FAR, POWER = (-0.28, 0.55, 0.79), 5.0, 70.0
RADIUS = 0.9
SMALLEST, LARGEST = 16, 2048
PROJECTIONS = ("lathe", "front")

_STEEL = {"model": "smith", "alpha": 0.06, "material": "Fe"}
BRUSHED = {
    "seed": 3,
    "psi": 3.0,
    "base": _STEEL,
    "layer": [
        {"profile": "quartic:0.4", "material": "Fe", "area": 0.2, "width": 0.004, "length": 0.7, "spread": 5.0,
         "count": 4},
    ],
}  # fmt: skip
SCRATCHED = {
    "seed": 7,
    "psi": 5.0,
    "base": _STEEL,
    "layer": [
        {"profile": "quartic:0.4", "material": "Fe", "density": 0.08, "width": 0.005, "length": 1.0, "spread": 180.0,
         "count": 24},
    ],
}  # fmt: skip


@dataclass(frozen=True)
class Sphere:
    """One sphere: its material, how the tile lies on it, and how many tiles a radius holds."""

    layered: Layered
    projection: str = "front"
    tiles: float = 1.0

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn; raises `ParameterError`."""
        if self.projection not in PROJECTIONS:
            raise ParameterError.not_known("projection", self.projection, PROJECTIONS)
        if not 0.0 < self.tiles <= 1000.0:
            raise ParameterError.out_of_range("tiles", self.tiles, "(0, 1000]", "tiles a radius")


def default_spheres() -> list[Sphere]:
    """Return the two spheres of the picture without a file: brushed, and scratched in all directions."""
    return [
        Sphere(parse(BRUSHED, "brushed"), "lathe", 1.0),
        Sphere(parse(SCRATCHED, "scratched"), "front", 1.0),
    ]


def _surface(x: Array, y: Array, sphere: Sphere) -> tuple[Array, Array, Array, Array, Array]:
    """Return normals, tangents along u, u, v and tiles a radius at points (N,) of the unit disc."""
    z = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))
    normal = np.stack([x, y, z], axis=-1)
    if sphere.projection == "lathe":
        wide = np.sqrt(np.maximum(x * x + z * z, 1e-12))
        tangent = np.stack([z / wide, np.zeros_like(x), -x / wide], axis=-1)
        u, v = np.arctan2(x, z), np.arctanh(np.clip(y, -0.9999, 0.9999))
        scale = 1.0 / wide
    else:
        tangent = np.array([1.0, 0.0, 0.0]) - (x / (1.0 + z))[:, None] * (normal + np.array([0.0, 0.0, 1.0]))
        u, v = 2.0 * x / (1.0 + z), 2.0 * y / (1.0 + z)
        scale = 2.0 / (1.0 + z)
    return normal, tangent, u * sphere.tiles + 0.5, v * sphere.tiles + 0.5, scale * sphere.tiles


def _angles(directions: Array, normal: Array, tangent: Array) -> tuple[Array, Array]:
    """Return theta and azimuth (N,) of directions in the surfaces' own frames."""
    across = np.cross(normal, tangent)
    x, y, z = (np.einsum("ni,ni->n", directions, axis) for axis in (tangent, across, normal))
    return np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)


def _rgb(values: Array) -> Array:
    """Return (..., 3): one channel counts in each."""
    return np.broadcast_to(values, (*values.shape[:-1], 3))


@dataclass(frozen=True, eq=False)
class _Tables:
    """What the kernels look up: cones of each distinct scratch, and samples of the base."""

    kinds: NDArray[np.int64]
    cumulative: Array
    ratio: NDArray[np.float32]
    rho: Array
    directions: Array
    weights: Array


def _scratches(layered: Layered) -> tuple[NDArray[np.int64], list[Setup]]:
    """Return which of the distinct profiles and materials each layer has, and these."""
    setups = [layer.setup(layered.psi) for layer in layered.layers]
    names = [str(setup.parameters) for setup in setups]
    distinct = list(dict.fromkeys(names))
    return np.array([distinct.index(n) for n in names]), [setups[names.index(n)] for n in distinct]


def _tables(layered: Layered, seed: int) -> _Tables:
    """Trace the scratches and sample the base."""
    base = layered.base
    if not base.isotropic:
        raise ParameterError(
            f"base model = {base.model.name} has a direction of its own, which the picture does not draw; give it "
            "equal roughness along both axes"
        )
    if len(layered.channels) not in (1, 3):
        raise ParameterError(f"a picture needs 1 or 3 channels, not {len(layered.channels)}; leave out wavelengths")
    kinds, setups = _scratches(layered)
    cumulative, ratio, rho = [], [], []
    for setup in setups:
        assert setup.fresnel is not None
        found = trace(parse_profile(setup.values["profile"]), BINS, RAYS)
        mirror = found.layers.sum(axis=0) / (found.aperture[:, None] * found.aperture)
        slices = [found.shaded(t, setup.fresnel) for t in np.linspace(0.0, 0.5 * math.pi, SLICES)]
        safe = np.where(mirror > 0.0, mirror, 1.0)[..., None]
        ratio.append(np.stack([_rgb(s / safe) for s in slices]).astype(np.float32))
        # shares lost to the cap of bounces dim what is drawn
        ratio[-1] *= (1.0 - found.lost)[:, None, None].astype(np.float32)
        cumulative.append(found.cumulative)
        rho.append(mirror)
    directions, each = np.zeros((ROWS, SAMPLES, 3)), np.zeros((ROWS, SAMPLES, 3))
    for row in range(ROWS):
        theta = (row + 0.5) * 0.5 * math.pi / ROWS
        drawn = sample(base.model.name, theta, SAMPLES, seed=seed + row, **base.parameters)
        s = np.sin(drawn.theta_o)
        directions[row] = np.stack([s * np.cos(drawn.phi_o), s * np.sin(drawn.phi_o), np.cos(drawn.theta_o)], -1)
        each[row] = _rgb(np.where(drawn.valid[:, None], drawn.weight, 0.0))
    return _Tables(kinds, np.stack(cumulative), np.stack(ratio), np.stack(rho), directions, each)


def _shade(
    sphere: Sphere, maps: AlphaMaps, tables: _Tables, x: Array, y: Array, pixel: float, count: int, seed: int
) -> Array:
    """Return radiance (N, 3) at points of the unit disc; `pixel` is a sample's width in radii."""
    layered = sphere.layered
    normal, tangent, u, v, scale = _surface(x, y, sphere)
    up = np.maximum(normal[:, 2], 1e-3)
    # a sample's footprint in texels, the geometric mean of its two axes
    texels = pixel * scale * maps.size / np.sqrt(up)
    alpha = maps.at(u, v, np.maximum(np.log2(np.maximum(texels, 1.0)), 0.0))
    each, rest = weights(np.clip(alpha, 0.0, 1.0), layered.combination)
    view = np.broadcast_to(np.array([0.0, 0.0, 1.0]), normal.shape)
    towards = FAR * np.array(LIGHT) / np.linalg.norm(LIGHT) - normal
    distance = np.linalg.norm(towards, axis=-1)
    light = towards / distance[:, None]
    power = POWER / distance**2
    out = np.zeros((x.size, 3))
    axis = np.array([[math.cos(layer.angle), math.sin(layer.angle)] for layer in layered.layers])
    add_cones(
        each, axis, tables.kinds, normal, tangent, np.ascontiguousarray(view), light, power, layered.psi,
        balanced(layered.psi), tables.cumulative, tables.ratio, tables.rho, LIGHTS, count, seed, out,
    )  # fmt: skip
    add_base(rest, normal, np.ascontiguousarray(view), tables.directions, tables.weights, LIGHTS, count, seed, out)
    theta_o, phi_o = _angles(view, normal, tangent)
    theta_i, phi_i = _angles(light, normal, tangent)
    f = values(layered.base, theta_i, theta_o, phi_o - phi_i, phi_i, BASE)
    lit = rest * power * np.maximum(np.cos(theta_i), 0.0)
    return out + lit[:, None] * _rgb(f)


def _background(x: Array, y: Array) -> Array:
    """Return a plain backdrop (N, 3): the room, dimmed towards the edges."""
    shade = 0.085 * np.exp(-0.45 * (x * x + y * y))
    return shade[:, None] * np.array([0.92, 0.97, 1.08])


def render(
    spheres: list[Sphere] | None = None,
    size: int = 400,
    *,
    samples: int = 24,
    detail: int = 3,
    maps_size: int = 1024,
    seed: int = 0,
    exposure: float = 1.0,
    progress: Callable[[float], None] | None = None,
) -> NDArray[np.uint8]:
    """Draw spheres side by side.

    Parameters
    ----------
    spheres : list of Sphere, optional
        By default a brushed one and a scratched one.
    size : int
        Rows of the picture, and columns a sphere, [16, 2048].
    samples : int
        Directions a point and cone, [1, 4096].
    detail : int
        Points along a side of a pixel, [1, 16].
    maps_size : int
        Texels along a side of the maps, a power of two.
    seed : int
        Of what is random.
    exposure : float
        Factor before tones are compressed, (0, 1e6].
    progress : callable, optional
        Called with the share done.

    Returns
    -------
    uint8 (size, size * spheres, 3)
        sRGB; the same bytes for the same arguments.

    Raises
    ------
    ParameterError
        If a number is out of range or a material cannot be drawn.
    """
    for name, value, low, high in (
        ("size", size, SMALLEST, LARGEST), ("samples", samples, 1, 4096), ("detail", detail, 1, 16),
    ):  # fmt: skip
        if int(value) != value or not low <= value <= high:
            raise ParameterError.out_of_range(name, value, f"the whole numbers in [{low}, {high}]")
    if int(seed) != seed or not 0 <= seed < 2**31:
        raise ParameterError.out_of_range("seed", seed, "the whole numbers in [0, 2147483647]")
    if not 0.0 < exposure <= 1e6:
        raise ParameterError.out_of_range("exposure", exposure, "(0, 1e6]", "1 is the default")
    given = default_spheres() if spheres is None else spheres
    images = []
    for number, sphere in enumerate(given):
        maps = alpha_maps(sphere.layered, maps_size)
        tables = _tables(sphere.layered, seed)
        total = np.zeros((size * size, 3))
        steps = detail * detail
        for step in range(steps):
            a, b = (step % detail + 0.5) / detail, (step // detail + 0.5) / detail
            row, column = np.divmod(np.arange(size * size), size)
            x = (2.0 * (column + a) / size - 1.0) / RADIUS
            y = (1.0 - 2.0 * (row + b) / size) / RADIUS
            inside = x * x + y * y < 1.0
            radiance = _background(x * RADIUS, y * RADIUS)
            pixel = 2.0 / (size * RADIUS)
            radiance[inside] = _shade(
                sphere, maps, tables, x[inside], y[inside], pixel, samples, seed + 7919 * step + number
            )
            total += _tone(exposure * radiance)
            if progress is not None:
                progress((number + (step + 1) / steps) / len(given))
        images.append((total / steps).reshape(size, size, 3))
    return _encode(np.concatenate(images, axis=1))


def _tone(radiance: Array) -> Array:
    """Compress radiance to [0, 1) before samples of a pixel are averaged, so that edges of highlights stay smooth."""
    return 1.0 - np.exp(-np.maximum(radiance, 0.0))


def _encode(linear: Array) -> NDArray[np.uint8]:
    """Return sRGB bytes of linear values in [0, 1]."""
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1.0 / 2.4) - 0.055)
    return np.asarray(np.rint(255.0 * np.clip(curve, 0.0, 1.0)), dtype=np.uint8)
