"""CarMaker Infofile: two tables, push and pull, speeds and forces both without sign.

Lines of a table begin with a tab; the first row is 0 0. Pull is rebound: the program's own example
takes it while the damper grows longer. Nothing public shows a place for gas force or friction.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.handover.force_table import force_tables
from damperfit.handover.provenance import commented, gas_line, provenance_lines

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.handover.force_table import ForceTable
    from damperfit.handover.handed_over import HandedOver
    from damperfit.handover.targets import ExportOptions

__all__ = ["write_carmaker"]

_SIGN = (
    "Damp_Push is bump, Damp_Pull is rebound; speed in m/s and force in N are without sign. "
    "Front axle; for the rear write SuspR for SuspF"
)


def write_carmaker(handed: HandedOver, options: ExportOptions) -> Mapping[str, bytes]:
    """Return the damper's part of a vehicle for each setting."""
    files = {}
    for table in force_tables(handed, extend=options.extend):
        gas = gas_line(table, place="add it to the spring")
        text = "#INFOFILE1.1 (UTF-8) - Do not remove this line!\n"
        text += commented(provenance_lines(handed, [table], sign=_SIGN, gas=gas), "##")
        text += _side(table, "Damp_Push", -1.0) + _side(table, "Damp_Pull", 1.0)
        name = f"{options.stem}_s{table.slug}.txt"
        files[name] = text.encode("utf-8", "replace")
    return files


def _side(table: ForceTable, name: str, sign: float) -> str:
    rows = sorted(
        (abs(float(v)), float(sign * f))
        for v, f in zip(table.speeds, table.forces, strict=True)
        if sign * v >= 0.0
    )
    lines = "".join(f"\t{speed:.7g} {max(force, 0.0) + 0.0:.3f}\n" for speed, force in rows)
    return f"SuspF.{name}.Amplify = 1.0\nSuspF.{name}:\n{lines}"
