"""Force at speeds by setting, with errors, and what one click changes.

The motion is one sine for all settings. At given speeds the force is a function of the parameters
alone; `stage` says how its errors follow from theirs. A rig is tared before each test: the offset
of a setting is the rig's, and no part of the forces, nor of what a click does. Only where a model
knows no gas the offset holds the gas force: it stays in the forces, and clicks are without it.
"""

from __future__ import annotations

import itertools
import math
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from damperfit.adjustment.level import STROKES, Level
from damperfit.adjustment.measured import measured_at
from damperfit.adjustment.stage import errors_parted, split
from damperfit.damper.model import Model
from damperfit.errors import SimulationError, sparing
from damperfit.parallel import apart, meanwhile, told_here
from damperfit.simulation import (
    NAMED_SPEEDS,
    Response,
    SolverOptions,
    signals_at_speeds,
    simulate,
    sine_motion,
)
from damperfit.statistics import NORMAL_95
from damperfit.tested.setting import ADJUSTER, lines_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.adjustment.stage import Stage
    from damperfit.errors import OnError
    from damperfit.recording import Trace
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty import SpeedForces

    FloatArray = NDArray[np.float64]

__all__ = [
    "Click",
    "Sine",
    "clicks",
    "fastest_sine",
    "levels",
    "levels_coming",
    "named_speeds",
    "sine_of",
]

# Forces at a speed move by less than 0.1 N from there to 4000 (`tests/test_told_figures.py`).
_SAMPLES_PER_CYCLE = 1000
_AS_FAST = 0.05  # rigs repeat a speed to 1 %
_SAME_STROKE = 0.05  # and a stroke no worse
_SINE = 0.1  # peak speed of a sine by its frequency against the one found; a triangle's is 36 % off
# Ahead of the cycle that counts, cycles and s; a damper's slowest pressure, at 80 1/s, has settled
# by then to 1e-8.
_LEAD, _SETTLING = 0.5, 0.25


@dataclass(frozen=True, slots=True)
class Sine:
    """The motion at which forces of all settings are compared.

    Attributes
    ----------
    amplitude, frequency : float
        m, Hz.
    was_run : bool
        It is a test's own motion; false where it stands for one that is no sine.
    """

    amplitude: float
    frequency: float
    was_run: bool = True

    @property
    def peak_speed(self) -> float:
        """Largest speed, m/s."""
        return 2.0 * math.pi * self.frequency * self.amplitude


@dataclass(frozen=True, slots=True)
class Click:
    """Change of force from one setting to the next one that was fitted.

    Attributes
    ----------
    first, second : Setting
        The two settings; more than one click apart where settings in between have no fit.
    speed : float
        m/s, positive.
    stroke : str
        "rebound" or "bump".
    adjuster : str
        Which was turned; the others are held.
    change, low, high : float
        Force of the second less that of the first with its 95 % interval, both without their
        offset, N. Negative in bump means a harder bump.
    percent, percent_low, percent_high : float
        How much harder, in per cent of the first one's damping: of the force less the gas force
        at mid-stroke and the offset. NaN where that is nothing.
    """

    first: Setting
    second: Setting
    speed: float
    stroke: str
    change: float
    low: float
    high: float
    percent: float
    percent_low: float
    percent_high: float
    adjuster: str = ADJUSTER


def sine_of(traces: Sequence[Trace]) -> Sine:
    """Return the sine that stands for the tests: that of the fastest speed that was run."""
    return fastest_sine(
        [
            (stretch.amplitude, stretch.frequency, stretch.peak_speed)
            for trace in traces
            for stretch in trace.stretches
        ]
    )


def fastest_sine(tested: Sequence[tuple[float, float, float]]) -> Sine:
    """Return the sine of the fastest motion, the middle one of those as fast.

    A motion that is no sine (a triangle, a road) stands for the sine of its stroke and speed.

    Parameters
    ----------
    tested : sequence of (float, float, float)
        Amplitude, frequency and peak speed of each motion: m, Hz, m/s.
    """
    fastest = max(speed for *_, speed in tested)
    near = [one for one in tested if one[2] >= (1.0 - _AS_FAST) * fastest]
    # Tests of one speed at several strokes have no motion in common: their means were never run.
    middle = sorted(near)[(len(near) - 1) // 2][0]
    alike = [one for one in near if abs(one[0] / middle - 1.0) <= _SAME_STROKE]
    amplitude, frequency = (median(one[k] for one in alike) for k in (0, 1))
    by_speed = max(speed for *_, speed in alike) / (2.0 * math.pi * amplitude)
    is_sine = abs(frequency / by_speed - 1.0) <= _SINE
    return Sine(amplitude, frequency if is_sine else by_speed, is_sine)


def named_speeds(sine: Sine) -> tuple[float, ...]:
    """Return the named test speeds that a sine reaches."""
    return tuple(speed for speed in NAMED_SPEEDS if speed < sine.peak_speed)


def levels(  # noqa: PLR0913 - one more than usual, to be told of errors
    stages: Sequence[Stage],
    damper: Model,
    sine: Sine,
    *,
    speeds: Sequence[float],
    solver: SolverOptions = SolverOptions(),
    jobs: int = 1,
    on_error: OnError | None = None,
) -> tuple[Level, ...]:
    """Return the forces of all settings at speeds, in both strokes; one simulation a setting.

    Parameters
    ----------
    stages : sequence of Stage
        Settings.
    damper : Model
        The damper's model.
    sine : Sine
        The motion.
    speeds : sequence of float
        Below the sine's peak speed, m/s.
    solver : SolverOptions
        How exactly to integrate.
    jobs : int
        Threads.
    on_error : callable, optional
        Told of a setting and the error that it met; without it such an error is raised.

    Returns
    -------
    tuple of Level
        By setting, speed and stroke. A setting that cannot be simulated is left out.
    """
    with levels_coming(
        stages, damper, sine, speeds=speeds, solver=solver, jobs=jobs, on_error=on_error
    ) as coming:
        return coming()


@contextmanager
def levels_coming(  # noqa: PLR0913 - as `levels`
    stages: Sequence[Stage],
    damper: Model,
    sine: Sine,
    *,
    speeds: Sequence[float],
    solver: SolverOptions = SolverOptions(),
    jobs: int = 1,
    measured: Sequence[SpeedForces] | None = None,
    on_error: OnError | None = None,
) -> Iterator[Callable[[], tuple[Level, ...]]]:
    """Let copies begin on what `levels` takes, and yield what gives its result.

    Beside forces as ``measured`` the offset of each setting is in them, as the rig's is.
    """
    lead = max(_LEAD, _SETTLING * sine.frequency)
    solver = replace(solver, settling=lead / sine.frequency)
    motion = sine_motion(
        sine.amplitude,
        sine.frequency,
        cycles=1.0 + lead,
        sample_rate=_SAMPLES_PER_CYCLE * sine.frequency,
    )

    take = None if on_error is None else told_here(on_error)
    by_stroke = None if measured is None else {(one.setting, one.stroke): one for one in measured}

    def one(stage: Stage) -> list[Level]:
        with sparing(stage.setting, take), suppress(SimulationError):
            response = simulate(
                stage.parameters,
                damper,
                motion,
                sensitivities=(*stage.own, *stage.shared),
                options=solver,
            )
            return _levels_of(stage, damper, response, sine, speeds, by_stroke)
        return []

    with meanwhile(one, stages, jobs=jobs) as coming:

        def found() -> tuple[Level, ...]:
            few = apart(one, stages, jobs=jobs) if coming is None else coming
            return tuple(itertools.chain.from_iterable(few))

        yield found


def _levels_of(
    stage: Stage,
    damper: Model,
    response: Response,
    sine: Sine,
    speeds: Sequence[float],
    measured: Mapping[tuple[Setting, str], SpeedForces] | None,
) -> list[Level]:
    holds_gas = damper.rest_force(0.0) is None  # the offset holds the gas force
    is_whole = measured is not None or holds_gas
    of_strokes = [(measured or {}).get((stage.setting, stroke)) for stroke in STROKES]
    names = (*stage.own, *stage.shared)
    signals = np.stack([response.force, *(response.sensitivities[name] for name in names)])
    values = signals_at_speeds(response, sine.frequency, signals, speeds=speeds)
    # u = ln y, but for linear quantities, which are in their unit.
    values_of = stage.parameters
    scales = [getattr(values_of, n) if values_of.quantity(n).is_logarithmic else 1.0 for n in names]
    slopes = values[1:].reshape(len(names), 2 * len(speeds)) * np.array(scales)[:, None]
    # The force without the offset has no slope by it.
    offsets, offset, offset_error = stage.offsets, stage.offset, stage.offset_error
    bare = np.array([0.0 if n in offsets else 1.0 for n in names])
    parts = errors_parted(stage)
    whole_errors = _sizes(*split(stage, parts, slopes)).tolist()
    rests, carried = split(stage, parts, slopes * bare[:, None])
    errors = whole_errors if is_whole else _sizes(rests, carried).tolist()
    forces = values[0].ravel() if is_whole else values[0].ravel() - offset
    is_cavitating = bool(response.pressures[:, -_SAMPLES_PER_CYCLE:].min() <= 0.0)
    at = itertools.product(speeds, zip(STROKES, of_strokes, strict=True))
    each = zip(at, forces.tolist(), errors, rests.tolist(), carried, whole_errors, strict=True)
    return [
        Level(
            stage.setting,
            speed,
            stroke,
            force,
            error,
            rest,
            of_shared,
            is_cavitating,
            tare=offset,
            tare_error=offset_error,
            whole_error=whole_error,
            is_whole=is_whole,
            holds_gas=holds_gas,
            **({} if known is None else measured_at(known, speed, sine)),
        )
        for (speed, (stroke, known)), force, error, rest, of_shared, whole_error in each
    ]


def _sizes(rests: FloatArray, carried: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(rests**2 + np.einsum("ij,ij->i", carried, carried)))


def clicks(found: Sequence[Level], damper: Model) -> tuple[Click, ...]:
    """Return the change of force between neighbouring settings, by speed and stroke.

    Neighbours differ in one adjuster alone; words are no neighbours.

    Parameters
    ----------
    found : sequence of Level
        As `levels` returns them.
    damper : Model
        For the gas force.
    """
    rest = damper.rest_force(0.0)
    gas = 0.0 if rest is None else float(rest)
    lines = lines_of(level.setting for level in found)
    levels_of = {
        setting: sorted(few, key=lambda one: one.speed)
        for setting, few in itertools.groupby(found, lambda one: one.setting)
    }
    return tuple(
        _click(first, second, gas, line.adjuster)
        for line in lines
        for a, b in itertools.pairwise(line.settings)
        for first, second in zip(levels_of[a], levels_of[b], strict=True)
    )


def _click(first: Level, second: Level, gas: float, adjuster: str) -> Click:
    change = second.bare_force - first.bare_force
    reach = NORMAL_95 * _spread(first, second)
    damping = first.bare_force - gas
    ratio = 1.0 + change / damping if damping else math.nan
    percent = 100.0 * (ratio - 1.0)
    # The first force is the denominator too: its error counts 1 + share times.
    spread = _spread(first, second, ratio=ratio)
    share = 100.0 * NORMAL_95 * spread / abs(damping) if damping else math.nan
    return Click(
        first=first.setting,
        second=second.setting,
        speed=first.speed,
        stroke=first.stroke,
        change=change,
        low=change - reach,
        high=change + reach,
        percent=percent,
        percent_low=percent - share,
        percent_high=percent + share,
        adjuster=adjuster,
    )


def _spread(first: Level, second: Level, *, ratio: float = 1.0) -> float:
    """Return the standard error of second - ratio first; NaN where one of both is not known."""
    if first.carried.shape != second.carried.shape:
        return math.nan
    apart = second.carried - ratio * first.carried
    rest = second.rest**2 + (ratio * first.rest) ** 2
    misfit = second.misfit**2 + (ratio * first.misfit) ** 2
    return math.sqrt(rest + misfit + float(apart @ apart))
