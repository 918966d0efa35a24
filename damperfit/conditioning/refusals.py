"""Logs that cannot be used at all, each refused with the reason and the way out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning.cycles import clean_cycles
from damperfit.conditioning.filters import fitting_corner
from damperfit.errors import ConditioningError
from damperfit.statistics import mean_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    from damperfit.conditioning.cycles import Cycles
    from damperfit.conditioning.options import ConditionOptions
    from damperfit.conditioning.timebase import UniformLog
    from damperfit.recording import Recording, Trace

__all__ = [
    "MIN_CYCLES",
    "harmonic_powers",
    "oversize",
    "refuse_dead",
    "refuse_fast",
    "refuse_small",
    "refuse_stroke",
    "refuse_swapped",
]


# How strong the harmonics of a motion are in a channel.


def harmonic_powers(values: FloatArray, turns: float, n_powers: int) -> FloatArray:
    """Return the power of the harmonics of a motion in whole cycles of a channel.

    Parameters
    ----------
    values : numpy.ndarray
        Shape (n,); its mean is taken off.
    turns : float
        Turns of the motion in a sample.
    n_powers : int
        As many, from the first on; 16 at most.

    Returns
    -------
    numpy.ndarray
        Shape (n_powers,), a quarter of the square of each one's amplitude.

    Examples
    --------
    >>> angle = 2.0 * np.pi * np.arange(300) / 100
    >>> harmonic_powers(2.0 * np.sin(angle) + 0.2 * np.sin(3.0 * angle), 0.01, 3).round(6)
    array([1.  , 0.  , 0.01])
    """
    turned = values - mean_of(values) + 0j
    turn = np.exp(-2j * np.pi * turns * np.arange(len(values)))
    powers = np.empty(n_powers)
    for k in range(n_powers):
        turned *= turn
        powers[k] = abs(complex(turned.sum())) ** 2 / len(values) ** 2
    return powers


MIN_CYCLES = 3
_MIN_SAMPLES = 20
_ABSURD = 1e9  # N or m; no column of any rig, in whatever unit; its squares might overflow
_ANSWERS = 3e-4  # a damper without friction and of one valve law has 1e-4
_MORE = 4.0


def refuse_dead(recording: Recording) -> None:
    """Refuse a log without a test in it: too short, or with a constant channel."""
    n = len(recording.time)
    if n < _MIN_SAMPLES:
        raise ConditioningError(
            f"{n} sample{'s' * (n != 1)}; expected at least {MIN_CYCLES} whole "
            "cycles of a steady test; record a longer log",
            subject=recording.name,
        )
    for channel, values in (
        ("displacement", recording.displacement),
        ("force", recording.force),
    ):
        middle = float(values[0])
        # A constant that passed a change of units differs by rounding only.
        if float(np.ptp(values)) <= 1e-12 * abs(middle):
            raise ConditioningError(
                f"the {channel} is constant ({middle:g}) in all {n} rows; "
                "expected a steady periodic test; check sensor and column",
                subject=recording.name,
            )
        if (largest := float(np.abs(values).max())) > _ABSURD:
            unit = "m" if channel == "displacement" else "N"
            raise ConditioningError(
                f"the {channel} reaches {largest:.3g} {unit}, which no rig "
                "reaches; declare its unit, or check sensor and column",
                subject=recording.name,
            )


def oversize(recording: Recording, options: ConditionOptions) -> str:
    """Return why a log is of an impossible size; empty where it is not."""
    if (half := 0.5 * float(np.ptp(recording.displacement))) > options.max_amplitude:
        return (
            f"{recording.name}: displacement swings +-{half:.4g} m, expected at most "
            f"+-{options.max_amplitude:g} m{_chambers(options)}; was mm read as m? "
            "Declare the unit or raise conditioning.max_amplitude"
        )
    peak = float(np.abs(recording.force).max())
    if peak > options.max_force:
        return (
            f"{recording.name}: force reaches {peak:.4g} N, expected at most "
            f"{options.max_force:g} N; was N read as kN? Declare the unit or raise "
            "conditioning.max_force"
        )
    return ""


def refuse_small(trace: Trace, options: ConditionOptions) -> None:
    """Refuse a motion that no rig makes: its unit was misread."""
    if trace.amplitude < options.min_amplitude:
        raise ConditioningError(
            f"displacement swings +-{1e3 * trace.amplitude:.4g} mm, expected at "
            f"least +-{1e3 * options.min_amplitude:g} mm; was m read as mm? Declare the unit "
            "(rig.units.displacement) or lower conditioning.min_amplitude",
            subject=trace.name,
        )


def refuse_swapped(trace: Trace) -> None:
    """Refuse a log whose force is driven and whose displacement answers: the wrong columns.

    A machine drives the displacement, near enough a sine. The force answers with harmonics: those
    of the displacement grow in the velocity, and valves and friction add theirs. Measured: 1e-9 to
    0.004 of the displacement's power is in harmonics, 0.15 of the force's share at most.
    """
    if not trace.fastest.n_cycles:
        return  # a random motion has no harmonics
    driven = _harmonic_share(trace, trace.displacement)
    if driven > _ANSWERS and driven > _MORE * (answers := _harmonic_share(trace, trace.force)):
        raise ConditioningError(
            f"force and displacement look swapped: what is read as displacement has "
            f"{100.0 * driven:.2g} % of its power in harmonics, what is read as force "
            f"{100.0 * answers:.1g} %, but it is the displacement that a machine drives; "
            "declare rig.columns = {displacement = ..., force = ...} and rig.units, for files "
            "that differ in a profile each",
            subject=trace.name,
        )


def _harmonic_share(trace: Trace, values: FloatArray) -> float:
    """Return the share of a channel's power that is in harmonics 2 to 7 of the motion."""
    stretch = trace.fastest
    first, *_, stop = np.rint(clean_cycles(stretch)).astype(np.int64)
    power = harmonic_powers(values[first:stop], stretch.frequency * trace.interval, 7)
    return float(np.sum(power[1:])) / max(float(np.sum(power)), 1e-300)


def _chambers(options: ConditionOptions) -> str:
    if options.chamber_lengths is None:
        return ""
    l_1, l_2 = options.chamber_lengths
    return f" (chambers l_1 {l_1:g} m, l_2 {l_2:g} m)"


def refuse_fast(name: str, log: UniformLog, cycles: Cycles, options: ConditionOptions) -> None:
    """Refuse a motion that the filter takes away."""
    is_rig = options.rig_filter != "none"
    corner = options.rig_filter_corner if is_rig else options.filter_corner
    frequency = 1.0 / (cycles.period * log.interval)
    if (is_rig or options.filter != "none") and frequency >= corner:
        raise ConditioningError(
            f"the motion found has {frequency:.3g} Hz, not below the filter "
            f"corner of {corner:g} Hz; {_raised(is_rig, frequency, log)}",
            subject=name,
        )


def _raised(is_rig: bool, frequency: float, log: UniformLog) -> str:  # noqa: FBT001
    if is_rig:
        return "the displacement is noise, or rig.filter_corner is another one"
    corner = fitting_corner(frequency, 1.0 / log.interval)
    fits = f"set conditioning.filter_corner = '{corner:g}Hz' or 'auto'"
    return f"the displacement is noise, or the corner must be raised: {fits}"


def refuse_stroke(trace: Trace, options: ConditionOptions) -> None:
    """Refuse a displacement that leaves chamber 1 (x >= l_1) or chamber 2 (x <= -l_2) no volume."""
    if options.chamber_lengths is None:
        return
    l_1, l_2 = options.chamber_lengths
    highest, lowest = float(trace.displacement.max()), float(trace.displacement.min())
    if highest < l_1 and lowest > -l_2:
        return
    x, at = (highest, "below l_1") if highest >= l_1 else (lowest, "above -l_2")
    hint = "mm read as m or inches?"
    if abs(x) < 10.0 * max(l_1, l_2):
        hint = "declare the right unit (rig.units.displacement) or centre (rig.centre)"
    raise ConditioningError(
        f"stroke beyond the chamber: x reaches {x:.4g} m, expected {at} "
        f"(l_1 = {l_1:g} m, l_2 = {l_2:g} m; x = 0 at {trace.centre:.4g} m of the log); {hint}",
        subject=trace.name,
    )
