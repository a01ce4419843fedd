"""Maps of scratch layers: run time, coverage, and what points cost where scratches are thin.

Draws the paper's distributions (Table 1) at one size and prints, for each, seconds of all layers, the worst relative
error of coverage, how many layers culling leaves alive, and the scatter of texels by points (16 a texel) and by
splatting. `--nearest` also times scipy.spatial.cKDTree on the points of one layer.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time

import numpy as np

from brdftab.scratch_layers import lattice, layers, maps

# figure of the paper: layers, spread (degrees), length, width, density
TABLE = {
    "1b": (4, 7, 0.2, 2e-4, 0.6),
    "1c": (16, 360, 0.1, 1e-5, 0.3),
    "1d": (32, 360, 0.3, 3e-4, 0.05),
    "10f": (32, 360, 0.1, 2e-4, 0.05),
    "12a": (4, 4, 0.1, 5e-5, 0.5),
    "12b": (16, 360, 0.1, 2e-4, 0.1),
    "12c": (16, 360, 0.02, 2e-5, 0.1),
    "14a": (4, 7, 0.02, 7e-4, 0.5),
    "wide": (32, 360, 0.3, 2e-2, 0.3),
}


def described(name):
    """Return the layers of one distribution."""
    count, spread, length, width, density = TABLE[name]
    entry = {"profile": "flat", "material": "mirror", "count": count, "spread": min(spread, 360), "length": length}
    return layers.parse({"base": {"model": "lambert"}, "layer": [{**entry, "width": width, "density": density}]}, name)


def measure(name, size, repeats):
    """Return one row of the table."""
    layered = described(name)
    first = layered.layers[0]
    seconds, cpu = [], []
    for _ in range(repeats):
        started, worked = time.perf_counter(), time.process_time()
        found = maps.alpha_maps(layered, size)
        seconds.append(time.perf_counter() - started)
        cpu.append(time.process_time() - worked)
    drawn = found.facts["layers"]
    points = maps.layer_map(first, size, method="sample", samples=4)[0]
    splat = maps.layer_map(first, size, method="splat")[0]
    culling = found.facts["culling"]
    return {
        "figure": name,
        "layers": len(drawn),
        "method": drawn[0]["method"],
        "scratches": sum(row["scratches"] for row in drawn),
        "seconds_min": min(seconds),
        "seconds_median": statistics.median(seconds),
        "cpu_min": min(cpu),
        "coverage_error": max(abs(row["mean"] / row["area"] - 1.0) for row in drawn),
        "alive_level0": culling[0]["alive"],
        "alive_level4": culling[min(4, len(culling) - 1)]["alive"],
        "cull_bound": max(c["bound"] for c in culling),
        "std_points": float(points.std()),
        "std_splat": float(splat.std()),
    }


def nearest(size, name="1d"):
    """Return seconds that a k-d tree and the lattice need for 16 points a texel of one layer."""
    from scipy.spatial import cKDTree

    layer = described(name).layers[0]
    features = lattice.build(layer.length, layer.width, layer.angle, np.random.default_rng(1))
    frame = lattice.frame_of(layer.length, layer.width, layer.angle)
    tiles = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), -1).reshape(-1, 1, 2)
    started = time.perf_counter()
    tree = cKDTree((features.positions() + tiles).reshape(-1, 2) @ frame.T)
    side = (np.arange(4 * size) + 0.5) / (4 * size)
    rows = 64
    u, v = np.meshgrid(side, side[:rows])
    tree.query(np.stack([u, v], -1).reshape(-1, 2) @ frame.T, distance_upper_bound=layer.density, workers=-1)
    tree_seconds = (time.perf_counter() - started) * 4 * size / rows
    started = time.perf_counter()
    maps.layer_map(layer, size, method="sample", samples=4)
    return {"tree_s": tree_seconds, "lattice_s": time.perf_counter() - started}


def main():
    """Print the table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--figures", default=",".join(TABLE), help="rows of the table, separated by commas")
    parser.add_argument("--nearest", action="store_true", help="also time a k-d tree")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    maps.alpha_maps(described("14a"), 64)
    rows = [measure(name, args.size, args.repeats) for name in args.figures.split(",")]
    tree = nearest(args.size) if args.nearest else None
    if args.json:
        print(json.dumps({"size": args.size, "rows": rows, "nearest": tree}, indent=2))
        return 0
    print(f"{args.size}^2 texels and their mip levels; seconds of all layers, {args.repeats} repeats")
    print(
        f"{'figure':<7}{'layers':>7}{'method':>8}{'scratches':>12}{'min':>7}{'median':>8}{'cpu':>7}{'coverage':>10}"
        f"{'alive':>7}{'mip 4':>7}{'left out':>10}{'points':>8}{'splat':>8}"
    )
    for r in rows:
        print(
            f"{r['figure']:<7}{r['layers']:>7}{r['method']:>8}{r['scratches']:>12,}{r['seconds_min']:>7.2f}"
            f"{r['seconds_median']:>8.2f}{r['cpu_min']:>7.2f}{r['coverage_error']:>10.1e}{r['alive_level0']:>7.1f}{r['alive_level4']:>7.1f}"
            f"{r['cull_bound']:>10.1e}{r['std_points']:>8.4f}{r['std_splat']:>8.4f}"
        )
    print(
        "coverage: worst relative error of a layer; alive: layers a texel after culling at 1e-6; points, splat: scatter"
    )
    if tree is not None:
        print(f"one layer, 16 points a texel: k-d tree {tree['tree_s']:.1f} s, lattice {tree['lattice_s']:.2f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
