"""Write the golden tables anew, and SOURCES.json with the command, tool, version and date of each.

    python tests/golden/make.py          # all
    python tests/golden/make.py smith    # those whose name begins so

Run it only when a change of values is meant, and look at `brdftab compare OLD NEW` before committing.
"""

from __future__ import annotations

import datetime
import json
import platform
import shlex
import sys
from pathlib import Path

import numba
import numpy as np

import brdftab
from brdftab.cli import main as run

HERE = Path(__file__).parent
MADE_WITH = (
    f"Python {platform.python_version()}, numba {numba.__version__}, numpy {np.__version__}, {platform.machine()}"
)
TABLES = {
    "ashikhmin-shirley.npz": "--model ashikhmin-shirley --grid 4x6x4x6",
    "ashikhmin-shirley-components.exr": "--model ashikhmin-shirley --grid 3x8x3x8 --nu 10 --nv 40 --f0 0.04 "
    "--kd 0.6,0.3,0.1 --components",
    "scratch.npz": "--model scratch --form blurred --bins 32 --rays 512 --psi 20 --grid 4x6x4x6",
    "scratch-components.exr": "--model scratch --form blurred --profile v:30 --bins 32 --rays 512 --psi 15 --eta 2.91 "
    "--k 3.09 --grid 3x8x3x8 --components",
    "lambert.npz": "--model lambert --grid 8x8x12 --kd 0.2,0.5,0.9 --dtype float64",
    "lambert-points.exr": "--model lambert --theta-i 0,30,60,90 --phi 0:180:5 --cell point",
    "oren-nayar.exr": "--model oren-nayar --grid 8x8x12 --sigma 30 --components",
    "oren-nayar-qualitative.npz": "--model oren-nayar --grid 8x8x12 --variant qualitative --kd 0.8 --cell average",
    "cook-torrance-dielectric.npz": "--model cook-torrance --grid 8x8x12 --ndf ggx --alpha 0.3 --ior 1.5",
    "cook-torrance-phong.exr": "--model cook-torrance --grid 8x8x12 --ndf phong --exponent 20 --f0 0.9,0.6,0.3",
    "smith.exr": "--model smith --grid 8x8x12",
    "smith-average.npz": "--model smith --grid 6x6x9 --ndf ggx --alpha 0.4 --cell average --tolerance 1e-2",
    "smith-spectral.npz": "--model smith --grid 8x8x12 --ndf ggx --alpha 0.2 --material Cu --wavelengths 450,550,650",
    "smith-separable.npz": "--model smith --grid 8x8x12 --masking separable --material Al --dtype float64 "
    "--tolerance 1e-9",
    "smith-anisotropic.exr": "--model smith --grid 4x8x4x8 --ndf ggx --alpha-x 0.2 --alpha-y 0.6 --eta 2.91 --k 3.09",
    "vgroove-sym.npz": "--model vgroove-sym --grid 8x8x12 --ndf ggx --alpha 0.5 --tolerance 1e-2",
    "vgroove-sym-components.exr": "--model vgroove-sym --grid 6x6x10 --max-bounces 3 --material Cu --components "
    "--tolerance 1e-2",
    "vgroove-sym-anisotropic.npz": "--model vgroove-sym --grid 4x6x4x6 --alpha-x 0.2 --alpha-y 0.6 --ior 1.7 "
    "--tolerance 1e-2",
    "vgroove-sym-white.exr": "--model vgroove-sym --grid 8x8x12 --alpha 0.3 --material mirror "
    "--dtype float64 --tolerance 1e-3",
    "vgroove-nonsym.exr": "--model vgroove-nonsym --grid 8x8x12 --tolerance 1e-2",
    "vgroove-nonsym-ggx.npz": "--model vgroove-nonsym --grid 8x8x12 --ndf ggx --alpha 0.3 --material Ag "
    "--tolerance 1e-2",
    "vgroove-nonsym-components.npz": "--model vgroove-nonsym --grid 6x6x10 --ndf ggx --alpha 0.6 --eta 0.2 --k 3.2 "
    "--components --tolerance 1e-2",
    "vgroove-nonsym-anisotropic.exr": "--model vgroove-nonsym --grid 3x6x3x6 --alpha-x 0.3 --alpha-y 0.6 --f0 0.8 "
    "--tolerance 1e-2",
    "smith-multi.npz": "--model smith-multi --grid 8x8x12 --tolerance 1e-4",
    "smith-multi-components.exr": "--model smith-multi --grid 6x6x10 --ndf beckmann --alpha 0.7 --material Cu "
    "--components",
    "smith-multi-dielectric.npz": "--model smith-multi --grid 4x4+4x6 --ior 1.5 --alpha 0.5 --dtype float64",
    "smith-multi-paths.exr": "--model smith-multi --grid 5x5x8 --estimator pt --samples 64 --alpha 0.9 --f0 0.8",
    "smith-multi-anisotropic.npz": "--model smith-multi --grid 3x4x3x4 --alpha-x 0.3 --alpha-y 0.6 --material mirror "
    "--samples 32 --tolerance 1e-2",
    "smith-walk.npz": "--model smith-walk --grid 5x5x8 --samples 64 --alpha 0.9",
    "smith-walk-glass.exr": "--model smith-walk --grid 3x3+3x6 --ndf beckmann --ior 1.5 --samples 32 --seed 2",
    "kulla-conty.npz": "--model kulla-conty --grid 8x8x12 --alpha 0.8",
    "kulla-conty-components.exr": "--model kulla-conty --grid 6x6x10 --ndf beckmann --masking height-correlated "
    "--components --dtype float64",
    "turquin.npz": "--model turquin --grid 8x8x12 --alpha 0.8",
    "turquin-beckmann.exr": "--model turquin --grid 6x6x10 --ndf beckmann --ior 1.8",
    "ilm.npz": "--model ilm --grid 8x8x12 --kd 0.8,0.4,0.1 --tolerance 1e-2",
    "ilm-smith-components.exr": "--model ilm --grid 6x6x10 --ndf ggx --masking smith --sigma 0.4 --components "
    "--tolerance 1e-3",
    "ilm-inf.npz": "--model ilm --grid 6x6x10 --bounces inf --sigma 0.8 --kd 0.9 --tolerance 1e-2",
    "ilm-anisotropic.exr": "--model ilm --grid 3x6x3x6 --sigma-x 0.2 --sigma-y 0.6 --f0 0.04 --tolerance 1e-2",
    "ilm-gaussian.npz": "--model ilm --grid 6x6x10 --ndf gaussian --sigma 0.2 --ior 1.3,1.4,1.5 --tolerance 1e-2",
    "ilm-approx-components.exr": "--model ilm-approx --grid 6x6x10 --sigma 0.6 --ior 1.3 --components",
    "ilm-approx.npz": "--model ilm-approx --grid 8x8x12 --kd 0.8,0.4,0.1",
    "vgroove-nonsym-direct.npz": "--model vgroove-nonsym --grid 8x8x12 --ndf phong --alpha 0.7 "
    "--material mirror --dtype float64 --tolerance 1e-3",
}


def main(prefixes: list[str]) -> None:
    """Tabulate and record."""
    path = HERE / "SOURCES.json"
    sources = json.loads(path.read_text()) if path.exists() else {}
    sources = {name: entry for name, entry in sources.items() if name in TABLES}
    for name, options in TABLES.items():
        if prefixes and not name.startswith(tuple(prefixes)):
            continue
        words = ["tabulate", *shlex.split(options), "--out", str(HERE / name), "--overwrite"]
        run(words, standalone_mode=False)
        sources[name] = {
            "command": f"brdftab tabulate {options} --out {name}",
            "generator": "tests/golden/make.py",
            "tool": f"brdftab {brdftab.__version__}",
            "with": MADE_WITH,
            "date": datetime.date.today().isoformat(),
        }
    path.write_text(json.dumps(dict(sorted(sources.items())), indent=2) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
