"""Results as named tables with units, and the files that hold them.

A column is declared once, with its unit and meaning: the Arrow field metadata, `describe_tables`
(for run.json) and the order of columns all come from that declaration. Tables are Arrow tables;
``Tables.frame`` gives pandas. Everything written here depends on the results alone, never on the
clock, the machine or the number of workers, so equal inputs give equal bytes.
"""

from __future__ import annotations

import csv
import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from damperfit.damper.parameters import PARAMETER_NAMES
from damperfit.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    import pandas as pd

    from damperfit.damper.parameters import Damper
    from damperfit.identification import Campaign, Fit, FitOptions
    from damperfit.recording import Trace
    from damperfit.simulation import Response

__all__ = [
    "MISSING",
    "SCHEMA_VERSION",
    "Tables",
    "describe_tables",
    "grade",
    "make_tables",
    "safe_cell",
    "time_series_table",
    "write_responses",
    "write_table",
]

SCHEMA_VERSION = 1
MISSING = "missing"  # outcome of a setting that was declared in the configuration but has no fit

PARAMETER_UNITS = {
    "r_m1": "s sqrt(N)/(m kg)",
    "r_m2": "N s/(m2 kg)",
    "r_m3": "N s/(m2 kg)",
    "k_e": "Pa",
    "f_f": "N",
    "f_0": "N",
}
_PARAMETER_MEANINGS = {
    "r_m1": "resistance of valve 1, the adjuster",
    "r_m2": "resistance of valve 2, in the piston, open in bump",
    "r_m3": "resistance of valve 3, open in rebound",
    "k_e": "effective bulk modulus of oil, air and tube",
    "f_f": "Coulomb friction of seals and bearings",
    "f_0": "constant offset added to the force, the rig's tare",
}


@dataclass(frozen=True, slots=True)
class _Column:
    name: str
    kind: pa.DataType
    unit: str
    description: str


_INT, _FLOAT, _TEXT = pa.int64(), pa.float64(), pa.string()
_SETTING = _Column("setting", _INT, "1", "adjuster setting")
_LOG = _Column("log", _TEXT, "", "file name of the log; empty for the row of the whole setting")
_MSE = _Column("mse_percent", _FLOAT, "%", "normalised mean square error of the force, eq. (22)")
_GRADE = _Column("grade", _TEXT, "", "excellent below 1 %, good below 5 %, else poor")
_SAMPLES = _Column("n_samples", _INT, "1", "samples evaluated")


def _parameter_columns() -> tuple[_Column, ...]:
    values = [
        _Column(name, _FLOAT, PARAMETER_UNITS[name], _PARAMETER_MEANINGS[name])
        for name in PARAMETER_NAMES
    ]
    details = [
        column
        for name in PARAMETER_NAMES
        for column in (
            _Column(f"{name}_se", _FLOAT, PARAMETER_UNITS[name], f"standard error of {name}"),
            _Column(f"{name}_ci_low", _FLOAT, PARAMETER_UNITS[name], f"95 % interval of {name}"),
            _Column(f"{name}_ci_high", _FLOAT, PARAMETER_UNITS[name], f"95 % interval of {name}"),
            _Column(f"{name}_status", _TEXT, "", f"how {name} was found"),
        )
    ]
    return (_SETTING, *values, *details)


_PARAMETERS: tuple[_Column, ...] = (
    *_parameter_columns(),
    _MSE,
    _GRADE,
    _Column("outcome", _TEXT, "", "how the fit ended"),
    _Column("n_logs", _INT, "1", "logs fitted together"),
    _SAMPLES,
    _Column("n_cycles", _INT, "1", "steady whole cycles evaluated"),
    _Column("evaluations", _INT, "1", "simulations the fit took"),
    _Column("cavitation_fraction", _FLOAT, "1", "share of the cycle with a chamber at P = 0"),
    _Column(
        "r_m3_cavitation_margin", _FLOAT, "1", "rise of r_m3 at which chamber 2 starts to cavitate"
    ),
)
_MSE_TABLE: tuple[_Column, ...] = (
    _SETTING,
    _LOG,
    _MSE,
    _Column("noise_floor_percent", _FLOAT, "%", "MSE that the scatter between cycles explains"),
    _GRADE,
    _SAMPLES,
)
_MOTION: tuple[_Column, ...] = (
    _Column("time_s", _FLOAT, "s", "time stamp"),
    _Column("displacement_m", _FLOAT, "m", "x, positive in rebound"),
    _Column("velocity_m_per_s", _FLOAT, "m/s", "dx/dt, positive in rebound"),
)
_PRESSURES: tuple[_Column, ...] = tuple(
    _Column(f"pressure_{i}_Pa", _FLOAT, "Pa", f"absolute pressure in chamber {i}")
    for i in (1, 2, 3)
)
_TIME_SERIES: tuple[_Column, ...] = (
    *_MOTION,
    _Column("force_N", _FLOAT, "N", "force of the model, positive in rebound"),
    *_PRESSURES,
)
_RESPONSES: tuple[_Column, ...] = (
    _SETTING,
    _LOG,
    *_MOTION,
    _Column("force_measured_N", _FLOAT, "N", "measured force as compared, filtered"),
    _Column("force_N", _FLOAT, "N", "force of the model as compared, filtered alike"),
    *_PRESSURES,
)
_TABLES: dict[str, tuple[_Column, ...]] = {
    "parameters": _PARAMETERS,
    "mse": _MSE_TABLE,
    "responses": _RESPONSES,
}


@dataclass(frozen=True, slots=True, eq=False)
class Tables:
    """The tables of a campaign, as Arrow tables.

    Attributes
    ----------
    parameters : pyarrow.Table
        One row per setting.
    mse : pyarrow.Table
        One row per setting (``log`` empty) and one per log.
    """

    parameters: pa.Table
    mse: pa.Table

    def frame(self, name: str) -> pd.DataFrame:
        """Return the table ``name`` ("parameters" or "mse") as a pandas data frame."""
        table: pa.Table = {"parameters": self.parameters, "mse": self.mse}[name]
        return table.to_pandas()


def grade(mse_percent: float) -> str:
    """Return the paper's word for an MSE in per cent: excellent < 1, good < 5, else poor.

    Examples
    --------
    >>> grade(0.3), grade(3.0), grade(float("nan"))
    ('excellent', 'good', 'poor')
    """
    if mse_percent < 1.0:
        return "excellent"
    return "good" if mse_percent < 5.0 else "poor"


def make_tables(
    campaign: Campaign,
    *,
    expected: Iterable[int] = (),
    provenance: Mapping[str, Any] | None = None,
) -> Tables:
    """Lay a campaign out as tables.

    Parameters
    ----------
    campaign : Campaign
        Result of `damperfit.identification.identify`.
    expected : iterable of int
        Settings that ought to be there; those without a fit get a row of nulls.
    provenance : mapping, optional
        Facts for the schema's ``damperfit`` entry: JSON values that depend on the inputs alone.

    Returns
    -------
    Tables
    """
    rows = {fit.setting: _parameter_row(fit) for fit in campaign.fits}
    for setting in set(expected) - rows.keys():
        rows[setting] = {"setting": setting, "outcome": MISSING}
    facts = dict(provenance or {})
    return Tables(
        parameters=_table("parameters", [rows[setting] for setting in sorted(rows)], facts),
        mse=_table("mse", [row for fit in campaign.fits for row in _mse_rows(fit)], facts),
    )


def _parameter_row(fit: Fit) -> dict[str, Any]:
    row: dict[str, Any] = {"setting": fit.setting}
    for name in PARAMETER_NAMES:
        row[name] = _finite(getattr(fit.parameters, name))
        row[f"{name}_status"] = fit.status[name]
    return row | {
        "mse_percent": _finite(fit.mse_percent),
        "grade": grade(fit.mse_percent),
        "outcome": fit.outcome.value,
        "n_logs": len(fit.logs),
        "n_samples": fit.n_samples,
        "n_cycles": fit.n_cycles,
        "evaluations": fit.evaluations,
        "cavitation_fraction": _finite(fit.cavitation_fraction),
        "r_m3_cavitation_margin": _finite(fit.r_m3_cavitation_margin),
    }


def _mse_rows(fit: Fit) -> Iterator[dict[str, Any]]:
    def row(log: str, mse: float, noise_floor: float | None, n_samples: int) -> dict[str, Any]:
        return {
            "setting": fit.setting,
            "log": log,
            "mse_percent": _finite(mse),
            "noise_floor_percent": _finite(noise_floor),
            "grade": grade(mse),
            "n_samples": n_samples,
        }

    yield row("", fit.mse_percent, fit.noise_floor_percent, fit.n_samples)
    for log in fit.logs:
        n_samples = log.trace.stop - log.trace.first
        yield row(log.trace.name, log.mse_percent, log.noise_floor_percent, n_samples)


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _schema(name: str, columns: Sequence[_Column], facts: Mapping[str, Any]) -> pa.Schema:
    entry = {"schema_version": SCHEMA_VERSION, "table": name, **facts}
    fields = [
        pa.field(c.name, c.kind, metadata={"unit": c.unit, "description": c.description})
        for c in columns
    ]
    return pa.schema(fields, metadata={"damperfit": json.dumps(entry, sort_keys=True)})


def _table(name: str, rows: Sequence[Mapping[str, Any]], facts: Mapping[str, Any]) -> pa.Table:
    return pa.Table.from_pylist(list(rows), schema=_schema(name, _TABLES[name], facts))


def describe_tables() -> dict[str, list[dict[str, str]]]:
    """Return names, types, units and meanings of every column of every table, for run.json."""
    return {
        table: [
            {
                "name": c.name,
                "type": str(c.kind),
                "unit": c.unit,
                "description": c.description,
            }
            for c in columns
        ]
        for table, columns in _TABLES.items()
    }


def time_series_table(response: Response, *, facts: Mapping[str, Any] | None = None) -> pa.Table:
    """Lay a simulated response out as a table with one row per sample.

    Parameters
    ----------
    response : Response
        Result of `damperfit.simulation.simulate`.
    facts : mapping, optional
        Facts for the schema's ``damperfit`` entry, as JSON values.
    """
    arrays = [
        response.time,
        response.displacement,
        response.velocity,
        response.force,
        *response.pressures,
    ]
    schema = _schema("time_series", _TIME_SERIES, facts or {})
    return pa.Table.from_arrays([pa.array(a) for a in arrays], schema=schema)


def write_responses(
    path: Path,
    campaign: Campaign,
    damper: Damper,
    *,
    options: FitOptions,
    provenance: Mapping[str, Any] | None = None,
) -> int:
    """Write measured and simulated signals of every setting, one row group per log.

    Each log is simulated when its turn comes, so that memory does not grow with their number.

    Returns
    -------
    int
        Rows written.
    """
    from damperfit.identification import compare

    schema = _schema("responses", _RESPONSES, provenance or {})
    n_rows = 0
    with pq.ParquetWriter(path, schema, write_page_checksum=True) as writer:
        for fit in campaign.fits:
            for log in fit.logs:
                seen = compare(fit.parameters, log.trace, damper, solver=options.solver)
                table = _response_table(schema, fit.setting, log.trace, seen)
                writer.write_table(table, row_group_size=max(table.num_rows, 1))
                n_rows += table.num_rows
    return n_rows


def _response_table(schema: pa.Schema, setting: int, trace: Trace, seen: Any) -> pa.Table:
    window = trace.window
    n = window.stop - window.start
    times = trace.start_time + trace.interval * np.arange(window.start, window.stop)
    arrays = [
        pa.array([setting]).take(pa.array([0] * n)),
        pa.repeat(trace.name, n),
        pa.array(times),
        pa.array(trace.displacement[window]),
        pa.array(trace.velocity[window]),
        pa.array(trace.force[window]),
        pa.array(seen.force),
        *(pa.array(pressure) for pressure in seen.response.pressures),
    ]
    return pa.Table.from_arrays(arrays, schema=schema)


def write_table(path: Path, table: pa.Table, *, suffix: str | None = None) -> None:
    """Write a table as Parquet (with page checksums) or CSV, told by the suffix.

    Parameters
    ----------
    path : pathlib.Path
        Where to write; see `damperfit.atomic` for writing whole or not at all.
    table : pyarrow.Table
        The table.
    suffix : str, optional
        ".parquet" or ".csv" when the path itself does not end so.

    Raises
    ------
    ConfigurationError
        The suffix is neither.
    """
    suffix = (suffix or path.suffix).lower()
    if suffix == ".parquet":
        pq.write_table(table, path, write_page_checksum=True)
    elif suffix == ".csv":
        _write_csv(path, table)
    else:
        raise ConfigurationError(f"{path.name}: tables are written as .csv or .parquet")


def _write_csv(path: Path, table: pa.Table) -> None:
    columns = [column.to_pylist() for column in table.columns]
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table.column_names)
        for row in zip(*columns, strict=True):
            writer.writerow([_csv_cell(value) for value in row])


def _csv_cell(value: object) -> str:
    if value is None:
        return ""
    return safe_cell(value) if isinstance(value, str) else repr(value)


def safe_cell(text: str) -> str:
    """Return text that no spreadsheet takes for a formula.

    A cell that starts with ``= + - @``, tab or carriage return gets a leading apostrophe.
    Numbers are never touched.

    Examples
    --------
    >>> safe_cell("=1+1"), safe_cell("run.csv")
    ("'=1+1", 'run.csv')
    """
    return "'" + text if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text
