"""CarSim and TruckSim: the block FD_TABLE, to be pasted into the shock absorber's data.

Rows are speed and force with a comma between; compression is positive. Keyword, interpolation word
and ENDTABLE are what public files show; the name of the data set around them is not known, so the
block stands alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.handover.force_table import force_tables
from damperfit.handover.provenance import commented, gas_line, provenance_lines

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.handover.handed_over import HandedOver
    from damperfit.handover.targets import ExportOptions

__all__ = ["write_carsim"]

_SIGN = "COMPRESSION (bump) is positive, for speed in mm/s and force in N alike"


def write_carsim(handed: HandedOver, options: ExportOptions) -> Mapping[str, bytes]:
    """Return the block for each setting."""
    files = {}
    for table in force_tables(handed, extend=options.extend):
        gas = gas_line(table, place="add it to the spring", is_bump_positive=True)
        text = commented(provenance_lines(handed, [table], sign=_SIGN, gas=gas), "!")
        rows = zip(-1e3 * table.speeds[::-1], -table.forces[::-1], strict=True)
        text += "FD_TABLE SPLINE\n"
        text += "".join(f"{v + 0.0:.4f}, {f + 0.0:.3f}\n" for v, f in rows)
        text += "ENDTABLE\n"
        files[f"{options.stem}_s{table.slug}.par"] = text.encode("ascii", "replace")
    return files
