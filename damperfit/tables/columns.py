"""Every column of every table, declared once: name, type, unit, meaning, and its place."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, fields, replace
from functools import cache
from itertools import takewhile
from typing import TYPE_CHECKING, Any

from damperfit.damper.model import values_type
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.quantity import Quantity
from damperfit.tested.setting import ADJUSTER, LONGEST_WORD, Place, Setting, parse_place

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    import pyarrow as pa

    from damperfit.damper.model import Values

__all__ = [
    "CHARACTERISTIC_COLUMNS",
    "PAPER_QUANTITIES",
    "SCHEMA_VERSION",
    "adjusters_in",
    "column_kinds",
    "column_names",
    "describe_tables",
    "is_late",
    "quantities_in",
    "quantity_records",
    "read_setting",
    "setting_cells",
    "table_schema",
    "unknown_schema",
    "values_from",
]


# The columns of the table "characteristics": name, type, unit, meaning.

_INT, _FLOAT, _TEXT = "int64", "double", "string"
CHARACTERISTIC_COLUMNS: tuple[tuple[str, str, str, str], ...] = (
    ("stretch", _INT, "1", "which stretch of the log, counted from 1"),
    ("kind", _TEXT, "", "steady: cycles that repeat; moving: motion that does not"),
    ("start_s", _FLOAT, "s", "time stamp of the first sample of the stretch"),
    ("cycles", _INT, "1", "whole cycles; 0 where nothing repeats"),
    ("frequency_Hz", _FLOAT, "Hz", "cycles per second"),
    ("amplitude_m", _FLOAT, "m", "half the stroke"),
    ("temperature_degC", _FLOAT, "degC", "mean over the log"),
    ("point", _TEXT, "", "peak: the largest forces and speeds (PVP); speed: a named speed"),
    ("speed_rebound_m_per_s", _FLOAT, "m/s", "speed in rebound, mean of the cycles"),
    ("speed_bump_m_per_s", _FLOAT, "m/s", "speed in bump, positive"),
    *(
        column
        for gas, said in (("", ""), ("_without_gas", ", gas force taken off"))
        for column in (
            *(
                (f"{whose}_{stroke}{gas}_N", _FLOAT, "N", f"{whose} force in {stroke}{said}")
                for whose in ("measured", "simulated")
                for stroke in ("rebound", "bump")
            ),
            *(
                (f"{whose}_ratio{gas}", _FLOAT, "1", f"rebound over bump, no signs, {whose}{said}")
                for whose in ("measured", "simulated")
            ),
        )
    ),
    ("mean_gas_force_N", _FLOAT, "N", "gas force from the damper's data, mean of the stretch"),
    *(
        (f"{whose}_energy_J", _FLOAT, "J", f"work in a cycle, {whose}; rows of peaks only")
        for whose in ("measured", "simulated")
    ),
    ("hysteresis_speed_m_per_s", _FLOAT, "m/s", "speed at which the hysteresis is taken"),
    *(
        (f"{whose}_hysteresis_{stroke}_N", _FLOAT, "N", f"opening less closing force, {whose}")
        for whose in ("measured", "simulated")
        for stroke in ("rebound", "bump")
    ),
    ("measured_energy_se_J", _FLOAT, "J", "standard error by the scatter of the cycles"),
    *(
        (f"measured_hysteresis_{stroke}_se_N", _FLOAT, "N", "standard error, likewise; of peaks")
        for stroke in ("rebound", "bump")
    ),
)


# The quantities of a model in the metadata of tables, and back.

# Older results do not tell theirs: they are the paper's.
PAPER_QUANTITIES = PURDY_DAMPER.quantities
# Nor does what was written before quantities had a role and an ideal value.
_LATER = {one.label: {"role": one.role, "ideal": one.ideal} for one in PAPER_QUANTITIES}


def quantity_records(quantities: Sequence[Quantity]) -> list[dict[str, Any]]:
    """Return quantities as JSON values; what has no limit has none."""
    return [
        {one.name: _as_json(getattr(quantity, one.name)) for one in fields(Quantity)}
        for quantity in quantities
    ]


def _as_json(value: Any) -> Any:
    if isinstance(value, tuple):
        return [end if math.isfinite(end) else None for end in value]
    return value


def quantities_in(facts: Mapping[str, Any], columns: Sequence[str] = ()) -> tuple[Quantity, ...]:
    """Return the quantities that the facts of a table or run.json tell, in their order.

    Parameters
    ----------
    facts : mapping
        With the key "quantities", but for older results, which are the paper's.
    columns : sequence of str
        Of the table, where known: where the facts tell nothing and a column has a status that the
        paper's model does not know, the columns say what there is.
    """
    records = facts.get("quantities")
    try:
        found = tuple(_quantity(one) for one in records) if isinstance(records, list) else ()
    except (KeyError, TypeError, ValueError):
        found = ()
    if found:
        return PAPER_QUANTITIES if found == PAPER_QUANTITIES else found
    seen = [name.removesuffix("_status") for name in columns if name.endswith("_status")]
    if set(seen) <= {one.name for one in PAPER_QUANTITIES}:
        return PAPER_QUANTITIES
    return tuple(Quantity(name, name, name, name, "", (-math.inf, math.inf)) for name in seen)


def _quantity(record: Mapping[str, Any]) -> Quantity:
    known = {one.name: record[one.name] for one in fields(Quantity) if one.name in record}
    ranges = {key: _range(ends) for key, ends in known.items() if isinstance(ends, list)}
    return Quantity(**_LATER.get(known["label"], {}) | known | ranges)


def _range(ends: Sequence[float | None]) -> tuple[float, float]:
    low, high = ends
    return -math.inf if low is None else float(low), math.inf if high is None else float(high)


def values_from(quantities: tuple[Quantity, ...], numbers: Sequence[float]) -> Values:
    """Return values read from a table."""
    is_paper = quantities == PAPER_QUANTITIES
    kind = PURDY_DAMPER.values_type if is_paper else values_type(quantities)
    return kind(*numbers)


SCHEMA_VERSION = 2
# 1 did not tell the quantities: they are the paper's.
_READ_VERSIONS = (1, SCHEMA_VERSION)
# Results of before these were added lack nothing that a reader must know of.
_LATE = frozenset(
    {
        "grade_reason",
        "force_misfit_se_N",
        "measured_N",
        "measured_se_N",
        "difference_N",
        "measured_energy_se_J",
        "measured_hysteresis_rebound_se_N",
        "measured_hysteresis_bump_se_N",
        "origin",
        "model_N",
        "gas_N",
        "friction_N",
        "tare_N",
        "tested",
        "measured_as",
        "measured_opening_N",
        "measured_closing_N",
        "measured_peak_N",
        "role",  # of before logs could be held out: all were fitted
    }
)


@dataclass(frozen=True, slots=True)
class _Column:
    name: str
    kind: str  # as Arrow names it
    unit: str
    description: str


_SETTING = _Column("setting", _INT, "1", "adjuster setting")
_CHANGED = _Column("changed", _TEXT, "", "adjuster that change_N is a click of")
_LOG = _Column("log", _TEXT, "", "file name of the log; empty for the row of the whole setting")
_MSE = _Column("mse_percent", _FLOAT, "%", "normalised mean square error of the force, eq. (22)")
_GRADE = _Column("grade", _TEXT, "", "excellent below 1 %, good below 5 %, else poor; or withheld")
# In their place stand columns for each quantity of the model.
_QUANTITIES = _Column("", _FLOAT, "", "")
_REFITTED = _Column("", _FLOAT, "", "refitted")
_SAMPLES = _Column("n_samples", _INT, "1", "samples evaluated")


def is_late(name: str) -> bool:
    """Whether a column was added later, so that older results are whole without it."""
    return name in _LATE or name.endswith("_misfit_se")


def _parameter_columns(quantities: Sequence[Quantity]) -> Iterator[_Column]:
    """A column for each quantity, then what is known of each."""
    for one in quantities:
        yield _Column(one.name, _FLOAT, one.unit, one.meaning)
    for one in quantities:
        name, unit = one.name, one.unit
        yield _Column(f"{name}_se", _FLOAT, unit, f"standard error of {name}")
        yield _Column(f"{name}_ci_low", _FLOAT, unit, f"95 % interval of {name}")
        yield _Column(f"{name}_ci_high", _FLOAT, unit, f"95 % interval of {name}")
        yield _Column(f"{name}_status", _TEXT, "", f"how {name} was found")
    for one in quantities:
        said = f"error of {one.name} for what the model misses"
        yield _Column(f"{one.name}_misfit_se", _FLOAT, one.unit, said)


_PARAMETERS: tuple[_Column, ...] = (
    _SETTING,
    _QUANTITIES,
    _MSE,
    _GRADE,
    _Column("outcome", _TEXT, "", "how the fit ended"),
    _Column("n_logs", _INT, "1", "logs fitted together"),
    _SAMPLES,
    _Column("n_cycles", _INT, "1", "steady whole cycles evaluated"),
    _Column("evaluations", _INT, "1", "simulations the fit took"),
    _Column("cavitation_fraction", _FLOAT, "1", "share of the cycle with a chamber at P = 0"),
    _Column(
        "r_m3_cavitation_margin",
        _FLOAT,
        "1",
        "rise of R_m3 at which chamber 2 starts to cavitate",
    ),
    _Column("lowest_pressure", _FLOAT, "Pa", "lowest absolute pressure of any chamber"),
    _Column("lowest_pressure_chamber", _INT, "1", "chamber of the lowest pressure"),
    _Column("lowest_pressure_displacement", _FLOAT, "m", "x at the lowest pressure"),
    _Column("lowest_pressure_velocity", _FLOAT, "m/s", "v at the lowest pressure"),
    _Column(
        "safe_gas_pressure",
        _FLOAT,
        "Pa",
        "absolute gas pressure at rest at which a chamber just reaches zero on this motion",
    ),
    _Column("grade_reason", _TEXT, "", "why the grade is withheld; empty where it is not"),
)
_MSE_TABLE: tuple[_Column, ...] = (
    _SETTING,
    _LOG,
    _MSE,
    _Column("noise_floor_percent", _FLOAT, "%", "MSE that the scatter between cycles explains"),
    _GRADE,
    _SAMPLES,
    _Column("role", _TEXT, "", "fitted, or held_out: predicted with what the other logs gave"),
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
_PROFILES: tuple[_Column, ...] = (
    _SETTING,
    _Column("parameter", _TEXT, "", "name of the parameter that is followed"),
    _Column("value", _FLOAT, "", "its value, in the unit of its column in parameters"),
    _Column(
        "misfit_rise",
        _FLOAT,
        "1",
        "rise of the misfit above its minimum; 3.84 is the 95 % limit",
    ),
    _REFITTED,
)
_ADJUSTMENT: tuple[_Column, ...] = (
    _SETTING,
    _Column("speed_m_per_s", _FLOAT, "m/s", "named test speed that the tests reach"),
    _Column("stroke", _TEXT, "", "rebound or bump"),
    _Column("force_N", _FLOAT, "N", "force there, gas and friction in it, the rig's tare not"),
    _Column("force_se_N", _FLOAT, "N", "standard error of force_N"),
    _Column("force_ci_low_N", _FLOAT, "N", "95 % interval of force_N"),
    _Column("force_ci_high_N", _FLOAT, "N", "95 % interval of force_N"),
    _Column("change_N", _FLOAT, "N", "force less that of the setting before, no offset in it"),
    _Column("change_ci_low_N", _FLOAT, "N", "95 % interval of change_N"),
    _Column("change_ci_high_N", _FLOAT, "N", "95 % interval of change_N"),
    _Column("change_percent", _FLOAT, "%", "the same of the damping: no gas force, no offset"),
    _Column("change_percent_ci_low", _FLOAT, "%", "95 % interval of change_percent"),
    _Column("change_percent_ci_high", _FLOAT, "%", "95 % interval of change_percent"),
    _Column("force_misfit_se_N", _FLOAT, "N", "error of force_N from the model's misfit"),
    _Column("measured_N", _FLOAT, "N", "measured force there, without the tare"),
    _Column("measured_se_N", _FLOAT, "N", "standard error of measured_N"),
    _Column("difference_N", _FLOAT, "N", "measured less modelled force, rig and filter in both"),
    _Column("origin", _TEXT, "", "of force_N: model, or measured where the model misses it"),
    _Column("model_N", _FLOAT, "N", "the damper's force at constant speed by the model"),
    _Column("gas_N", _FLOAT, "N", "gas force at mid-stroke, in all of these"),
    _Column("friction_N", _FLOAT, "N", "friction in model_N"),
    _Column("tare_N", _FLOAT, "N", "the rig's offset, in none of these"),
    _Column("tested", _TEXT, "", "yes where the setting was tested up to this speed"),
    _Column("measured_as", _TEXT, "", "pvp: peaks of segments; cvp: the loop at this speed"),
    _Column("measured_opening_N", _FLOAT, "N", "of a loop: measured while the speed rises"),
    _Column("measured_closing_N", _FLOAT, "N", "of a loop: measured while the speed falls"),
    _Column("measured_peak_N", _FLOAT, "N", "of segments: the largest force of the stroke"),
)
_CHARACTERISTICS: tuple[_Column, ...] = (
    _SETTING,
    _LOG,
    *(_Column(*one) for one in CHARACTERISTIC_COLUMNS),
)
_VALVES: tuple[_Column, ...] = (
    _SETTING,
    _Column("stroke", _TEXT, "", "rebound or bump"),
    _Column("curve", _TEXT, "", "measured: read off the loops without a law; law; opening"),
    _Column("pressure_Pa", _FLOAT, "Pa", "pressure across the valve of that stroke"),
    _Column("flow_m3_per_s", _FLOAT, "m3/s", "flow through it; empty at an opening"),
    _Column("valve_force_N", _FLOAT, "N", "that pressure times the area it acts on"),
)
_TABLES: dict[str, tuple[_Column, ...]] = {
    "parameters": _PARAMETERS,
    "mse": _MSE_TABLE,
    "adjustment": _ADJUSTMENT,
    "characteristics": _CHARACTERISTICS,
    "responses": _RESPONSES,
    "profiles": _PROFILES,
    "valves": _VALVES,
    "time_series": _TIME_SERIES,
}


def _setting_columns(table: str, settings: Collection[Setting]) -> tuple[_Column, ...]:
    """The column ``setting`` and one for each adjuster that has a name."""
    known = [Setting.of(one) for one in settings]
    is_whole = all(isinstance(one.cell, int) for one in known)
    first = _SETTING if is_whole else replace(_SETTING, kind=_TEXT, unit="")
    names = known[0].adjusters if known else (ADJUSTER,)
    if names == (ADJUSTER,):
        return (first,)
    turned = (_CHANGED,) if table == "adjustment" and len(names) > 1 else ()
    return (first, *(_place_column(name, known) for name in names), *turned)


def _place_column(name: str, settings: Iterable[Setting]) -> _Column:
    places = [one.place(name) for one in settings]
    if any(isinstance(place, str) for place in places):
        return _Column(name, _TEXT, "", f"position of the adjuster {name}")
    kind = _INT if all(isinstance(place, int) for place in places) else _FLOAT
    return _Column(name, kind, "1", f"position of the adjuster {name}")


def setting_cells(setting: Setting, *, is_whole: bool) -> dict[str, Place]:
    """Return what a row of a setting holds: ``setting``, and each adjuster that has a name.

    Parameters
    ----------
    setting : Setting
        Which.
    is_whole : bool
        Whether the column is one of whole numbers.
    """
    known = Setting.of(setting)
    named = {} if known.adjusters == (ADJUSTER,) else dict(known.places)
    return {"setting": known.cell if is_whole else known.label, **named}


def adjusters_in(
    names: Sequence[str], quantities: Sequence[Quantity] = PAPER_QUANTITIES
) -> tuple[str, ...]:
    """Return the adjusters that have a column in a table: what follows ``setting`` unknown.

    Examples
    --------
    >>> adjusters_in(["setting", "rebound", "compression", "r_m1"])
    ('rebound', 'compression')
    """
    if ADJUSTER not in names:
        return ()
    known = column_names(quantities)
    after = names[list(names).index(ADJUSTER) + 1 :]
    return tuple(takewhile(lambda name: name not in known, after))


def read_setting(row: Mapping[str, Any], adjusters: Sequence[str] = ()) -> Setting | None:
    """Return the setting of a row that was read back, None where its cell is empty.

    Parameters
    ----------
    row : mapping
        Cells by column, as numbers or text.
    adjusters : sequence of str
        Names of the adjusters; where their columns are missing the label is taken as it is.

    Raises
    ------
    ValueError
        A cell says no place of an adjuster.
    """
    cells = [row.get(name) for name in adjusters]
    if adjusters and all(cell not in (None, "") for cell in cells):
        return Setting(
            tuple(
                (name, parse_place(str(cell))) for name, cell in zip(adjusters, cells, strict=True)
            )
        )
    cell = row["setting"]
    if cell is None or cell == "":
        return None
    text = str(cell)
    return Setting.of(parse_place(text) if len(text) <= LONGEST_WORD else text)


def column_names(quantities: Sequence[Quantity] = PAPER_QUANTITIES) -> frozenset[str]:
    """Return the names of all columns, which no adjuster may have."""
    return _column_names(tuple(quantities))


@cache
def _column_names(quantities: tuple[Quantity, ...]) -> frozenset[str]:
    every = (c.name for table in _TABLES for c in _columns(table, (), quantities))
    return frozenset((*every, _CHANGED.name)) - {ADJUSTER}


def table_schema(
    name: str,
    facts: Mapping[str, Any],
    *,
    settings: Collection[Setting] = (),
    quantities: Sequence[Quantity] = PAPER_QUANTITIES,
) -> pa.Schema:
    """Return the Arrow schema of a table.

    Parameters
    ----------
    name : str
        As in the schema of run.json ("parameters", "mse", ...), or "time_series".
    facts : mapping
        JSON values for the schema's ``damperfit`` entry, beside version and name of the table.
    settings : collection of Setting
        Of the run: they say what the column ``setting`` holds, and which columns follow it.
    quantities : sequence of Quantity
        Of the model.
    """
    import pyarrow as pa

    metadata = {"quantities": quantity_records(quantities)}
    entry = {"schema_version": SCHEMA_VERSION, "table": name, **metadata, **facts}
    fields = [
        pa.field(
            c.name,
            pa.type_for_alias(c.kind),
            metadata={"unit": c.unit, "description": c.description},
        )
        for c in _columns(name, settings, quantities)
    ]
    return pa.schema(fields, metadata={"damperfit": json.dumps(entry, sort_keys=True)})


def _columns(
    table: str, settings: Collection[Setting], quantities: Sequence[Quantity]
) -> Iterator[_Column]:
    for column in _TABLES[table]:
        if column is _SETTING:
            yield from _setting_columns(table, settings)
        elif column is _QUANTITIES:
            yield from _parameter_columns(quantities)
        elif column is _REFITTED:
            for one in quantities:
                yield _Column(one.name, _FLOAT, one.unit, f"{one.meaning}, {column.description}")
        else:
            yield column


def column_kinds(name: str, quantities: Sequence[Quantity] = PAPER_QUANTITIES) -> dict[str, type]:
    """Return the Python type of each column of a table, in order."""
    kinds = {_INT: int, _FLOAT: float, _TEXT: str}
    return {column.name: kinds[column.kind] for column in _columns(name, (), quantities)}


def describe_tables(
    settings: Collection[Setting] = (), quantities: Sequence[Quantity] = PAPER_QUANTITIES
) -> dict[str, list[dict[str, str]]]:
    """Return name, type, unit and meaning of every column that `identify` writes.

    Parameters
    ----------
    settings : collection of Setting
        Of the run.
    quantities : sequence of Quantity
        Of the model.
    """
    return {
        table: [
            {
                "name": c.name,
                "type": c.kind,
                "unit": c.unit,
                "description": c.description,
            }
            for c in _columns(table, settings, quantities)
        ]
        for table in _TABLES
        if table != "time_series"
    }


def unknown_schema(record: Mapping[str, Any]) -> str | None:
    """Return a sentence where results, by their record, are of a schema that is not known here."""
    version = record.get("schema_version", SCHEMA_VERSION)
    if version in _READ_VERSIONS:
        return None
    is_newer = isinstance(version, int) and version > SCHEMA_VERSION
    return (
        f"the results are of schema version {version} (damperfit {record.get('version')}), "
        f"this damperfit knows {SCHEMA_VERSION}: what is not found is left out; "
        f"{'update damperfit, or ' * is_newer}run identify again on the logs"
    )
