"""What a damper engineer reads off a loop: peak forces, energy, hysteresis, pressures, cavitation.

Everything is taken over the last whole cycle of a response, where the start has died out. The
*opening* branch of a stroke runs from the end of the travel to the peak speed, the *closing* branch
from the peak speed to the other end. Hysteresis is opening minus closing force at half of the peak
speed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import SimulationError
from damperfit.passed_speeds import cycle_energies, in_both_strokes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.simulation.response import Response

# The test speeds that damper dynos use by habit, m/s.
NAMED_SPEEDS = (0.05, 0.1, 0.13, 0.26, 0.3, 0.52, 1.05)


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
            "at least one whole cycle is needed",
            code="too-short",
        )
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
