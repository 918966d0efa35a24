"""A model and a displacement to the damper's response; the only door to the compiled core.

Motions that drive a damper (sampled displacement and velocity, sines, triangles), how exactly its
model is integrated, and what an engineer reads off the loop. That is taken over the last whole
cycle of a response, where the start has died out. The *opening* branch of a stroke runs from the
end of the travel to the peak speed, the *closing* branch from the peak speed to the other end.
Hysteresis is opening minus closing force at half of the peak speed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from numbers import Real
from typing import Any, NamedTuple

import numpy as np

from damperfit.arrays import FloatArray
from damperfit.errors import ConfigurationError, SimulationError, refuse_wrong_arguments
from damperfit.passed_speeds import cycle_energies, in_both_strokes
from damperfit.recording import Trace

# The test speeds that damper dynos use by habit, m/s.
NAMED_SPEEDS = (0.05, 0.1, 0.13, 0.26, 0.3, 0.52, 1.05)


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A displacement as uniform samples of position and velocity.

    Between samples x is the cubic Hermite piece of (x, v). With v from a cubic spline through x
    that is the spline itself.

    Attributes
    ----------
    interval : float
        Sample interval, s.
    displacement, velocity : numpy.ndarray
        Shape (n,); m and m/s, positive in rebound.
    start_time : float
        Time of the first sample, s.
    gas_pressure : float or None
        What the damper was filled to for this test, Pa absolute; None: as it is declared.
    temperature : float or None
        Mean over the test, degrees Celsius; None: it is not known.
    jumps : numpy.ndarray
        Where the speed jumps, shape (k, 4), in order of time: after how many samples from the
        first (a part of one counts), x there, and the speed before and after it. A sample at
        which it jumps has the speed after it.

    Raises
    ------
    SimulationError
        The channels differ in length, hold no sample or one that is no finite number, or the
        interval is not above 0.
    """

    interval: float
    displacement: FloatArray
    velocity: FloatArray
    start_time: float = 0.0
    gas_pressure: float | None = None
    temperature: float | None = None
    jumps: FloatArray = field(default_factory=lambda: np.empty((0, 4)))

    def __post_init__(self) -> None:
        """Refuse what is no motion."""
        for name in ("interval", "start_time", "gas_pressure", "temperature"):
            value = getattr(self, name)
            is_unknown = value is None and name in {"gas_pressure", "temperature"}
            if type(value) is not float and not is_unknown and not isinstance(value, Real):
                raise _no_motion(f"expected a number for {name}, found {value!r}", "not-a-number")
        channels = {
            name: _as_numbers(name, getattr(self, name)) for name in ("displacement", "velocity")
        }
        x, v = (channel.shape for channel in channels.values())
        if x != v or len(x) != 1 or not x[0]:
            raise _no_motion(
                "expected one axis of equal length, one sample or more, found displacement of "
                f"shape {x} and velocity of shape {v}"
            )
        if not 0.0 < self.interval < math.inf:
            raise _no_motion(f"expected an interval above 0, found {self.interval:g} s")
        for name, channel in channels.items():
            if not (is_finite := np.isfinite(channel)).all():
                where = f"at sample {int(np.argmin(is_finite))} (counted from 0)"
                raise _no_motion(f"{name} is not a finite number {where}", "not-finite")
        if not np.size(self.jumps):
            return
        if np.ndim(self.jumps) != 2 or np.shape(self.jumps)[1] != 4:
            raise _no_motion(f"expected jumps of shape (k, 4), found {np.shape(self.jumps)}")
        if not np.all(np.isfinite(self.jumps)):
            raise _no_motion("a number of jumps is not finite")
        after = np.array([0.0, *self.jumps[:, 0]])
        if np.any(np.diff(after) <= 0.0) or after[-1] > len(self.displacement) - 1:
            wanted = "jumps in order of time, after the first sample and not after the last"
            raise _no_motion(f"expected {wanted}")

    def until(self, first: int, stop: int) -> Motion:
        """Return the motion from one sample to before another."""
        at = self.jumps[:, 0]
        jumps = self.jumps[(at > first) & (at <= stop - 1)] - [first, 0.0, 0.0, 0.0]
        return replace(
            self,
            displacement=self.displacement[first:stop],
            velocity=self.velocity[first:stop],
            start_time=self.start_time + first * self.interval,
            jumps=jumps,
        )


# What dataclasses write says TypeError, of __init__.
Motion.__init__ = refuse_wrong_arguments("damperfit.Motion")(Motion.__init__)  # type: ignore[method-assign]


def _no_motion(what: str, code: str = "motion") -> SimulationError:
    return SimulationError(f"motion: {what}", code=code)


def _as_numbers(name: str, channel: object) -> FloatArray:
    try:
        numbers = np.asarray(channel)
    except ValueError:  # rows of different lengths
        numbers = np.array(None)
    if numbers.dtype.kind not in "iuf":
        kind = f"{type(channel).__name__} of something else"
        raise _no_motion(f"expected an array of numbers for {name}, found {kind}", "not-a-number")
    return numbers


def motion_of(trace: Trace) -> Motion:
    """Return the motion that drives a model for a trace."""
    drive, start = trace.drive, trace.start_time
    beside = start, trace.gas_pressure, trace.temperature, drive.jumps
    return Motion(trace.interval, drive.displacement, drive.velocity, *beside)


def refuse_amplitude(amplitude: float, room: float) -> None:
    """Refuse an amplitude, m, that leaves the shorter chamber no volume."""
    if amplitude >= room:
        text = (
            f"amplitude {1e3 * amplitude:g} mm is beyond the damper's travel; expected less than "
        )
        raise ConfigurationError(f"{text}the shorter chamber, {1e3 * room:g} mm", code="stroke")


def sine_motion(amplitude: float, frequency: float, *, cycles: float, sample_rate: float) -> Motion:
    """Return x = A sin(2 pi f t), A in m and f in Hz, from t = 0 to the end of the last cycle."""
    _refuse_wave(amplitude, frequency, cycles, sample_rate)
    phase = 2.0 * np.pi * frequency * _times(cycles / frequency, sample_rate)
    velocity = amplitude * 2.0 * np.pi * frequency * np.cos(phase)
    return Motion(1.0 / sample_rate, amplitude * np.sin(phase), velocity)


def triangle_motion(
    amplitude: float, frequency: float, *, cycles: float, sample_rate: float
) -> Motion:
    """Return a triangle wave that starts upwards from 0, sampled like `sine_motion`."""
    _refuse_wave(amplitude, frequency, cycles, sample_rate)
    phase = frequency * _times(cycles / frequency, sample_rate) + 0.25
    part = phase - np.floor(phase)
    displacement = amplitude * (1.0 - 4.0 * np.abs(part - 0.5))
    speed = 4.0 * amplitude * frequency
    velocity = np.where(part < 0.5, speed, -speed)
    # At a corner the velocity is the mean of both sides.
    at_corner = np.isclose(part[:, None], [0.0, 0.5, 1.0], atol=1e-9).any(axis=1)
    return Motion(1.0 / sample_rate, displacement, np.where(at_corner, 0.0, velocity))


def _refuse_wave(amplitude: float, frequency: float, cycles: float, sample_rate: float) -> None:
    if not math.isfinite(amplitude):
        text = f"amplitude: expected a finite number, found {amplitude:g} m"
        raise ConfigurationError(text, code="not-finite")
    wanted = {"frequency": (frequency, " Hz"), "cycles": (cycles, "")}
    for name, (value, unit) in (wanted | {"sample_rate": (sample_rate, " Hz")}).items():
        if not 0.0 < value < math.inf:
            text = f"expected a finite number above 0, found {value:g}{unit}"
            raise ConfigurationError(text, subject=name, code="out-of-range")


def _times(duration: float, sample_rate: float) -> FloatArray:
    n = int(np.floor(duration * sample_rate + 1e-9)) + 1
    return np.arange(n, dtype=np.float64) / sample_rate


@dataclass(frozen=True, slots=True)
class SolverOptions:
    """How exactly to integrate."""

    # Force error that one step may make, N. At 3 mN the force agrees with SciPy's Radau at rtol
    # 1e-10 within 0.1 N at every instant of the standard test, reversals included, and within
    # 0.02 N rms.
    tolerance: float = 3e-3
    # Half width of the friction's dead band, m/s: friction is f_f clip(v/dead_band, -1, 1). 0.1
    # mm/s lasts 0.07 ms at a reversal of the standard test.
    dead_band: float = 1e-4
    max_steps_per_sample: int = 10_000  # limit of work between two samples
    # Of a network only: pressure below which the root of an orifice is rounded, Pa. 100 Pa cost
    # less than 0.03 N (`tests/damper/test_core.py`) and make its sensitivities smoother.
    rounding: float = 100.0


class Work(NamedTuple):
    """What a simulation cost."""

    steps: int
    rejected: int
    newton_iterations: int


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """A damper's answer to a motion: arrays of shape (n,), unless another is given."""

    time: FloatArray  # s
    displacement: FloatArray  # m
    velocity: FloatArray  # m/s
    force: FloatArray  # N
    pressures: FloatArray  # shape (3, n), absolute pressure of chambers 1, 2, 3, Pa
    masses: FloatArray  # shape (2, n), oil mass in chambers 1 and 2, kg
    # By name the derivative of the force by that parameter, in SI.
    sensitivities: dict[str, FloatArray] = field(default_factory=dict)
    work: Work = field(default_factory=lambda: Work(0, 0, 0))


def simulate(
    values: Any,
    damper: Any,
    motion: Motion,
    *,
    sensitivities: Sequence[str] = (),
    options: SolverOptions = SolverOptions(),
) -> Response:
    """Simulate a damper that is driven by a displacement.

    The start of the paper's model and of networks has one pressure in all chambers and the oil mass
    of the damper at x = 0; the steady cycle is reached within one cycle from there.

    Examples
    --------
    >>> from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
    >>> from damperfit.simulation import sine_motion
    >>> y = Parameters(r_m1=1.8e4, r_m2=3.527e6, r_m3=2.597e6, k_e=3.65e8, f_f=50.0)
    >>> response = simulate(y, PURDY_DAMPER, sine_motion(0.032, 1.5, cycles=4, sample_rate=1500))
    >>> round(float(response.force[3100]))  # a tenth into the fourth cycle
    673
    """
    response: Response = damper.simulate(
        values, motion, sensitivities=tuple(sensitivities), options=options
    )
    return response


_ENDINGS = {
    1: "the state or the displacement is not a finite number",
    2: "the integrator needs more than {limit} steps between two samples",
    3: "the stroke leaves no volume in a chamber or in the gas",
    4: "a parameter or a solver option is zero, negative or not finite",
}


def describe_ending(code: int, sample: int, motion: Motion, options: SolverOptions) -> str:
    """Return the sentence of a simulation that ended with a code other than 0, at a sample."""
    what = _ENDINGS[code].format(limit=options.max_steps_per_sample)
    if sample >= len(motion.displacement):
        return f"simulation failed: {what}."
    moment = motion.start_time + sample * motion.interval
    x = motion.displacement[sample]
    return f"simulation failed at sample {sample} ({moment:.6g} s, x = {x:.6g} m): {what}."


@dataclass(frozen=True, slots=True)
class SpeedForce:
    """Force at one speed, mean of the opening and the closing branch."""

    speed: float  # m/s, positive
    rebound: float  # N, at v = +speed
    bump: float  # N, at v = -speed


@dataclass(frozen=True, slots=True)
class Characteristics:
    """Figures of one cycle, in SI."""

    peak_force_rebound: float
    peak_force_bump: float  # negative
    peak_speed_rebound: float
    peak_speed_bump: float  # positive
    energy: float  # work taken up in the cycle, the loop integral of f dx, J
    hysteresis_speed: float  # at which the hysteresis is taken
    hysteresis_rebound: float  # opening minus closing force at that speed
    hysteresis_bump: float
    pressure_ranges: tuple[tuple[float, float], ...]  # lowest and highest of chambers 1, 2, 3, Pa
    cavitation_shares: tuple[float, ...]  # of the cycle with chambers 1, 2, 3 at zero pressure
    speed_forces: tuple[SpeedForce, ...]  # at the named speeds that both strokes reach


def characterise(
    response: Response, frequency: float, *, speeds: Sequence[float] = NAMED_SPEEDS
) -> Characteristics:
    """Return the figures of the last whole cycle of a periodic response on uniform samples.

    Forces are taken at those of the rising speeds, m/s, that both strokes reach. A SimulationError:
    the response is shorter than one cycle.
    """
    time, period = response.time, 1.0 / frequency
    begin = time[-1] - period
    slack = 1e-9 * period  # a whole cycle may come out a rounding error short
    # Where a cycle is no whole number of samples, the only one ends up to a sample early.
    if len(time) > 1 and time[0] - (time[1] - time[0]) < begin < time[0]:
        begin = time[0]
    if begin < time[0] - slack:
        cycles = (time[-1] - time[0]) * frequency
        text = f"the response lasts {cycles:.2f} cycles at {frequency:g} Hz: at least one whole "
        raise SimulationError(f"{text}cycle is needed", code="too-short")
    first = int(np.searchsorted(time, begin + slack, side="right"))
    rows = np.vstack([response.velocity, response.force, response.pressures])
    start = [[np.interp(begin, time, row)] for row in rows]
    velocity, force, *pressures = np.hstack([start, rows[:, first:]])
    up, down = float(velocity.max()), float(-velocity.min())
    half = 0.5 * min(up, down)
    reached = [speed for speed in speeds if speed < 2.0 * half]
    # Of each stroke the opening and the closing branch, by speed.
    branches = in_both_strokes(velocity, force[None], reached)[1][..., 0].mean(axis=1)
    (rebound,), (bump,) = np.diff(in_both_strokes(velocity, force[None], [half])[1][:, ::-1, 0, 0])
    interval = float(time[-1] - time[0]) / (len(time) - 1)
    edges = np.array([(begin - time[0]) / interval, len(time) - 1.0])
    return Characteristics(
        peak_force_rebound=float(force.max()),
        peak_force_bump=float(force.min()),
        peak_speed_rebound=up,
        peak_speed_bump=down,
        energy=float(cycle_energies(response.velocity, response.force, edges, interval)[0]),
        hysteresis_speed=half,
        hysteresis_rebound=float(rebound),
        hysteresis_bump=float(bump),
        pressure_ranges=tuple((float(p.min()), float(p.max())) for p in pressures),
        # The first sample is the last one of the cycle before.
        cavitation_shares=tuple(float(np.mean(p[1:] <= 0.0)) for p in pressures),
        speed_forces=tuple(
            SpeedForce(speed, *forces)
            for speed, forces in zip(reached, branches.T.tolist(), strict=True)
        ),
    )
