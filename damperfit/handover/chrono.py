"""Chrono: the entry of a spring and damper (TSDA) in a YAML model, with its damping curve.

Chrono goes straight from point to point and applies minus the curve at the rate at which the length
grows; the curve itself is positive with it. Bodies and points of the entry are the user's.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.handover.force_table import force_tables
from damperfit.handover.provenance import commented, gas_line, provenance_lines

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.handover.handed_over import HandedOver
    from damperfit.handover.targets import ExportOptions

__all__ = ["write_chrono"]

_SIGN = (
    "velocity in m/s is positive in rebound, as the length grows; so is the curve in N, "
    "which Chrono applies with a minus"
)


def write_chrono(handed: HandedOver, options: ExportOptions) -> Mapping[str, bytes]:
    """Return the entry for each setting."""
    files = {}
    for table in force_tables(handed, extend=options.extend):
        gas = gas_line(table, place="add it to spring_curve_data of the same entry")
        text = commented(provenance_lines(handed, [table], sign=_SIGN, gas=gas), "#")
        name = f"{options.stem}_s{table.slug}"
        rows = ",\n".join(
            f"      [ {v:.7g}, {f:.3f} ]" for v, f in zip(table.speeds, table.forces, strict=True)
        )
        text += (
            "# add body1, body2, point1 and point2 of your model\n"
            f'tsdas:\n  - name: "{name}"\n    damping_curve_data: [\n{rows}\n    ]\n'
        )
        files[f"{name}.yaml"] = text.encode("utf-8", "replace")
    return files
