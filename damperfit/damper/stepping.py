"""A damper that another program steps, in the core's own numerics."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from damperfit.damper.model import RIG, Model, Values
from damperfit.damper.mounting import OF_LOAD_CELL
from damperfit.errors import ConfigurationError
from damperfit.simulation import Motion, SolverOptions

_ROOM = 1 << 14  # bytes; of the core's state, which it refuses if it is less than that


@dataclass(frozen=True, slots=True, eq=False)
class Step(Motion):
    """One step of a motion that goes on from `state`, two samples; of one sample its beginning."""

    state: bytearray = field(default_factory=lambda: bytearray(_ROOM))


def without_rig(values: Values) -> Values:
    """Return the values of the damper alone, as it is in a car: without mounting and tare."""
    rig = [q.name for q in values.quantities if q.scope == RIG or q.is_offset]
    return values.replace(dict.fromkeys({*rig, *OF_LOAD_CELL}.intersection(values.names), 0.0))


class SteppedDamper:
    """One setting, stepped by a program of the user's, as by the solver of a car.

    It begins at rest, all chambers at one pressure. Steps may be of any length: the core divides
    them as its tolerance asks. `copy` keeps a state to go back to, as after a rejected step.

    Parameters
    ----------
    damper, values : Model, Values
        Of the paper's damper or one of valves.
    x : float
        Displacement from mid-stroke at the beginning, m.
    with_rig : bool
        With the mounting and the tare; by default the damper alone. Lag and mass of a load cell
        are never in it.

    Raises
    ------
    ConfigurationError
        The model has no chambers that could be stepped.
    SimulationError
        The core cannot go there: `step`.
    """

    def __init__(
        self,
        damper: Model,
        values: Values,
        *,
        x: float = 0.0,
        options: SolverOptions = SolverOptions(),
        with_rig: bool = False,
    ) -> None:
        if not damper.signals:
            raise ConfigurationError(
                f"the model {damper.name} has no chambers that could be stepped; simulate it",
                code="other-model",
            )
        own = values if with_rig else without_rig(values)
        own = own.replace({name: 0.0 for name in values.names if name in OF_LOAD_CELL})
        self._how = (damper, own, options)
        self._at = (x, 0.0)
        self._state = bytearray(_ROOM)
        self.force, self.pressures = self._run(1.0, [x], [0.0])

    def step(self, x: float, v: float, dt: float) -> float:
        """Go on to x, m, and v, m/s, a time dt, s, later; return the force, N.

        Between them x is the cubic piece through both (x, v). `pressures` are then those there.
        """
        (x_0, v_0) = self._at
        self.force, self.pressures = self._run(dt, [x_0, x], [v_0, v])
        self._at = (x, v)
        return self.force

    def copy(self) -> Self:
        """Return the same damper in the same state, apart from this one."""
        return copy(self)  # a step makes a state of its own

    def _run(self, dt: float, x: list[float], v: list[float]) -> tuple[float, NDArray[np.float64]]:
        damper, values, options = self._how
        motion = Step(dt, np.array(x), np.array(v), state=bytearray(self._state))
        seen = damper.simulate(values, motion, sensitivities=(), options=options)
        self._state = motion.state  # not before: a step that is refused leaves all as it was
        return float(seen.force[-1]), np.array(seen.pressures[:, -1])
