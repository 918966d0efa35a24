"""Motions that drive a damper: sampled displacement and velocity, sines, triangles."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from numbers import Real
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import ConfigurationError, SimulationError, refuse_wrong_arguments

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

_CHANNELS = ("displacement", "velocity")
_MAY_BE_UNKNOWN = ("gas_pressure", "temperature")


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
            is_unknown = value is None and name in _MAY_BE_UNKNOWN
            if type(value) is not float and not is_unknown and not isinstance(value, Real):
                raise SimulationError(
                    f"motion: expected a number for {name}, found {value!r}", code="not-a-number"
                )
        channels = {name: _as_numbers(name, getattr(self, name)) for name in _CHANNELS}
        shapes = tuple(channel.shape for channel in channels.values())
        if shapes[0] != shapes[1] or len(shapes[0]) != 1 or not shapes[0][0]:
            raise SimulationError(
                "motion: expected one axis of equal length, one sample or more, found "
                f"displacement of shape {shapes[0]} and velocity of shape {shapes[1]}",
                code="motion",
            )
        if not 0.0 < self.interval < math.inf:
            raise SimulationError(
                f"motion: expected an interval above 0, found {self.interval:g} s", code="motion"
            )
        for name, channel in channels.items():
            if not (is_finite := np.isfinite(channel)).all():
                at = int(np.argmin(is_finite))
                raise SimulationError(
                    f"motion: {name} is not a finite number at sample {at} (counted from 0)",
                    code="not-finite",
                )
        if np.size(self.jumps):
            if np.ndim(self.jumps) != 2 or np.shape(self.jumps)[1] != 4:
                raise SimulationError(
                    f"motion: expected jumps of shape (k, 4), found {np.shape(self.jumps)}",
                    code="motion",
                )
            if not np.all(np.isfinite(self.jumps)):
                raise SimulationError("motion: a number of jumps is not finite", code="motion")
            after = self.jumps[:, 0]
            if (
                after[0] <= 0.0
                or after[-1] > len(self.displacement) - 1
                or np.any(np.diff(after) <= 0.0)
            ):
                raise SimulationError(
                    "motion: expected jumps in order of time, after the first sample and not "
                    "after the last",
                    code="motion",
                )

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


def _as_numbers(name: str, channel: object) -> FloatArray:
    try:
        numbers = np.asarray(channel)
    except ValueError:  # rows of different lengths
        numbers = np.array(None)
    if numbers.dtype.kind not in "iuf":
        raise SimulationError(
            f"motion: expected an array of numbers for {name}, found {type(channel).__name__} of "
            "something else",
            code="not-a-number",
        )
    return numbers


def motion_of(trace: Trace) -> Motion:
    """Return the motion that drives a model for a trace."""
    return Motion(
        trace.interval,
        trace.drive.displacement,
        trace.drive.velocity,
        trace.start_time,
        trace.gas_pressure,
        trace.temperature,
        trace.drive.jumps,
    )


def refuse_amplitude(amplitude: float, room: float) -> None:
    """Refuse an amplitude, m, that leaves the shorter chamber no volume."""
    if amplitude >= room:
        raise ConfigurationError(
            f"amplitude {1e3 * amplitude:g} mm is beyond the damper's travel; expected less "
            f"than the shorter chamber, {1e3 * room:g} mm",
            code="stroke",
        )


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
        raise ConfigurationError(
            f"amplitude: expected a finite number, found {amplitude:g} m", code="not-finite"
        )
    wanted = {"frequency": (frequency, " Hz"), "cycles": (cycles, "")}
    for name, (value, unit) in (wanted | {"sample_rate": (sample_rate, " Hz")}).items():
        if not 0.0 < value < math.inf:
            raise ConfigurationError(
                f"expected a finite number above 0, found {value:g}{unit}",
                subject=name,
                code="out-of-range",
            )


def _times(duration: float, sample_rate: float) -> FloatArray:
    n = int(np.floor(duration * sample_rate + 1e-9)) + 1
    return np.arange(n, dtype=np.float64) / sample_rate
