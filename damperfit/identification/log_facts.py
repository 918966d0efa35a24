"""What a fit asks of its logs: how much each sample counts, how many count, what they can tell."""

from __future__ import annotations

import math
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.damper.quantity import GAS_AMOUNT, RIG, STIFFNESS
from damperfit.problem import Problem, warning
from damperfit.recording import FilterDesign
from damperfit.statistics import mean_of, median, variance_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    from collections.abc import Sequence

    from damperfit.damper.quantity import Quantity
    from damperfit.recording import Trace

FEWEST_SAMPLES = 20.0  # effective ones, of a stretch


def effective_samples(residuals: FloatArray, n_cycles: int) -> float:
    """The effective number of samples of one stretch, (n,) over whole cycles.

    A residual of one harmonic alone counts as few samples as a stretch may have.

    >>> effective_samples(np.sin(np.linspace(0.0, 40.0 * np.pi, 2000)), 20)
    20.0
    """
    power = np.abs(np.fft.rfft(residuals)) ** 2
    lines = power[n_cycles::n_cycles]
    whole = float(np.sum(lines))
    if whole <= 0.0:
        return FEWEST_SAMPLES
    return max(2.0 * whole**2 / float(np.sum(lines**2)), FEWEST_SAMPLES)


# How much each sample counts in the fit of a setting: by its stretch's noise, and not at a corner.
#
# Where the speed jumps, as at the corners of a triangle, the force of some milliseconds follows
# from the microns and microseconds of the turn, which no sensor tells: noise of a few um there
# bent R_m3 of two triangles. These samples are simulated, shown and in every MSE, but the fit
# takes no notice of them, unless the motion is straight on both sides (`conditioning.drive`).

# Noises within this factor of each other are one: a scatter of few cycles is no better known.
_ALIKE = 1.25
# No stretch counts more than this against the middle one, as a fit has other errors than noise.
_FARTHEST = 5.0
_OTHER_ERRORS = 1e-3  # of the force's deviation
# Of the peak speed: what the compared filter takes off the drive's velocity at a jump of it.
_JUMP = 0.5
# Before and after it nothing counts for so many widths of the filter's answer to an impulse, which
# at 30 Hz are 10 and 20 ms.
_BEFORE, _AFTER = 0.6, 1.2
_IMPULSE = 1 << 13  # samples, far longer than any filter's answer
# Where corners are more of a stretch than this, they are what it tells.
_MOST = 1.0 / 3.0


def weights(traces: Sequence[Trace]) -> tuple[FloatArray | None, ...]:
    """What the residuals of each log are multiplied by, over its compared samples; mean square 1.

    One over the noise of each stretch (the middle one's, where none is known), nothing beside a
    jump of the speed. None for all where nothing is to be told apart.
    """
    counted = [_counted(trace) for trace in traces]
    stretches = [stretch for trace in traces for stretch in trace.stretches]
    known = [stretch.noise for stretch in stretches if math.isfinite(stretch.noise)]
    factors = np.ones(len(stretches))
    if len(stretches) > 1 and known:
        force = np.concatenate([trace.force[trace.compared] for trace in traces])
        other = _OTHER_ERRORS * float(np.std(force))
        middle = math.hypot(median(known), other)
        noises = (one.noise for one in stretches)
        sizes = [math.hypot(one, other) if math.isfinite(one) else middle for one in noises]
        if max(sizes) > _ALIKE * min(sizes):
            factors = np.clip(middle / np.array(sizes), 1.0 / _FARTHEST, _FARTHEST)
            counts = np.array([one.n_samples for one in stretches])
            factors /= math.sqrt(float(counts @ factors**2) / float(counts.sum()))
    if np.all(factors == 1.0) and all(one is None for one in counted):
        return (None,) * len(traces)
    rows = iter(np.full(one.n_samples, k) for k, one in zip(factors, stretches, strict=True))
    both = []
    for trace, counts_here in zip(traces, counted, strict=True):
        of_log = np.concatenate([next(rows) for _ in trace.stretches])
        both.append(of_log if counts_here is None else of_log * counts_here)
    if any(one is not None for one in counted):
        power = sum(float(one @ one) for one in both) / sum(len(one) for one in both)
        both = [one / math.sqrt(power) for one in both]
    return tuple(both)


def _counted(trace: Trace) -> NDArray[np.bool_] | None:
    """Which of the compared samples lie beside no jump of the speed; None for all."""
    if trace.drive.velocity is trace.velocity or len(trace.drive.jumps):
        return None
    cut_off = np.abs(trace.drive.velocity - trace.velocity)
    counts = np.ones(len(cut_off), dtype=bool)
    width = _width(trace.model_filter.sections.tobytes(), trace.model_filter.is_zero_phase)
    for stretch in trace.stretches:
        part = stretch.window
        near = np.zeros(stretch.n_samples, dtype=bool)
        for at in np.flatnonzero(cut_off[part] > _JUMP * stretch.peak_speed).tolist():
            near[max(0, at - round(_BEFORE * width)) : at + round(_AFTER * width) + 1] = True
        if np.mean(near) <= _MOST:
            counts[part] = ~near
    return None if counts.all() else counts[trace.compared]


@lru_cache(maxsize=64)
def _width(sections: bytes, is_zero_phase: bool) -> float:  # noqa: FBT001
    """How long a filter's answer to an impulse lasts, in samples: 1 over its power."""
    design = FilterDesign(np.frombuffer(sections).reshape(-1, 6).copy(), is_zero_phase, "")
    impulse = np.zeros(_IMPULSE)
    impulse[_IMPULSE // 2] = 1.0
    return 1.0 / float(np.sum(apply_filter(design, impulse) ** 2))


# Logs that hold one speed, or a few: what triangle waves cannot tell.
#
# At constant speed a stroke shows one level of force, and two levels cannot tell R_m1, R_m2, R_m3
# and f_f. What is left are the corners, a few milliseconds in which the elasticity of the oil
# settles; a descent finds a minimum there that is several of its errors away from the truth. Six
# levels, of three speeds, do not tell the eight numbers of two valves, a friction and an offset
# either: above the knee of both curves a friction and a preload make one level.

_ONE_SPEED = (
    "the logs hold one speed, so that the valves and friction cannot be separated: "
    "add a log or a segment at another speed, or hold one valve and the friction."
)
_FEW_SPEEDS = (
    "the logs hold {} speeds: their {} levels of force do not determine {} numbers of valves, "
    "friction and offset, and only the corners separate a friction from a preload: add a test at "
    "another speed, below the knee of the force."
)
_LEVELS = 2  # of a speed, one in rebound, one in bump
_NEAR = 0.1  # of the speed
# Of the samples. A triangle has 0.96 and more, a sine 0.29; beside 10 % of another speed 0.9.
_SHARE = 0.9


class LogFacts:
    """What a fit asks of the logs of one setting again and again, found where first asked for."""

    def __init__(self, traces: tuple[Trace, ...]) -> None:
        self.traces = traces

    @cached_property
    def deviation(self) -> float:
        """Standard deviation of all measured forces that are compared, N."""
        forces = [one.force[one.compared] for one in self.traces]
        return math.sqrt(variance_of(forces[0] if len(forces) == 1 else np.concatenate(forces)))

    @cached_property
    def n_samples(self) -> int:
        """Samples compared."""
        return sum(one.n_samples for one in self.traces)

    @cached_property
    def weights(self) -> tuple[FloatArray | None, ...]:
        """What the residuals of each log are multiplied by, as `weights` has it."""
        return weights(self.traces)

    @cached_property
    def holds_one_speed(self) -> bool:
        """Whether nearly all samples are at one speed, either way."""
        speeds = [np.abs(trace.drive.velocity[trace.compared]) for trace in self.traces]
        return _speed_held(np.concatenate(speeds)) is not None

    @cached_property
    def n_speeds(self) -> int | None:
        """How many speeds the stretches hold; None where one holds none."""
        speeds: list[float] = []
        for trace in self.traces:
            for stretch in trace.stretches:
                held = _speed_held(np.abs(trace.drive.velocity[stretch.window]))
                if held is None:
                    return None
                if all(abs(held / other - 1.0) > _NEAR for other in speeds):
                    speeds.append(held)
        return len(speeds)


def _speed_held(speed: FloatArray) -> float | None:
    """The speed at which nearly all samples are; None where there is none."""
    usual = median(speed)
    is_held = mean_of(np.abs(speed - usual) <= _NEAR * usual) > _SHARE
    return usual if is_held else None


def inseparable(
    facts: LogFacts, free: Sequence[str], quantities: Sequence[Quantity]
) -> tuple[str, ...]:
    """The free parameters that logs of one speed cannot separate; none where they can."""
    # The stiffness of the oil shows in the corners.
    unknown = [one for one in quantities if one.name in free and one.role != STIFFNESS]
    return tuple(free) if len(unknown) > _LEVELS and facts.holds_one_speed else ()


def said_of_speeds(
    facts: LogFacts, free: Sequence[str], quantities: Sequence[Quantity]
) -> tuple[Problem, ...]:
    """What is to be said of logs that hold one speed, or too few for what is fitted."""
    if inseparable(facts, free, quantities):
        return (warning("one-speed", _ONE_SPEED),)
    # Stiffness, gas and mounting show in the corners and along the stroke.
    unknown = [
        one
        for one in quantities
        if one.name in free
        and (one.is_offset or one.scope != RIG)
        and one.role not in {STIFFNESS, GAS_AMOUNT}
    ]
    if len(unknown) <= 2 * _LEVELS:  # two speeds determine them, and one was asked for above
        return ()
    n = facts.n_speeds
    if n is None or _LEVELS * n >= len(unknown):
        return ()
    return (warning("few-speeds", _FEW_SPEEDS.format(n, _LEVELS * n, len(unknown))),)
