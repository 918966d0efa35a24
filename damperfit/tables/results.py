"""Campaigns and responses laid out as Arrow tables."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from damperfit.adjustment.clicks import Adjustment
from damperfit.conditioning import branch_forces
from damperfit.conditioning.measured_characteristics import (
    counted_edges,
    figures_in,
    mean_energy,
    mean_extremes,
)
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.identification.outcome import Status
from damperfit.identification.setting import EXCELLENT
from damperfit.simulation import NAMED_SPEEDS
from damperfit.statistics import mean_of
from damperfit.tables.columns import PAPER_QUANTITIES, setting_cells, table_schema
from damperfit.tables.files import column, float_array
from damperfit.uncertainty import Assessment

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    import pandas as pd
    from numpy.typing import NDArray

    from damperfit.adjustment.clicks import Click
    from damperfit.adjustment.force_at import Force
    from damperfit.damper.model import Model
    from damperfit.damper.quantity import Quantity
    from damperfit.identification import Campaign, Fit, LogFit, SimulatedLog
    from damperfit.recording import Stretch, Trace
    from damperfit.simulation import Response
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty import Interval, MisfitProfile, Prediction

    FloatArray = NDArray[np.float64]

    from damperfit.damper.valve_characteristics import ValveCharacteristic

__all__ = [
    "MISSING",
    "WITHHELD",
    "Tables",
    "adjustment_rows",
    "characteristic_rows",
    "grade",
    "lay_out",
    "make_tables",
    "profiles_table",
    "time_series_table",
    "valve_rows",
]


WITHHELD = "withheld"  # in place of a grade that a low MSE does not deserve
MISSING = "missing"  # outcome of a setting that the configuration expects but that has no fit


_CHANGES = (
    "change_N",
    "change_ci_low_N",
    "change_ci_high_N",
    "change_percent",
    "change_percent_ci_low",
    "change_percent_ci_high",
)


@dataclass(frozen=True, slots=True, eq=False)
class Tables:
    """The tables of a campaign, as Arrow tables.

    Attributes
    ----------
    parameters : pyarrow.Table
        One row per setting.
    mse : pyarrow.Table
        One row per setting (``log`` empty) and one per log.
    adjustment : pyarrow.Table
        Force and its change by click: one row per setting, named speed and stroke.
    quantities : tuple of Quantity
        What the columns of ``parameters`` are of.
    """

    parameters: pa.Table
    mse: pa.Table
    adjustment: pa.Table
    quantities: tuple[Quantity, ...] = PAPER_QUANTITIES

    def frame(self, name: str) -> pd.DataFrame:
        """Return the table ``name`` (as the attributes) as a pandas data frame."""
        tables = {"parameters": self.parameters, "mse": self.mse, "adjustment": self.adjustment}
        if name not in tables:
            hint = did_you_mean(name, tables)
            raise ConfigurationError(f"no table {name!r}; there are {', '.join(tables)}.{hint}")
        table: pa.Table = tables[name]
        frame: pd.DataFrame = table.to_pandas()
        return frame


def grade(mse_percent: float) -> str:
    """Return the paper's word for an MSE in per cent: excellent < 1, good < 5, else poor.

    Examples
    --------
    >>> grade(0.3), grade(3.0), grade(float("nan"))
    ('excellent', 'good', 'poor')
    """
    if mse_percent < EXCELLENT:
        return "excellent"
    return "good" if mse_percent < 5.0 else "poor"


def make_tables(
    campaign: Campaign,
    *,
    assessment: Assessment = Assessment(),
    predictions: Sequence[Prediction] = (),
    adjustment: Adjustment = Adjustment(),
    expected: Iterable[Setting] = (),
    provenance: Mapping[str, Any] | None = None,
) -> Tables:
    """Lay a campaign out as tables.

    Parameters
    ----------
    campaign : Campaign
        Result of `damperfit.identification.identify`.
    assessment : Assessment
        Errors and intervals, cells without one stay empty; why grades are withheld.
    predictions : sequence of Prediction
        What was held out; their rows follow those of the setting in table ``mse``.
    adjustment : Adjustment
        Forces by setting; without them that table has no rows.
    expected : iterable of Setting
        Settings that ought to be there; those without a fit get a row of nulls.
    provenance : mapping, optional
        Facts for the schema's ``damperfit`` entry: JSON values that depend on the inputs alone.

    Returns
    -------
    Tables
    """
    reasons = {
        setting: "; ".join(one.sentence for one in why)
        for setting, why in assessment.objections.items()
    }
    known = {one.setting: one.intervals for one in assessment.uncertainties}
    rows = {
        fit.setting: _parameter_row(
            fit, assessment, known.get(fit.setting, {}), reasons.get(fit.setting)
        )
        for fit in campaign.fits
    }
    for setting in set(expected) - rows.keys():
        rows[setting] = {"setting": setting, "outcome": MISSING}
    quantities = campaign.quantities or PAPER_QUANTITIES
    lay = partial(
        lay_out, facts=dict(provenance or {}), settings=tuple(rows), quantities=quantities
    )
    return Tables(
        quantities=quantities,
        parameters=lay("parameters", [rows[setting] for setting in sorted(rows)]),
        mse=lay("mse", list(_mse_rows(campaign, predictions, reasons))),
        adjustment=lay("adjustment", adjustment_rows(adjustment.forces, adjustment.clicks)),
    )


def _parameter_row(
    fit: Fit, assessment: Assessment, intervals: Mapping[str, Interval], reason: str | None
) -> dict[str, Any]:
    row: dict[str, Any] = {"setting": fit.setting}
    for name in fit.parameters.names:
        row[name] = _finite(getattr(fit.parameters, name))
        interval = intervals.get(name)
        low, high = assessment.plausible_limits(fit, name)
        is_open = fit.status[name] == Status.NOT_IDENTIFIABLE and low is None and high is None
        if interval is not None and not is_open:  # without a limit there is no error either
            row[f"{name}_se"] = _finite(interval.error)
            row[f"{name}_misfit_se"] = _finite(interval.misfit)
        row[f"{name}_ci_low"], row[f"{name}_ci_high"] = _finite(low), _finite(high)
        row[f"{name}_status"] = fit.status[name].value
    return row | {
        "mse_percent": _finite(fit.mse_percent),
        "grade": WITHHELD if reason else grade(fit.mse_percent),
        "grade_reason": reason,
        "outcome": fit.outcome.value,
        "n_logs": len(fit.logs),
        "n_samples": fit.n_samples,
        "n_cycles": fit.n_cycles,
        "evaluations": fit.evaluations,
        "cavitation_fraction": _finite(fit.cavitation.fraction),
        "r_m3_cavitation_margin": _finite(fit.cavitation.margin),
        "lowest_pressure": _finite(fit.cavitation.lowest_pressure),
        "lowest_pressure_chamber": fit.cavitation.chamber or None,
        "lowest_pressure_displacement": _finite(fit.cavitation.displacement),
        "lowest_pressure_velocity": _finite(fit.cavitation.velocity),
        "safe_gas_pressure": _finite(fit.cavitation.safe_gas_pressure),
    }


def _mse_rows(
    campaign: Campaign, predictions: Sequence[Prediction], withheld: Collection[Setting]
) -> Iterator[dict[str, Any]]:
    """Yield for each setting the row of the whole, of each log fitted, of each held out."""
    for row in _graded_rows(campaign, predictions):
        yield row | {"grade": WITHHELD} if row["setting"] in withheld else row


def _graded_rows(campaign: Campaign, predictions: Sequence[Prediction]) -> Iterator[dict[str, Any]]:
    held_out_at: dict[Setting, list[Prediction]] = defaultdict(list)
    for one in predictions:
        held_out_at[one.setting].append(one)
    for fit in campaign.fits:
        whole = ("", fit.mse_percent, fit.noise_floor_percent, fit.n_samples)
        yield _mse_row(fit.setting, "fitted", *whole)
        for seen in fit.logs:
            yield _mse_row(fit.setting, "fitted", *_of_log(seen))
        for held_out in held_out_at.get(fit.setting, ()):
            yield _mse_row(fit.setting, "held_out", *_of_log(held_out))
    for unseen in (one for one in predictions if one.is_unseen):
        yield _mse_row(unseen.setting, "held_out", *_of_log(unseen))


def _of_log(seen: LogFit | Prediction) -> tuple[str, float, float, int]:
    trace = seen.trace
    return trace.name, seen.mse_percent, seen.noise_floor_percent, trace.n_samples


def _mse_row(
    setting: Setting, role: str, log: str, mse: float, noise_floor: float, n_samples: int
) -> dict[str, Any]:
    return {
        "setting": setting,
        "log": log,
        "mse_percent": _finite(mse),
        "noise_floor_percent": _finite(noise_floor),
        "grade": grade(mse),
        "n_samples": n_samples,
        "role": role,
    }


def profiles_table(
    profiles: Iterable[MisfitProfile],
    *,
    provenance: Mapping[str, Any] | None = None,
    quantities: Sequence[Quantity] = PAPER_QUANTITIES,
) -> pa.Table:
    """Lay profiles out as a table with one row per point.

    Parameters
    ----------
    profiles : iterable of MisfitProfile
        As in `damperfit.uncertainty.Assessment`.
    provenance : mapping, optional
        Facts for the schema's ``damperfit`` entry, as JSON values.
    quantities : sequence of Quantity
        Of the model.
    """
    known = tuple(profiles)
    rows = [
        {
            "setting": profile.setting,
            "parameter": profile.name,
            "value": _finite(point.value),
            "misfit_rise": _finite(point.rise),
        }
        | {name: _finite(getattr(point.parameters, name)) for name in point.parameters.names}
        for profile in known
        for point in profile.points
    ]
    settings = {profile.setting for profile in known}
    return lay_out(
        "profiles",
        rows,
        facts=dict(provenance or {}),
        settings=tuple(settings),
        quantities=quantities,
    )


def adjustment_rows(forces: Sequence[Force], clicks: Sequence[Click]) -> list[dict[str, Any]]:
    """Return the rows of the table "adjustment".

    Parameters
    ----------
    forces : sequence of Force
        By setting, speed and stroke, as they are told.
    clicks : sequence of Click
        Their changes; the rows of the lowest setting have none. With several adjusters a setting
        has a row for each that has a neighbour below it.
    """
    changes: dict[tuple[Setting, float, str], list[Click | None]] = defaultdict(list)
    for click in clicks:
        changes[click.second, click.speed, click.stroke].append(click)
    rows = []
    for one in forces:
        row = _force_row(one)
        for click_or_none in changes.get((one.setting, one.speed, one.stroke), [None]):
            changed = {} if click_or_none is None else {"changed": click_or_none.adjuster}
            rows.append(row | _change(click_or_none) | changed)
    return rows


def _force_row(one: Force) -> dict[str, Any]:
    seen = one.measured
    tare = one.tare if seen is not None and one.measured_force != seen.force else 0.0
    branches: dict[str, Any] = {}
    if seen is not None:
        branches = {
            "measured_as": seen.kind,
            "measured_opening_N": _finite(seen.opening - tare),
            "measured_closing_N": _finite(seen.closing - tare),
            "measured_peak_N": _finite(seen.peak - tare),
        }
    return {
        "setting": one.setting,
        "speed_m_per_s": one.speed,
        "stroke": one.stroke,
        "force_N": _finite(one.force),
        "force_se_N": _finite(one.error),
        "force_ci_low_N": _finite(one.low),
        "force_ci_high_N": _finite(one.high),
        "force_misfit_se_N": _finite(one.misfit),
        "measured_N": _finite(one.measured_force),
        "measured_se_N": _finite(one.measured_error),
        "difference_N": _finite(one.difference),
        "origin": one.origin,
        "model_N": _finite(one.model_force),
        "gas_N": _finite(one.gas),
        "friction_N": _finite(one.friction),
        "tare_N": _finite(one.tare),
        "tested": "yes" if one.is_tested else "no",
        "measured_as": None,
        "measured_opening_N": None,
        "measured_closing_N": None,
        "measured_peak_N": None,
        **branches,
    }


def _change(click: Click | None) -> dict[str, Any]:
    if click is None:
        return dict.fromkeys(_CHANGES)
    values = (
        click.change,
        click.low,
        click.high,
        click.percent,
        click.percent_low,
        click.percent_high,
    )
    return {name: _finite(value) for name, value in zip(_CHANGES, values, strict=True)}


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def lay_out(
    name: str,
    rows: Sequence[Mapping[str, Any]],
    *,
    facts: Mapping[str, Any] | None = None,
    settings: Collection[Setting] = (),
    quantities: Sequence[Quantity] = (),
) -> pa.Table:
    """Return rows as a table of `columns`; cells that a row has not are null.

    Parameters
    ----------
    name : str
        Of the table, as `columns` declares it.
    rows : sequence of mapping
        Cells by column; each row has its setting.
    facts : mapping, optional
        For the schema's ``damperfit`` entry, as JSON values.
    settings : collection of Setting
        Of the run.
    quantities : sequence of Quantity
        Of the model.
    """
    schema = table_schema(name, facts or {}, settings=settings, quantities=quantities)
    is_whole = schema.field("setting").type == pa.int64()
    cells = []
    for _, few in itertools.groupby(rows, lambda row: id(row["setting"])):
        of_setting = list(few)
        shown = setting_cells(of_setting[0]["setting"], is_whole=is_whole)
        cells += [{**row, **shown} for row in of_setting]
    named = zip(schema.names, schema.types, strict=True)
    arrays = [column([row.get(name) for row in cells], kind) for name, kind in named]
    return pa.Table.from_arrays(arrays, schema=schema)


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
    schema = table_schema("time_series", facts or {})
    return pa.Table.from_arrays([float_array(a) for a in arrays], schema=schema)


# What a dyno's software reads off each stretch, as rows: measured beside simulated.
#
# One row of the peaks (PVP) and one of each named speed that both strokes reach. The gas force is
# that of the damper's data at the displacement of each sample; a model without gas has none, and
# the cells stay empty. Of a motion that does not repeat there are the peaks alone.

_STROKES = (("rebound", 1.0), ("bump", -1.0))
_UNREPEATED = ((math.nan, math.nan),) * len(_STROKES)


def characteristic_rows(
    setting: Setting, trace: Trace, seen: SimulatedLog, damper: Model
) -> Iterator[dict[str, Any]]:
    """Yield the rows of a log: of each stretch the peaks, then the named speeds.

    Parameters
    ----------
    setting : Setting
        Of the log.
    trace : Trace
        The log.
    seen : SimulatedLog
        The model's force as compared.
    damper : Model
        Whose gas force is taken off.
    """
    for place, stretch in enumerate(trace.stretches, start=1):
        facts = {
            "setting": setting,
            "log": trace.name,
            "stretch": place,
            "kind": stretch.kind,
            "start_s": trace.start_time + stretch.first * trace.interval,
            "cycles": stretch.n_cycles,
            "frequency_Hz": stretch.frequency,
            "amplitude_m": stretch.amplitude,
            "temperature_degC": trace.temperature,
        }
        for row in _stretch_rows(trace, stretch, seen.force, damper):
            cells = facts | row
            yield {
                name: None if isinstance(cell, float) and not math.isfinite(cell) else cell
                for name, cell in cells.items()
            }


def _stretch_rows(
    trace: Trace, stretch: Stretch, simulated: FloatArray, damper: Model
) -> Iterator[dict[str, Any]]:
    edges = counted_edges(stretch)
    part = slice(int(edges[0]), int(edges[-1]))
    velocity, begins = trace.velocity[part], edges[:-1] - edges[0]
    forces = {("measured", ""): trace.force[part], ("simulated", ""): simulated[part]}
    gas = damper.rest_force(trace.displacement[part])
    level = {}
    if gas is not None:
        level = {"mean_gas_force_N": mean_of(gas)}
        forces = {
            (whose, suffix): force if not suffix else force - gas
            for (whose, _), force in forces.items()
            for suffix in ("", "_without_gas")
        }
    stacked = np.stack(list(forces.values()))
    measured = figures_in(trace, stretch)
    top = min(measured.peak_speed_rebound, measured.peak_speed_bump)
    half = measured.hysteresis_speed
    speeds = [speed for speed in NAMED_SPEEDS if speed < top] if stretch.n_cycles else []
    passed = sorted({*speeds, half}) if stretch.n_cycles else []
    # By speed and force: of each stroke the opening and the closing branch.
    both = [branch_forces(velocity, stacked, passed, sign=sign) for _, sign in _STROKES]
    branches = dict(zip(passed, np.transpose(both, (2, 3, 0, 1)).tolist(), strict=True))
    peak: dict[str, Any] = {
        "point": "peak",
        "speed_rebound_m_per_s": measured.peak_speed_rebound,
        "speed_bump_m_per_s": measured.peak_speed_bump,
        "hysteresis_speed_m_per_s": half,
    }
    tops, bottoms = mean_extremes(stacked, begins)
    for (whose, suffix), rebound, bump in zip(forces, tops, bottoms, strict=True):
        peak |= _pair(whose, suffix, rebound, bump)
    peak |= {
        "measured_energy_J": measured.energy,
        "simulated_energy_J": mean_energy(trace, stretch, simulated),
        "measured_energy_se_J": measured.energy_se,
        "measured_hysteresis_rebound_se_N": measured.hysteresis_rebound_se,
        "measured_hysteresis_bump_se_N": measured.hysteresis_bump_se,
    }
    yield level | peak | _hysteresis(forces, branches.get(half, [_UNREPEATED] * len(forces)))
    for speed in speeds:
        row: dict[str, Any] = {
            "point": "speed",
            "speed_rebound_m_per_s": speed,
            "speed_bump_m_per_s": speed,
            "hysteresis_speed_m_per_s": speed,
        }
        for (whose, suffix), of in zip(forces, branches[speed], strict=True):
            rebound, bump = (0.5 * (opening + closing) for opening, closing in of)
            row |= _pair(whose, suffix, rebound, bump)
        yield level | row | _hysteresis(forces, branches[speed])


def _hysteresis(
    forces: Collection[tuple[str, str]], branches: Sequence[Sequence[tuple[float, float]]]
) -> dict[str, float]:
    """Of each force its opening less its closing branch, by stroke."""
    return {
        f"{whose}_hysteresis_{stroke}_N": opening - closing
        for (whose, suffix), of in zip(forces, branches, strict=True)
        if not suffix
        for (stroke, _), (opening, closing) in zip(_STROKES, of, strict=True)
    }


def _pair(whose: str, suffix: str, rebound: float, bump: float) -> dict[str, float | None]:
    # Where the gas pushes both strokes to one side there is no ratio.
    ratio = -rebound / bump if rebound > 0.0 > bump else None
    return {
        f"{whose}_rebound{suffix}_N": rebound,
        f"{whose}_bump{suffix}_N": bump,
        f"{whose}_ratio{suffix}": ratio,
    }


# The valves of each setting, flow against pressure: measured points, the fitted law, openings.


def valve_rows(setting: Setting, valves: Iterable[ValveCharacteristic]) -> Iterator[dict[str, Any]]:
    """Yield the rows of a setting: of each valve what was measured, its law, its opening.

    Parameters
    ----------
    setting : Setting
        Which.
    valves : iterable of ValveCharacteristic
        Of the setting.
    """
    for one in valves:
        points = [("measured", one.drop, one.flow), ("law", one.law_drop, one.law_flow)]
        for curve, drop, flow in points:
            for pressure, rate in zip(drop.tolist(), flow.tolist(), strict=True):
                yield _row(setting, one, curve, pressure, rate)
        if one.opening is not None:
            yield _row(setting, one, "opening", one.opening, None)


def _row(
    setting: Setting, valve: ValveCharacteristic, curve: str, pressure: float, flow: float | None
) -> dict[str, Any]:
    return {
        "setting": setting,
        "stroke": valve.stroke,
        "curve": curve,
        "pressure_Pa": pressure,
        "flow_m3_per_s": flow,
        "valve_force_N": pressure * valve.area,
    }
