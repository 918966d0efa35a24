"""Force at speeds by setting, with errors.

The motion is one sine for all settings. At given speeds the force is a function of the parameters
alone; `stage` says how its errors follow from theirs. A rig is tared before each test: the offset
of a setting is the rig's, and no part of the forces, nor of what a click does. Only where a model
knows no gas the offset holds the gas force: it stays in the forces.
"""

from __future__ import annotations

import itertools
import math
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.adjustment.level import STROKES, Level
from damperfit.adjustment.measured import measured_at
from damperfit.adjustment.stage import errors_parted, split
from damperfit.damper.model import Model
from damperfit.errors import SimulationError, sparing
from damperfit.simulation import (
    NAMED_SPEEDS,
    Response,
    SolverOptions,
    signals_at_speeds,
    simulate,
    sine_motion,
)
from damperfit.workers import apart, meanwhile, told_here

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
    "Sine",
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
    """Return the sine of the fastest motion; of several as fast, that of the middle stroke.

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

    def one(stage: Stage) -> _ReadOff | None:
        with sparing(stage.setting, take), suppress(SimulationError):
            response = simulate(
                stage.parameters,
                damper,
                motion,
                sensitivities=(*stage.own, *stage.shared),
                options=solver,
            )
            return _read_off(stage, response, sine, speeds)
        return None

    def told(stages: Sequence[Stage], seen: Sequence[_ReadOff]) -> list[list[Level]]:
        return _with_errors(stages, seen, damper, sine, speeds, by_stroke)

    with meanwhile(one, stages, jobs=jobs) as coming:

        def found() -> tuple[Level, ...]:
            few = apart(one, stages, jobs=jobs) if coming is None else coming
            pairs = [pair for pair in zip(stages, few, strict=True) if pair[1] is not None]
            levels = _each(told, pairs, on_error)
            return tuple(itertools.chain.from_iterable(levels))

        yield found


@dataclass(frozen=True, slots=True, eq=False)
class _ReadOff:
    """Force and its slopes by own and shared values, u, at the speeds: (m,) and (k, m)."""

    forces: FloatArray
    slopes: FloatArray
    is_cavitating: bool


def _read_off(stage: Stage, response: Response, sine: Sine, speeds: Sequence[float]) -> _ReadOff:
    """Read off what the levels of a setting are made of."""
    names = (*stage.own, *stage.shared)
    signals = np.stack([response.force, *(response.sensitivities[name] for name in names)])
    values = signals_at_speeds(response, sine.frequency, signals, speeds=speeds)
    # u = ln y, but for linear quantities, which are in their unit.
    values_of = stage.parameters
    scales = [getattr(values_of, n) if values_of.quantity(n).is_logarithmic else 1.0 for n in names]
    slopes = values[1:].reshape(len(names), 2 * len(speeds)) * np.array(scales)[:, None]
    is_cavitating = bool(response.pressures[:, -_SAMPLES_PER_CYCLE:].min() <= 0.0)
    return _ReadOff(values[0].ravel(), slopes, is_cavitating)


def _each(
    told: Callable[[Sequence[Stage], Sequence[_ReadOff]], list[list[Level]]],
    pairs: Sequence[tuple[Stage, _ReadOff]],
    on_error: OnError | None,
) -> Iterator[list[Level]]:
    """Yield the levels of each setting: of all alike at once, one by one where that fails."""
    for _, alike in itertools.groupby(pairs, lambda pair: pair[0].kind):
        few = list(alike)
        try:
            yield from told(*zip(*few, strict=True))
        except Exception:  # noqa: BLE001 - whose it is shows below
            for stage, seen in few:
                with sparing(stage.setting, on_error):
                    yield from told((stage,), (seen,))


def _with_errors(
    stages: Sequence[Stage],
    seen: Sequence[_ReadOff],
    damper: Model,
    sine: Sine,
    speeds: Sequence[float],
    measured: Mapping[tuple[Setting, str], SpeedForces] | None,
) -> list[list[Level]]:
    """Return the levels of settings of one kind."""
    first, holds_gas = stages[0], damper.rest_force(0.0) is None  # the offset holds the gas force
    is_whole = measured is not None or holds_gas
    # The force without the offset has no slope by it.
    bare = np.array([0.0 if n in first.offsets else 1.0 for n in (*first.own, *first.shared)])
    slopes, parts = np.stack([one.slopes for one in seen]), errors_parted(*stages)
    whole_errors = _sizes(*split(first, parts, slopes))
    rests, carried = split(first, parts, slopes * bare[:, None])
    errors = whole_errors if is_whole else _sizes(rests, carried)
    forces = np.stack([one.forces for one in seen])
    if not is_whole:
        forces = forces - np.array([stage.offset for stage in stages])[:, None]
    columns = (one.tolist() for one in (forces, errors, rests, whole_errors))
    found = []
    for stage, one, of_all, *rows in zip(stages, seen, carried, *columns, strict=True):
        facts: dict[str, Any] = {
            "is_cavitating": one.is_cavitating,
            "tare": stage.offset,
            "tare_error": stage.offset_error,
            "is_whole": is_whole,
            "holds_gas": holds_gas,
        }
        at = itertools.product(speeds, STROKES)
        levels = []
        for (speed, stroke), of_shared, *row in zip(at, of_all, *rows, strict=True):
            force, error, rest, whole_error = row
            known = None if measured is None else measured.get((stage.setting, stroke))
            beside = facts if known is None else facts | measured_at(known, speed, sine)
            levels.append(
                Level(
                    stage.setting, speed, stroke, force, error, rest, of_shared,
                    whole_error=whole_error, **beside,
                )
            )  # fmt: skip
        found.append(levels)
    return found


def _sizes(rests: FloatArray, carried: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(rests**2 + np.einsum("...ij,...ij->...i", carried, carried)))
