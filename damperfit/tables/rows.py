"""What was fitted, assessed and read off the logs, as rows of tables."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.adjustment.clicks import Adjustment, Click
from damperfit.adjustment.force_at import Force
from damperfit.arrays import FloatArray
from damperfit.conditioning.measured_characteristics import (
    counted_edges,
    figures_in,
    mean_energy,
    mean_extremes,
)
from damperfit.damper.model import Model
from damperfit.identification.fit_setting import EXCELLENT, Fit
from damperfit.identification.logs import SimulatedLog
from damperfit.identification.outcome import Status
from damperfit.identification.procedures import Campaign
from damperfit.passed_speeds import in_both_strokes
from damperfit.recording import Segment, Trace
from damperfit.simulation import NAMED_SPEEDS
from damperfit.statistics import mean_of
from damperfit.tables.columns import CAVITATION, CLICK, FORCE, Column
from damperfit.tables.files import LogSignals, finite
from damperfit.tested.setting import Setting
from damperfit.uncertainty.assessment import Assessment
from damperfit.uncertainty.covariance import Interval
from damperfit.uncertainty.grades import Prediction
from damperfit.uncertainty.profiles import MisfitProfile

if TYPE_CHECKING:
    from damperfit.damper.valve_dampers import ValveCharacteristic


WITHHELD = "withheld"  # in place of a grade that a low MSE does not deserve
MISSING = "missing"  # outcome of a setting that the configuration expects but that has no fit
_GOOD = 5.0  # per cent


def _cells(columns: Iterable[Column], source: object) -> dict[str, Any]:
    return {c.name: finite(getattr(source, c.source)) for c in columns if c.source}


def grade(mse_percent: float) -> str:
    """Return the paper's word for an MSE in per cent: excellent < 1, good < 5, else poor."""
    if mse_percent < EXCELLENT:
        return "excellent"
    return "good" if mse_percent < _GOOD else "poor"


def campaign_rows(
    campaign: Campaign,
    *,
    assessment: Assessment = Assessment(),
    predictions: Sequence[Prediction] = (),
    adjustment: Adjustment = Adjustment(),
    expected: Iterable[Setting] = (),
) -> dict[str, list[dict[str, Any]]]:
    """Return the rows of the tables "parameters", "mse" and "adjustment" of a campaign.

    Settings that were expected and have no fit get a row without figures.
    """
    reasons = {
        setting: "; ".join(objection.sentence for objection in why)
        for setting, why in assessment.objections.items()
    }
    intervals = {each.setting: each.intervals for each in assessment.uncertainties}
    parameters, errors = {}, []

    def add_error(setting: Setting, result: Any, role: str = "fitted") -> None:
        trace = getattr(result, "trace", None)  # of a log
        errors.append(
            {
                "setting": setting,
                "log": "" if trace is None else trace.name,
                "mse_percent": result.mse_percent,
                "noise_floor_percent": result.noise_floor_percent,
                "grade": WITHHELD if setting in reasons else grade(result.mse_percent),
                "n_samples": result.n_samples if trace is None else trace.n_samples,
                "role": role,
            }
        )

    for fit in campaign.fits:
        row = _parameter_row(fit, assessment, intervals.get(fit.setting, {}))
        reason = reasons.get(fit.setting)
        row |= {"grade": WITHHELD if reason else grade(fit.mse_percent), "grade_reason": reason}
        parameters[fit.setting] = row
        for result in (fit, *fit.logs):
            add_error(fit.setting, result)
        for prediction in predictions:
            if prediction.setting == fit.setting:
                add_error(fit.setting, prediction, "held_out")
    for prediction in predictions:
        if prediction.is_unseen:
            add_error(prediction.setting, prediction, "held_out")
    for setting in expected:
        parameters.setdefault(setting, {"setting": setting, "outcome": MISSING})
    return {
        "parameters": [parameters[setting] for setting in sorted(parameters)],
        "mse": errors,
        "adjustment": adjustment_rows(adjustment.forces, adjustment.clicks),
    }


def _parameter_row(
    fit: Fit, assessment: Assessment, intervals: Mapping[str, Interval]
) -> dict[str, Any]:
    row: dict[str, Any] = {"setting": fit.setting, **_cells(CAVITATION, fit.cavitation)}
    for name in fit.parameters.names:
        interval, (low, high) = intervals.get(name), assessment.plausible_limits(fit, name)
        is_open = fit.status[name] == Status.NOT_IDENTIFIABLE and low is None and high is None
        row[name] = getattr(fit.parameters, name)
        if interval is not None and not is_open:  # without a limit there is no error either
            row |= {f"{name}_se": interval.error, f"{name}_misfit_se": interval.misfit}
        row |= {f"{name}_ci_low": low, f"{name}_ci_high": high}
        row[f"{name}_status"] = fit.status[name].value
    for name in ("mse_percent", "n_samples", "n_cycles", "evaluations"):
        row[name] = getattr(fit, name)
    row |= {"outcome": fit.outcome.value, "n_logs": len(fit.logs)}
    return row | {"lowest_pressure_chamber": fit.cavitation.chamber or None}


def profile_rows(profiles: Iterable[MisfitProfile]) -> list[dict[str, Any]]:
    """Return the rows of the table "profiles", one a point."""
    return [
        {"setting": profile.setting, "parameter": profile.name}
        | {"value": point.value, "misfit_rise": point.rise}
        | {name: getattr(point.parameters, name) for name in point.parameters.names}
        for profile in profiles
        for point in profile.points
    ]


def adjustment_rows(forces: Sequence[Force], clicks: Sequence[Click]) -> list[dict[str, Any]]:
    """Return the rows of the table "adjustment": by setting, speed and stroke, as they are shown.

    The rows of the lowest setting have no change. With several adjusters a setting has a row for
    each that has a neighbour below it.
    """
    changes: dict[tuple[Setting, float, str], list[dict[str, Any]]] = defaultdict(list)
    for click in clicks:
        change = {**_cells(CLICK, click), "changed": click.adjuster}
        changes[click.second, click.speed, click.stroke].append(change)
    none = [dict.fromkeys(column.name for column in CLICK)]
    rows = []
    for force in forces:
        measured, key = force.measured, (force.setting, force.speed, force.stroke)
        has_tare = measured is not None and force.measured_force != measured.force
        tare = force.tare if has_tare else 0.0
        row = dict(zip(("setting", "speed_m_per_s", "stroke"), key, strict=True))
        row |= {**_cells(FORCE, force), "origin": force.origin}
        row |= {"tested": "yes" if force.is_tested else "no"}
        row |= {"measured_as": None if measured is None else measured.kind}
        for part in ("opening", "closing", "peak"):
            value = None if measured is None else getattr(measured, part) - tare
            row[f"measured_{part}_N"] = finite(value)
        rows += [row | change for change in changes.get(key, none)]
    return rows


def signals_of(setting: Setting, trace: Trace, compared: SimulatedLog) -> LogSignals:
    """Return the signals of a log where it is compared."""
    part, response = trace.compared, compared.response
    measured = trace.displacement[part], trace.velocity[part], trace.force[part]
    simulated = compared.force[part], response.pressures[:, part]
    return LogSignals(setting, trace.name, response.time[part], *measured, *simulated)


# What a dyno's software reads off each segment, as rows: measured beside simulated.
#
# One row of the peaks (PVP) and one of each named speed that both strokes reach. The gas force is
# that of the damper's data at the displacement of each sample; a model without gas has none, and
# the cells stay empty. Of a motion that does not repeat there are the peaks alone.

_UNREPEATED = ((math.nan, math.nan),) * 2  # opening and closing force of both strokes


def characteristic_rows(
    setting: Setting,
    trace: Trace,
    compared: SimulatedLog,
    damper: Model,
    speeds: Sequence[float] = NAMED_SPEEDS,
) -> Iterator[dict[str, Any]]:
    """Yield the rows of a log: of each segment the peaks, then the named speeds (m/s)."""
    for place, segment in enumerate(trace.segments, start=1):
        facts = {"setting": setting, "log": trace.name, "stretch": place}
        facts |= {"temperature_degC": trace.temperature, **segment.describe(trace)}
        for row in _segment_rows(trace, segment, compared.force, damper, speeds):
            yield facts | row


def _segment_rows(
    trace: Trace, segment: Segment, simulated: FloatArray, damper: Model, speeds: Sequence[float]
) -> Iterator[dict[str, Any]]:
    edges = counted_edges(segment)
    part = slice(int(edges[0]), int(edges[-1]))
    gas = damper.rest_force(trace.displacement[part])
    level = {} if gas is None else {"mean_gas_force_N": mean_of(gas)}
    forces = {
        (whose, suffix): force if gas is None or not suffix else force - gas
        for whose, force in (("measured", trace.force[part]), ("simulated", simulated[part]))
        for suffix in (("",) if gas is None else ("", "_without_gas"))
    }
    stacked = np.stack(list(forces.values()))
    measured = figures_in(trace, segment)
    top = min(measured.peak_speed_rebound, measured.peak_speed_bump)
    half = measured.hysteresis_speed
    speeds = [speed for speed in speeds if speed < top] if segment.n_cycles else []
    passed = sorted({*speeds, half}) if segment.n_cycles else []
    # By speed and force: of each stroke the opening and the closing branch.
    both = in_both_strokes(trace.velocity[part], stacked, passed)[1]
    branches = dict(zip(passed, np.transpose(both, (2, 3, 0, 1)).tolist(), strict=True))

    def cells(pairs: Iterable[Sequence[float]], loops: Iterable[Any]) -> dict[str, Any]:
        """Of each force that of both strokes, their ratio, and opening less closing branch."""
        row: dict[str, Any] = {}
        for (whose, suffix), (rebound, bump), of in zip(forces, pairs, loops, strict=True):
            row[f"{whose}_rebound{suffix}_N"], row[f"{whose}_bump{suffix}_N"] = rebound, bump
            # Where the gas pushes both strokes to one side there is no ratio.
            row[f"{whose}_ratio{suffix}"] = -rebound / bump if rebound > 0.0 > bump else None
            if not suffix:
                for stroke, (opening, closing) in zip(("rebound", "bump"), of, strict=True):
                    row[f"{whose}_hysteresis_{stroke}_N"] = opening - closing
        return row

    extremes = zip(*mean_extremes(stacked, edges[:-1] - edges[0]), strict=True)
    yield {
        **level,
        "point": "peak",
        "speed_rebound_m_per_s": measured.peak_speed_rebound,
        "speed_bump_m_per_s": measured.peak_speed_bump,
        "hysteresis_speed_m_per_s": half,
        **{f"measured_{name}": value for name, value in measured.describe().items()},
        "simulated_energy_J": mean_energy(trace, segment, simulated),
        **cells(extremes, branches.get(half, [_UNREPEATED] * len(forces))),
    }
    for speed in speeds:
        names = ("speed_rebound_m_per_s", "speed_bump_m_per_s", "hysteresis_speed_m_per_s")
        means = [[0.5 * sum(pair) for pair in of] for of in branches[speed]]
        row = {**level, "point": "speed", **dict.fromkeys(names, speed)}
        yield row | cells(means, branches[speed])


def valve_rows(setting: Setting, valves: Iterable[ValveCharacteristic]) -> Iterator[dict[str, Any]]:
    """Yield the rows of a setting: of each valve what was measured, its law, its opening."""
    for valve in valves:
        curves = {
            "measured": zip(valve.drop.tolist(), valve.flow.tolist(), strict=True),
            "law": zip(valve.law_drop.tolist(), valve.law_flow.tolist(), strict=True),
            "opening": [] if valve.opening is None else [(valve.opening, None)],
        }
        for curve, points in curves.items():
            for pressure, flow in points:
                row = {"setting": setting, "stroke": valve.stroke, "curve": curve}
                row |= {"pressure_Pa": pressure, "flow_m3_per_s": flow}
                yield row | {"valve_force_N": pressure * valve.area}
