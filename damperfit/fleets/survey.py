"""A table of many dampers evaluated: medians and bands by setting, dampers far off, shifts by date.

A series is one parameter, or the force at one named speed and stroke. Distances are from the median
of a setting in median absolute deviations, so that dampers far off do not hide each other.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from datetime import date, timedelta
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from damperfit.adjustment.force_at import STROKE_WORDS
from damperfit.comparison.tolerance import Point, Tolerance
from damperfit.errors import ConfigurationError
from damperfit.fleets.parts import SERIAL, SYMBOL
from damperfit.problem import Option
from damperfit.reporting.sheet import Column, Sheet, laid_out, number, with_interval
from damperfit.simulation import NAMED_SPEEDS
from damperfit.statistics import NORMAL_95, chi_squared_quantile, median
from damperfit.tables.columns import PAPER_QUANTITIES
from damperfit.tested.setting import Setting, parse_place

if TYPE_CHECKING:
    import pyarrow as pa

LEAST_DAMPERS = 8  # in a setting, before one of them is called far off
FAR_OFF = 8.0  # median absolute deviations: 5.4 standard deviations of a normal distribution
# No rig repeats within a smaller share of the median.
LEAST_SPREAD = 1e-3
_FORCE = re.compile(r"force_(rebound|bump)_([\d.]+)_mm_per_s_N")
_SHARES = {"low": 0.05, "quarter": 0.25, "three_quarters": 0.75, "high": 0.95}
_GRADES = ("excellent", "good", "poor", "withheld")  # the last is the worst


Rows = Sequence[dict[str, Any]]


class Series(NamedTuple):
    """One parameter, or the force at one speed and stroke, of all dampers."""

    name: str  # of its column
    label: str
    unit: str
    speed: float = 0.0  # m/s, of a force
    stroke: str = ""  # rebound or bump; empty of a parameter


class Survey(NamedTuple):
    """What follows from a fleet's table.

    `dampers` are rows of damper (its serial; empty: not known), n_settings with a fit, n_failures,
    n_outliers, worst_mse (per cent; NaN: no fit), worst_setting, the worst grade, the date of the
    latest test, and the first error. `rows` are the fitted settings: damper, place of its setting
    among `settings`, day since 1970 (NaN: not known). `values` are those of all series, by series,
    setting and damper, with their standard `error` and what all dampers have there: `n_dampers`,
    `median`, `low` and `high` of the middle 90 %, `quarter` and `three_quarters`, `distance` from
    the median. `outliers` are rows of it, the farthest first. `shifts` says in sentences what has
    changed over the dates, `rules` what each force says of it, `check` compares the fleet with a
    tolerance with the `capability` of each force.
    """

    dampers: tuple[Any, ...]  # every one, by serial number
    settings: tuple[Setting, ...]
    series: tuple[Series, ...]
    rows: pd.DataFrame
    values: pd.DataFrame
    outliers: pd.DataFrame
    shifts: Sequence[str] = ()
    rules: Rows = ()
    check: ToleranceCheck | None = None
    capability: Rows = ()


def survey(table: pa.Table, tolerance: Tolerance | None = None) -> Survey:
    """Return the evaluation of a fleet's collected table."""
    names = ("damper", SERIAL, "date", "setting", "grade", "error", "error_kind")
    columns: Any = table.to_pandas()
    frame = columns.reindex(columns=names).astype(object).fillna("").astype(str)
    # A part with several dampers has the damper of each row.
    frame["damper"] = frame["damper"].where(frame["damper"] != "", frame[SERIAL])
    frame["mse"] = columns.reindex(columns=["mse_percent"]).astype(float)
    fitted = frame[frame["error_kind"] == ""]
    settings_of = {text: _setting(text) for text in fitted["setting"].unique()}
    settings = sorted(set(settings_of.values()))
    places = {text: settings.index(setting) for text, setting in settings_of.items()}
    rows: Any = pd.DataFrame(
        {
            "damper": fitted["damper"],
            "setting": fitted["setting"].map(places).astype(int),
            "day": fitted["date"].map(_day).astype(float),
        }
    ).sort_values("setting", kind="stable")
    series, blocks = [], []
    of_paper = {quantity.name: quantity.symbol for quantity in PAPER_QUANTITIES}
    for name in table.column_names:
        match = _FORCE.fullmatch(name)
        error = f"{name.removesuffix('_N')}_se_N" if match else f"{name}_se"
        if not match and error not in table.column_names:
            continue
        pair = columns.reindex(columns=[name, error]).loc[rows.index]
        values, errors = pair.to_numpy(dtype=float, na_value=np.nan).T
        is_known = np.isfinite(values)
        # A parameter that is fixed at one value everywhere is not shown.
        is_fixed = is_known.sum() > 1 and not np.ptp(values[is_known])
        is_fixed = is_fixed and not np.isfinite(errors).any() and not match
        if is_fixed or not is_known.any():
            continue
        blocks.append(rows.assign(series=name, value=values, error=errors)[is_known])
        if match:
            speed, stroke = float(match[2]) / 1000.0, match[1]
            label = f"force in {STROKE_WORDS[stroke]} at {speed:g} m/s"
            series.append(Series(name, label, "N", speed, stroke))
        else:
            metadata = table.schema.field(name).metadata or {}
            # Older parts, of the paper's model, have no symbols.
            symbol = metadata.get(SYMBOL, of_paper.get(name, name).encode())
            unit = metadata.get(b"unit", b"").decode()
            series.append(Series(name, symbol.decode(), "" if unit == "1" else unit))
    nothing = rows.iloc[:0].assign(series="", value=0.0, error=0.0)
    values = _with_bands(pd.concat(blocks or [nothing], ignore_index=True))
    is_far = (values["n_dampers"] >= LEAST_DAMPERS) & (values["distance"].abs() > FAR_OFF)
    outliers = values[is_far].sort_values("distance", key=lambda x: -x.abs(), kind="stable")
    dampers = _dampers(frame, outliers)
    fleet = Survey(dampers, tuple(settings), tuple(series), rows, values, outliers)
    shifts, rules = run_rules(fleet)
    fleet = fleet._replace(shifts=shifts, rules=rules)
    if tolerance is None:
        return fleet
    check = fleet_against_bands(fleet, tolerance)
    return fleet._replace(check=check, capability=capability(fleet, check))


def _with_bands(values: Any) -> Any:
    """Return values with median, bands and distance at each series and setting."""
    keys = [values["series"], values["setting"]]
    groups = values.groupby(keys, sort=False)
    values = values.assign(
        n_dampers=groups["damper"].transform("nunique"),
        median=groups["value"].transform("median"),
        **{name: groups["value"].transform("quantile", share) for name, share in _SHARES.items()},
    )
    difference = values["value"] - values["median"]
    deviation = difference.abs().groupby(keys, sort=False).transform("median")
    deviation = np.maximum(deviation, LEAST_SPREAD * values["median"].abs())
    return values.assign(distance=difference.div(deviation).where(deviation > 0.0, 0.0))


def _dampers(frame: Any, outliers: Any) -> tuple[Any, ...]:
    """Every damper in a row; by whole columns, as Python in each of 10 000 groups takes 10 s."""
    is_failed = frame["error_kind"] != ""
    failed, fitted = frame[is_failed], frame[~is_failed]
    with_mse = fitted[np.isfinite(fitted["mse"])].sort_values("mse", ascending=False, kind="stable")
    worst = with_mse.drop_duplicates("damper").set_index("damper")
    grades = fitted["grade"].map({grade: k for k, grade in enumerate(_GRADES)}).astype(float)
    counts = {
        "n_settings": fitted.groupby("damper")["setting"].nunique(),
        "n_failures": failed["damper"].value_counts(),
        "n_outliers": outliers["damper"].value_counts(),
    }
    texts = {
        "worst_setting": worst["setting"],
        "grade": grades.groupby(fitted["damper"]).max().map(dict(enumerate(_GRADES))),
        "date": fitted.groupby("damper")["date"].max(),
        "error": failed.drop_duplicates("damper").set_index("damper")["error"],
    }
    names = frame["damper"].unique()
    columns = {"damper": names}
    columns |= {name: column.reindex(names, fill_value=0) for name, column in counts.items()}
    columns |= {"worst_mse": worst["mse"].reindex(names)}
    columns |= {name: column.reindex(names).fillna("") for name, column in texts.items()}
    rows: Any = pd.DataFrame(columns, index=names)
    return tuple(rows.itertuples(index=False, name="DamperLine"))


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


# The forces of a fleet compared with bands around the median of the fleet, or nominal ones.

_NEAR = 1e-9  # m/s


class ToleranceCheck(NamedTuple):
    """The forces of a fleet compared with a tolerance."""

    source: str  # the tolerance, as it was given
    n_points: int
    n_dampers: int
    # Forces outside, and those that could not be evaluated; these first, then the farthest.
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
        or_not, of_them = " or not evaluated", f", {unseen} of them not evaluated"
        return (
            f"{len(self.worst)} of {self.n_dampers} dampers are outside the tolerance"
            f"{or_not * bool(unseen)}, at {len(self.missed)} of {self.n_points} points"
            f"{of_them * bool(unseen)}."
        )


def fleet_against_bands(fleet: Survey, tolerance: Tolerance) -> ToleranceCheck:
    """Compare the forces of a fleet with a tolerance.

    Per cent and newtons are around the median force of the setting over the fleet, and a damper
    without any force misses them. A table of nominal forces holds for every damper: a force that a
    damper lacks is missed. A ConfigurationError: a nominal force is at a speed that the fleet's
    table does not have.
    """
    forces = {series.name: series for series in fleet.series if series.stroke}
    dampers = [damper.damper for damper in fleet.dampers]
    values = fleet.values[fleet.values["series"].isin(forces)]
    blocks: list[Any] = [values.iloc[:0].assign(least=0.0, most=0.0)]  # forces with their bands
    missing: list[Point] = []
    if not tolerance.bands:
        having = set(values["damper"])
        text = "it has no force at any named speed"
        missing += [Point(damper, "", reason=text) for damper in dampers if damper not in having]
        reach = np.maximum(tolerance.share * values["median"].abs(), tolerance.newtons)
        least, most = values["median"] - reach, values["median"] + reach
        blocks.append(values.assign(least=least, most=most))
    speeds = sorted({*NAMED_SPEEDS, *(force.speed for force in forces.values())})
    for band in tolerance.bands:
        if not any(abs(speed - band.speed) <= _NEAR for speed in speeds):
            raise ConfigurationError(
                f"a fleet has no forces at {band.speed:g} m/s; expected its named speeds, "
                f"{', '.join(f'{speed:g}' for speed in speeds)} m/s",
                where=Option("tolerance", tolerance.source),
                code="no-speed",
            )
        places = [
            k for k, setting in enumerate(fleet.settings) if band.setting in {"", str(setting)}
        ]
        names = [
            name
            for name, force in forces.items()
            if force.stroke == band.stroke and abs(force.speed - band.speed) <= _NEAR
        ]
        at_speed = values[values["series"].isin(names) & values["setting"].isin(places)]
        blocks.append(at_speed.assign(least=band.low, most=band.high))
        fitted = fleet.rows[fleet.rows["setting"].isin(places)]
        tested, reached = (
            set(zip(rows["setting"], rows["damper"], strict=True)) for rows in (fitted, at_speed)
        )
        cells = (band.speed, band.stroke, math.nan, band.low, band.high, math.nan)
        text = "the test does not reach the speed"
        missing += [
            Point(damper, fleet.settings[k], *cells, text) for k, damper in sorted(tested - reached)
        ]
        text = "the setting was not tested" if band.setting else "nothing was fitted"
        having = {damper for _, damper in tested}
        missing += [
            Point(damper, band.setting, *cells, text) for damper in dampers if damper not in having
        ]
    table = pd.concat(blocks)
    outside: Any = table[(table["value"] < table["least"]) | (table["value"] > table["most"])]
    missed = []
    for row in outside.itertuples():
        of = (row.damper, fleet.settings[row.setting])
        force = forces[row.series]
        missed.append(Point(*of, force.speed, force.stroke, row.value, row.least, row.most))
    return ToleranceCheck(
        tolerance.source,
        len(missing) + len(table),
        len(dampers),
        (*missing, *sorted(missed, key=lambda point: point.margin)),
        table,
    )


# Statistical process control: Cp and Cpk of each force, and rules over the dates

LEAST_OF_CP = 10  # dampers: with fewer the interval of Cp is wider than 0.55 to 1.45 of it
DOMINATES = "measurement dominates"
CAPABILITY_COLUMNS = (
    *("setting", "speed_m_per_s", "stroke", "n_dampers", "mean_N", "low_N", "high_N", "s_N"),
    *("measurement_s_N", "cp", "cp_ci_low", "cp_ci_high", "cpk", "cpk_ci_low", "cpk_ci_high"),
    "note",
)
RULE_COLUMNS = (
    *("shift", "setting", "speed_m_per_s", "stroke", "side", "first_damper", "first_date"),
    *("last_damper", "last_date", "rules"),
)
# Of so many dampers in a row so many lie more than so many sigmas off, on one side.
_RULES = {"1": (1, 1, 3.0), "2": (2, 3, 2.0), "3": (4, 5, 1.0), "4": (8, 8, 0.0)}
_MOVING_RANGE = math.sqrt(2.0) * 0.67449  # median of |a - b| of two normal values of sigma 1


def capability(fleet: Survey, check: ToleranceCheck) -> Rows:
    """Return Cp and Cpk of each force that a tolerance covers, the smallest Cpk first.

    s^2 is the variance S^2 of n dampers less the mean square v of their forces' standard errors.
    The interval of Cp is that of S^2 by chi-square of n - 1, less v (no upper end where nothing is
    left). That of Cpk is the normal approximation of Bissell (1990), "How reliable is your
    capability index?", Applied Statistics 39, 331-340, whose variance 1/(9 n) + Cpk^2/(2 (n - 1))
    takes the factors S^2/s^2 and S^4/s^4 here, as S^2 is what scatters. v counts as known.
    """
    series = {force.name: force for force in fleet.series}
    rows = []
    groups: Any = check.forces.groupby(["series", "setting", "least", "most"])
    for (name, setting, low, high), group in groups:
        # A damper that was tested several times is the mean of its tests.
        tests = group.assign(square=group["error"] ** 2).groupby("damper")
        dampers = tests[["value", "square"]].mean()
        n, noise = len(dampers), float((dampers["square"] / tests.size()).mean())
        if n < LEAST_OF_CP or math.isnan(noise):
            continue
        mean, total = float(dampers["value"].mean()), float(dampers["value"].var())
        s, indices, note = math.sqrt(max(total - noise, 0.0)), (None,) * 6, DOMINATES
        if s > 0.0:
            limits = []
            for share in (0.025, 0.975):
                spread = total * (n - 1) / chi_squared_quantile(n - 1, share) - noise
                limits.append((high - low) / (6.0 * math.sqrt(spread)) if spread > 0.0 else None)
            cpk, ratio = min(high - mean, mean - low) / (3.0 * s), total / s**2
            reach = NORMAL_95 * math.sqrt(ratio / (9 * n) + (cpk * ratio) ** 2 / (2 * (n - 1)))
            indices = ((high - low) / (6.0 * s), *limits, cpk, cpk - reach, cpk + reach)
            note = ""
        place = (str(fleet.settings[setting]), series[name].speed, series[name].stroke)
        cells = (*place, n, mean, low, high, s, math.sqrt(noise), *indices, note)
        rows.append(dict(zip(CAPABILITY_COLUMNS, cells, strict=True)))
    return sorted(rows, key=lambda row: math.inf if row["cpk"] is None else row["cpk"])


def capability_sheet(rows: Rows, most: int) -> Sheet:
    """Return Cp and Cpk by force, so many at most."""

    def index(name: str, row: dict[str, Any]) -> str:
        low, high = row[f"{name}_ci_low"], row[f"{name}_ci_high"]
        if row[name] is not None and high is None:
            return f"{row[name]:.2f} (above {low:.2f})"
        return with_interval(row[name], low, high, digits=3)

    columns = [
        Column("set", "", lambda row: row["setting"]),
        Column("speed", "m/s", lambda row: number(row["speed_m_per_s"])),
        Column("stroke", "", lambda row: STROKE_WORDS[row["stroke"]], is_number=False),
        Column("dampers", "", lambda row: str(row["n_dampers"])),
        *(Column.of(name, "N", f"{name}_N") for name in ("mean", "low", "high")),
        Column.of("s", "N", "s_N", digits=3),
        Column.of("measurement", "N", "measurement_s_N", digits=3),
        Column("Cp", "", partial(index, "cp")),
        Column("Cpk", "", partial(index, "cpk")),
        Column.text("", "note"),
    ]
    note = (
        "s: standard deviation of the dampers, that of the measurement taken out. ± and ranges are "
        "95 % intervals. All forces are in fleet_capability.csv."
    )
    return laid_out(rows[:most], columns, note)


class _Event(NamedTuple):
    """Dampers in a row, by place among all tests, at which one force breaks rules on one side."""

    series: str
    setting: int
    side: str
    first: int
    last: int
    rules: str
    size: float  # sigmas, of the farthest


def run_rules(fleet: Survey) -> tuple[list[str], Rows]:
    """Return a sentence for each shift over the dates of the tests, and the rules that it breaks.

    The four zone rules of the Western Electric Statistical Quality Control Handbook (1956), by date
    and then serial number, around the median; sigma is the median moving range over 0.954, so that
    neither a shift nor one damper widens it. A steady force breaks one of them once in 92 tests
    (Champ and Woodall 1987, Technometrics 29, 393-399), with median and sigma of 20 dampers once in
    62. Events at the dampers of the longest one, or next to them, are one shift with it; the shift
    of the most forces comes first.
    """
    forces_of = {series.name: series for series in fleet.series if series.stroke}
    names = [damper.damper for damper in fleet.dampers]
    rank = {name: k for k, name in enumerate(names)}
    values: Any = fleet.values.dropna(subset=["day"])
    values = values[values["series"].isin(forces_of)]
    values = values.assign(test=list(zip(values["day"], values["damper"].map(rank), strict=True)))
    tests = sorted(set(values["test"]))
    places = {test: k for k, test in enumerate(tests)}
    events, n_forces = [], 0
    by_force: Any = values.groupby(["series", "setting"], sort=False)
    for (name, setting), group in by_force:
        forces = group.groupby("test")["value"].mean()
        if len(forces) < LEAST_OF_CP or group["day"].nunique() < 2:
            continue
        n_forces += 1
        middle, moves = median(forces), median(np.abs(np.diff(forces)))
        sigma = max(moves / _MOVING_RANGE, LEAST_SPREAD * abs(middle))
        z = (forces.to_numpy() - middle) / (sigma or math.inf)
        at = [places[test] for test in forces.index]
        for side, first, last, rules in _broken(z):
            size = float(np.abs(z[first : last + 1]).max())
            events.append(_Event(name, setting, side, at[first], at[last], rules, size))
    events.sort(key=lambda event: (event.first - event.last, -event.size))
    shifts = []
    while events:
        low, high = events[0].first - 1, events[0].last + 1
        shifts.append([event for event in events if event.first <= high and event.last >= low])
        events = [event for event in events if event.first > high or event.last < low]
    shifts.sort(key=lambda shift: -len({event[:2] for event in shift}))
    labels = [
        (names[k] or "unknown", str(date(1970, 1, 1) + timedelta(days=day))) for day, k in tests
    ]

    def text_of(event: _Event) -> str:
        until = " to {} ({})".format(*labels[event.last]) if event.last > event.first else ""
        span = "{} ({})".format(*labels[event.first]) + until
        return f"{event.side} its median at {span} by rule {event.rules}"

    sentences: list[str] = []
    rows: list[dict[str, Any]] = []
    for number_of, shift in enumerate(shifts, start=1):
        main = shift[0]
        runs = [event for event in shift if event[:2] == main[:2]]
        runs.sort(key=lambda event: event.first)
        sentences.append(
            f"The {forces_of[main.series].label} at setting {fleet.settings[main.setting]} is "
            f"{', '.join(map(text_of, runs))}; with it {len({event[:2] for event in shift})} of "
            f"{n_forces} forces are off."
        )
        for event in shift:
            force = forces_of[event.series]
            place = (str(fleet.settings[event.setting]), force.speed, force.stroke, event.side)
            cells = (number_of, *place, *labels[event.first], *labels[event.last], event.rules)
            rows.append(dict(zip(RULE_COLUMNS, cells, strict=True)))
    return sentences, rows


def _broken(z: NDArray[np.float64]) -> Iterator[tuple[str, int, int, str]]:
    """Yield side, first and last place, and rules, of each row of tests that breaks rules."""
    for side, sign in (("above", 1), ("below", -1)):
        spans: list[tuple[int, int, str]] = []
        for rule, (needed, window, zone) in _RULES.items():
            over = sign * z > zone
            counts = np.convolve(over, np.ones(window))[: len(z)]
            for end in np.flatnonzero(over & (counts > needed - 0.5)).tolist():
                begin = max(0, end - window + 1)
                spans.append((begin + int(np.argmax(over[begin : end + 1])), end, rule))
        merged: list[tuple[int, int, str]] = []
        for first, last, rule in sorted(spans):
            if merged and first <= merged[-1][1] + 1:
                begin, end, broken = merged.pop()
                merged.append((begin, max(end, last), broken + rule))
            else:
                merged.append((first, last, rule))
        for first, last, rules in merged:
            yield side, first, last, ", ".join(sorted(set(rules)))
