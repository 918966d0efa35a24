"""Forces checked against tolerance bands: around those of the reference, or nominal ones."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.adjustment.force_at import REPEATS, STROKES
from damperfit.comparison.circumstances import settings_of
from damperfit.comparison.comparing import ComparisonOptions, RunComparison, force_readings
from damperfit.comparison.measured import Reading, measured_readings
from damperfit.errors import ConfigurationError
from damperfit.io.files import read_text, why_unread
from damperfit.problem import Option
from damperfit.units.quantities import parse_quantity
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from damperfit.results import Run
    from damperfit.tested.setting import Setting

_UNIT = re.compile(r"(_n|_m_per_s|_m/s)$")  # of a column's name, in lower case
_PER_CENT = re.compile(r"\s*([0-9.]+(?:[eE][-+]?\d+)?)\s*%\s*")


class Band(NamedTuple):
    """Where a force may lie, N, positive in rebound."""

    setting: str  # its label; empty: every one
    speed: float  # m/s, positive
    stroke: str
    low: float
    high: float


class Tolerance(NamedTuple):
    """How far forces may be from those of the reference, or which bands they must keep."""

    source: str  # as it was given, for people
    share: float = 0.0  # of the reference's damping,
    newtons: float = 0.0  # and N; the larger of the two counts
    bands: tuple[Band, ...] = ()  # nominal forces in place of a reference's

    def reach(self, force: Any) -> Any:
        """Return how far from a force, N, another may be."""
        return max(self.share * abs(force), self.newtons)


class Point(NamedTuple):
    """A force checked against its band, N, positive in rebound."""

    run: str  # whose
    setting: Setting | str
    speed: float = math.nan  # m/s; NaN where a whole setting is missing
    stroke: str = ""
    force: float = math.nan  # NaN where it is not known
    low: float = math.nan
    high: float = math.nan
    reach: float = math.nan  # half of the 95 % interval of the force; NaN: not known
    reason: str = ""  # why it was not evaluated
    is_measured: bool = False
    units: ShownUnits = SI  # of its sentences

    @property
    def margin(self) -> float:
        """How far inside the band, N; negative: outside."""
        return min(self.force - self.low, self.high - self.force)

    @property
    def is_met(self) -> bool:
        """Whether the force is inside; one that was not evaluated is not."""
        return self.margin >= 0.0

    @property
    def words(self) -> str:
        """The result in words."""
        if math.isnan(self.margin):
            return f"not evaluated: {self.reason}"
        near = ", by less than its error" if abs(self.margin) <= self.reach else ""
        mark = " (measured)" if self.is_measured else ""
        result, side = ("passes", "inside") if self.is_met else ("FAILS", "outside")
        return f"{result}, {self.units.write(abs(self.margin), 'N', '.3g')} {side}{near}{mark}"


def _refused(source: str | Path, message: str) -> ConfigurationError:
    return ConfigurationError(message, where=Option("tolerance", source), code="bad-tolerance")


def parse_tolerance(text: str) -> Tolerance:
    """Return a tolerance from text: per cent of the damping, newtons, or both.

    Examples
    --------
    >>> parse_tolerance("5%, 10N")
    Tolerance(source='5%, 10N', share=0.05, newtons=10.0, bands=())
    """
    share = newtons = 0.0
    for entry in text.split(","):
        try:
            if per_cent := _PER_CENT.fullmatch(entry):
                share = float(per_cent[1]) / 100.0
            else:
                newtons = parse_quantity(entry.strip(), "force")
        except (ConfigurationError, ValueError) as error:
            message = (
                "expected per cent, newtons, both as in 5%,10N, or the name of a file with "
                "nominal forces"
            )
            raise _refused(text, message) from error
    if not (share > 0.0 or newtons > 0.0) or newtons < 0.0:
        raise _refused(text, "expected a tolerance above zero")
    return Tolerance(text, share, newtons)


def parse_bands(text: str | None) -> Tolerance | None:
    """Return the tolerance that the text of a command line means: a file, or per cent and newtons.

    A file is CSV with the columns speed, stroke, and force with tolerance (5% or 20N), or low and
    high; setting may be missing or empty, the row is then of every setting. Makers write
    compression as positive numbers: such a force is taken as negative.
    """
    if text is None:
        return None
    path = Path(text)
    # "2.5%" has a suffix too, as pathlib sees it.
    if not (path.is_file() or path.suffix[1:2].isalpha()):
        return parse_tolerance(text)
    try:
        lines = read_text(path).splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise _refused(path, why_unread(error)) from error
    reader = csv.DictReader(line for line in lines if line.strip() and not line.startswith("#"))
    names = {_UNIT.sub("", (name or "").strip().lower()): name for name in reader.fieldnames or ()}
    has_band = {"force", "tolerance"} <= names.keys() or {"low", "high"} <= names.keys()
    if not {"speed", "stroke"} <= names.keys() or not has_band:
        columns = "speed, stroke, and force with tolerance, or low and high"
        headings = ", ".join(reader.fieldnames or ()) or "nothing"
        raise _refused(path, f"expected the columns {columns}; found {headings}")
    bands = []
    for number, row in enumerate(reader, start=2):
        try:
            bands.append(_band({key: (row.get(name) or "").strip() for key, name in names.items()}))
        except (ConfigurationError, ValueError) as error:
            raise _refused(path, f"row {number}: {error}") from error
    if not bands:
        raise _refused(path, "no row below the headings")
    return Tolerance(str(path), bands=tuple(bands))


def _band(cells: Mapping[str, str]) -> Band:
    strokes = {"rebound": "rebound", "compression": "bump", "bump": "bump"}
    if (stroke := strokes.get(cells["stroke"].lower(), "")) not in STROKES:
        raise ValueError(f"stroke {cells['stroke']!r}: expected rebound or compression")
    speed = abs(parse_quantity(cells["speed"], "velocity"))
    if speed == 0.0:
        raise ValueError("speed 0: expected a speed above zero")
    if cells.get("low") and cells.get("high"):
        low, high = (parse_quantity(cells[name], "force") for name in ("low", "high"))
    else:
        force = parse_quantity(cells.get("force", ""), "force")
        reach = parse_tolerance(cells.get("tolerance", "")).reach(force)
        low, high = force - reach, force + reach
    if stroke == "bump" and low + high > 0.0:
        low, high = -high, -low
    if low > high:
        raise ValueError(f"low {low:g} N is above high {high:g} N")
    return Band(cells.get("setting", ""), speed, stroke, low, high)


def tolerated(comparison: RunComparison, tolerance: Tolerance) -> tuple[Point, ...]:
    """Return the forces of a run checked against bands around those of the reference.

    A setting of the reference that the run does not have is a point without a force.
    """
    name, units = comparison.second.name, comparison.units
    points = []
    for line in comparison.of("force"):
        topic, first = line.subject, line.first
        size = first.scale if first.scale and math.isfinite(first.scale) else first.value
        reach = tolerance.reach(size)
        place = (name, topic.setting or "", topic.speed or math.nan, topic.stroke)
        band = (line.second.value, first.value - reach, first.value + reach)
        evidence = (line.high - line.difference, line.reason, line.is_measured, units)
        points.append(Point(*(place + band + evidence)))
    points += [
        Point(name, setting, reason="not tested", units=units)
        for setting in settings_of(comparison.first, is_bare=comparison.is_without_model)
        if setting not in comparison.settings
    ]
    return tuple(points)


def bands_met(run: Run, tolerance: Tolerance, options: ComparisonOptions) -> tuple[Point, ...]:
    """Return the forces of a run checked against nominal bands."""
    is_bare = options.is_measured or not run.settings
    settings = settings_of(run, is_bare=is_bare)
    speeds = sorted({band.speed for band in tolerance.bands})
    if is_bare:
        (table,) = measured_readings((run,), settings, speeds=speeds)
    else:
        top = (1.0 + REPEATS) * (options.sine or run.motion).peak_speed
        speeds = [speed for speed in speeds if speed <= top]
        (table,) = force_readings((run,), settings, speeds=speeds) if speeds else ({},)
    readings: dict[Any, Reading] = {(t.setting, t.speed, t.stroke): table[t] for t in table}
    points = []
    for band in tolerance.bands:
        tested: list[Any] = [s for s in settings if band.setting in {"", str(s)}]
        reason = "the test does not reach the speed" if tested else "the setting was not tested"
        for setting in tested or [band.setting]:
            reading = readings.get((setting, band.speed, band.stroke))
            if reading is None or math.isnan(reading.value):
                reading = Reading(math.nan, objection=reason)
            force = (band.speed, band.stroke, reading.value, band.low, band.high)
            evidence = (reading.half_interval, reading.objection, reading.is_measured)
            points.append(Point(run.name, setting, *force, *evidence, options.units))
    return tuple(points)
