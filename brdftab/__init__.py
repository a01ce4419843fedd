"""brdftab: BRDF models as numbers you can trust.

The public names load on first use, so that ``import brdftab`` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from brdftab import models
from brdftab._version import __version__

if TYPE_CHECKING:
    from brdftab.albedos import AlbedoTable, read_albedo, tabulate_albedo, write_albedo
    from brdftab.comparison import compare
    from brdftab.evaluation import evaluate
    from brdftab.fitting.result import FitResult
    from brdftab.fitting.run import fit
    from brdftab.golden.check import check_golden
    from brdftab.golden.record import record_golden
    from brdftab.grid import Grid
    from brdftab.integrals import albedo
    from brdftab.io import read, write
    from brdftab.sampling import pdf, sample
    from brdftab.scratches.files import read_scratch, write_scratch
    from brdftab.scratches.traced import Scratch, trace_scratch
    from brdftab.table import Table
    from brdftab.tabulation import tabulate
    from brdftab.validate.run import check

_HOMES = {
    "AlbedoTable": "brdftab.albedos",
    "FitResult": "brdftab.fitting.result",
    "Grid": "brdftab.grid",
    "Scratch": "brdftab.scratches.traced",
    "Table": "brdftab.table",
    "albedo": "brdftab.integrals",
    "check",
