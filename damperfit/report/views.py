"""One log as it is looked at: its last cycle, the figures of it, its temperature and findings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.characteristics import Characteristics, characterise
from damperfit.errors import SimulationError
from damperfit.simulation import Response

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.tables import LogSignals, Results

    FloatArray = NDArray[np.float64]

__all__ = ["LogView", "log_views"]


@dataclass(frozen=True, slots=True, eq=False)
class LogView:
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
    temperature : float or None
        degC.
    notes : tuple of str
        What was found in the log.
    """

    signals: LogSignals
    frequency: float
    cycle: slice
    measured: Characteristics | None
    simulated: Characteristics | None
    temperature: float | None
    notes: tuple[str, ...]


def log_views(results: Results) -> tuple[LogView, ...]:
    """Return each log of the results with its figures."""
    inputs = results.record.get("inputs")
    known: dict[str, dict[str, Any]] = {
        str(entry.get("log")): entry
        for entry in (inputs if isinstance(inputs, list) else [])
        if isinstance(entry, dict)
    }
    return tuple(_view(signals, known.get(signals.log, {})) for signals in results.logs)


def _view(signals: LogSignals, facts: dict[str, Any]) -> LogView:
    frequency = _frequency(signals)
    cycle = slice(0, len(signals.time))
    if np.isfinite(frequency):
        start = signals.time[-1] - 1.0 / frequency
        cycle = slice(max(0, int(np.searchsorted(signals.time, start)) - 1), len(signals.time))
    notes = facts.get("notes")
    return LogView(
        signals=signals,
        frequency=frequency,
        cycle=cycle,
        measured=_figures(signals, signals.force_measured, frequency),
        simulated=_figures(signals, signals.force, frequency),
        temperature=_number(facts.get("temperature_degC")),
        notes=tuple(str(note) for note in notes) if isinstance(notes, list) else (),
    )


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) else None


def _frequency(signals: LogSignals) -> float:
    """Return cycles per second from the rising passages through mid-stroke, noise passed over."""
    x = signals.displacement
    if len(x) < 8 or not np.isfinite(x).all() or np.ptp(x) == 0.0:
        return float("nan")
    middle, reach = 0.5 * (x.max() + x.min()), 0.25 * np.ptp(x)
    side = np.where(x > middle + reach, 1, np.where(x < middle - reach, -1, 0))
    turns = np.flatnonzero(side)
    rises = turns[1:][(side[turns[:-1]] < 0) & (side[turns[1:]] > 0)]
    if len(rises) >= 2:
        return float((len(rises) - 1) / (signals.time[rises[-1]] - signals.time[rises[0]]))
    # One rise: the window holds whole cycles, so it holds one.
    return float(1.0 / (signals.time[-1] - signals.time[0])) if len(rises) == 1 else float("nan")


def _figures(signals: LogSignals, force: FloatArray, frequency: float) -> Characteristics | None:
    if not (np.isfinite(frequency) and np.isfinite(force).all()):
        return None
    response = Response(
        time=signals.time,
        displacement=signals.displacement,
        velocity=signals.velocity,
        force=force,
        pressures=signals.pressures,
        masses=np.empty((2, 0)),
    )
    try:
        return characterise(response, frequency)
    except SimulationError:  # shorter than one cycle
        return None
