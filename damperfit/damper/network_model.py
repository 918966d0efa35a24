"""A damper of any layout and a displacement to its response.

The theory stands in `damperfit.damper.network`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.compiled_core import compiled_core
from damperfit.errors import ConfigurationError, SimulationError, did_you_mean
from damperfit.simulation import Response, SolverOptions, Work, describe_ending

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.network import Network
    from damperfit.damper.purdy.parameters import Damper
    from damperfit.damper.valve_dampers import ValveDamper
    from damperfit.simulation import Motion

    FloatArray = NDArray[np.float64]

__all__ = ["simulate_network"]


def simulate_network(
    network: Network,
    values: Mapping[str, float],
    damper: Damper | ValveDamper,
    motion: Motion,
    *,
    sensitivities: Sequence[str] = (),
    options: SolverOptions = SolverOptions(),
) -> Response:
    """Simulate a damper of any layout that is driven by a displacement.

    The start is that of `simulate`: one pressure in all chambers, the oil mass of x = 0.

    Parameters
    ----------
    network : Network
        Passages between the chambers.
    values : mapping of str to float
        SI, by the names of ``network.numbers``. Of the body's own only ``k_e`` and ``f_f`` are
        needed: free gas and offset are 0, the gas is the damper's, the mounting rigid.
    damper : Damper
        Geometry, oil and gas.
    motion : Motion
        Uniform samples of displacement and velocity.
    sensitivities : sequence of str
        Numbers to differentiate the force by: any of ``network.numbers``.
    options : SolverOptions
        Tolerance, dead band, rounding of the orifices' roots.

    Returns
    -------
    Response
        Force, pressures, masses and sensitivities at the samples. With a floating piston the second
        mass is that of chamber 2 at rest.

    Raises
    ------
    ConfigurationError
        A number is missing or unknown.
    SimulationError
        As `simulate`, and where a number is negative or not finite, or a passage has no resistance.

    Examples
    --------
    >>> from damperfit.damper.network import purdy
    >>> from damperfit.damper.purdy.parameters import PURDY_DAMPER
    >>> from damperfit.simulation import sine_motion
    >>> y = {"r_m1": 1.8e4, "r_m2": 3.527e6, "r_m3": 2.597e6, "k_e": 3.65e8, "f_f": 50.0}
    >>> motion = sine_motion(0.032, 1.5, cycles=4, sample_rate=1500)
    >>> round(float(simulate_network(purdy(), y, PURDY_DAMPER, motion).force[3100]))
    673
    """
    at_rest = {
        "free_gas": 0.0,
        "f_0": 0.0,
        "gas_pressure": damper.gas_pressure,
        "gas_exponent": damper.gas_exponent,
        "gas_volume": damper.gas_volume,
        "series_stiffness": 0.0,
        "play": 0.0,
        "drag": 0.0,
        "presliding": 0.0,
        "breakaway": 0.0,
        "stribeck_speed": 0.0,
        "seal_area": 0.0,
        "turning_speed": 0.0,
    }
    known = network.numbers
    numbers = at_rest | dict(values)
    for name in (*numbers, *sensitivities):
        if name not in known:
            raise ConfigurationError(
                f"no number {name!r} in {network.name}; there are {', '.join(known)}."
                f"{did_you_mean(name, known)}"
            )
    missing = [name for name in known if name not in numbers]
    if missing:
        raise ConfigurationError(f"{network.name} needs a value of {', '.join(missing)}")
    place = {"": -1} | {name: k for k, name in enumerate(known)}
    passages = [
        [p.start, p.end, *(place[name] for name in p.numbers), p.is_two_way]
        for p in network.passages
    ]
    x = np.ascontiguousarray(motion.displacement, dtype=np.float64)
    v = np.ascontiguousarray(motion.velocity, dtype=np.float64)
    jumps = np.ascontiguousarray(motion.jumps, dtype=np.float64)
    n = len(x)
    pressures, masses, force = np.empty((3, n)), np.empty((2, n)), np.empty(n)
    rows = np.empty((len(sensitivities), n))
    code, steps, rejected, newton, sample = compiled_core().simulate_network(
        _body(damper, network), np.array([numbers[name] for name in known], dtype=np.float64),
        np.array(passages, dtype=np.intc), x, v, jumps,
        np.array([place[name] for name in sensitivities], dtype=np.intc),
        pressures, masses, force, rows, motion.interval, options.rounding,
        network.has_floating_piston, options.tolerance, options.dead_band,
        options.max_steps_per_sample,
    )  # fmt: skip
    if code:
        raise SimulationError(describe_ending(code, sample, motion, options))
    return Response(
        time=motion.start_time + motion.interval * np.arange(n, dtype=np.float64),
        displacement=x,
        velocity=v,
        force=force,
        pressures=pressures,
        masses=masses,
        sensitivities=dict(zip(sensitivities, rows, strict=True)),
        work=Work(steps, rejected, newton),
    )


def _body(damper: Damper | ValveDamper, network: Network) -> FloatArray:
    """The order of `df_network` in network.h."""
    return np.array(
        [
            damper.annulus_area,
            damper.piston_area,
            damper.chamber_1_volume,
            damper.chamber_2_volume,
            damper.oil_density,
            damper.rod_area * network.ambient_pressure,
        ]
    )
