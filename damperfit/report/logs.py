"""One log as it is looked at: its last cycle, the figures of it, its temperature and findings."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.conditioning import figures_of
from damperfit.errors import SimulationError
from damperfit.report.forces import PeakPoint
from damperfit.report.records import findings_in, listed_in, number_in
from damperfit.simulation import Characteristics, Response, characterise, mean_figures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.recording import Finding, StretchFigures
    from damperfit.results import Run
    from damperfit.tables import LogSignals
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = [
    "EvaluatedLog",
    "EvaluatedStretch",
    "evaluate_logs",
    "has_several_speeds",
    "peak_points",
]


@dataclass(frozen=True, slots=True, eq=False)
class EvaluatedStretch:
    """One stretch of a log that is no single steady run.

    Attributes
    ----------
    window : slice
        Its samples of the log's signals.
    cycle : slice
        Its last whole cycle without another motion in the filter; all of it where none repeats.
    start : float
        Time stamp of its first sample, s.
    n_cycles : int
        Whole cycles; 0 where nothing repeats.
    frequency : float
        Hz.
    measured, simulated : StretchFigures
        What is read off both forces.
    """

    window: slice
    cycle: slice
    start: float
    n_cycles: int
    frequency: float
    measured: StretchFigures
    simulated: StretchFigures


_LATE = 1e-6  # s; time stamps are rounded alike
_FEWEST = 8  # samples
_ONE_SPEED = 0.05  # speeds within this share are one test, run again


@dataclass(frozen=True, slots=True, eq=False)
class EvaluatedLog:
    """A log with what is read off it.

    Attributes
    ----------
    signals : LogSignals
        All evaluated cycles.
    frequency : float
        Hz; NaN when it cannot be determined.
    cycle : slice
        The last whole cycle, all samples when the frequency cannot be determined.
    measured, simulated : Characteristics or None
        Means over its cycles (pressures: of the last one); None when there is no whole cycle.
    amplitude : float
        Half the stroke, m; NaN when it cannot be determined.
    temperature : float or None
        degC.
    notes : tuple of str
        How the log was read.
    findings : tuple of Finding
        What its data show.
    stretches : tuple of EvaluatedStretch
        Of a log that is no single steady run; then the figures above are of the fastest cycle.
    """

    signals: LogSignals
    frequency: float
    cycle: slice
    measured: Characteristics | None
    simulated: Characteristics | None
    amplitude: float
    temperature: float | None
    notes: tuple[str, ...]
    findings: tuple[Finding, ...]
    stretches: tuple[EvaluatedStretch, ...] = ()


def peak_points(views: Sequence[EvaluatedLog]) -> tuple[PeakPoint, ...]:
    """Return the peaks of each log, or of each of its steady stretches."""
    found = []
    for view in views:
        who = view.signals.setting, view.signals.log
        steady = [one for one in view.stretches if one.n_cycles]
        found += [PeakPoint(*who, one.frequency, one.measured, one.simulated) for one in steady]
        if not steady and view.measured and view.simulated:
            found.append(PeakPoint(*who, view.frequency, view.measured, view.simulated))
    return tuple(found)


def has_several_speeds(points: Sequence[PeakPoint]) -> bool:
    """Whether a setting was tested at more than one speed."""
    speeds: dict[Setting, list[float]] = {}
    for one in points:
        speeds.setdefault(one.setting, []).append(one.measured.peak_speed_rebound)
    return any(max(known) > (1.0 + _ONE_SPEED) * min(known) for known in speeds.values())


def evaluate_logs(run: Run) -> tuple[EvaluatedLog, ...]:
    """Return each log of the results with its figures."""
    known: dict[str, dict[str, Any]] = {
        str(entry.get("log")): entry
        for entry in listed_in(run.record, "inputs")
        if isinstance(entry, dict)
    }
    return tuple(_evaluate(signals, known.get(signals.log, {})) for signals in run.signals)


def _evaluate(signals: LogSignals, facts: dict[str, Any]) -> EvaluatedLog:
    stretches = _stretches(signals, facts)
    steady = [one for one in stretches if one.n_cycles]
    first, logged = 0, number_in(facts, "frequency_Hz")
    inner = signals
    if steady:
        fastest = max(steady, key=lambda one: one.measured.peak_speed_rebound)
        until = slice(fastest.window.start, fastest.cycle.stop)
        first, logged, inner = until.start, fastest.frequency, _cut(signals, until)
    frequency = np.nan if stretches and not steady else _frequency(inner, logged)
    cycle = slice(0, len(signals.time))
    if np.isfinite(frequency):
        start = inner.time[-1] - 1.0 / frequency
        begin = max(0, int(np.searchsorted(inner.time, start)) - 1)
        cycle = slice(first + begin, first + len(inner.time))
    return EvaluatedLog(
        signals=signals,
        frequency=frequency,
        cycle=cycle,
        stretches=stretches,
        measured=_figures(inner, inner.force_measured, frequency),
        simulated=_figures(inner, inner.force, frequency),
        amplitude=0.5 * float(np.ptp(signals.displacement)) if len(signals.time) else np.nan,
        temperature=number_in(facts, "temperature_degC"),
        notes=tuple(str(note) for note in listed_in(facts, "notes")),
        findings=findings_in(facts),
    )


def _stretches(signals: LogSignals, facts: dict[str, Any]) -> tuple[EvaluatedStretch, ...]:
    """Return the stretches of a log that is no single steady run, as far as run.json tells."""
    stretches = [one for one in listed_in(facts, "stretches") if isinstance(one, dict)]
    if len(stretches) < 2 and not any(one.get("kind") == "moving" for one in stretches):
        return ()
    found = (_stretch(signals, one) for one in stretches)
    return tuple(one for one in found if one is not None)


def _stretch(signals: LogSignals, facts: dict[str, Any]) -> EvaluatedStretch | None:
    start, stop, rate = (number_in(facts, key) for key in ("start_s", "stop_s", "frequency_Hz"))
    if start is None or stop is None or rate is None or len(signals.time) < 2 or not rate > 0.0:
        return None
    window = _between(signals, start, stop)
    begin, end = (number_in(facts, f"figures_{key}_s") for key in ("start", "stop"))
    inner = window if begin is None or end is None else _between(signals, begin, end)
    n = inner.stop - inner.start
    if n < _FEWEST or inner.start < window.start or inner.stop > window.stop:
        return None
    n_cycles = int(number_in(facts, "cycles") or 0)
    interval = float(np.median(np.diff(signals.time[inner])))
    inside = max(round(n * interval * rate), 1) if n_cycles else 1
    edges = np.rint(np.linspace(0, n, inside + 1)).astype(np.int64)
    measured, simulated = (
        figures_of(
            signals.velocity[inner],
            force[inner],
            edges.astype(np.float64),
            interval=interval,
            is_steady=n_cycles > 0,
        )
        for force in (signals.force_measured, signals.force)
    )
    cycle = slice(inner.start + int(edges[-2]), inner.stop)
    return EvaluatedStretch(window, cycle, start, n_cycles, rate, measured, simulated)


def _between(signals: LogSignals, start: float, stop: float) -> slice:
    """Return the samples from one time stamp to another."""
    first, last = np.searchsorted(signals.time, [start - _LATE, stop - _LATE])
    return slice(int(first), int(last))


def _cut(signals: LogSignals, window: slice) -> LogSignals:
    return replace(
        signals,
        time=signals.time[window],
        displacement=signals.displacement[window],
        velocity=signals.velocity[window],
        force_measured=signals.force_measured[window],
        force=signals.force[window],
        pressures=signals.pressures[:, window],
    )


def _frequency(signals: LogSignals, logged: float | None) -> float:
    """Return cycles per second from the passages through mid-stroke, noise passed over.

    The record's own figure is taken where the signals do not contradict it: it was found on more
    cycles.
    """
    x, time = signals.displacement, signals.time
    if len(x) < 8 or not np.isfinite(x).all() or np.ptp(x) == 0.0:
        return float("nan")
    middle, reach = 0.5 * (x.max() + x.min()), 0.25 * np.ptp(x)
    side = np.where(x > middle + reach, 1, np.where(x < middle - reach, -1, 0))
    turns = np.flatnonzero(side)
    begins, ends = side[turns[:-1]], side[turns[1:]]
    passages = max(
        (turns[1:][(begins < 0) & (ends > 0)], turns[1:][(begins > 0) & (ends < 0)]), key=len
    )
    if len(passages) < 2:  # the window holds whole cycles: this is one
        return float(1.0 / (time[-1] - time[0] + _interval(signals)))
    found = float((len(passages) - 1) / (time[passages[-1]] - time[passages[0]]))
    return logged if logged is not None and abs(logged - found) <= 0.02 * found else found


def _interval(signals: LogSignals) -> float:
    return float(signals.time[-1] - signals.time[0]) / (len(signals.time) - 1)


def _figures(signals: LogSignals, force: FloatArray, frequency: float) -> Characteristics | None:
    if not (np.isfinite(frequency) and np.isfinite(force).all()):
        return None
    # A window of whole cycles stops one sample before the cycle closes: the first sample is next.
    period = 1.0 / frequency
    n_back = round(period / _interval(signals))
    next_time = signals.time[-1] + _interval(signals)

    def closed(signal: FloatArray) -> FloatArray:
        return np.concatenate((signal, signal[-n_back:][:1]))

    response = Response(
        time=np.concatenate((signals.time, [next_time])),
        displacement=closed(signals.displacement),
        velocity=closed(signals.velocity),
        force=closed(force),
        pressures=np.stack([closed(p) for p in signals.pressures]),
        masses=np.empty((2, 0)),
    )
    try:
        last = characterise(response, frequency)
    except SimulationError:  # shorter than one cycle
        return None
    # Back from the end, cycle by cycle, over what is evaluated.
    n, cycles = len(signals.time), [last]
    for k in range(1, n // max(n_back, 1)):
        stop = n - round(k * period / _interval(signals))
        with suppress(SimulationError):
            one = _cut_response(response, max(stop - n_back, 0), stop + 1)
            cycles.append(characterise(one, frequency))
    return mean_figures(cycles)


def _cut_response(response: Response, first: int, stop: int) -> Response:
    return replace(
        response,
        time=response.time[first:stop],
        displacement=response.displacement[first:stop],
        velocity=response.velocity[first:stop],
        force=response.force[first:stop],
        pressures=response.pressures[:, first:stop],
    )
