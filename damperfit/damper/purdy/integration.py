"""Parameters of the paper's model and a displacement to the damper's response.

The core integrates the oil masses of chambers 1 and 2 (theory:
`damperfit.damper.purdy.parameters` for the symbols)::

    dm_1/dt = -w_1 + w_2        dm_2/dt = -w_2 + w_3        dm_3 = -(dm_1 + dm_2)
    P_i = max(0, K_e (m_i/(rho_0 V_i) - 1) + P_0)           (4) (7) (11) (12)
    P_3 = P_0 (V_g0/(V_g0 - dm_3/rho_0))^gamma              (17)
    f = P_1 a_p1 - P_2 a_p2 + f_f(v) + f_0 + a_r P_amb      (20), where P_amb = 0

by TR-BDF2 with a step that adapts to the reversals, and differentiates every converged stage, so
that the sensitivities are those of the numbers it returns. Three misprints of the paper are put
right here: (5) lacks a factor 1/rho_0, (17) has the wrong sign before m_3, and the root of (18) is
signed, because P_1 falls below P_3 for a fraction of a per cent of a cycle.
"""

from __future__ import annotations

from array import array
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from damperfit.compiled_core import compiled_core
from damperfit.damper.cylinder import filling
from damperfit.damper.network import purdy
from damperfit.damper.purdy.quantities import QUANTITIES
from damperfit.errors import SimulationError, did_you_mean
from damperfit.simulation import Response, Work, describe_ending

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.damper.purdy.parameters import Damper
    from damperfit.simulation import Motion, SolverOptions

    FloatArray = NDArray[np.float64]

__all__ = ["SENSITIVITY_NAMES", "integrate"]

SENSITIVITY_NAMES: tuple[str, ...] = (
    *(one.name for one in QUANTITIES),
    "gas_pressure",
    "gas_exponent",
)

# The root of valve 1 is rounded within 1 Pa of zero, so that its slope stays finite at a reversal:
# 100 Pa cost 0.01 to 0.02 N, 1 Pa cannot be seen (`tests/damper/test_rounded_root.py`).
_ROUNDING = 1.0

_NETWORK = purdy()
_PLACES = {name: place for place, name in enumerate(_NETWORK.numbers)}
_PLACES_OF_ALL = [
    *(_PLACES[one.name] for one in QUANTITIES),
    *(_PLACES[name] for name in ("gas_pressure", "gas_exponent", "gas_volume")),
]
_ZEROS = array("d", [0.0] * len(_PLACES))
_PASSAGES = np.array(
    [
        [p.start, p.end, *(_PLACES.get(name, -1) for name in p.numbers), p.is_two_way]
        for p in _NETWORK.passages
    ],
    dtype=np.intc,
)


def integrate(
    values: Values,
    damper: Damper,
    motion: Motion,
    *,
    sensitivities: Sequence[str],
    options: SolverOptions,
) -> Response:
    """Integrate the paper's equations, as `Model.simulate` asks for it.

    The first sample has one pressure in all chambers and the oil mass of the damper at x = 0;
    the steady cycle is reached within one cycle from there.

    Raises
    ------
    SimulationError
        When a state is not finite, a chamber has no volume left, or the step limit is met.
    """
    names = tuple(sensitivities)
    which = _places_of(names)
    x = np.ascontiguousarray(motion.displacement, dtype=np.float64)
    v = np.ascontiguousarray(motion.velocity, dtype=np.float64)
    jumps = np.ascontiguousarray(motion.jumps, dtype=np.float64)
    n = len(x)
    # One block: of many the C library gives each back to the system, and its pages come anew.
    block = np.empty((6 + len(names), n))
    pressures, masses, force, rows = block[:3], block[3:5], block[5], block[6:]
    filled = filling(motion, damper.gas_pressure)
    numbers = array("d", _ZEROS)
    gas = filled * damper.gas_pressure, damper.gas_exponent, damper.gas_volume
    for place, number in zip(_PLACES_OF_ALL, (*values.numbers, *gas), strict=True):
        numbers[place] = number
    code, steps, rejected, newton, sample = compiled_core().simulate_network(
        _body(damper), numbers, _PASSAGES, x, v, jumps, which, pressures, masses, force,
        rows, motion.interval, _ROUNDING, False, options.tolerance, options.dead_band,
        options.max_steps_per_sample,
    )  # fmt: skip
    if code:
        raise SimulationError(describe_ending(code, sample, motion, options))
    if "gas_pressure" in names:
        rows[names.index("gas_pressure")] *= filled
    time = np.arange(n, dtype=np.float64)
    time *= motion.interval
    time += motion.start_time
    return Response(
        time=time,
        displacement=x,
        velocity=v,
        force=force,
        pressures=pressures,
        masses=masses,
        sensitivities=dict(zip(names, rows, strict=True)),
        work=Work(steps, rejected, newton),
    )


# A fit asks for both at every simulation.
@lru_cache(maxsize=64)
def _places_of(names: tuple[str, ...]) -> array[int]:
    """Where the sensitivities' numbers are among the network's."""
    for name in names:
        if name not in SENSITIVITY_NAMES:
            hint = did_you_mean(name, SENSITIVITY_NAMES)
            known = ", ".join(SENSITIVITY_NAMES)
            raise SimulationError(f"no sensitivity by {name!r}; there are {known}.{hint}")
    return array("i", [_PLACES[name] for name in names])


@lru_cache(maxsize=64)
def _body(damper: Damper) -> bytes:
    """The order of `df_network` in network.h."""
    return array(
        "d",
        [
            damper.annulus_area,
            damper.piston_area,
            damper.chamber_1_volume,
            damper.chamber_2_volume,
            damper.oil_density,
            damper.rod_area * damper.ambient_pressure,
        ],
    ).tobytes()
