"""The group ``scratch``: profiles, maps of covered area, values and pictures of scratched materials."""

from __future__ import annotations

import json
import math
from typing import Any

import click

from brdftab.commands.nearest_words import Group
from brdftab.commands.progress import progress_bar
from brdftab.timing import Clock

_json = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
_overwrite = click.option("--overwrite", is_flag=True, help="Replace an existing output.")


@click.group(
    cls=Group,
    epilog="\b\nExamples:\n"
    "  brdftab scratch profile quartic:1 --out profile.png\n"
    "  brdftab scratch maps layers.toml --size 1024 --out maps.exr\n"
    "  brdftab scratch picture --out picture.png",
)
def scratch() -> None:
    """Scratched materials: profiles, layers in a TOML file, their maps, values and pictures."""


@scratch.command(
    epilog="\b\nExamples:\n"
    "  brdftab scratch profile quartic:1\n"
    "  brdftab scratch profile v:45 --out profile.png --overwrite",
)
@click.argument("profile", metavar="SPEC")
@click.option("--out", metavar="FILE", help="Also draw heights and slopes (.png, .pdf, .svg).")
@_overwrite
@_json
def profile(profile: str, out: str | None, overwrite: bool, as_json: bool) -> None:
    """Say how deep and how steep a cross-section is: quartic:1, v:45, u:1:8, ellipse:1, flat or file:PATH."""
    from brdftab.scratch_layers.figure import draw, profile_of, summary

    shape = profile_of(profile)
    facts = {**summary(shape), "figure": out}
    if out is not None:
        draw(shape, out, overwrite=overwrite)
    if as_json:
        click.echo(json.dumps(facts, indent=2, allow_nan=False))
        return
    click.echo(f"profile      {facts['profile']}")
    click.echo(f"depth        {facts['depth']:.6g} half widths")
    click.echo(f"steepest     slope {facts['steepest_slope']:.6g}, {facts['steepest_degrees']:.4g} degrees")
    click.echo(f"pieces       {facts['pieces']} parabolas, {'symmetric' if facts['symmetric'] else 'not symmetric'}")
    if out is not None:
        click.echo(f"wrote        {out}")


@scratch.command(
    epilog="\b\nExamples:\n"
    "  brdftab scratch maps layers.toml\n"
    "  brdftab scratch maps layers.toml --size 256 --out maps.exr --cull 0 --overwrite --json",
)
@click.argument("layers", metavar="FILE")
@click.option("--size", type=int, default=1024, help="Texels along a side, a power of two [default: 1024].")
@click.option("--out", default="maps.exr", metavar="FILE", help="Output, .exr [default: maps.exr].")
@click.option(
    "--method", default="auto", metavar="auto|sample|splat",
    help="Points, ellipses laid down, or by width: points where half a scratch is a texel wide [default: auto].",
)  # fmt: skip
@click.option("--samples", type=int, help="Points along a side of a texel [default: 4, more on small maps].")
@click.option("--cull", type=float, default=1e-6, help="Shares below it become 0 [default: 1e-6].")
@_overwrite
@_json
def maps(
    layers: str, size: int, out: str, method: str, samples: int | None, cull: float, overwrite: bool, as_json: bool
) -> None:
    """Map the share of each texel that each layer covers, with mip levels: an EXR part a level, a channel a layer."""
    from brdftab.scratch_layers.layers import read
    from brdftab.scratch_layers.mapfile import check_map_output, write
    from brdftab.scratch_layers.maps import alpha_maps

    check_map_output(out, overwrite=overwrite)
    layered = read(layers)
    with progress_bar("drawing") as report:
        found = alpha_maps(layered, size, method=method, samples=samples, cull=cull, progress=report)
    write(found, out, overwrite=overwrite)
    facts = found.facts
    if as_json:
        click.echo(json.dumps({**facts, "file": out}, indent=2, allow_nan=False))
        return
    click.echo(
        f"{'layer':<10}{'method':>8}{'angle':>9}{'scratches':>11}{'area asked':>12}{'area drawn':>12}{'error':>10}"
    )
    for row in facts["layers"]:
        off = row["mean"] / row["area"] - 1.0 if row["area"] > 0.0 else 0.0
        click.echo(
            f"{row['name']:<10}{row['method']:>8}{row['angle_degrees']:>9.2f}{row['scratches']:>11,}"
            f"{row['area']:>12.6f}{row['mean']:>12.6f}{off:>10.1e}"
        )
    first = facts["culling"][0]
    click.echo(
        f"culling      {first['alive']:.1f} of {len(facts['layers'])} layers alive at a texel; at most "
        f"{max(c['bound'] for c in facts['culling']):.1e} of a texel left out"
    )
    click.echo(f"maps         {len(found.levels)} levels from {found.size}^2, {facts['run_time_s']:.2f} s")
    click.echo(f"wrote        {out}")


@scratch.command(
    "eval",
    epilog="\b\nExamples:\n"
    "  brdftab scratch eval layers.toml --theta-i 30 --theta-o 30 --phi 180 --level 3\n"
    "  brdftab scratch eval layers.toml --maps maps.exr --theta-i 30 --theta-o 40 --phi 90 --u 0.2 --v 0.7 --json",
)
@click.argument("layers", metavar="FILE")
@click.option("--theta-i", "theta_i", type=float, required=True, help="Polar angle of the light [degrees].")
@click.option("--theta-o", "theta_o", type=float, required=True, help="Polar angle of the view [degrees].")
@click.option("--phi", type=float, required=True, help="phi_o - phi_i [degrees]; 180 is the mirror side.")
@click.option("--phi-i", "phi_i", type=float, default=0.0, help="Azimuth of the light against u [degrees; default: 0].")
@click.option("--u", type=float, default=0.5, help="Place on the tile [default: 0.5].")
@click.option("--v", type=float, default=0.5, help="Place on the tile [default: 0.5].")
@click.option("--level", type=float, default=0.0, help="Mip level, 0 is the finest [default: 0].")
@click.option("--size", type=int, default=1024, help="Texels along a side of the maps [default: 1024].")
@click.option("--maps", "file", metavar="FILE", help="Maps made before; without it they are drawn anew.")
@click.option("--combination", metavar="normalised|union", help="Instead of the file's own: how layers add up.")
@_json
def evaluate(
    layers: str,
    theta_i: float,
    theta_o: float,
    phi: float,
    phi_i: float,
    u: float,
    v: float,
    level: float,
    size: int,
    file: str | None,
    combination: str | None,
    as_json: bool,
) -> None:
    """Evaluate the BRDF of a footprint: the layers and the base, weighted by the areas that they cover there."""
    from brdftab.scratch_layers.combine import weights
    from brdftab.scratch_layers.layers import read
    from brdftab.scratch_layers.mapfile import check_maps_of
    from brdftab.scratch_layers.mapfile import read as read_maps
    from brdftab.scratch_layers.maps import alpha_maps
    from brdftab.scratch_layers.shading import evaluate as evaluate_layers

    layered = read(layers)
    mode = combination or layered.combination
    if file is not None:
        found = read_maps(file)
        check_maps_of(found, layered, file)
    else:
        found = alpha_maps(layered, size)
    alpha = found.at(u, v, level)
    each, rest = weights(alpha, mode)
    angles = [math.radians(x) for x in (theta_i, theta_o, phi)]
    value = evaluate_layers(layered, alpha, *angles, phi_i=math.radians(phi_i), combination=mode)
    facts = {
        "value": value.tolist(),
        "channels": list(layered.channels),
        "alpha": alpha.tolist(),
        "weights": each.tolist(),
        "base": float(rest),
        "combination": mode,
        "size": found.size,
        "level": level,
    }
    if as_json:
        click.echo(json.dumps(facts, indent=2, allow_nan=False))
        return
    click.echo(f"{layers}  theta_i {theta_i:g}  theta_o {theta_o:g}  phi {phi:g}  phi_i {phi_i:g} degrees, f in 1/sr")
    click.echo(f"{'':<14}" + "".join(f"{c:>18}" for c in layered.channels))
    click.echo(f"{'value':<14}" + "".join(f"{x:>18.10g}" for x in value))
    click.echo(f"{'base covers':<14}{float(rest):>18.10g}")
    for layer, share in zip(layered.layers, each, strict=True):
        if share > 0.0:
            click.echo(f"{'layer ' + layer.name:<14}{share:>18.10g}")


@scratch.command(
    epilog="\b\nExamples:\n"
    "  brdftab scratch picture --out picture.png\n"
    "  brdftab scratch picture layers.toml --size 300 --projection lathe --out mine.png --overwrite",
)
@click.argument("layers", metavar="[FILE]", required=False)
@click.option("--out", default="picture.png", metavar="FILE", help="Output, .png [default: picture.png].")
@click.option("--size", type=int, default=400, help="Rows, and columns a sphere [default: 400].")
@click.option("--samples", type=int, default=16, help="Directions a point and cone [default: 16].")
@click.option("--detail", type=int, default=3, help="Points along a side of a pixel [default: 3].")
@click.option("--maps-size", type=int, default=1024, help="Texels along a side of the maps [default: 1024].")
@click.option(
    "--projection", default="front", metavar="front|lathe",
    help="How the tile lies on FILE's sphere: from the front, or around the vertical axis [default: front].",
)  # fmt: skip
@click.option("--tiles", type=float, default=1.0, help="Tiles a radius of FILE's sphere [default: 1].")
@click.option("--exposure", type=float, default=1.0, help="Factor on all light [default: 1].")
@click.option("--seed", type=int, default=0, help="Seed of the samples [default: 0].")
@_overwrite
@_json
def picture(
    layers: str | None,
    out: str,
    size: int,
    samples: int,
    detail: int,
    maps_size: int,
    projection: str,
    tiles: float,
    exposure: float,
    seed: int,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Draw spheres in a room with windows and a point light: a brushed and a scratched one, or FILE's material."""
    from brdftab.kernel_cache import has_compiled
    from brdftab.scratch_layers.layers import read
    from brdftab.scratch_layers.picture import Sphere, render
    from brdftab.scratch_layers.png import check_picture_output, write

    check_picture_output(out, overwrite=overwrite)
    spheres = None if layers is None else [Sphere(read(layers), projection, tiles)]
    if not has_compiled("brdftab.scratch_layers.cones"):
        click.echo("brdftab: compiling kernels: the first picture takes up to a minute longer", err=True)
    clock = Clock()
    with progress_bar("drawing") as report:
        pixels = render(
            spheres, size, samples=samples, detail=detail, maps_size=maps_size, seed=seed, exposure=exposure,
            progress=report,
        )  # fmt: skip
    write(pixels, out, overwrite=overwrite)
    facts: dict[str, Any] = {
        "file": out,
        "rows": pixels.shape[0],
        "columns": pixels.shape[1],
        "run_time_s": clock.seconds,
    }
    if as_json:
        click.echo(json.dumps(facts, indent=2, allow_nan=False))
        return
    click.echo(f"wrote        {out}, {facts['columns']} x {facts['rows']} pixels, {facts['run_time_s']:.1f} s")
