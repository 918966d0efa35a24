"""Tables as `collect` makes them, of dampers that never were."""

import numpy as np
import pyarrow as pa

SETTINGS = ("1", "2", "10")


def fleet_table(n: int, *, changed=None, dates=None, n_settings: int = 3) -> pa.Table:
    """Return the table of ``n`` dampers whose values lie evenly around 1000 N by up to 2 %."""
    rows = []
    for k in range(n):
        share = 1.0 + 0.04 * (((7 * k) % n) / max(n - 1, 1) - 0.5)
        for number, setting in enumerate(SETTINGS[:n_settings]):
            rows.append(
                {
                    "serial": f"D{k + 1}",
                    "damper": f"D{k + 1}",
                    "date": None if dates is None else dates[k],
                    "setting": setting,
                    "r_m1": 14000.0 * share * (1 + number),
                    "r_m1_se": 10.0,
                    "mse_percent": 0.1 + 0.001 * k,
                    "grade": "excellent",
                    "force_rebound_260_mm_per_s_N": 1000.0 * share * (1 + number),
                    "force_bump_260_mm_per_s_N": -500.0 * share * (1 + number),
                    "force_bump_1050_mm_per_s_N": np.nan,
                    "error_kind": None,
                    "error": None,
                }
            )
    for (damper, setting), values in (changed or {}).items():
        for row in rows:
            if (row["damper"], row["setting"]) == (damper, setting):
                row.update(values)
    unit = {b"unit": b"s sqrt(N)/(m kg)"}
    schema = pa.Table.from_pylist(rows).schema
    fields = [
        field.with_metadata(unit)
        if field.name == "r_m1"
        else pa.field(field.name, pa.string())
        if pa.types.is_null(field.type)
        else field
        for field in schema
    ]
    return pa.Table.from_pylist(rows, pa.schema(fields))


def failed_row(table: pa.Table, damper: str, setting: str | None = None) -> pa.Table:
    """Return the table with one failure more."""
    row = {
        "serial": damper,
        "damper": damper,
        "setting": setting,
        "error_kind": "LogError",
        "error": f"{damper}.csv: <b>no</b> force",
    }
    more = pa.Table.from_pylist([row], table.schema)
    return pa.concat_tables([table, more])
