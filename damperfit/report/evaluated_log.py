"""One log as it is looked at: its last cycle, the figures of it, its temperature and findings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.errors import SimulationError
from damperfit.report.json_records import findings_in, listed_in, number_in
from damperfit.simulation import Characteristics, Response, characterise

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.recording import Finding
    from damperfit.tables import LogSignals, Results

    FloatArray = NDArray[np.float64]

__all__ = ["EvaluatedLog", "evaluate_logs"]


@dataclass(frozen=True, slots=True, eq=False)
class EvaluatedLog:
    """A log with what is read off it.

    Attributes
    ----------
    signals : LogSignals
        All evaluated cycles.
    frequency : float
        Hz; NaN when it cannot be told.
    cycle : slice
        The last whole cycle, all samples when the frequency cannot be told.
    measured, simulated : Characteristics or None
        Figures of the last cycle; None when there is no whole cycle.
    amplitude : float
        Half the stroke, m; NaN when it cannot be told.
    temperature : float or None
        degC.
    notes : tuple of str
        How the log was read.
    findings : tuple of Finding
        What its data show.
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


def evaluate_logs(results: Results) -> tuple[EvaluatedLog, ...]:
    """Return each log of the results with its figures."""
    known: dict[str, dict[str, Any]] = {
        str(entry.get("log")): entry
        for entry in listed_in(results.record, "inputs")
        if isinstance(entry, dict)
    }
    return tuple(_evaluate(signals, known.get(signals.log, {})) for signals in results.logs)


def _evaluate(signals: LogSignals, facts: dict[str, Any]) -> EvaluatedLog:
    frequency = _frequency(signals, number_in(facts, "frequency_Hz"))
    cycle = slice(0, len(signals.time))
    if np.isfinite(frequency):
        start = signals.time[-1] - 1.0 / frequency
        cycle = slice(max(0, int(np.searchsorted(signals.time, start)) - 1), len(signals.time))
    return EvaluatedLog(
        signals=signals,
        frequency=frequency,
        cycle=cycle,
        measured=_figures(signals, signals.force_measured, frequency),
        simulated=_figures(signals, signals.force, frequency),
        amplitude=0.5 * float(np.ptp(signals.displacement)) if len(signals.time) else np.nan,
        temperature=number_in(facts, "temperature_degC"),
        notes=tuple(str(note) for note in listed_in(facts, "notes")),
        findings=findings_in(facts),
    )


def _frequency(signals: LogSignals, told: float | None) -> float:
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
    return told if told is not None and abs(told - found) <= 0.02 * found else found


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
        return characterise(response, frequency)
    except SimulationError:  # shorter than one cycle
        return None
