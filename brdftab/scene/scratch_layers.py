"""Layers of scratches in a scene: those that cover less than the tolerance are neither mapped nor traced."""

from __future__ import annotations

from dataclasses import replace

from brdftab.scene.plan import Item, Plan, Planned
from brdftab.scene.scene import Material
from brdftab.scratch_layers.layers import Layered, read
from brdftab.scratch_layers.maps import AlphaMaps, alpha_maps, check_size


def shown(layered: Layered, tolerance: float) -> tuple[Layered, float, int]:
    """Return the layers that are kept, the share of the surface that the others cover, and how many they are.

    A texel that a layer does not cover shows another layer or the base: no albedo changes by more than the share.
    """
    order = sorted(range(len(layered.layers)), key=lambda n: layered.layers[n].area)
    lost, gone = 0.0, set()
    for n in order[: len(order) - 1]:
        if lost + layered.layers[n].area > tolerance:
            break
        lost += layered.layers[n].area
        gone.add(n)
    kept = tuple(layer for n, layer in enumerate(layered.layers) if n not in gone)
    return replace(layered, layers=kept), lost, len(gone)


def plan(material: Material) -> Planned:
    """Plan the maps of layers of scratches.

    Raises
    ------
    ParameterError, FileFormatError
        As `brdftab.scratch_layers.layers.read`.
    """
    check_size(material.size)
    layered = read(material.layers)
    kept, lost, gone = shown(layered, material.albedo_tolerance)
    share = gone / len(layered.layers)
    items: tuple[Item, ...] = ()
    if gone:
        told = f"{gone} of {len(layered.layers)} layers, which cover {lost:.2e} of the surface in the mean"
        items = (Item("layers", told, "bound", 0.0, lost, time=share, size=share),)
    texels = 4.0 * material.size**2 * 4.0 / 3.0
    predicted = {"bytes": texels * len(kept.layers), "bytes_unplanned": texels * len(layered.layers)}
    made = Plan(
        model="", given={"layers": material.layers, "size": material.size}, parameters={}, luminance=False,
        quantity="maps", grid=None, full=None, whole=None, tolerance=material.albedo_tolerance, rules=0.0,
        items=items, predicted=predicted,
    )  # fmt: skip
    return Planned(material, made)


def make(material: Material) -> AlphaMaps:
    """Return the maps of the layers that are kept."""
    return alpha_maps(shown(read(material.layers), material.albedo_tolerance)[0], material.size)
