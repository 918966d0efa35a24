"""Force by speed of one setting, from the model on the tested motion, and what it leaves out.

The table is the mean of the opening and the closing branch of the tested sine, without what presses
at rest: gas must not stand in F(v), for a force at rest is no damping. What the rig adds (tare,
mounting, a late force channel) is no part of the damper and is left out as well. Beyond the tested
speed there is nothing unless it is asked for; then it is the model's at the tested stroke and a
higher frequency, for only one thing should leave the range that was tested.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from damperfit.adjustment import Sine
from damperfit.damper.mounting import NONE, Mounting
from damperfit.damper.valve_dampers import ValveDamper
from damperfit.errors import ConfigurationError
from damperfit.simulation import simulate, sine_motion

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.handover.handed_over import HandedOver, HandedSetting
    from damperfit.simulation import SolverOptions
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = ["ForceTable", "force_table", "force_tables", "without_rig"]

_CYCLES = 3  # the last counts: the steady cycle is reached within one
_SAMPLES = 2000  # a cycle
_BEYOND = 400  # samples a cycle beyond the tested speed
_POINTS = 30  # a side: programs that go straight from point to point then miss little of a knee
_FIRST = 0.02  # of the highest speed: friction jumps at 0, the table goes steeply through 0 0
_FARTHEST = 5.0  # times the tested speed; the model says little of the damper beyond
_GAS_POINTS = 13


@dataclass(frozen=True, slots=True, eq=False)
class ForceTable:
    """Mean of the opening and the closing branch, without gas force and tare.

    Attributes
    ----------
    setting : Setting
        Which.
    slug : str
        For names of files; no two settings of a damper have the same.
    mse_percent : float
        Of the fit; NaN where it is not known.
    speeds, forces : numpy.ndarray
        Rising, through 0 0; m/s and N, positive in rebound.
    tested_speed : float
        Highest speed of the tested motion, m/s; what lies beyond was never tested.
    stroke : float
        Amplitude of the tested motion, m.
    level : float
        What presses at rest at x = 0, N, positive in rebound; it is not in `forces`.
    gas_displacements, gas_forces : numpy.ndarray
        The same over the tested stroke, m and N; one point where the model has no gas of its own.
    has_gas : bool
        The model knows its gas; otherwise the level is read off the loop, a tare included.
    """

    setting: Setting
    slug: str
    mse_percent: float
    speeds: FloatArray
    forces: FloatArray
    tested_speed: float
    stroke: float
    level: float
    gas_displacements: FloatArray
    gas_forces: FloatArray
    has_gas: bool

    @property
    def is_extended(self) -> bool:
        """Whether it goes beyond the tested speed."""
        return bool(self.speeds[-1] > self.tested_speed * (1.0 + 1e-9))

    def at_rest(self, displacement: FloatArray) -> FloatArray:
        """Return the force at no speed, N."""
        return np.asarray(np.interp(displacement, self.gas_displacements, self.gas_forces))


def force_tables(handed: HandedOver, *, extend: float | None = None) -> tuple[ForceTable, ...]:
    """Return the table of each setting, all on the same speeds.

    Parameters
    ----------
    handed : HandedOver
        The damper.
    extend : float, optional
        Speed up to which the tables go, m/s.

    Raises
    ------
    ConfigurationError
        ``extend`` is not above the tested speed, or far beyond it.
    SimulationError
        The model cannot be integrated over the motion.
    """
    tables = [force_table(handed, one, extend=extend) for one in handed.settings]
    slugs: dict[str, int] = {}
    for k, table in enumerate(tables):
        # Labels that differ in signs alone, or in capitals, must not share a file.
        seen = slugs[table.slug.casefold()] = slugs.get(table.slug.casefold(), 0) + 1
        tables[k] = table if seen == 1 else replace(table, slug=f"{table.slug}_{seen}")
    return tuple(tables)


def force_table(
    handed: HandedOver, one: HandedSetting, *, extend: float | None = None
) -> ForceTable:
    """Return the table of a setting; parameters and errors are those of `force_tables`."""
    damper, values = without_rig(handed.damper, one.values)
    sine = handed.motion
    speeds, forces, level = _tested(damper, values, sine, handed.solver)
    if extend is not None:
        more = _speeds_beyond(sine.peak_speed, extend)
        up, down = _beyond(damper, values, sine, handed.solver, more, level)
        speeds = np.concatenate([-more[::-1], speeds, more])
        forces = np.concatenate([down[::-1], forces, up])
    x = np.linspace(-sine.amplitude, sine.amplitude, _GAS_POINTS)
    gas = damper.rest_force(x)
    return ForceTable(
        one.setting,
        one.setting.slug,
        one.mse_percent,
        speeds,
        forces,
        sine.peak_speed,
        sine.amplitude,
        level,
        np.zeros(1) if gas is None else x,
        np.array([level]) if gas is None else gas,
        gas is not None,
    )


@lru_cache(maxsize=128)
def without_rig(damper: Model, values: Values) -> tuple[Model, Values]:
    """Return the damper without what the rig adds to its force: tare, mounting, late channel.

    Where the model knows no gas of its own the offset holds the gas force, and stays.
    """
    if isinstance(damper, ValveDamper):
        bare: Model = replace(damper, mounting=Mounting(series_stiffness=NONE))
        values = bare.values({name: getattr(values, name) for name in bare.names})
        damper = bare
    if damper.rest_force(0.0) is not None:
        offsets = {one.name: 0.0 for one in values.quantities if one.is_offset}
        values = values.replace(offsets)
    return damper, values


@lru_cache(maxsize=512)
def _tested(
    damper: Model, values: Values, sine: Sine, solver: SolverOptions
) -> tuple[FloatArray, FloatArray, float]:
    """Return speeds, forces and the level at rest on the tested motion."""
    top = sine.peak_speed
    side = np.concatenate([[_FIRST * top], np.linspace(0.0, top, _POINTS)[1:]])
    grid = np.concatenate([-side[::-1], [0.0], side])
    mean = _mean_branches(damper, values, sine, solver, grid)
    known = damper.rest_force(0.0)
    level = float(mean[_POINTS]) if known is None else float(np.asarray(known).reshape(-1)[0])
    if known is None:
        mean = mean - level
    mean[_POINTS] = 0.0
    for one in (grid, mean):
        one.flags.writeable = False  # they are kept, and given to everybody
    return grid, mean, level


def _speeds_beyond(tested: float, extend: float) -> FloatArray:
    if not (math.isfinite(extend) and tested < extend <= _FARTHEST * tested):
        raise ConfigurationError(
            f"--extend {extend:g} m/s: expected a speed above the tested {tested:.4g} m/s and up "
            f"to {_FARTHEST:g} times it; leave --extend out for a table of what was tested"
        )
    n = math.ceil((extend - tested) / (tested / (_POINTS - 1)) - 1e-9)
    return np.linspace(tested, extend, n + 1)[1:]


def _beyond(
    damper: Model,
    values: Values,
    sine: Sine,
    solver: SolverOptions,
    speeds: FloatArray,
    level: float,
) -> tuple[FloatArray, FloatArray]:
    """Return the model's forces beyond the tested speed, in rebound and in bump.

    Each is read at the peak of a sine of its own, in the middle of the stroke: on a faster sine
    the branches lie so far apart that their mean would step up from the tested part.
    """
    found = np.empty((2, len(speeds)))
    for k, speed in enumerate(speeds):
        frequency = float(speed) / (2.0 * math.pi * sine.amplitude)
        rate = _BEYOND * frequency
        motion = sine_motion(sine.amplitude, frequency, cycles=_CYCLES, sample_rate=rate)
        response = simulate(values, damper, motion, options=solver)
        at = [len(response.force) - 1, len(response.force) - 1 - _BEYOND // 2]
        found[:, k] = response.force[at] - level
    return found[0], found[1]


def _mean_branches(
    damper: Model, values: Values, sine: Sine, solver: SolverOptions, grid: FloatArray
) -> FloatArray:
    """Return the mean force of both branches at speeds, N, without the damper's gas force."""
    rate = _SAMPLES * sine.frequency
    motion = sine_motion(sine.amplitude, sine.frequency, cycles=_CYCLES, sample_rate=rate)
    response = simulate(values, damper, motion, options=solver)
    x, v = response.displacement[-_SAMPLES:], response.velocity[-_SAMPLES:]
    at_rest = damper.rest_force(x)
    force = response.force[-_SAMPLES:] - (0.0 if at_rest is None else at_rest)
    opening = np.gradient(v) > 0.0
    rise, fall = (_branch(v[part], force[part], grid) for part in (opening, ~opening))
    return 0.5 * (rise + fall)


def _branch(v: FloatArray, force: FloatArray, grid: FloatArray) -> FloatArray:
    order = np.argsort(v, kind="stable")
    return np.asarray(np.interp(grid, v[order], force[order]))
