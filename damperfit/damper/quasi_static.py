"""The quasi-static characteristic: the force of a damper at constant speed, by its valves alone.

What yields or lags is out: elasticity of oil and mounting, play, presliding, lag of the force
channel, moving mass (each quantity's `ideal`), and the rig's tare. A damper without them is steady
at once. Each stroke starts at rest and runs through its speeds upwards: what a chamber that
cavitates has lost in one stroke must not be in the force of the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from damperfit.arrays import FloatArray
from damperfit.damper.model import FRICTION, Model, Values
from damperfit.errors import ConfigurationError
from damperfit.simulation import Motion, SolverOptions, simulate

# A speed is held for so long, s: behind an orifice at 1000 bar rigid oil settles in 3 us. Without
# oil there is nothing that takes time; the way of a leg would be in the force of a spring.
_LEG, _LEG_NO_GAS = 1e-4, 1e-6
_SAMPLES = 4  # of a leg
# At constant speed friction is whole, however low the speed.
_SOLVER = SolverOptions(dead_band=1e-6)
# Seals add these to Coulomb's friction; the force is linear in each.
_FRICTION_PARTS = ("breakaway", "seal_area")


class QuasiStatic(NamedTuple):
    """Forces of one setting at constant speeds, all at one displacement."""

    speeds: FloatArray  # shape (m,), m/s, positive in rebound
    forces: FloatArray  # shape (m,): valves, friction, `rest` and `tare` in the sum, N
    # Force at rest at the displacement, N: gas against ambient pressure. Where the model knows no
    # gas, its offset, which then holds gas force and tare.
    rest: float
    knows_gas: bool  # the model has a gas of its own
    tare: float  # the rig's offset, as far as it is in the forces, N
    friction: FloatArray  # shape (m,): what of the force is friction, N, with the sign of the speed
    pressures: FloatArray  # shape (3, m), absolute, Pa; NaN where the model has none
    sensitivities: tuple[str, ...]  # quantities of the rows of `slopes`
    # Shape (k, m): derivatives of the forces by u, ln y of a logarithmic quantity and y of another,
    # N or N by its unit; 0 by what is out.
    slopes: FloatArray

    @property
    def damping(self) -> FloatArray:
        """Force of valves and friction alone, N: what a table of damping holds."""
        return self.forces - self.rest - self.tare

    @property
    def is_cavitating(self) -> NDArray[np.bool_]:
        """Where a chamber is at zero pressure, shape (m,)."""
        return np.asarray(np.nanmin(self.pressures, axis=0, initial=np.inf) <= 0.0)


def quasi_static(
    damper: Model,
    values: Values,
    speeds: ArrayLike,
    *,
    displacement: float = 0.0,
    with_tare: bool = False,
    sensitivities: Sequence[str] = (),
) -> QuasiStatic:
    """Return the forces of a damper at constant speeds, in the sum and in parts.

    Oil is incompressible here, and its density the declared one: a model with elastic oil has
    2 (P - P_0)/K_e more force behind an orifice, 2 % at 100 bar and 1 GPa.

    Speeds are in m/s, of any sign and order; at 0 the force is that at rest. The rod is at the
    displacement, m. A model of any kind will do, a `WithTemperature` one at its declared
    temperature. Of a rig nothing but its offset acts at constant speed: with the tare or without.

    Raises
    ------
    ConfigurationError
        A speed is not finite.
    SimulationError
        The damper cannot be at this displacement, or its valves let no oil through.

    Examples
    --------
    >>> from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
    >>> y = Parameters(r_m1=1.8e4, r_m2=3.527e6, r_m3=2.597e6, k_e=3.65e8, f_f=50.0, f_0=7.0)
    >>> curve = quasi_static(PURDY_DAMPER, y, [-0.1, 0.0, 0.1])
    >>> curve.forces.round(1).tolist(), curve.friction.tolist(), round(curve.rest, 1)
    ([-334.7, -130.4, 86.5], [-50.0, 0.0, 50.0], -130.4)
    """
    asked = np.atleast_1d(np.asarray(speeds, dtype=np.float64))
    if not np.all(np.isfinite(asked)):
        raise ConfigurationError(
            f"speeds: expected finite numbers, found {asked.tolist()}", code="not-finite"
        )
    if values.quantities != damper.quantities:
        # Those of an older run do not say what is ideal.
        values = damper.values(dict(values))
    offsets = [quantity.name for quantity in values.quantities if quantity.is_offset]
    gas = damper.rest_force(displacement)
    # Where the model knows no gas the rig's offset holds the gas force, and stays in any case.
    is_out = dict.fromkeys(offsets, 0.0) if gas is not None and not with_tare else {}
    is_out |= {q.name: q.ideal for q in damper.quantities if q.ideal is not None}
    ideal = values.replace(is_out)
    seals = [quantity.name for quantity in values.quantities if quantity.role == FRICTION]
    seals += [name for name in _FRICTION_PARTS if name in values.names]
    wanted = tuple(dict.fromkeys((*(n for n in sensitivities if n not in is_out), *seals)))
    forces, pressures = np.empty(len(asked)), np.empty((3, len(asked)))
    rows = {name: np.zeros(len(asked)) for name in (*wanted, *sensitivities)}
    for is_of_stroke in (asked >= 0.0, asked < 0.0):
        places = np.flatnonzero(is_of_stroke)
        if not len(places):
            continue
        places = places[np.argsort(np.abs(asked[places]), kind="stable")]
        motion, at = _steps(asked[places], displacement, _LEG if gas is not None else _LEG_NO_GAS)
        seen = simulate(ideal, damper, motion, sensitivities=wanted, options=_SOLVER)
        forces[places], pressures[:, places] = seen.force[at], seen.pressures[:, at]
        if gas is not None:
            forces[places] += gas - np.asarray(damper.rest_force(motion.displacement[at]))
        for name in wanted:
            # By u: y of a linear quantity, ln y of another.
            scale = getattr(ideal, name) if values.quantity(name).is_logarithmic else 1.0
            rows[name][places] = scale * seen.sensitivities[name][at]
    offset = sum(float(getattr(ideal, name)) for name in offsets)
    return QuasiStatic(
        speeds=asked,
        forces=forces,
        rest=offset if gas is None else float(np.asarray(gas).reshape(-1)[0]),
        knows_gas=gas is not None,
        tare=0.0 if gas is None else offset,
        friction=sum((rows[name] for name in seals), np.zeros(len(asked))),
        pressures=pressures,
        sensitivities=tuple(sensitivities),
        slopes=np.array([rows[n] for n in sensitivities]).reshape(len(sensitivities), len(asked)),
    )


def _steps(speeds: FloatArray, end: float, leg: float) -> tuple[Motion, NDArray[np.intp]]:
    """Return a motion through rising speeds of one stroke, and the last but one sample of each."""
    # The last is accelerated, which some models have a law for. What a cavitating chamber lacks at
    # one speed it lacks at the next.
    interval = leg / _SAMPLES
    v = np.repeat(speeds, _SAMPLES)
    x = interval * np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]))])
    at = np.arange(_SAMPLES - 2, len(v), _SAMPLES)
    return Motion(interval, end + x - x[at[-1]], v), at
