"""Traced scratches as files: the native one, and what renderers take instead.

`native` holds flux and cosines by bounce order, for any material; `triplet` is the paper's texture of rho_m, rho_0 and
gamma for one material; `dense` a 4-D table in (t, p) of both directions, the delta of the cone in mirrored bins.
"""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from brdftab._version import __version__
from brdftab.errors import FileFormatError, ParameterError
from brdftab.materials.fresnel import Fresnel
from brdftab.models.scratch import SPEC
from brdftab.models.scratch.flux import FACTS, balanced
from brdftab.models.scratch.profiles import Profile
from brdftab.models.scratch.shoot import LAYERS
from brdftab.models.scratch.trace import Traced
from brdftab.quadrature import gauss
from brdftab.scratch_layers import images
from brdftab.scratch_layers.scratch import Scratch, material_of
from brdftab.system import machine
from brdftab.timing import Clock

KINDS = {"native": "brdftab-scratch", "triplet": "brdftab-scratch-triplet", "dense": "brdftab-scratch-dense"}
NAMES = ("bounces", "cosine1", "cosine2", "cosine3", "cosine4", "spread", "tilt")
DENSE = (16, 32)
# gamma where its definition has no value: large, so that rho_0 serves up to grazing
NO_GAMMA = 64.0
ANGLES = (
    "p = atan2(omega.v, omega.n) across the scratch, t = asin(omega.u) along it, radians in [-pi/2, pi/2]; directions "
    "point away from the surface; rows are the exit bin of p, columns the incident one; a mirror sends t_i into -t_i"
)


def _head(scratch: Scratch, kind: str, clock: Clock) -> dict[str, Any]:
    """Return what every file says of itself."""
    one = scratch.traced
    return {
        "format": KINDS[kind],
        "format_version": 1,
        "version": __version__,
        "profile": one.profile.text,
        "bins": one.bins,
        "phi_edges": one.phi_edges.tolist(),
        "angles": ANGLES,
        "rays": one.rays,
        "cap": one.cap,
        "error": {
            "l1": scratch.error,
            "meaning": "L1 distance of the flux to an independent trace with as many rays; 2 is the largest possible",
            "lost": one.lost.tolist(),
            "lost_mean": float(one.lost @ one.aperture / 2.0),
            "column_sum_deviation": one.deviation,
            "largest_scaling": float(np.abs(one.change - 1.0).max()),
        },
        "run_time_s": clock.seconds,
        "machine": machine(),
        "citation": SPEC.citation,
        "doi": SPEC.doi,
    }


def _native(scratch: Scratch, clock: Clock) -> tuple[images.Images, dict[str, Any]]:
    one = scratch.traced
    rho = [scratch.rho(1), scratch.rho(2), scratch.rho() - scratch.rho(1) - scratch.rho(2)]
    made: images.Images = dict(zip("RGB", (np.maximum(a, 0.0) for a in rho), strict=True))
    for layer in range(LAYERS):
        if not one.layers[layer].any():
            continue
        made[f"layer{layer:02d}.flux"] = one.layers[layer]
        for n, name in enumerate(NAMES):
            if one.facts[layer, n].any():
                made[f"layer{layer:02d}.{name}"] = one.facts[layer, n]
    shape = asdict(one.profile) | {n: getattr(one.profile, n).tolist() for n in ("knots", "height", "slope", "bend")}
    head = _head(scratch, "native", clock) | {
        "shape": shape,
        "meaning": (
            "R, G, B: rho of mirrors in 1/rad by 1, 2 and more bounces, to look at; layerNN.flux: flux between bins, "
            "NN = 00 the first bounce, then orders 2, 3, 4, 5+ in three classes each by the smallest cosine of "
            "incidence (below .15, below .4, above); bounces: mean number; cosine1..4: means of equal groups of the "
            "sorted cosines of incidence in the plane across; spread: standard deviation of the smallest; tilt: by how "
            "much the others move with it"
        ),
    }
    return made, head


def _triplet(scratch: Scratch, fresnel: Fresnel, clock: Clock) -> tuple[images.Images, dict[str, Any]]:
    mirror = scratch.rho()
    flat, middle = scratch.shaded(0.0, fresnel), scratch.shaded(math.pi / 3.0, fresnel)
    made: images.Images = {"rho_m": mirror}
    undefined = {}
    for c, channel in enumerate(fresnel.channels):
        low, at = flat[..., c], middle[..., c]
        lit = mirror > 0.0
        share = np.divide(at - low, mirror - low, out=np.zeros_like(low), where=lit & (mirror > low))
        defined = share > 0.0
        # R(t) = (2 |t|/pi)^gamma is (2/3)^gamma at 60 degrees
        gamma = np.where(defined, np.log(np.where(defined, share, 1.0)) / math.log(2.0 / 3.0), NO_GAMMA)
        made[f"rho_0.{channel}"] = low
        made[f"gamma.{channel}"] = np.where(lit, np.clip(gamma, 0.0, NO_GAMMA), 0.0)
        undefined[channel] = float((lit & ~defined).sum() / max(lit.sum(), 1))
    head = _head(scratch, "triplet", clock) | {
        "channels": list(fresnel.channels),
        "fresnel": fresnel.source,
        "gamma_undefined": undefined,
        "meaning": (
            "rho(t) = R rho_m + (1 - R) rho_0 with R = (2 |t|/pi)^gamma, per radian (times pi: the paper's, per unit "
            f"p/pi); gamma = {NO_GAMMA:g} in the share gamma_undefined of the bins, where reflectance at 60 degrees "
            "lies below that at 0"
        ),
    }
    return made, head


def _dense(
    scratch: Scratch, fresnel: Fresnel, sizes: tuple[int, int], clock: Clock
) -> tuple[images.Images, dict[str, Any]]:
    along, across = sizes
    one = scratch.traced
    if one.bins % across:
        raise ParameterError(
            f"grid = {along}x{across} needs bins in multiples of {across}, not {one.bins}; give --bins"
        )
    step = one.bins // across
    edges = np.linspace(-0.5 * math.pi, 0.5 * math.pi, along + 1)
    x, w = gauss(4)
    share = one.aperture.reshape(across, step).sum(axis=1)
    values = np.zeros((along, across, along, across, len(fresnel.channels)))
    for n in range((along + 1) // 2):
        # the mean over the bin, weighted as the delta is
        t = 0.5 * (edges[n] + edges[n + 1]) + 0.5 * (edges[n + 1] - edges[n]) * x
        weight = 0.5 * (edges[n + 1] - edges[n]) * w * np.cos(t) ** 2
        flux = sum(a * scratch.shaded(float(b), fresnel) for a, b in zip(weight / weight.sum(), t, strict=True))
        flux = flux * (one.aperture[:, None] * one.aperture)[..., None]
        coarse = flux.reshape(across, step, across, step, -1).sum(axis=(1, 3))
        f = coarse / (share[:, None] * share)[..., None] / weight.sum()
        # by incident direction first
        values[n, :, along - 1 - n] = values[along - 1 - n, :, n] = f.transpose(1, 0, 2)
    flat = values.reshape(along * across, along * across, -1)
    head = _head(scratch, "dense", clock) | {
        "channels": list(fresnel.channels),
        "fresnel": fresnel.source,
        "t_bins": along,
        "p_bins": across,
        "meaning": (
            "f in 1/sr without cosine; row t_i * p_bins + p_i, column t_o * p_bins + p_o, equal bins of t and p; the "
            "delta of the cone lies in the mirrored bin of t, so that with the bins' exact integrals of cos t cos p "
            "over solid angle no energy is lost or made"
        ),
    }
    return {c: flat[..., n] for n, c in enumerate(fresnel.channels)}, head


def write_scratch(
    scratch: Scratch,
    path: str | Path,
    *,
    form: str = "native",
    sizes: tuple[int, int] = DENSE,
    overwrite: bool = False,
    **material: Any,
) -> dict[str, Any]:
    """Write a traced scratch as .exr (float32) or .npz (float64) and return the header that it carries.

    Parameters
    ----------
    scratch : Scratch
        From `trace_scratch`.
    path : str or Path
        Ends in .exr or .npz.
    form : {"native", "triplet", "dense"}, optional
        What is written; `read_scratch` reads native files.
    sizes : tuple of int, optional
        Bins of t and p of a dense table.
    overwrite : bool, optional
        Replace an existing file.
    **material
        Of triplet and dense, as in `Scratch.albedo`.

    Raises
    ------
    ParameterError
        If the form or the material is not valid, or the bins do not divide.
    OutputExistsError, BrdftabError
        As `brdftab.write`.
    """
    clock = Clock()
    if form not in KINDS:
        raise ParameterError.not_known("form", form, KINDS)
    if form == "native":
        if material:
            raise ParameterError(
                f"{next(iter(material))} has no place in a native file, which serves any; leave it out"
            )
        made, head = _native(scratch, clock)
    elif form == "triplet":
        made, head = _triplet(scratch, material_of(material), clock)
    else:
        made, head = _dense(scratch, material_of(material), sizes, clock)
    images.write(made, head, path, overwrite=overwrite)
    return head


def read_scratch(path: str | Path) -> Scratch:
    """Read a native file; the flux of an .exr is scaled anew, as float32 keeps energy to 1e-7 only.

    Raises
    ------
    FileFormatError
        If the file is no native scratch of brdftab.
    BrdftabError
        If it cannot be opened.
    """
    made, head = images.read(path, KINDS["native"])
    try:
        shape = head["shape"]
        arrays = {n: np.array(shape[n], dtype=np.float64) for n in ("knots", "height", "slope", "bend")}
        profile = Profile(shape["text"], **arrays, symmetric=shape["symmetric"], depth=shape["depth"])
        bins, lost = int(head["bins"]), np.array(head["error"]["lost"])
        layers, facts = np.zeros((LAYERS, bins, bins)), np.zeros((LAYERS, FACTS, bins, bins), dtype=np.float32)
        for name, pixels in made.items():
            layer, _, what = name.partition(".")
            if what == "flux":
                layers[int(layer[5:])] = pixels
            elif what:
                facts[int(layer[5:]), NAMES.index(what)] = pixels
        one = Traced(profile, head["rays"], head["cap"], layers, facts, lost, 0.0, np.ones(bins))
        if made["R"].dtype == np.float32:
            g, _ = balanced(layers.sum(axis=0), one.aperture * (1.0 - lost))
            layers *= g[:, None] * g
        return Scratch(one)
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise FileFormatError(f"{path}: is a damaged scratch ({error}); write it again") from error
