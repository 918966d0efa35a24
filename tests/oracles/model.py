"""The damper's model in plain words, slow and obvious: the twin that the compiled core must match.

Nothing here is shared with the core or with ``damperfit.synthetic``: geometry, volumes, pressures,
flows and force are written out again, one line each, in the order of the theory. The state is the
oil mass in chambers 1 and 2 (kg); chamber 3 holds the rest, because no oil is lost.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from damperfit.damper.purdy.parameters import Damper, Parameters

FloatArray = NDArray[np.float64]
Function = Callable[[float], float]


class Instant(NamedTuple):
    """Everything that can be said about the damper at one moment, SI."""

    volume_1: float
    volume_2: float
    gas_volume: float
    pressure_1: float
    pressure_2: float
    pressure_3: float
    flow_1: float
    flow_2: float
    flow_3: float
    rate_1: float
    rate_2: float
    oil_force: float


@dataclass(frozen=True)
class Oracle:
    """A solved motion: masses (2, n), pressures (3, n), flows (3, n), force (n,) at ``time``."""

    time: FloatArray
    masses: FloatArray
    pressures: FloatArray
    flows: FloatArray
    force: FloatArray


def rest_masses(damper: Damper) -> tuple[float, float]:
    """Oil in chambers 1 and 2 at x = 0 and P_0."""
    rod = math.pi * damper.rod_diameter**2 / 4
    bore = math.pi * damper.piston_diameter**2 / 4
    return (
        damper.oil_density * damper.chamber_1_length * (bore - rod),
        damper.oil_density * damper.chamber_2_length * bore,
    )


def instant(
    parameters: Parameters, damper: Damper, mass_1: float, mass_2: float, x: float
) -> Instant:
    """Work out volumes, pressures, valve flows and rates of change for one state."""
    rod = math.pi * damper.rod_diameter**2 / 4
    bore = math.pi * damper.piston_diameter**2 / 4
    annulus = bore - rod
    volume_1 = damper.chamber_1_length * annulus - x * annulus
    volume_2 = damper.chamber_2_length * bore + x * bore

    # Oil squeezed into a chamber raises its pressure; it cannot pull below zero (cavitation).
    stretch_1 = mass_1 / (damper.oil_density * volume_1) - 1
    stretch_2 = mass_2 / (damper.oil_density * volume_2) - 1
    pressure_1 = max(0.0, parameters.k_e * stretch_1 + damper.gas_pressure)
    pressure_2 = max(0.0, parameters.k_e * stretch_2 + damper.gas_pressure)

    # What chambers 1 and 2 have lost, chamber 3 has gained, and the gas gives way for it.
    rest_1, rest_2 = rest_masses(damper)
    gained_3 = (rest_1 - mass_1) + (rest_2 - mass_2)
    gas_at_rest = damper.gas_length * math.pi * damper.gas_piston_diameter**2 / 4
    gas_volume = gas_at_rest - gained_3 / damper.oil_density
    pressure_3 = damper.gas_pressure * (gas_at_rest / gas_volume) ** damper.gas_exponent

    # Valve 1 passes both ways, with a square root; valves 2 and 3 are linear and pass one way.
    drop_1 = pressure_1 - pressure_3
    flow_1 = math.copysign(math.sqrt(abs(drop_1)), drop_1) / parameters.r_m1
    flow_2 = max(0.0, pressure_2 - pressure_1) / parameters.r_m2
    flow_3 = max(0.0, pressure_3 - pressure_2) / parameters.r_m3
    oil_force = pressure_1 * annulus - pressure_2 * bore
    rates = -flow_1 + flow_2, -flow_2 + flow_3
    pressures, flows = (pressure_1, pressure_2, pressure_3), (flow_1, flow_2, flow_3)
    return Instant(volume_1, volume_2, gas_volume, *pressures, *flows, *rates, oil_force)


def friction_share(velocity: float, dead_band: float = 1e-4) -> float:
    """Share of the Coulomb force in effect: -1 to 1, linear inside the dead band."""
    return min(1.0, max(-1.0, velocity / dead_band))


def equal_pressure_start(parameters: Parameters, damper: Damper, x: float) -> tuple[float, float]:
    """Masses at ``x`` with all three chambers at one pressure and no oil gained or lost."""
    rest_1, rest_2 = rest_masses(damper)
    volume_1 = (damper.chamber_1_length - x) * rest_1 / damper.oil_density
    volume_1 /= damper.chamber_1_length
    volume_2 = (damper.chamber_2_length + x) * rest_2 / damper.oil_density
    volume_2 /= damper.chamber_2_length
    gas_at_rest = damper.gas_length * math.pi * damper.gas_piston_diameter**2 / 4

    def masses(pressure: float) -> tuple[float, float]:
        density = damper.oil_density * (1 + (pressure - damper.gas_pressure) / parameters.k_e)
        return density * volume_1, density * volume_2

    def surplus(pressure: float) -> float:
        mass_1, mass_2 = masses(pressure)
        squeeze = (damper.gas_pressure / pressure) ** (1 / damper.gas_exponent)
        gained_3 = damper.oil_density * gas_at_rest * (1 - squeeze)
        return (mass_1 - rest_1) + (mass_2 - rest_2) + gained_3

    low, high = 1e-3 * damper.gas_pressure, 1e3 * damper.gas_pressure
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if surplus(middle) < 0 else (low, middle)
    return masses((low + high) / 2)


def sine(amplitude: float, frequency: float, phase: float = 0.0) -> tuple[Function, Function]:
    """Displacement A sin(2 pi (f t + phase)) and its velocity, as functions of time."""
    omega = 2 * math.pi * frequency
    shift = 2 * math.pi * phase
    return (
        lambda t: amplitude * math.sin(omega * t + shift),
        lambda t: amplitude * omega * math.cos(omega * t + shift),
    )


def solve(
    parameters: Parameters,
    damper: Damper,
    motion: tuple[Function, Function],
    time: FloatArray,
    *,
    rtol: float = 1e-10,
    max_step: float = 2e-3,
    dead_band: float = 1e-4,
    start: tuple[float, float] | None = None,
    method: str = "Radau",
) -> Oracle:
    """Integrate from rest at ``time[0]`` with SciPy and work the force out at every ``time``."""
    displacement, velocity = motion

    def rates(t: float, masses: FloatArray) -> tuple[float, float]:
        mass_1, mass_2 = masses.tolist()  # Python's floats: NumPy's take three times as long
        now = instant(parameters, damper, mass_1, mass_2, displacement(t))
        return now.rate_1, now.rate_2

    begin = float(time[0])
    first = start or equal_pressure_start(parameters, damper, displacement(begin))
    with np.errstate(divide="ignore", over="ignore"):  # a step without error is no trouble
        solution = solve_ivp(
            rates,
            (begin, float(time[-1])),
            first,
            method=method,
            t_eval=time,
            rtol=rtol,
            atol=[1e-6 * rtol * m for m in first],
            max_step=max_step,
        )
    if not solution.success:
        raise AssertionError(f"the oracle stopped: {solution.message}")
    moments = [
        instant(parameters, damper, m_1, m_2, displacement(t))
        for t, m_1, m_2 in zip(time, solution.y[0], solution.y[1], strict=True)
    ]
    friction = [
        parameters.f_f * friction_share(velocity(t), dead_band) + parameters.f_0 for t in time
    ]
    return Oracle(
        time=np.asarray(time, dtype=float),
        masses=solution.y,
        pressures=np.array([[m.pressure_1, m.pressure_2, m.pressure_3] for m in moments]).T,
        flows=np.array([[m.flow_1, m.flow_2, m.flow_3] for m in moments]).T,
        force=np.array([m.oil_force for m in moments]) + np.array(friction),
    )


def dissipation(
    parameters: Parameters, damper: Damper, pressures: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Power lost in valves 1, 2, 3 (W, shape (n,)) from pressures (3, n) and the valve laws."""
    p_1, p_2, p_3 = pressures
    k_e, rho, p_0 = parameters.k_e, damper.oil_density, damper.gas_pressure
    h_1 = k_e / rho * np.log1p((p_1 - p_0) / k_e)
    h_2 = k_e / rho * np.log1p((p_2 - p_0) / k_e)
    h_3 = (p_3 - p_0) / rho
    w_1 = np.sign(p_1 - p_3) * np.sqrt(np.abs(p_1 - p_3)) / parameters.r_m1
    w_2 = np.maximum(0, p_2 - p_1) / parameters.r_m2
    w_3 = np.maximum(0, p_3 - p_2) / parameters.r_m3
    return w_1 * (h_1 - h_3), w_2 * (h_2 - h_1), w_3 * (h_3 - h_2)


def cycle_energy(time: FloatArray, force: FloatArray, velocity: FloatArray) -> float:
    """Work done on the damper, J, by Simpson's rule over the samples."""
    from scipy.integrate import simpson

    return float(simpson(force * velocity, x=time))
