"""A log of a run as it is looked at: its signals, which of them are drawn, what is known of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.report.records import findings_in, listed_in, number_in

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from damperfit.recording import Finding
    from damperfit.results import Run
    from damperfit.tables.reading import LogSignals
    from damperfit.tested.setting import Setting

    Row = Mapping[str, Any]

__all__ = ["LogView", "has_several_speeds", "log_views"]

_LATE = 1e-6  # s; time stamps are rounded alike
_FEWEST = 8  # samples
_ONE_SPEED = 0.05  # speeds within this share are one test, run again


@dataclass(frozen=True, slots=True, eq=False)
class LogView:
    """A log with what the run tells of it.

    Attributes
    ----------
    signals : LogSignals
        All evaluated cycles.
    facts : mapping
        Its entry of the inputs in run.json.
    rows : tuple of mapping
        Its rows of the table "characteristics".
    cycles : tuple of slice
        The last whole cycle of each steady segment.
    """

    signals: LogSignals
    facts: Row
    rows: tuple[Row, ...]
    cycles: tuple[slice, ...]

    @property
    def setting(self) -> Setting:
        """Where the adjusters stand."""
        return self.signals.setting

    @property
    def peaks(self) -> tuple[Row, ...]:
        """Its segments: peak speeds and forces, energy, hysteresis."""
        return tuple(row for row in self.rows if row["point"] == "peak")

    @property
    def is_moving(self) -> bool:
        """Whether nothing in it repeats."""
        return bool(self.peaks) and not any(row["cycles"] for row in self.peaks)

    @property
    def has_segments(self) -> bool:
        """Whether it is no single steady run."""
        return len(self.peaks) > 1 or self.is_moving

    @property
    def fastest(self) -> Row | None:
        """Its fastest steady segment; None where nothing repeats, or no table tells."""
        steady = [row for row in self.peaks if row["cycles"]]
        return max(steady, key=lambda row: row["speed_rebound_m_per_s"] or 0.0, default=None)

    @property
    def cycle(self) -> slice:
        """The last cycle of the fastest steady segment, all samples where nothing repeats."""
        speeds = (np.ptp(self.signals.velocity[part]) for part in self.cycles)
        ranked = sorted(zip(speeds, self.cycles, strict=True), key=lambda one: one[0])
        return ranked[-1][1] if ranked else slice(0, len(self.signals.time))

    @property
    def frequency(self) -> float:
        """Hz; NaN where it is not known."""
        known = number_in(self.fastest or self.facts, "frequency_Hz")
        return math.nan if known is None else known

    @property
    def amplitude(self) -> float:
        """Half of the stroke, m; NaN where it is not known."""
        known = [number_in(one, "amplitude_m") for one in (*self.peaks, self.facts)]
        return max((one for one in known if one is not None), default=math.nan)

    @property
    def temperature(self) -> float | None:
        """Mean over the log, degC."""
        return number_in(self.facts, "temperature_degC")

    @property
    def notes(self) -> tuple[str, ...]:
        """How it was read."""
        return tuple(map(str, listed_in(self.facts, "notes")))

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What its data show, the gravest first."""
        return findings_in(self.facts)


def log_views(run: Run) -> tuple[LogView, ...]:
    """Return each log of a run that has signals."""
    known = {
        str(entry.get("log")): entry
        for entry in listed_in(run.record, "inputs")
        if isinstance(entry, dict)
    }
    rows: dict[tuple[Setting, str], list[Row]] = {}
    for row in run.rows("characteristics"):
        rows.setdefault((row["setting"], str(row["log"])), []).append(row)
    views = []
    for signals in run.signals:
        facts = known.get(signals.log, {})
        mine = tuple(rows.get((signals.setting, signals.log), ()))
        views.append(LogView(signals, facts, mine, tuple(_cycles(signals, facts))))
    return tuple(views)


def has_several_speeds(rows: Iterable[Row]) -> bool:
    """Whether a setting was tested at more than one speed, by its rows of characteristics."""
    speeds: dict[Setting, list[float]] = {}
    for row in rows:
        if row["point"] == "peak" and row["cycles"] and row["speed_rebound_m_per_s"]:
            speeds.setdefault(row["setting"], []).append(row["speed_rebound_m_per_s"])
    return any(max(known) > (1.0 + _ONE_SPEED) * min(known) for known in speeds.values())


def _cycles(signals: LogSignals, facts: Row) -> Iterator[slice]:
    """Yield the last cycle of each steady segment; older runs tell of one, in the entry itself."""
    told = listed_in(facts, "stretches") or [facts]
    for segment in (one for one in told if isinstance(one, dict)):
        rate = number_in(segment, "frequency_Hz")
        is_steady = segment.get("kind", "steady") == "steady"
        if not is_steady or rate is None or not rate > 0.0 or len(signals.time) < _FEWEST:
            continue
        stop = number_in(segment, "figures_stop_s") or number_in(segment, "stop_s") or math.inf
        end = int(np.searchsorted(signals.time, stop - _LATE))
        begin = int(np.searchsorted(signals.time, signals.time[end - 1] - 1.0 / rate - _LATE))
        if end - begin >= _FEWEST:
            yield slice(begin, end)
