"""Tables made again from their own provenance."""

from __future__ import annotations

from brdftab import models
from brdftab.errors import ParameterError
from brdftab.scene.execute import repeat
from brdftab.tables.table import Table
from brdftab.tabulation.tabulate import tabulate


def retabulate(table: Table, threads: int | None = None) -> Table:
    """Tabulate again from a table's own provenance.

    Raises
    ------
    ParameterError
        If the provenance lacks what is needed or names an unknown model or parameter.
    """
    made = table.provenance
    if "plan" in made:
        return repeat(table)
    missing = [key for key in ("model", "parameters", "tolerance", "components") if key not in made]
    if missing:
        raise ParameterError(
            f"provenance lacks {', '.join(missing)}; only tables that brdftab tabulated can be verified"
        )
    if "fit" in made and made["model"] not in models.names():
        raise ParameterError(
            f"model = {made['model']} is a sum that a fit predicted; verify repeats tables of one model: fit again"
        )
    if made["model"] not in models.names():
        raise ParameterError.not_known("model", made["model"], models.names())
    return tabulate(
        made["model"],
        table.grid,
        dtype=str(table.dtype),
        tolerance=made["tolerance"],
        components=bool(made["components"]),
        threads=threads,
        **made["parameters"],
    )
