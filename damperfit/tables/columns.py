"""Every column of every table, declared once: name, type, unit, meaning, and its place.

The Arrow field metadata (``unit``, ``description``), the order of columns and the schema in
run.json all come from here, and so does what a cell is read back as.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields
from functools import cache
from itertools import takewhile
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.damper.model import Quantity, Values, values_type
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.tested.setting import ADJUSTER, LONGEST_WORD, Place, Setting, parse_place

if TYPE_CHECKING:
    import pyarrow as pa


SCHEMA_VERSION = 2
PAPER_QUANTITIES = PURDY_DAMPER.quantities

_INT, _FLOAT, _TEXT = "int64", "double", "string"  # as Arrow names them
_KINDS: dict[str, type] = {_INT: int, _FLOAT: float, _TEXT: str}


class Column(NamedTuple):
    """A column, and the attribute of a force, click or cavitation that fills it, if one does."""

    name: str
    kind: str
    unit: str
    description: str
    source: str = ""


def _number(name: str, unit: str, description: str, source: str = "") -> Column:
    return Column(name, _FLOAT, unit, description, source)


def _count(name: str, description: str) -> Column:
    return Column(name, _INT, "1", description)


def _text(name: str, description: str) -> Column:
    return Column(name, _TEXT, "", description)


_SETTING = _count("setting", "adjuster setting")
_CHANGED = _text("changed", "adjuster that change_N is a click of")
_LOG = _text("log", "file name of the log; empty for the row of the whole setting")
_STROKE = _text("stroke", "rebound or bump")
_MSE = _number("mse_percent", "%", "normalised mean square error of the force, eq. (22)")
_GRADE = _text("grade", "excellent below 1 %, good below 5 %, else poor; or withheld")
_SAMPLES = _count("n_samples", "samples evaluated")
# In their place stand columns for each quantity of the model.
_QUANTITIES = _number("", "", "")
_REFITTED = _number("", "", "refitted")
_BOTH = [(whose, stroke) for whose in ("measured", "simulated") for stroke in ("rebound", "bump")]

_MOTION = (
    _number("time_s", "s", "time stamp"),
    _number("displacement_m", "m", "x, positive in rebound"),
    _number("velocity_m_per_s", "m/s", "dx/dt, positive in rebound"),
)
_PRESSURES = tuple(
    _number(f"pressure_{i}_Pa", "Pa", f"absolute pressure in chamber {i}") for i in (1, 2, 3)
)
_FORCES_OF_SEGMENT = [
    column
    for gas, more in (("", ""), ("_without_gas", ", gas force taken off"))
    for column in (
        *(_number(f"{w}_{s}{gas}_N", "N", f"{w} force in {s}{more}") for w, s in _BOTH),
        *(
            _number(f"{whose}_ratio{gas}", "1", f"rebound over bump, no signs, {whose}{more}")
            for whose in ("measured", "simulated")
        ),
    )
]
CHARACTERISTICS = (
    _count("stretch", "which segment of the log, counted from 1"),
    _text("kind", "steady: cycles that repeat; moving: motion that does not"),
    _number("start_s", "s", "time stamp of the first sample of the segment"),
    _count("cycles", "whole cycles; 0 where nothing repeats"),
    _number("frequency_Hz", "Hz", "cycles per second"),
    _number("amplitude_m", "m", "half the stroke"),
    _number("temperature_degC", "degC", "mean over the log"),
    _text("point", "peak: the largest forces and speeds (PVP); speed: a named speed"),
    _number("speed_rebound_m_per_s", "m/s", "speed in rebound, mean of the cycles"),
    _number("speed_bump_m_per_s", "m/s", "speed in compression, positive"),
    *_FORCES_OF_SEGMENT,
    _number("mean_gas_force_N", "N", "gas force from the damper's data, mean of the segment"),
    _number("measured_energy_J", "J", "work in a cycle, measured; rows of peaks only"),
    _number("simulated_energy_J", "J", "work in a cycle, simulated; rows of peaks only"),
    _number("hysteresis_speed_m_per_s", "m/s", "speed at which the hysteresis is taken"),
    *(_number(f"{w}_hysteresis_{s}_N", "N", f"opening less closing force, {w}") for w, s in _BOTH),
    _number("measured_energy_se_J", "J", "standard error by the scatter of the cycles"),
    _number("measured_hysteresis_rebound_se_N", "N", "standard error, likewise; of peaks"),
    _number("measured_hysteresis_bump_se_N", "N", "standard error, likewise; of peaks"),
)
_SAFE = "absolute gas pressure at rest at which a chamber just reaches zero on this motion"
CAVITATION = (
    _number("cavitation_fraction", "1", "share of the cycle with a chamber at P = 0", "fraction"),
    _number(
        "r_m3_cavitation_margin", "1", "rise of R_m3 at which chamber 2 cavitates", "r_m3_margin"
    ),
    _number("lowest_pressure", "Pa", "lowest absolute pressure of any chamber", "lowest_pressure"),
    _count("lowest_pressure_chamber", "chamber of the lowest pressure"),
    _number("lowest_pressure_displacement", "m", "x at the lowest pressure", "displacement"),
    _number("lowest_pressure_velocity", "m/s", "v at the lowest pressure", "velocity"),
    _number("safe_gas_pressure", "Pa", _SAFE, "safe_gas_pressure"),
)
FORCE = (
    _number("force_N", "N", "force there, gas and friction in it, the rig's tare not", "force"),
    _number("force_se_N", "N", "standard error of force_N", "error"),
    _number("force_ci_low_N", "N", "95 % interval of force_N", "low"),
    _number("force_ci_high_N", "N", "95 % interval of force_N", "high"),
    _number("force_misfit_se_N", "N", "error of force_N from the model's misfit", "misfit"),
    _number("measured_N", "N", "measured force there, without the tare", "measured_force"),
    _number("measured_se_N", "N", "standard error of measured_N", "measured_error"),
    _number("difference_N", "N", "measured less model, rig and filter in both", "difference"),
    _number("model_N", "N", "the damper's force at constant speed by the model", "model_force"),
    _number("gas_N", "N", "gas force at mid-stroke, in all of these", "gas"),
    _number("friction_N", "N", "friction in model_N", "friction"),
    _number("tare_N", "N", "the rig's offset, in none of these", "tare"),
)
CLICK = (
    _number("change_N", "N", "force less that of the setting before, no offset in it", "change"),
    _number("change_ci_low_N", "N", "95 % interval of change_N", "low"),
    _number("change_ci_high_N", "N", "95 % interval of change_N", "high"),
    _number("change_percent", "%", "the same of the damping: no gas force, no offset", "percent"),
    _number("change_percent_ci_low", "%", "95 % interval of change_percent", "percent_low"),
    _number("change_percent_ci_high", "%", "95 % interval of change_percent", "percent_high"),
)
_TABLES: dict[str, tuple[Column, ...]] = {
    "parameters": (
        _SETTING,
        _QUANTITIES,
        _MSE,
        _GRADE,
        _text("outcome", "how the fit ended"),
        _count("n_logs", "logs fitted together"),
        _SAMPLES,
        _count("n_cycles", "steady whole cycles evaluated"),
        _count("evaluations", "simulations the fit took"),
        *CAVITATION,
        _text("grade_reason", "why the grade is withheld; empty where it is not"),
    ),
    "mse": (
        _SETTING,
        _LOG,
        _MSE,
        _number("noise_floor_percent", "%", "MSE that the scatter between cycles explains"),
        _GRADE,
        _SAMPLES,
        _text("role", "fitted, or held_out: predicted with what the other logs gave"),
    ),
    "adjustment": (
        _SETTING,
        _number("speed_m_per_s", "m/s", "named test speed that the tests reach"),
        _STROKE,
        *FORCE[:4],
        *CLICK,
        *FORCE[4:8],
        _text("origin", "of force_N: model, or measured where the model misses it"),
        *FORCE[8:],
        _text("tested", "yes where the setting was tested up to this speed"),
        _text("measured_as", "pvp: peaks of segments; cvp: the loop at this speed"),
        _number("measured_opening_N", "N", "of a loop: measured while the speed rises"),
        _number("measured_closing_N", "N", "of a loop: measured while the speed falls"),
        _number("measured_peak_N", "N", "of segments: the largest force of the stroke"),
    ),
    "characteristics": (_SETTING, _LOG, *CHARACTERISTICS),
    "responses": (
        _SETTING,
        _LOG,
        *_MOTION,
        _number("force_measured_N", "N", "measured force as compared, filtered"),
        _number("force_N", "N", "force of the model as compared, filtered alike"),
        *_PRESSURES,
    ),
    "profiles": (
        _SETTING,
        _text("parameter", "name of the parameter that is followed"),
        _number("value", "", "its value, in the unit of its column in parameters"),
        _number("misfit_rise", "1", "rise of the misfit above its minimum; 3.84 is the 95 % limit"),
        _REFITTED,
    ),
    "valves": (
        _SETTING,
        _STROKE,
        _text("curve", "measured: read off the loops without a law; law; opening"),
        _number("pressure_Pa", "Pa", "pressure across the valve of that stroke"),
        _number("flow_m3_per_s", "m3/s", "flow through it; empty at an opening"),
        _number("valve_force_N", "N", "that pressure times the area it acts on"),
    ),
    "valve_parts": (
        _SETTING,
        _text("quantity", "the orifice or opening, as its column in parameters"),
        _number("area_m2", "m2", "of an orifice as a hole, at a discharge coefficient of 0.7"),
        _number("area_ci_low_m2", "m2", "95 % interval, the coefficient within 0.1"),
        _number("area_ci_high_m2", "m2", "95 % interval, the coefficient within 0.1"),
        _number("diameter_m", "m", "of one round hole"),
        _number("area_change_m2", "m2", "a click, since the setting before on the adjuster"),
        _number("pressure_Pa", "Pa", "at which a blow-off opens"),
        _number("pressure_ci_low_Pa", "Pa", "95 % interval"),
        _number("pressure_ci_high_Pa", "Pa", "95 % interval"),
        _number("pressure_change_Pa", "Pa", "a click, since the setting before on the adjuster"),
    ),
    "time_series": (
        *_MOTION,
        _number("force_N", "N", "force of the model, positive in rebound"),
        *_PRESSURES,
    ),
}

TABLES = tuple(name for name in _TABLES if name != "time_series")  # of a run


def _columns(
    table: str, settings: Collection[Setting] = (), quantities: Sequence[Quantity] = ()
) -> Iterator[Column]:
    for column in _TABLES[table]:
        if column is _SETTING:
            yield from _setting_columns(table, list(map(Setting.of, settings)))
        elif column is _QUANTITIES:
            units = {quantity.name: quantity.unit for quantity in quantities}
            yield from (_number(q.name, q.unit, q.meaning) for q in quantities)
            for name, unit in units.items():
                yield _number(f"{name}_se", unit, f"standard error of {name}")
                yield _number(f"{name}_ci_low", unit, f"95 % interval of {name}")
                yield _number(f"{name}_ci_high", unit, f"95 % interval of {name}")
                yield _text(f"{name}_status", f"how {name} was found")
            for name, unit in units.items():
                yield _number(f"{name}_misfit_se", unit, f"error of {name} from lack of fit")
        elif column is _REFITTED:
            more = f", {column.description}"
            yield from (_number(q.name, q.unit, q.meaning + more) for q in quantities)
        else:
            yield column


def _setting_columns(table: str, settings: Sequence[Setting]) -> Iterator[Column]:
    """The column ``setting`` and one for each adjuster that has a name."""
    is_whole = all(isinstance(setting.cell, int) for setting in settings)
    yield _SETTING if is_whole else _text(_SETTING.name, _SETTING.description)
    names = settings[0].adjusters if settings else (ADJUSTER,)
    for name in names if names != (ADJUSTER,) else ():
        places = [setting.place(name) for setting in settings]
        kind = next(
            (kind for kind in (str, float) if any(isinstance(p, kind) for p in places)), int
        )
        arrow = {str: _TEXT, float: _FLOAT, int: _INT}[kind]
        yield Column(name, arrow, "" if kind is str else "1", f"position of the adjuster {name}")
    if table == "adjustment" and len(names) > 1:
        yield _CHANGED


def table_schema(
    name: str,
    facts: Mapping[str, Any],
    *,
    settings: Collection[Setting] = (),
    quantities: Sequence[Quantity] = PAPER_QUANTITIES,
) -> pa.Schema:
    """Return the Arrow schema of a table; the facts join its ``damperfit`` entry as JSON values."""
    import pyarrow as pa

    entry = {"schema_version": SCHEMA_VERSION, "table": name}
    entry |= {"quantities": quantity_records(quantities), **facts}
    columns = []
    for column in _columns(name, settings, quantities):
        words = {"unit": column.unit, "description": column.description}
        columns.append(pa.field(column.name, pa.type_for_alias(column.kind), metadata=words))
    return pa.schema(columns, metadata={"damperfit": json.dumps(entry, sort_keys=True)})


def describe_tables(
    settings: Collection[Setting] = (), quantities: Sequence[Quantity] = PAPER_QUANTITIES
) -> dict[str, list[dict[str, str]]]:
    """Return name, type, unit and meaning of every column that `identify` writes, by table."""
    keys = ("name", "type", "unit", "description")
    return {
        table: [dict(zip(keys, c, strict=False)) for c in _columns(table, settings, quantities)]
        for table in TABLES
    }


def column_kinds(name: str, quantities: Sequence[Quantity] = PAPER_QUANTITIES) -> dict[str, type]:
    """Return the Python type of each column of a table, in order, but for adjusters."""
    columns = (*_columns(name, (), quantities), *[_CHANGED] * (name == "adjustment"))
    return {column.name: _KINDS[column.kind] for column in columns}


@cache
def column_names(quantities: tuple[Quantity, ...] = PAPER_QUANTITIES) -> frozenset[str]:
    """Return the names of all columns, which no adjuster may have."""
    every = (c.name for table in _TABLES for c in _columns(table, (), quantities))
    return frozenset((*every, _CHANGED.name)) - {ADJUSTER}


def unknown_schema(record: Mapping[str, Any]) -> str | None:
    """Return a sentence where results, by their record, are of a schema that is not known here."""
    version = record.get("schema_version", SCHEMA_VERSION)
    if version in (1, SCHEMA_VERSION):  # 1 did not name the quantities: they are the paper's
        return None
    return (
        f"the results are of schema version {version} (damperfit {record.get('version')}), "
        f"this damperfit knows {SCHEMA_VERSION}: what is not found is left out; "
        "update damperfit, or run identify again on the logs"
    )


# The setting of a row: its label, and a column for each adjuster that has a name.


def setting_cells(setting: Setting, *, is_whole: bool) -> dict[str, Place]:
    """Return what a row of a setting holds; ``is_whole``: the column is one of whole numbers."""
    setting = Setting.of(setting)
    named = {} if setting.adjusters == (ADJUSTER,) else dict(setting.places)
    return {"setting": setting.cell if is_whole else setting.label, **named}


def adjusters_in(
    names: Sequence[str], quantities: Sequence[Quantity] = PAPER_QUANTITIES
) -> tuple[str, ...]:
    """Return the adjusters that have a column in a table: what follows ``setting`` unknown."""
    known, after = column_names(tuple(quantities)), iter(names)
    # The search for it goes as far as it.
    return tuple(takewhile(lambda name: name not in known, after)) if ADJUSTER in after else ()


def read_setting(row: Mapping[str, Any], adjusters: Sequence[str] = ()) -> Setting | None:
    """Return the setting of a row that was read back, None where its cell is empty.

    Where the columns of the adjusters are missing the label is taken as it is. A ValueError:
    a cell is not the place of an adjuster.
    """
    cells = [row.get(name) for name in adjusters]
    if adjusters and all(cell not in (None, "") for cell in cells):
        places = (parse_place(str(cell)) for cell in cells)
        return Setting(tuple(zip(adjusters, places, strict=True)))
    cell = row["setting"]
    if isinstance(cell, Setting) or cell in (None, ""):
        return cell or None
    text = str(cell)
    return Setting.of(parse_place(text) if len(text) <= LONGEST_WORD else text)


# The quantities of a model in the metadata of tables, and back.


def quantity_records(quantities: Sequence[Quantity]) -> list[dict[str, Any]]:
    """Return quantities as JSON values; what has no limit has none."""

    def value(of: Any) -> Any:
        is_range = isinstance(of, tuple)
        return [limit if math.isfinite(limit) else None for limit in of] if is_range else of

    names = [field.name for field in fields(Quantity)]
    return [{name: value(getattr(q, name)) for name in names} for q in quantities]


def quantities_in(facts: Mapping[str, Any], columns: Sequence[str] = ()) -> tuple[Quantity, ...]:
    """Return the quantities in the facts of a table or run.json, else the paper's.

    Where the facts are lost, and ``columns`` are not the paper's, these say what there is: those
    with a status, of a table of one's own all.
    """
    records = facts.get("quantities")
    quantities: tuple[Quantity, ...] = ()
    with suppress(KeyError, TypeError, ValueError):
        quantities = tuple(map(_quantity, records)) if isinstance(records, list) else ()
    named = [name.removesuffix("_status") for name in columns if name.endswith("_status")]
    if not (named or {"r_m1", "r_m2", "r_m3"}.intersection(columns)):
        named = [name for name in columns if name != "setting"]
    if not quantities and not {q.name for q in PAPER_QUANTITIES}.issuperset(named):
        quantities = tuple(Quantity(n, n, n, n, "", (-math.inf, math.inf)) for n in named)
    return quantities if quantities and quantities != PAPER_QUANTITIES else PAPER_QUANTITIES


def _quantity(record: Mapping[str, Any]) -> Quantity:
    values = {field.name: record[field.name] for field in fields(Quantity) if field.name in record}
    for key, pair in values.items():
        if isinstance(pair, list):
            limits = zip(pair, (-math.inf, math.inf), strict=True)
            values[key] = tuple(none if limit is None else float(limit) for limit, none in limits)
    return Quantity(**values)


def values_from(quantities: tuple[Quantity, ...], numbers: Sequence[float]) -> Values:
    """Return values read from a table."""
    is_paper = quantities == PAPER_QUANTITIES
    return (PURDY_DAMPER.values_type if is_paper else values_type(quantities))(*numbers)
