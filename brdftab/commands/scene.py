"""Commands on scenes: ``plan``, ``cache``, and ``tabulate --scene``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from brdftab.commands.progress import progress_bar

if TYPE_CHECKING:
    from brdftab.scene.plan import Planned
    from brdftab.scene.scene import Material, Scene

_json = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")


@click.command(epilog="\b\nExamples:\n  brdftab plan scene.toml\n  brdftab plan scene.toml --json")
@click.argument("file", metavar="SCENE")
@_json
def plan(file: str, as_json: bool) -> None:
    """Say what tables of a scene (TOML) can leave out, the bound on what that costs, and what it saves.

    Nothing is written; brdftab tabulate --scene follows the plan.
    """
    from brdftab.scene.planner import as_json as told
    from brdftab.scene.planner import plan_scene
    from brdftab.scene.scene import read

    found = plan_scene(read(file))
    if as_json:
        click.echo(json.dumps({"scene": file, "materials": [told(one) for one in found]}, indent=2, allow_nan=False))
        return
    for planned in found:
        for line in lines(planned):
            click.echo(line)
    before, after = (sum(one.plan.predicted.get(k, 0.0) for one in found) for k in ("bytes_unplanned", "bytes"))
    click.echo(f"{'scene':<12} {_size(before)} become {_size(after)}")


def _size(count: float) -> str:
    for unit, step in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if count >= step:
            return f"{count / step:.3g} {unit}"
    return f"{count:.0f} B"


def lines(planned: Planned) -> list[str]:
    """Return what is told of a planned material."""
    made, name = planned.plan, planned.material.name
    head = made.model or planned.material.layers
    found = [f"{name:<12} {head}, {made.quantity}, tolerance {made.tolerance:g}"]
    for item in made.items:
        saves = [f"{share:.0%} of {what}" for what, share in (("time", item.time), ("bytes", item.size)) if share > 0]
        costs = "no cost" if item.kind == "exact" else f"{item.kind}, cell {item.cell:.1e}, albedo {item.albedo:.1e}"
        found.append(f"  {item.name:<11} {item.told}")
        found.append(f"  {'':<11} {costs}{'; saves ' + ', '.join(saves) if saves else ''}")
    expected = made.predicted
    found.append(
        f"  {'promised':<11} cell {made.cell_error:.1e} (values below {made.floor:g}/sr count absolutely), "
        f"albedo {made.albedo_error:.1e}"
    )
    told = f"{_size(expected['bytes_unplanned'])} become {_size(expected['bytes'])}"
    if "seconds" in expected:
        told += (
            f"; predicted {expected['seconds']:.2g} s in kernels, {expected['seconds_unplanned']:.2g} s without a plan"
        )
    found.append(f"  {'predicted':<11} {told}")
    return found


def _paths(scene: Scene, outs: tuple[str, ...], file: str) -> dict[str, str]:
    """Return the output of each material: a file in a folder, or a pattern with {name} in it."""
    from brdftab.errors import ParameterError

    if len(outs) > 1:
        raise ParameterError(f"out = {', '.join(outs)} names several places; a scene takes one folder or {{name}}.npz")
    where = outs[0] if outs else Path(file).stem
    if "{name}" not in where and Path(where).suffix.lower() in (".exr", ".npz"):
        raise ParameterError(f"out = {where} is one file; give a folder for the scene's tables, or {{name}}.npz")
    pattern = where if "{name}" in where else str(Path(where) / "{name}.exr")
    return {material.name: pattern.replace("{name}", material.name) for material in scene.materials}


def tabulate_scene(
    file: str, outs: tuple[str, ...], overwrite: bool, verify: bool, cached: bool, as_json: bool, idle: dict[str, Any]
) -> bool:
    """Tabulate the materials of a scene as planned, print what was made, and tell whether all promises hold.

    `idle` are options of single tables, which a scene states itself.
    """
    from brdftab.errors import ParameterError
    from brdftab.io import check_output
    from brdftab.scene.scene import read

    for name, value in idle.items():
        if value is not None and value is not False and value != ():
            raise ParameterError(f"{name} = {value} goes with --model; a scene states it in its file")
    from brdftab.timing import Clock

    clock = Clock()
    scene = read(file)
    paths = _paths(scene, outs, file)
    for path in paths.values():
        try:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ParameterError(
                f"out = {Path(path).parent} cannot be made a folder ({error.strerror or error}); choose another path"
            ) from error
        check_output(path, overwrite=overwrite)
    told, fits = [], True
    with progress_bar("tabulating") as report:
        # a scene that does not fit its budget is refused before any table is made
        made = _made(scene, cached)
        for number, (material, run) in enumerate(made):
            facts = run(paths[material.name], overwrite, verify)
            told.append({"name": material.name, "file": paths[material.name], **facts})
            fits = fits and facts.get("verified", {}).get("holds", True)
            if report is not None:
                report((number + 1) / len(made))
    wall = clock.seconds
    if as_json:
        click.echo(json.dumps({"scene": file, "wall_time_s": wall, "materials": told}, indent=2, allow_nan=False))
    else:
        for facts in told:
            _print(facts)
        click.echo(f"{'scene':<12} {len(told)} materials, {wall:.2f} s in all")
    return fits


def _made(scene: Scene, cached: bool) -> list[tuple[Material, Any]]:
    """Return for each material what makes and writes its table; cached ones are not planned again."""
    from dataclasses import replace

    from brdftab.scene import cache
    from brdftab.scene.planner import plan_scene

    held = {m.name: cache.get(m) for m in scene.materials if cached and not m.layers}
    rest = tuple(m for m in scene.materials if held.get(m.name) is None)
    plans = {p.material.name: p for p in plan_scene(replace(scene, materials=rest))} if rest else {}
    found: list[tuple[Material, Any]] = []
    for material in scene.materials:
        if material.layers:
            found.append((material, _maps(material, plans[material.name])))
        else:
            found.append((material, _table(material, plans.get(material.name), held.get(material.name), cached)))
    return found


def _table(material: Material, planned: Planned | None, held: Any, cached: bool) -> Any:
    def run(path: str, overwrite: bool, verify: bool) -> dict[str, Any]:
        from brdftab.io import write
        from brdftab.scene import cache
        from brdftab.scene.execute import carry_out
        from brdftab.scene.verify import verify as measure
        from brdftab.tabulation.albedo_table import AlbedoTable, write_albedo

        table = held
        if table is None:
            assert planned is not None
            table = carry_out(planned)
            if cached:
                cache.put(material, table)
        (write_albedo if isinstance(table, AlbedoTable) else write)(table, path, overwrite=overwrite)
        made = table.provenance["plan"]
        facts = {
            "cached": held is not None,
            "model": made["model"],
            "promised": made["promised"],
            "error": table.provenance.get("error", {}).get("estimate"),
            "items": made["items"],
            "bytes": Path(path).stat().st_size,
            "total_time_s": table.provenance.get("total_time_s", table.provenance.get("run_time_s")),
        }
        return facts | ({"verified": measure(material, table, timed=True)} if verify else {})

    return run


def _maps(material: Material, planned: Planned) -> Any:
    def run(path: str, overwrite: bool, verify: bool) -> dict[str, Any]:
        from brdftab.scene.scratch_layers import make
        from brdftab.scratch_layers.mapfile import write as write_maps

        maps = make(material)
        write_maps(maps, path, overwrite=overwrite)
        made = planned.plan.to_json()
        return {
            "cached": False, "model": "layers of scratches", "promised": made["promised"], "error": None,
            "items": made["items"], "bytes": Path(path).stat().st_size,
            "total_time_s": maps.facts["run_time_s"],
        }  # fmt: skip

    return run


def _print(facts: dict[str, Any]) -> None:
    """Print one line on what was made, one on its true error if that was measured."""
    how = "from the cache" if facts["cached"] else f"{facts['total_time_s']:.2f} s"
    error = "" if facts["error"] is None else f"error {facts['error']:.1e} on probes, "
    promised = facts["promised"]
    click.echo(
        f"{facts['name']:<12} {facts['model']}: {error}promised {promised['cell_error']:.1e} a cell, "
        f"{promised['albedo_error']:.1e} in albedo; {_size(facts['bytes'])}, {how}; wrote {facts['file']}"
    )
    # of tables of albedos the error is the albedo's
    if facts["error"] is not None and facts["error"] > (promised["cell_error"] or promised["albedo_error"]):
        click.echo(f"{'':<12} missed: the probes exceed the promise; raise tolerance or floor, or take a finer grid")
    found = facts.get("verified")
    if found:
        click.echo(
            f"{'':<12} measured {found['cell_error']:.1e} a cell, {found['albedo_error']:.1e} in albedo: "
            f"{'holds' if found['holds'] else 'EXCEEDS the promise'}; "
            f"{found['seconds']:.2f} s, {found['seconds_unplanned']:.2f} s without a plan"
        )


@click.command(epilog="\b\nExamples:\n  brdftab cache\n  brdftab cache --clear")
@click.option("--clear", is_flag=True, help="Throw all tables away.")
@click.option(
    "--limit", type=click.IntRange(min=0), metavar="BYTES", help="Throw the longest unused away down to this."
)
@_json
def cache(clear: bool, limit: int | None, as_json: bool) -> None:
    """Show or clear the cache of tables that scenes share.

    It lies in BRDFTAB_CACHE_DIR, or below the user's cache, and holds BRDFTAB_CACHE_SIZE bytes [default: 2 GiB].
    """
    from brdftab.scene import cache as kept

    gone, freed = kept.shrink(0) if clear else kept.shrink(limit) if limit is not None else (0, 0)
    found = kept.entries()
    facts: dict[str, Any] = {
        "folder": str(kept.folder()),
        "limit_bytes": kept.limit(),
        "tables": len(found),
        "bytes": sum(entry.size for entry in found),
        "removed": gone,
        "removed_bytes": freed,
    }
    if as_json:
        click.echo(json.dumps(facts, indent=2))
        return
    click.echo(f"folder       {facts['folder']}")
    click.echo(f"tables       {facts['tables']}, {_size(facts['bytes'])} of {_size(facts['limit_bytes'])}")
    if clear or limit is not None:
        click.echo(f"removed      {gone}, {_size(freed)}")
