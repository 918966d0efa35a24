"""What a table of many dampers tells: medians and bands by setting, who is far off, change by date.

A series is one parameter, or the force at one named speed and stroke. Distances are from the median
of a setting in median absolute deviations, so that those who are off do not hide each other.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from datetime import date
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd

from damperfit.comparison import Point
from damperfit.errors import ConfigurationError
from damperfit.fleets.parts import SERIAL, SYMBOL
from damperfit.problem import Option
from damperfit.simulation import NAMED_SPEEDS
from damperfit.tables.columns import PAPER_QUANTITIES
from damperfit.tested.setting import Setting, parse_place

if TYPE_CHECKING:
    import pyarrow as pa
    from numpy.typing import NDArray

    from damperfit.comparison import Tolerance

    FloatArray = NDArray[np.float64]

LEAST_DAMPERS = 8  # in a setting, before one of them is called far off
FAR_OFF = 8.0  # median absolute deviations: 5.4 standard deviations of a normal distribution
# No rig repeats better than this share of the median: closer than that, all are alike.
LEAST_SPREAD = 1e-3
_FORCE = re.compile(r"force_(rebound|bump)_([\d.]+)_mm_per_s_N")
_SHARES = {"low": 0.05, "quarter": 0.25, "three_quarters": 0.75, "high": 0.95}
_GRADES = ("excellent", "good", "poor", "withheld")  # the last is the worst


class Series(NamedTuple):
    """One parameter, or the force at one speed and stroke, of all dampers."""

    name: str  # of its column
    label: str
    unit: str
    speed: float = 0.0  # m/s, of a force
    stroke: str = ""  # rebound or bump; empty of a parameter


class DamperLine(NamedTuple):
    """One damper in a line."""

    damper: str  # its serial; empty where none is known
    n_settings: int  # with a fit
    n_failures: int
    n_outliers: int
    worst_mse: float  # per cent; NaN where nothing was fitted
    worst_setting: str
    grade: str  # the worst one
    date: str  # of its latest test; empty where none is known
    error: str  # the first failure


class Survey(NamedTuple):
    """What a fleet's table tells.

    `rows` are the fitted ones: damper, place of its setting among `settings`, day since 1970 (NaN:
    not known). `values` are those of all series, by series, setting and damper, with their standard
    `error` and what all dampers have there: `n_dampers`, `median`, `low` and `high` of the middle
    90 %, `quarter` and `three_quarters`, `distance` from the median. `outliers` are rows of it, the
    farthest first.
    """

    dampers: tuple[DamperLine, ...]  # every one, by serial number
    settings: tuple[Setting, ...]
    series: tuple[Series, ...]
    rows: pd.DataFrame
    values: pd.DataFrame
    outliers: pd.DataFrame


def survey(table: pa.Table) -> Survey:
    """Return what the collected table of a fleet tells."""
    names = ("damper", SERIAL, "date", "setting", "grade", "error", "error_kind")
    frame: Any = pd.DataFrame({name: _texts(table, name) for name in names}, dtype=object)
    # A part of logs of several dampers says whose each row is.
    frame["damper"] = frame["damper"].where(frame["damper"] != "", frame[SERIAL])
    frame["mse"] = _numbers(table, "mse_percent")
    fitted = frame[frame["error_kind"] == ""]
    known = {text: _setting(text) for text in fitted["setting"].unique()}
    settings = sorted(set(known.values()))
    places = {text: settings.index(setting) for text, setting in known.items()}
    rows: Any = pd.DataFrame(
        {
            "damper": fitted["damper"],
            "setting": fitted["setting"].map(places).astype(int),
            "day": fitted["date"].map(_day).astype(float),
        }
    ).sort_values("setting", kind="stable")
    series, columns = [], []
    for name in table.column_names:
        match = _FORCE.fullmatch(name)
        if not match and f"{name}_se" not in table.column_names:
            continue
        values = _numbers(table, name)[rows.index]
        is_known = np.isfinite(values)
        error = f"{name.removesuffix('_N')}_se_N" if match else f"{name}_se"
        errors = _numbers(table, error)[rows.index]
        # A parameter that was fitted nowhere and is the same everywhere: nothing to see.
        is_held = is_known.sum() > 1 and not np.ptp(values[is_known])
        is_held = is_held and not np.isfinite(errors).any() and not match
        if is_held or not is_known.any():
            continue
        known_rows = rows[is_known].assign(value=values[is_known], error=errors[is_known])
        columns.append(known_rows.assign(series=name))
        if match:
            speed, stroke = float(match[2]) / 1000.0, match[1]
            label = f"force in {stroke} at {speed:g} m/s"
            series.append(Series(name, label, "N", speed, stroke))
        else:
            metadata = table.schema.field(name).metadata or {}
            # Older parts, of the paper's model, do not tell what people call a quantity.
            of_paper = {one.name: one.symbol for one in PAPER_QUANTITIES}
            symbol = metadata.get(SYMBOL, of_paper.get(name, name).encode())
            series.append(Series(name, symbol.decode(), metadata.get(b"unit", b"").decode()))
    values = _with_bands(
        pd.concat(columns, ignore_index=True)
        if columns
        else rows.iloc[:0].assign(series="", value=0.0, error=0.0)
    )
    is_far = (values["n_dampers"] >= LEAST_DAMPERS) & (values["distance"].abs() > FAR_OFF)
    outliers = values[is_far].sort_values("distance", key=lambda x: -x.abs(), kind="stable")
    dampers = _lines(frame, Counter(outliers["damper"]))
    return Survey(tuple(dampers), tuple(settings), tuple(series), rows, values, outliers)


def _with_bands(values: Any) -> Any:
    """Return values with median, bands and distance at each series and setting."""
    keys = [values["series"], values["setting"]]
    groups = values.groupby(keys, sort=False)
    values = values.assign(
        n_dampers=groups["damper"].transform("nunique"),
        median=groups["value"].transform("median"),
        **{name: groups["value"].transform("quantile", share) for name, share in _SHARES.items()},
    )
    beside = values["value"] - values["median"]
    deviation = beside.abs().groupby(keys, sort=False).transform("median")
    deviation = np.maximum(deviation, LEAST_SPREAD * values["median"].abs())
    return values.assign(distance=beside.div(deviation).where(deviation > 0.0, 0.0))


def _lines(frame: Any, n_outliers: Counter[str]) -> list[DamperLine]:
    rows: dict[str, list[Any]] = {}
    for (
        row
    ) in frame.itertuples():  # by hand: what pandas does with each of 10 000 groups takes 10 s
        rows.setdefault(row.damper, []).append(row)
    lines = []
    for damper, own in rows.items():
        failed, fitted = ([row for row in own if bool(row.error_kind) is k] for k in (True, False))
        judged = [row for row in fitted if math.isfinite(row.mse)]
        worst = max(judged, key=lambda row: float(row.mse), default=None)
        lines.append(
            DamperLine(
                damper,
                len({row.setting for row in fitted}),
                len(failed),
                n_outliers[damper],
                math.nan if worst is None else float(worst.mse),
                "" if worst is None else worst.setting,
                max(
                    (row.grade for row in fitted if row.grade in _GRADES),
                    key=_GRADES.index,
                    default="",
                ),
                max((row.date for row in fitted), default=""),
                failed[0].error if failed else "",
            )
        )
    return lines


def _texts(table: pa.Table, column: str) -> list[str]:
    if column not in table.column_names:
        return [""] * table.num_rows
    return [str(one or "") for one in table[column].to_pylist()]


def _numbers(table: pa.Table, column: str) -> FloatArray:
    if column not in table.column_names:
        return np.full(table.num_rows, np.nan)
    return np.asarray(table[column].to_numpy(), dtype=np.float64)


def _setting(text: str) -> Setting:
    """Return the setting that a part's text names."""
    try:
        return Setting.of(parse_place(text))
    except ValueError:
        return Setting.of(text)


def _day(text: str) -> float:
    """Return a date as days since 1970; NaN where it is none."""
    try:
        return float((date.fromisoformat(text[:10]) - date(1970, 1, 1)).days)
    except ValueError:
        return math.nan


# The forces of a fleet held against bands: around the median of the fleet, or nominal ones.

_NEAR = 1e-9  # m/s


class HeldFleet(NamedTuple):
    """A fleet held against a tolerance."""

    source: str  # the tolerance, as it was given
    n_points: int
    n_dampers: int
    # Forces outside, and those that could not be looked at; these first, then the farthest.
    missed: tuple[Point, ...]
    forces: pd.DataFrame  # rows of the survey's values with their band, `least` to `most`

    @property
    def worst(self) -> tuple[Point, ...]:
        """The first of `missed` of each damper that has one."""
        first = {point.run: point for point in reversed(self.missed)}
        return tuple(point for point in self.missed if first[point.run] is point)

    @property
    def sentence(self) -> str:
        """The result in a sentence."""
        if not self.missed:
            return (
                f"All {self.n_dampers} dampers are within the tolerance, at {self.n_points} points."
            )
        unseen = sum(math.isnan(point.margin) for point in self.missed)
        beside = f", {unseen} of them not evaluated" if unseen else ""
        or_not = " or not evaluated" if unseen else ""
        return (
            f"{len(self.worst)} of {self.n_dampers} dampers are outside the tolerance{or_not}, at "
            f"{len(self.missed)} of {self.n_points} points{beside}."
        )


def fleet_against_bands(  # noqa: C901 - two kinds of bands, one list
    found: Survey, tolerance: Tolerance
) -> HeldFleet:
    """Return the forces of a fleet that do not keep a tolerance.

    Per cent and newtons are around the median force of the setting over the fleet, and a damper
    without any force misses them; a table of nominal forces holds for every damper, and what a
    damper lacks of it is missed. A ConfigurationError: a nominal force is at a speed that a fleet's
    table does not have.
    """
    forces = [one for one in found.series if one.stroke]
    everyone = [one.damper for one in found.dampers]
    by_series: dict[Any, Any] = dict(tuple(found.values.groupby("series")))
    n_points, missed = 0, []
    kept = [found.values.iloc[:0].assign(least=0.0, most=0.0)]

    def hold(one: Series, rows: Any, low: Any, high: Any) -> None:
        nonlocal n_points
        n_points += len(rows)
        rows = rows.assign(least=low, most=high)
        kept.append(rows)
        for row in rows[(rows["value"] < low) | (rows["value"] > high)].itertuples():
            place = (row.damper, found.settings[row.setting], one.speed, one.stroke)
            missed.append(Point(*place, row.value, row.least, row.most))

    def lose(reason: str, damper: str, setting: Setting | str = "", *band: Any) -> None:
        nonlocal n_points
        n_points += 1
        speed, stroke, low, high = band or (math.nan, "", math.nan, math.nan)
        missed.append(Point(damper, setting, speed, stroke, math.nan, low, high, reason=reason))

    if not tolerance.bands:
        having = {damper for one in forces for damper in by_series[one.name]["damper"]}
        for damper in everyone:
            if damper not in having:
                lose("it has no force at any named speed", damper)
        for one in forces:
            rows = by_series[one.name]
            reach = np.maximum(tolerance.share * rows["median"].abs(), tolerance.newtons)
            hold(one, rows, rows["median"] - reach, rows["median"] + reach)
    speeds = sorted({*NAMED_SPEEDS, *(one.speed for one in forces)})
    for band in tolerance.bands:
        if not any(abs(speed - band.speed) <= _NEAR for speed in speeds):
            raise ConfigurationError(
                f"a fleet has no forces at {band.speed:g} m/s; expected its named speeds, "
                f"{', '.join(f'{speed:g}' for speed in speeds)} m/s",
                where=Option("tolerance", tolerance.source),
                code="no-speed",
            )
        places = [k for k, one in enumerate(found.settings) if band.setting in {"", str(one)}]
        fitted = found.rows[found.rows["setting"].isin(places)]
        reached: set[tuple[int, str]] = set()
        for one in forces:
            if one.stroke == band.stroke and abs(one.speed - band.speed) <= _NEAR:
                rows = by_series[one.name]
                rows = rows[rows["setting"].isin(places)]
                hold(one, rows, band.low, band.high)
                reached |= set(zip(rows["setting"], rows["damper"], strict=True))
        ends = (band.speed, band.stroke, band.low, band.high)
        tested = set(zip(fitted["setting"], fitted["damper"], strict=True))
        for k, damper in sorted(tested - reached):
            lose("the test does not reach the speed", damper, found.settings[k], *ends)
        why = "the setting was not tested" if band.setting else "nothing was fitted"
        having = {damper for _, damper in tested}
        for damper in everyone:
            if damper not in having:
                lose(why, damper, band.setting, *ends)
    missed.sort(key=lambda one: (not math.isnan(one.margin), one.margin))
    in_bands = pd.concat(kept[1:] or kept)
    return HeldFleet(tolerance.source, n_points, len(everyone), tuple(missed), in_bands)
