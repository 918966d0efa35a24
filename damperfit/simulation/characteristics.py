"""What a damper engineer reads off a loop: peak forces, energy, hysteresis, pressures, cavitation.

Symbols: x displacement (m), v velocity (m/s), f force (N), P pressures (Pa), all positive in
rebound. Everything is taken over the last whole cycle of a response, where the start has died out.

The *opening* branch of a stroke runs from the end of the travel to the peak speed, the *closing*
branch from the peak speed to the other end. Hysteresis is opening minus closing force at one
speed, here half of the peak speed unless another is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.errors import SimulationError
from damperfit.passed_speeds import cycle_energies, in_both_strokes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.simulation.response import Response

    FloatArray = NDArray[np.float64]

__all__ = [
    "NAMED_SPEEDS",
    "Characteristics",
    "SpeedForce",
    "characterise",
    "mean_figures",
    "signals_at_speeds",
]

# What is averaged over cycles.
_MEANT = (
    *("peak_force_rebound", "peak_force_bump", "peak_speed_rebound", "peak_speed_bump"),
    *("energy", "hysteresis_speed", "hysteresis_rebound", "hysteresis_bump"),
)
# The test speeds that damper dynos use by habit, m/s.
NAMED_SPEEDS = (0.05, 0.1, 0.13, 0.26, 0.3, 0.52, 1.05)


@dataclass(frozen=True, slots=True)
class SpeedForce:
    """Force at one speed, mean of the opening and the closing branch.

    Attributes
    ----------
    speed : float
        m/s, positive.
    rebound, bump : float
        Force at v = +speed and at v = -speed, N.
    """

    speed: float
    rebound: float
    bump: float


@dataclass(frozen=True, slots=True)
class Characteristics:
    """Figures of one cycle.

    Attributes
    ----------
    peak_force_rebound, peak_force_bump : float
        Largest and smallest force, N (bump is negative).
    peak_speed_rebound, peak_speed_bump : float
        Largest speed of each stroke, m/s, positive.
    energy : float
        Work taken up in the cycle, the loop integral of f dx, J.
    hysteresis_speed : float
        Speed at which the hysteresis is taken, m/s.
    hysteresis_rebound, hysteresis_bump : float
        Opening minus closing force at that speed, N.
    pressure_ranges : tuple of (float, float)
        Lowest and highest pressure of chambers 1, 2, 3, Pa.
    cavitation_shares : tuple of float
        Share of the cycle with the chamber at zero pressure, for chambers 1, 2, 3.
    speed_forces : tuple of SpeedForce
        Forces at the named speeds that both strokes reach.
    """

    peak_force_rebound: float
    peak_force_bump: float
    peak_speed_rebound: float
    peak_speed_bump: float
    energy: float
    hysteresis_speed: float
    hysteresis_rebound: float
    hysteresis_bump: float
    pressure_ranges: tuple[tuple[float, float], ...]
    cavitation_shares: tuple[float, ...]
    speed_forces: tuple[SpeedForce, ...]


def characterise(
    response: Response,
    frequency: float,
    *,
    hysteresis_speed: float | None = None,
    speeds: Sequence[float] = NAMED_SPEEDS,
) -> Characteristics:
    """Return the figures of the last whole cycle of a response.

    Parameters
    ----------
    response : Response
        Periodic response on uniform samples, at least one cycle long.
    frequency : float
        Cycles per second, Hz.
    hysteresis_speed : float, optional
        Speed at which the hysteresis is taken, m/s; half of the lower peak speed by default.
    speeds : sequence of float
        Speeds at which forces are wanted, m/s; those that a stroke does not reach are left out.

    Raises
    ------
    SimulationError
        The response is shorter than one cycle.
    """
    cycle = _last_cycle(response, frequency)
    up, down = float(cycle.velocity.max()), float(-cycle.velocity.min())
    slower = min(up, down)
    speed = slower / 2.0 if hysteresis_speed is None else hysteresis_speed
    rebound = _branch_forces(cycle, speed)
    bump = _branch_forces(cycle, -speed)
    inside = cycle.pressures[:, 1:]  # the first sample is the last one of the cycle before
    return Characteristics(
        peak_force_rebound=float(cycle.force.max()),
        peak_force_bump=float(cycle.force.min()),
        peak_speed_rebound=up,
        peak_speed_bump=down,
        energy=_last_energy(response, frequency),
        hysteresis_speed=speed,
        hysteresis_rebound=rebound[0] - rebound[1],
        hysteresis_bump=bump[0] - bump[1],
        pressure_ranges=tuple((float(p.min()), float(p.max())) for p in cycle.pressures),
        cavitation_shares=tuple(float(np.mean(p <= 0.0)) for p in inside),
        speed_forces=tuple(
            SpeedForce(s, _mean(_branch_forces(cycle, s)), _mean(_branch_forces(cycle, -s)))
            for s in speeds
            if s < slower
        ),
    )


def mean_figures(cycles: Sequence[Characteristics]) -> Characteristics:
    """Return the mean of what is read off several cycles of one motion.

    Parameters
    ----------
    cycles : sequence of Characteristics
        The last cycle first: its pressures are kept. Of the named speeds those that all reach.
    """
    last = cycles[0]

    def mean(name: str) -> float:
        return float(np.mean([getattr(one, name) for one in cycles]))

    means: dict[str, Any] = {name: mean(name) for name in _MEANT}
    tables = [{at.speed: at for at in one.speed_forces} for one in cycles]
    return replace(
        last,
        **means,
        speed_forces=tuple(
            SpeedForce(
                at.speed,
                float(np.mean([table[at.speed].rebound for table in tables])),
                float(np.mean([table[at.speed].bump for table in tables])),
            )
            for at in last.speed_forces
            if all(at.speed in table for table in tables)
        ),
    )


def signals_at_speeds(
    response: Response,
    frequency: float,
    signals: FloatArray,
    *,
    speeds: Sequence[float] = NAMED_SPEEDS,
) -> FloatArray:
    """Return signals where each stroke passes given speeds, mean of opening and closing branch.

    With the force as signal this is `SpeedForce`; with its sensitivities, their derivative: the
    moments are the motion's alone.

    Parameters
    ----------
    response : Response
        Periodic response on uniform samples, at least one cycle long; its last cycle counts.
    frequency : float
        Cycles per second, Hz.
    signals : numpy.ndarray
        Shape (k, n), on the samples of the response.
    speeds : sequence of float
        m/s, positive.

    Returns
    -------
    numpy.ndarray
        Shape (k, number of speeds, 2): rebound and bump. NaN where a stroke does not reach a
        speed.

    Raises
    ------
    SimulationError
        The response is shorter than one cycle.
    """
    begin, first = _cycle_start(response, frequency)
    rows = np.vstack([response.velocity, signals])
    # Before the first sample behind it lies the cycle's beginning, between two samples or on one.
    before = max(first - 1, 0)
    step = response.time[first] - response.time[before]
    share = (begin - response.time[before]) / step if step > 0.0 else 0.0
    cycle = rows[:, before:].copy() if first else np.hstack([rows[:, :1], rows])
    cycle[:, 0] += share * (rows[:, first] - rows[:, before])
    rising = sorted(speeds)
    order = [rising.index(speed) for speed in speeds]
    _, means, _ = in_both_strokes(cycle[0], cycle[1:], rising)
    return 0.5 * (means[:, 0] + means[:, 1])[:, order].T


@dataclass(frozen=True, slots=True, eq=False)
class _Cycle:
    displacement: FloatArray
    velocity: FloatArray
    force: FloatArray
    pressures: FloatArray  # (3, n)


def _cycle_start(response: Response, frequency: float) -> tuple[float, int]:
    """Return where the last cycle begins, s, and the first sample after it."""
    time = response.time
    period = 1.0 / frequency
    slack = 1e-9 * period  # a whole cycle may come out a rounding error short
    begin = time[-1] - period
    # Where a cycle is no whole number of samples, the only one ends up to a sample early.
    if len(time) > 1 and time[0] - (time[1] - time[0]) < begin < time[0]:
        begin = time[0]
    if begin < time[0] - slack:
        cycles = (time[-1] - time[0]) * frequency
        raise SimulationError(
            f"the response lasts {cycles:.2f} cycles at {frequency:g} Hz: "
            "at least one whole cycle is needed"
        )
    return begin, int(np.searchsorted(time, begin + slack, side="right"))


def _last_energy(response: Response, frequency: float) -> float:
    begin, _ = _cycle_start(response, frequency)
    time = response.time
    interval = float(time[-1] - time[0]) / (len(time) - 1)
    edges = np.array([(begin - time[0]) / interval, len(time) - 1.0])
    return float(cycle_energies(response.velocity, response.force, edges, interval)[0])


def _last_cycle(response: Response, frequency: float) -> _Cycle:
    begin, first = _cycle_start(response, frequency)
    time = response.time

    def cut(signal: FloatArray) -> FloatArray:
        start = np.interp(begin, time, signal)
        return np.concatenate(([start], signal[first:]))

    return _Cycle(
        displacement=cut(response.displacement),
        velocity=cut(response.velocity),
        force=cut(response.force),
        pressures=np.stack([cut(p) for p in response.pressures]),
    )


def _branch_forces(cycle: _Cycle, velocity: float) -> tuple[float, float]:
    """Return the force on the opening and the closing branch where v passes ``velocity``."""
    towards = 1.0 if velocity > 0.0 else -1.0
    speed = cycle.velocity * towards - abs(velocity)  # first and last sample close the loop
    opening, closing = (
        float(_crossing_mean(speed, cycle.force[None, :], at)[0]) for at in _crossings(speed)
    )
    return opening, closing


def _crossings(speed: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the samples before each rise through zero, and before each fall."""
    before, after = speed[:-1], speed[1:]
    opening = np.flatnonzero((before < 0.0) & (after >= 0.0))
    return opening, np.flatnonzero((before >= 0.0) & (after < 0.0))


def _crossing_mean(speed: FloatArray, rows: FloatArray, at: NDArray[np.intp]) -> FloatArray:
    """Return the mean of each row, shape (k, n), where the speed passes zero."""
    if len(at) == 0:
        return np.full(len(rows), np.nan)
    share = speed[at] / (speed[at] - speed[at + 1])
    return np.asarray(np.mean(rows[:, at] + share * (rows[:, at + 1] - rows[:, at]), axis=1))


def _mean(pair: tuple[float, float]) -> float:
    return 0.5 * (pair[0] + pair[1])
