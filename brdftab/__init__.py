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
    from brdftab.bench.run import benchmark
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
    "benchmark": "brdftab.bench.run",
    "check": "brdftab.validate.run",
    "check_golden": "brdftab.golden.check",
    "compare": "brdftab.comparison",
    "evaluate": "brdftab.evaluation",
    "fit": "brdftab.fitting.run",
    "pdf": "brdftab.sampling",
    "read": "brdftab.io",
    "read_albedo": "brdftab.albedos",
    "read_scratch": "brdftab.scratches.files",
    "record_golden": "brdftab.golden.record",
    "sample": "brdftab.sampling",
    "tabulate": "brdftab.tabulation",
    "tabulate_albedo": "brdftab.albedos",
    "trace_scratch": "brdftab.scratches.traced",
    "write": "brdftab.io",
    "write_albedo": "brdftab.albedos",
    "write_scratch": "brdftab.scratches.files",
}

__all__ = [
    "AlbedoTable",
    "FitResult",
    "Grid",
    "Scratch",
    "Table",
    "__version__",
    "albedo",
    "benchmark",
    "check",
    "check_golden",
    "compare",
    "evaluate",
    "fit",
    "models",
    "pdf",
    "read",
    "read_albedo",
    "read_scratch",
    "record_golden",
    "sample",
    "tabulate",
    "tabulate_albedo",
    "trace_scratch",
    "write",
    "write_albedo",
    "write_scratch",
]


def __dir__() -> list[str]:
    """Return the public names, loaded or not."""
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'brdftab' has no attribute {name!r}")
