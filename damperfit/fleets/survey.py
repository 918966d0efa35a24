"""What a table of many dampers tells: medians and bands by setting, who is far off, change by date.

A series is one parameter, or the force at one named speed and stroke. Distances are from the median
of a setting in median absolute deviations, so that those who are off do not hide each other.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from dataclasses import dataclass
from datetime import date
from typing import TYPE_CHECKING

import numpy as np

from damperfit.comparison import Point
from damperfit.errors import ConfigurationError
from damperfit.fleets.parts import SERIAL, SYMBOL
from damperfit.problem import Option
from damperfit.simulation.characteristics import NAMED_SPEEDS
from damperfit.tables.columns import PAPER_QUANTITIES
from damperfit.tested.setting import Setting, parse_place

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import pyarrow as pa
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    from damperfit.comparison import Tolerance

LEAST_DAMPERS = 8  # in a setting, before one of them is called far off
FAR_OFF = 8.0  # median absolute deviations: 5.4 standard deviations of a normal distribution
# No rig repeats better than this share of the median: closer than that, all are alike.
LEAST_SPREAD = 1e-3
_FORCE = re.compile(r"force_(rebound|bump)_([\d.]+)_mm_per_s_N")
_EDGES = (5.0, 95.0)  # per cent
_GRADES = ("excellent", "good", "poor", "withheld")  # the last is the worst


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """One series at one setting.

    Attributes
    ----------
    setting : Setting
        Which.
    rows : numpy.ndarray
        Which of the fitted rows have a value here.
    n_dampers : int
        How many dampers those are of.
    median, low, high : float
        Median and the band of the middle 90 %.
    deviation : float
        Median absolute deviation, at least `LEAST_SPREAD` of the median.
    """

    setting: Setting
    rows: NDArray[np.intp]
    n_dampers: int
    median: float
    low: float
    high: float
    deviation: float


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """One parameter, or the force at one speed and stroke, of all dampers.

    Attributes
    ----------
    name : str
        Its column.
    label, unit : str
        For people.
    values : numpy.ndarray
        By fitted row; NaN where there is none.
    bands : tuple of Spread
        By setting.
    speed : float
        m/s, of a force; 0 of a parameter.
    stroke : str
        "rebound" or "bump"; empty of a parameter.
    """

    name: str
    label: str
    unit: str
    values: FloatArray
    bands: tuple[Spread, ...]
    speed: float = 0.0
    stroke: str = ""


@dataclass(frozen=True, slots=True)
class FarOff:
    """A damper far from the others in one series at one setting.

    Attributes
    ----------
    damper : str
        Its serial.
    series : str
        Column of the series.
    setting : Setting
        Where.
    value, median, low, high : float
        Its value; median and band of all.
    distance : float
        From the median in median absolute deviations, signed.
    """

    damper: str
    series: str
    setting: Setting
    value: float
    median: float
    low: float
    high: float
    distance: float


@dataclass(frozen=True, slots=True)
class DamperLine:
    """One damper in a line.

    Attributes
    ----------
    damper : str
        Its serial; empty where none is known.
    n_settings, n_failures, n_outliers : int
        Settings with a fit, failures, values far off.
    worst_mse : float
        Per cent; NaN where nothing was fitted.
    worst_setting : str
        Where that is.
    grade : str
        The worst one.
    date : str
        Of its latest test; empty where none is known.
    error : str
        The first failure.
    """

    damper: str
    n_settings: int
    n_failures: int
    n_outliers: int
    worst_mse: float
    worst_setting: str
    grade: str
    date: str
    error: str


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """What a fleet's table tells.

    Attributes
    ----------
    dampers : tuple of DamperLine
        Every one, by serial number.
    names : numpy.ndarray
        Damper of each fitted row.
    settings : tuple of Setting
        Of each fitted row.
    days : numpy.ndarray
        Date of each fitted row in days since 1970; NaN where it is not known.
    series : tuple of Series
        Parameters, then forces.
    outliers : tuple of FarOff
        The farthest first.
    """

    dampers: tuple[DamperLine, ...]
    names: NDArray[np.object_]
    settings: tuple[Setting, ...]
    days: FloatArray
    series: tuple[Series, ...]
    outliers: tuple[FarOff, ...]


def survey(table: pa.Table) -> Survey:
    """Return what the collected table of a fleet tells.

    Parameters
    ----------
    table : pyarrow.Table
        From `damperfit.fleets.parts.collect`.
    """
    texts = {
        name: _texts(table, name)
        for name in (SERIAL, "damper", "date", "setting", "grade", "error", "error_kind")
    }
    # A part of logs of several dampers says whose each row is.
    owners = np.array(
        [own or serial for own, serial in zip(texts["damper"], texts[SERIAL], strict=True)],
        dtype=object,
    )
    is_fit = np.array([not kind for kind in texts["error_kind"]], dtype=bool)
    rows = np.flatnonzero(is_fit)
    names = owners[rows]
    known = {text: _setting(text) for text in dict.fromkeys(texts["setting"])}
    settings = tuple(known[texts["setting"][k]] for k in rows)
    by_setting: dict[Setting, list[int]] = {}
    for k, one in enumerate(settings):
        by_setting.setdefault(one, []).append(k)
    places = {one: np.array(by_setting[one], dtype=np.intp) for one in sorted(by_setting)}
    series = tuple(_series(table, rows, names, places))
    outliers = sorted(
        (one for line in series for one in _outliers(line, names)),
        key=lambda one: -abs(one.distance),
    )
    days = np.array([_day(texts["date"][k]) for k in rows], dtype=np.float64)
    lines = tuple(_lines(owners, texts, is_fit, _numbers(table, "mse_percent"), outliers))
    return Survey(lines, names, settings, days, series, tuple(outliers))


def spreads_of(
    values: FloatArray, names: NDArray[np.object_], places: dict[Setting, NDArray[np.intp]]
) -> Iterator[Spread]:
    """Yield the band of a series at each setting that has values of it.

    Parameters
    ----------
    values : numpy.ndarray
        By row; NaN where there is none.
    names : numpy.ndarray
        Whose each is.
    places : mapping of Setting to numpy.ndarray
        Rows of each setting.
    """
    for setting, rows in places.items():
        mine = rows[np.isfinite(values[rows])]
        if not len(mine):
            continue
        median = float(np.median(values[mine]))
        low, high = (float(x) for x in np.percentile(values[mine], _EDGES))
        deviation = float(np.median(np.abs(values[mine] - median)))
        yield Spread(
            setting,
            mine,
            len(set(names[mine])),
            median,
            low,
            high,
            max(deviation, LEAST_SPREAD * abs(median)),
        )


def _series(
    table: pa.Table,
    rows: NDArray[np.intp],
    names: NDArray[np.object_],
    places: dict[Setting, NDArray[np.intp]],
) -> Iterator[Series]:
    for column in table.column_names:
        found = _FORCE.fullmatch(column)
        if not found and f"{column}_se" not in table.column_names:
            continue
        values = _numbers(table, column)[rows]
        if not found and _is_held(values, _numbers(table, f"{column}_se")[rows]):
            continue
        bands = tuple(spreads_of(values, names, places))
        if not bands:
            continue
        if found:
            speed, stroke = float(found[2]) / 1000.0, found[1]
            yield Series(
                column, f"force in {stroke} at {speed:g} m/s", "N", values, bands, speed, stroke
            )
        else:
            metadata = table.schema.field(column).metadata or {}
            unit = metadata.get(b"unit", b"").decode()
            yield Series(column, _symbol(column, metadata), unit, values, bands)


def _symbol(column: str, metadata: Mapping[bytes, bytes]) -> str:
    """Return what people call a quantity; older parts, of the paper's model, do not tell it."""
    if SYMBOL in metadata:
        return metadata[SYMBOL].decode()
    return next((one.symbol for one in PAPER_QUANTITIES if one.name == column), column)


def _is_held(values: FloatArray, errors: FloatArray) -> bool:
    """Whether a parameter was fitted nowhere and is the same everywhere: nothing to see."""
    known = values[np.isfinite(values)]
    return not np.isfinite(errors).any() and len(known) > 1 and bool(np.all(known == known[0]))


def _outliers(series: Series, names: NDArray[np.object_]) -> Iterator[FarOff]:
    for band in series.bands:
        if band.n_dampers < LEAST_DAMPERS or not band.deviation:
            continue
        distances = (series.values[band.rows] - band.median) / band.deviation
        for k in np.flatnonzero(np.abs(distances) > FAR_OFF):
            row = band.rows[k]
            yield FarOff(
                str(names[row]),
                series.name,
                band.setting,
                float(series.values[row]),
                band.median,
                band.low,
                band.high,
                float(distances[k]),
            )


def _lines(
    owners: NDArray[np.object_],
    texts: dict[str, list[str]],
    is_fit: NDArray[np.bool_],
    errors: FloatArray,
    outliers: list[FarOff],
) -> Iterator[DamperLine]:
    rows_of: dict[str, list[int]] = {}
    for k, owner in enumerate(owners):
        rows_of.setdefault(owner, []).append(k)
    far = Counter(one.damper for one in outliers)
    for owner, rows in rows_of.items():
        fitted = [k for k in rows if is_fit[k]]
        failed = [k for k in rows if not is_fit[k]]
        known = [k for k in fitted if np.isfinite(errors[k])]
        worst = max(known, key=lambda k: errors[k]) if known else None
        grades = [texts["grade"][k] for k in fitted if texts["grade"][k] in _GRADES]
        yield DamperLine(
            owner,
            len({texts["setting"][k] for k in fitted}),
            len(failed),
            far[owner],
            math.nan if worst is None else float(errors[worst]),
            "" if worst is None else texts["setting"][worst],
            max(grades, key=_GRADES.index, default=""),
            max((texts["date"][k] for k in fitted), default=""),
            texts["error"][failed[0]] if failed else "",
        )


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
        return float("nan")


# The forces of a fleet held against bands: around the median of the fleet, or nominal ones.

_NEAR = 1e-9  # m/s


@dataclass(frozen=True, slots=True)
class HeldFleet:
    """A fleet held against a tolerance.

    Attributes
    ----------
    source : str
        The tolerance, as it was given.
    n_points, n_dampers : int
        Forces and dampers that were held against it.
    missed : tuple of Point
        Forces outside, and those that could not be looked at; these first, then the farthest.
    """

    source: str
    n_points: int
    n_dampers: int
    missed: tuple[Point, ...]

    @property
    def worst(self) -> tuple[Point, ...]:
        """The first of `missed` of each damper that has one."""
        found: dict[str, Point] = {}
        for point in self.missed:
            found.setdefault(point.run, point)
        return tuple(found.values())

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


def fleet_against_bands(found: Survey, tolerance: Tolerance) -> HeldFleet:
    """Return the forces of a fleet that do not keep a tolerance.

    Per cent and newtons are around the median force of the setting over the fleet, and a damper
    without any force misses them; a table of nominal forces holds for every damper, and what a
    damper lacks of it is missed.

    Parameters
    ----------
    found : Survey
        Of the fleet.
    tolerance : Tolerance
        The bands.

    Raises
    ------
    ConfigurationError
        A nominal force is at a speed that a fleet's table does not have.
    """
    forces = [one for one in found.series if one.stroke]
    everyone = tuple(one.damper for one in found.dampers)
    n_points, missed = 0, []
    pieces = (
        _nominal(found, forces, tolerance, everyone)
        if tolerance.bands
        else _around(found, forces, tolerance, everyone)
    )
    for number, points in pieces:
        n_points += number
        missed += points
    missed.sort(key=lambda one: (not math.isnan(one.margin), one.margin))
    return HeldFleet(tolerance.source, n_points, len(everyone), tuple(missed))


def _around(
    found: Survey, forces: list[Series], tolerance: Tolerance, everyone: tuple[str, ...]
) -> Iterator[tuple[int, list[Point]]]:
    having = {str(found.names[k]) for one in forces for band in one.bands for k in band.rows}
    nothing = (math.nan, "", math.nan, math.nan, math.nan)  # speed, stroke, force and band
    lost = [
        Point(name, "", *nothing, reason="it has no force at any named speed")
        for name in everyone
        if name not in having
    ]
    yield len(lost), lost
    for series in forces:
        for band in series.bands:
            reach = max(tolerance.share * abs(band.median), tolerance.newtons)
            yield _held(found, series, band, band.median - reach, band.median + reach)


def _held(
    found: Survey, series: Series, band: Spread, low: float, high: float
) -> tuple[int, list[Point]]:
    values = series.values[band.rows]
    outside = [
        Point(
            *(str(found.names[row]), band.setting, series.speed, series.stroke),
            *(float(series.values[row]), low, high),
        )
        for row in band.rows[(values < low) | (values > high)]
    ]
    return len(band.rows), outside


def _nominal(
    found: Survey, forces: list[Series], tolerance: Tolerance, everyone: tuple[str, ...]
) -> Iterator[tuple[int, list[Point]]]:
    fitted: dict[str, set[str]] = {}
    for name, setting in zip(found.names, found.settings, strict=True):
        fitted.setdefault(str(setting), set()).add(str(name))
    for wanted in tolerance.bands:
        speeds = sorted({*NAMED_SPEEDS, *(series.speed for series in forces)})
        if not any(abs(speed - wanted.speed) <= _NEAR for speed in speeds):
            raise ConfigurationError(
                f"a fleet has no forces at {wanted.speed:g} m/s; expected its named "
                f"speeds, {', '.join(f'{speed:g}' for speed in speeds)} m/s",
                where=Option("tolerance", tolerance.source),
            )
        places = {k: own for k, own in fitted.items() if wanted.setting in {"", k}}
        reached: set[tuple[str, str]] = set()
        for one in forces:
            if one.stroke != wanted.stroke or abs(one.speed - wanted.speed) > _NEAR:
                continue
            for band in one.bands:
                if str(band.setting) in places:
                    yield _held(found, one, band, wanted.low, wanted.high)
                    reached |= {(str(found.names[k]), str(band.setting)) for k in band.rows}
        unseen = [
            (name, setting, "the test does not reach the speed")
            for setting, names in places.items()
            for name in sorted(names)
            if (name, setting) not in reached
        ]
        having = {name for names in places.values() for name in names}
        why = "the setting was not tested" if wanted.setting else "nothing was fitted"
        unseen += [(name, wanted.setting, why) for name in everyone if name not in having]
        ends = (wanted.speed, wanted.stroke, math.nan, wanted.low, wanted.high)
        lost = [Point(name, setting, *ends, reason=reason) for name, setting, reason in unseen]
        yield len(lost), lost
