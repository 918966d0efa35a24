"""Rig tests that are no steady sine: displacement and velocity over time, and logs of them.

The force comes from `tests.oracles.model.solve`, which shares nothing with the compiled core. Logs
are raw: what the sensors saw, with their noise, and no filter.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from damperfit.damper.purdy.parameters import PURDY_DAMPER, Damper, Parameters, reference_parameters
from damperfit.recording import Recording
from tests.oracles.model import equal_pressure_start, instant, solve

FloatArray = NDArray[np.float64]
Function = Callable[[float], float]

RATE = 1000.0
AMPLITUDE = 0.032


@dataclass(frozen=True)
class Drive:
    """A motion over a time: x and v as functions of t, and the moments at which v jumps."""

    displacement: Function
    velocity: Function
    duration: float
    corners: tuple[float, ...] = ()


def steps(
    speeds: Sequence[float] = (0.05, 0.1, 0.2, 0.3),
    *,
    cycles: int = 5,
    amplitude: float = AMPLITUDE,
    rest: float = 1.0,
) -> Drive:
    """A rest, then so many cycles of a sine at each peak speed, one after the other."""
    rates = [speed / (2.0 * math.pi * amplitude) for speed in speeds]
    begins = [rest]
    for rate in rates:
        begins.append(begins[-1] + cycles / rate)

    def angle(t: float) -> tuple[float, float]:
        for begin, end, rate in zip(begins, begins[1:], rates, strict=False):
            if begin <= t < end:
                return 2.0 * math.pi * rate * (t - begin), 2.0 * math.pi * rate
        return 0.0, 0.0

    def displacement(t: float) -> float:
        return amplitude * math.sin(angle(t)[0])

    def velocity(t: float) -> float:
        phase, omega = angle(t)
        return amplitude * omega * math.cos(phase)

    return Drive(displacement, velocity, begins[-1], tuple(begins))


def sweep(
    low: float = 0.3, high: float = 4.0, *, duration: float = 20.0, amplitude: float = 0.012
) -> Drive:
    """A sine whose frequency rises evenly from low to high."""
    rise = (high - low) / duration

    def displacement(t: float) -> float:
        return amplitude * math.sin(2.0 * math.pi * (low + 0.5 * rise * t) * t)

    def velocity(t: float) -> float:
        rate = low + rise * t
        phase = 2.0 * math.pi * (low + 0.5 * rise * t) * t
        return amplitude * 2.0 * math.pi * rate * math.cos(phase)

    return Drive(displacement, velocity, duration)


def road(
    *,
    reach: float = 0.042,
    low: float = 0.2,
    high: float = 3.0,
    duration: float = 15.0,
    seed: int = 3,
) -> Drive:
    """Random motion between two frequencies that reaches so far out and in."""
    random = np.random.default_rng(seed)
    rates = np.arange(low, high, 1.0 / duration)
    sizes = random.standard_normal(len(rates)) / np.sqrt(rates)
    phases = random.uniform(0.0, 2.0 * math.pi, len(rates))
    time = np.arange(0.0, duration, 1e-3)
    waves = np.sin(2.0 * np.pi * rates[:, None] * time + phases[:, None])
    whole = sizes @ waves
    sizes *= 2.0 * reach / np.ptp(whole)
    middle = 0.5 * reach * 2.0 * (whole.max() + whole.min()) / np.ptp(whole)
    omega = 2.0 * np.pi * rates

    def displacement(t: float) -> float:
        return float(sizes @ np.sin(omega * t + phases)) - middle

    def velocity(t: float) -> float:
        return float((sizes * omega) @ np.cos(omega * t + phases))

    return Drive(displacement, velocity, duration)


def triangles(
    *speeds: float, cycles: int = 8, amplitude: float = AMPLITUDE, rest: float = 0.0
) -> Drive:
    """So many cycles of a triangle at each speed, one after the other."""
    periods = [4.0 * amplitude / speed for speed in speeds]
    begins = [rest]
    for period in periods:
        begins.append(begins[-1] + cycles * period)

    def place(t: float) -> tuple[float, float]:
        for begin, end, period in zip(begins, begins[1:], periods, strict=False):
            if begin <= t < end:
                return ((t - begin) / period) % 1.0, period
        return 0.0, math.inf

    def displacement(t: float) -> float:
        u, _ = place(t)
        return amplitude * (4.0 * u if u < 0.25 else 2.0 - 4.0 * u if u < 0.75 else 4.0 * u - 4.0)

    def velocity(t: float) -> float:
        u, period = place(t)
        return (1.0 if u < 0.25 or u >= 0.75 else -1.0) * 4.0 * amplitude / period

    corners = [
        begin + period * (k + part)
        for begin, period in zip(begins, periods, strict=False)
        for k in range(cycles)
        for part in (0.0, 0.25, 0.75)
    ]
    return Drive(displacement, velocity, begins[-1], tuple(corners))


def rounded(sharp: Drive, width: float = 4e-3) -> Drive:
    """The same with each corner turned at an even acceleration, within a time, as a rig does it."""
    corners = [*sharp.corners, sharp.duration]

    def displacement(t: float) -> float:
        low, high = t - 0.5 * width, t + 0.5 * width
        edges = [low, *corners[bisect_right(corners, low) : bisect_left(corners, high)], high]
        # Even speed between corners: the middle is the mean.
        parts = ((b - a) * sharp.displacement(0.5 * (a + b)) for a, b in pairwise(edges))
        return sum(parts) / width

    def velocity(t: float) -> float:
        ends = (sharp.displacement(t + 0.5 * width), sharp.displacement(t - 0.5 * width))
        return (ends[0] - ends[1]) / width

    # The third keeps the middle between two away from the turn, which is no rest.
    turns = [corner + part * width for corner in sharp.corners for part in (-0.5, 0.25, 0.5)]
    return Drive(displacement, velocity, sharp.duration - width, tuple(turns))


MOTIONS: dict[str, Callable[[], Drive]] = {
    "steps": steps,
    "three steps": lambda: steps((0.1, 0.2, 0.3)),
    "sweep": sweep,
    "road": road,
    # 0.48 m/s: chamber 2 empties now and then.
    "rough road": lambda: road(high=6.0),
    "triangle": lambda: triangles(0.2, cycles=15),
    "two triangles": lambda: triangles(0.1, 0.25),
    "rounded triangles": lambda: rounded(triangles(0.1, 0.25, rest=1.0)),
    "sine": lambda: steps((2.0 * math.pi * 1.5 * AMPLITUDE,), cycles=15, rest=0.0),
}


@cache
def solved(
    name: str, setting: int = 10, *, parameters: Parameters | None = None, rate: float = RATE
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return time, displacement and force of a motion, exact: SI, shape (n,) each."""
    drive = MOTIONS[name]()
    time = np.arange(round(drive.duration * rate)) / rate
    force = _force(parameters or reference_parameters(setting), PURDY_DAMPER, drive, time)
    return time, np.array([drive.displacement(t) for t in time.tolist()]), force


def _force(parameters: Parameters, damper: Damper, drive: Drive, time: FloatArray) -> FloatArray:
    """Integrate from corner to corner: no step may reach over one."""
    edges = [0.0, *(c for c in drive.corners if 0.0 < c < time[-1]), math.inf]
    start = equal_pressure_start(parameters, damper, drive.displacement(0.0))
    force = np.empty(len(time))
    at = 0.0
    for end in edges[1:]:
        inside = (time >= at) & (time < end)
        last = min(end, float(time[-1]))
        # The corner itself belongs to what follows.
        before = last - 1e-9 if last < time[-1] else last
        stamps = np.concatenate([[at], time[inside & (time > at)], [before]])
        motion = (drive.displacement, drive.velocity)
        if drive.velocity(0.5 * (at + last)) == 0.0:
            # At rest all pressures are one: no solver comes away from the root of a difference.
            still = instant(parameters, damper, *start, drive.displacement(at))
            force[inside] = still.oil_force + parameters.f_0
            at = last
            continue
        # LSODA is twenty times as fast as Radau and differs by 0.03 N at the corners of a triangle.
        seen = solve(
            parameters,
            damper,
            motion,
            np.unique(stamps),
            rtol=1e-9,
            start=start,
            max_step=5e-3,
            method="LSODA",
        )
        here = seen.time
        force[inside] = seen.force[np.isin(here, time[inside])]
        start = (float(seen.masses[0, -1]), float(seen.masses[1, -1]))
        at = last
    return force


def logged(
    name: str,
    setting: int = 10,
    *,
    seed: int = 1,
    force_noise: float = 4.0,
    displacement_noise: float = 3e-6,
    rate: float = RATE,
) -> Recording:
    """Return a raw log of a motion, with the noise of its sensors (rms, N and m)."""
    time, x, force = solved(name, setting, rate=rate)
    random = np.random.default_rng(seed)
    return Recording(
        name=f"{name}.csv",
        path=f"{name}.csv",
        sha256="",
        setting=setting,
        time=time,
        displacement=x + displacement_noise * random.standard_normal(len(x)),
        force=force + force_noise * random.standard_normal(len(force)),
    )
