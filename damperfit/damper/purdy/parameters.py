"""The damper as a device (`Damper`) and the numbers that a fit finds (`Parameters`).

Symbols are those of D. J. Purdy, "Theoretical and experimental investigation into an adjustable
automotive damper", Proc. IMechE D, 2000 (*the paper*).

    d_r d_p d_g    rod, piston and gas piston diameters        m
    l_1 l_2 l_g    chamber 1, chamber 2 and gas lengths        m, at x = 0
    rho_0 P_0      oil density and absolute pressure at rest   kg/m3, Pa
    gamma          polytropic exponent of the gas
    a_p2 a_r a_p1  full bore, rod and annulus areas            m2
    R_m1           valve 1, w = sgn(dP) sqrt(abs(dP))/R_m1     s sqrt(N)/(m kg)
    R_m2 R_m3      valves 2 and 3, w = max(0, dP)/R            N s/(m2 kg)
    K_e f_f f_0    effective bulk modulus, friction, force offset   Pa, N, N

Slips of the paper's text, and what damperfit uses
--------------------------------------------------
    (5)            lacks 1/rho_0: rho = rho_0 (1 + (1/rho_0)(drho/dP)(P - P_0))
    (17)           V_g0 + m_3/rho_0: the sign is minus, oil entering chamber 3 compresses the gas
    (18)           sqrt(P_1 - P_3): the root is signed, P_1 < P_3 for 0.1 to 0.4 % of a cycle
    (25), (26)     numerator K_e K_B: K_g K_B
    (33), (35)     sign of eta opposite to (16): eta = -x a_r/a_g is kept
    4.1.2          "valve 2, R_m1": R_m2
    Fig. 8         caption K_c: K_e

The core integrates the oil masses of chambers 1 and 2::

    dm_1/dt = -w_1 + w_2        dm_2/dt = -w_2 + w_3        dm_3 = -(dm_1 + dm_2)
    P_i = max(0, K_e (m_i/(rho_0 V_i) - 1) + P_0)           (4) (7) (11) (12)
    P_3 = P_0 (V_g0/(V_g0 - dm_3/rho_0))^gamma              (17)
    f = P_1 a_p1 - P_2 a_p2 + f_f(v) + f_0 + a_r P_amb      (20), where P_amb = 0

The ranges of the parameters are a factor of a hundred or more beyond any car damper on both sides;
the fallbacks are the paper's published values.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from damperfit.arrays import FloatArray
from damperfit.damper.cylinder import F_0, F_F, K_E, RANGES, Cylinder
from damperfit.damper.model import DAMPER, VISCOUS, FurtherStart, Quantity, Values
from damperfit.errors import ConfigurationError, SimulationError, refuse_wrong_arguments

if TYPE_CHECKING:
    from damperfit.damper.cylinder import Cavitation
    from damperfit.damper.model import Names
    from damperfit.damper.network import Network
    from damperfit.recording import Trace
    from damperfit.simulation import Response, SolverOptions


QUANTITIES = (
    Quantity(
        "r_m1", "R_m1", "valve 1 (adjuster)", "resistance of valve 1, the adjuster",
        "s sqrt(N)/(m kg)", (1e1, 1e7), power=3, shown_unit="10³ s √N / (m kg)",
    ),
    Quantity(
        "r_m2", "R_m2", "valve 2 (compression)", "resistance of valve 2, open in compression",
        "N s/(m2 kg)", (1e3, 1e10), power=6, shown_unit="10⁶ N s / (m² kg)", role=VISCOUS,
    ),
    Quantity(
        "r_m3", "R_m3", "valve 3 (rebound)", "resistance of valve 3, open in rebound",
        "N s/(m2 kg)", (1e3, 1e10), scope=DAMPER, fallback=2.597e6, power=6,
        shown_unit="10⁶ N s / (m² kg)", role=VISCOUS,
    ),
    replace(K_E, is_open=True, trend_degree=2),
    replace(F_F, fallback=50.0),
    replace(F_0, default=0.0),
)  # fmt: skip

DAMPER_RANGES = {name: limits for name, limits in RANGES.items() if name != "gas_volume"}


@dataclass(frozen=True, slots=True)
class Parameters(Values):
    """The parameters y of eq. (21) and the force offset f_0 of a tared rig, in SI."""

    quantities: ClassVar[tuple[Quantity, ...]] = QUANTITIES

    r_m1: float
    r_m2: float
    r_m3: float
    k_e: float
    f_f: float
    f_0: float = 0.0


@dataclass(frozen=True, slots=True)
class Damper(Cylinder):
    """Geometry, oil and gas of a damper; the defaults are Table 1 of the paper.

    The paper does not print P_0 and gamma. P_0 = 0.46 MPa is recovered from its section 6.2
    (R_m3 = 2.597e6 lies 15 % below the onset of cavitation); gamma = 1.4 is nitrogen's.
    Its eq. (20) leaves out the air, which presses the rod in; a_r ``ambient_pressure`` is added.

    Raises
    ------
    ConfigurationError
        A value is outside `DAMPER_RANGES`, or the rod is as wide as the piston.
    """

    rod_diameter: float = 0.019
    piston_diameter: float = 0.0285
    gas_piston_diameter: float = 0.04
    chamber_1_length: float = 0.133
    chamber_2_length: float = 0.133
    gas_length: float = 0.05
    oil_density: float = 770.0
    gas_pressure: float = 4.6e5
    gas_exponent: float = 1.4
    ambient_pressure: float = 0.0

    name = "purdy"
    title = "the paper's damper: one orifice, two linear checks"
    procedures = ("paper", "joint", "plain")
    conditions = ("gas_pressure", "gas_exponent")
    quantities = QUANTITIES
    values_type = Parameters
    ranges = DAMPER_RANGES
    bulk_moduli = ("free", "appendix1")
    # The root of valve 1 is rounded within 1 Pa of zero, so that its slope stays finite at a
    # reversal: 100 Pa cost 0.01 to 0.02 N, 1 Pa cannot be seen (`tests/damper/test_core.py`).
    rounding = 1.0

    @property
    def network(self) -> Network:
        """The paper's layout."""
        from damperfit.damper.network import purdy

        return purdy(self.ambient_pressure)

    @property
    def sentence(self) -> str:
        """The damper's main figures."""
        air = f", air at {self.ambient_pressure / 1e5:.4g} bar" if self.ambient_pressure else ""
        return (
            f"rod {1e3 * self.rod_diameter:g} mm, piston {1e3 * self.piston_diameter:g} mm, "
            f"gas piston {1e3 * self.gas_piston_diameter:g} mm, chambers "
            f"{1e3 * self.chamber_1_length:g} and {1e3 * self.chamber_2_length:g} mm, gas "
            f"{1e3 * self.gas_length:g} mm at {self.gas_pressure / 1e5:.5g} bar absolute, exponent "
            f"{self.gas_exponent:g}, oil {self.oil_density:g} kg/m3{air}"
        )

    def start(self, traces: Sequence[Trace], fixed: Mapping[str, float]) -> tuple[Values, ...]:
        """Start from the incompressible closed form, with several bulk moduli unless held."""
        first, *others = (fixed["k_e"],) if "k_e" in fixed else _BULK_MODULI
        likeliest = starting_values(traces, self, fixed, first)
        return (likeliest, *(replace(likeliest, k_e=k_e) for k_e in others))

    def further_starts(
        self, start: Values, traces: Sequence[Trace], free: Names
    ) -> tuple[FurtherStart, ...]:
        """Come from below the onset of cavitation, where R_m3 is free; then start beyond it.

        What the closed form makes of cavitation, which it does not know, is an offset: beyond the
        onset a free one begins at nothing.
        """
        if "r_m3" not in free:
            return ()
        limit, is_offset_free = cavitation_limit(traces, self), "f_0" in free
        offset = 0.0 if is_offset_free else start.f_0
        stages = (REBOUND | {"f_0"}, *([frozenset({"f_0"})] if is_offset_free else []))
        beyond = (
            FurtherStart(
                start.replace(r_m3=factor * limit, f_0=offset), stages, is_last_resort=True
            )
            for factor in _BEYOND_ONSET
        )
        return (FurtherStart(start.replace(r_m3=min(start.r_m3, limit)), (REBOUND,)), *beyond)

    def examine(
        self, values: Values, seen: Sequence[tuple[Trace, Response]], *, solver: SolverOptions
    ) -> Cavitation:
        """With the margin of R_m3 and the gas pressure at which a chamber just stays full."""
        from damperfit.damper.cylinder import examine_cavitation

        return examine_cavitation(values, seen, self, solver=solver)

    def rest_force(self, displacement: ArrayLike) -> NDArray[np.float64]:
        """Gas against ambient pressure on the rod, N."""
        return self.rod_area * (self.ambient_pressure - gas_pressure(self, displacement))

    @property
    def gas_volume(self) -> float:
        """V_g0, gas at x = 0, m3."""
        return self.gas_length * math.pi / 4.0 * self.gas_piston_diameter**2


# What dataclasses write says TypeError, of __init__.
Damper.__init__ = refuse_wrong_arguments("damperfit.Damper")(Damper.__init__)  # type: ignore[method-assign]

PURDY_DAMPER = Damper()


# Closed forms of the paper: forces that need no integration, and its two appendices.
#
# The gas expands by what the rod draws from chamber 3: P_3 = P_0 (V_g0/(V_g0 + a_r x))^gamma. With
# oil that cannot be compressed, the flows follow from the velocity alone (x, v, f > 0 in rebound),
# as Appendix 2 has them; the mass flows of the full model are w = rho_0 Q.
#
# **Full model, K_e -> infinity** (square-root valve 1, linear valves 2 and 3, friction). The force
# is linear in R_m1^2, R_m2, R_m3, f_f, which gives a fit its starting values:
#
#    f = a_p1 (R_m1 rho_0 a_p1 v)^2 + rho_0 R_m3 a_p2^2 v - a_r (P_3 - P_amb) + f_f + f_0      v > 0
#    f = -a_r (R_m1 rho_0 a_r v)^2  + rho_0 R_m2 a_p2^2 v - a_r (P_3 - P_amb) - f_f + f_0      v < 0
#
# **Appendix 1**, eqs (23) to (30): the effective bulk modulus of oil with some gas in it inside an
# elastic tube. Oil, gas bubbles and tube wall give way together, like springs in series; V_r is the
# volume of bubbles over that of liquid, K_g, K_B and K_c the moduli of gas, liquid and tube, C = 1
# + K_B/K_c. The paper prints K_e K_B as the numerator of (25) and (26); (23) gives K_g K_B, used
# here.
#
# **Appendix 2**, eqs (31) to (39), the simple model: oil that cannot be compressed, no friction,
# all valves linear. The flows Q_1 (chamber 1 to 3), Q_2 (2 to 1) and Q_3 (3 to 2) in m3/s follow
# from v alone, eta of the gas piston (positive: gas compressed) from x, and with it P_3, eq. (37).
# P = R_v Q, R_v in Pa s/m3: a valve of the full model that is linear in mass flow has R_v = rho_0
# R_m. (33) and (35) print eta with the sign opposite to (16), and (16) is kept.
#
# Functions of the appendices take floats or arrays that broadcast against each other, in SI.
# Source: D. J. Purdy, Proc. IMechE D, 2000.


def gas_pressure(damper: Damper, displacement: ArrayLike) -> FloatArray:
    """Return P_3 = P_0 (V_g0/(V_g0 + a_r x))^gamma, eq. (17) corrected and (37).

    Pa absolute, of the shape of the displacement, m, positive in rebound. A `SimulationError`: the
    rod goes in so far that no room is left for the gas.

    Examples
    --------
    >>> from damperfit.damper.purdy.parameters import PURDY_DAMPER
    >>> float(gas_pressure(PURDY_DAMPER, 0.0))
    460000.0
    """
    x = np.asarray(displacement, dtype=np.float64)
    gas_volume = damper.gas_volume + damper.rod_area * x
    if np.any(gas_volume <= 0.0):
        raise SimulationError(
            f"gas volume used up at displacement {float(np.min(x)):.4g} m; expected more than "
            f"{-damper.gas_volume / damper.rod_area:.4g} m; check the stroke and the gas length",
            code="stroke",
        )
    return np.asarray(damper.gas_pressure * (damper.gas_volume / gas_volume) ** damper.gas_exponent)


def incompressible_design(
    damper: Damper, displacement: ArrayLike, velocity: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return the matrix and offset in which the incompressible force is linear.

    ``force = columns @ [r_m1**2, r_m2, r_m3, f_f] + offset`` is "Full model" above with f_0 = 0,
    columns of shape (n, 4), offset the force of gas and air, N. A column is zero in the stroke its
    valve is shut in; at v = 0 friction is 0.
    """
    v = np.asarray(velocity, dtype=np.float64)
    a_p1, a_p2, a_r = damper.annulus_area, damper.piston_area, damper.rod_area
    out, into = np.maximum(v, 0.0), np.minimum(v, 0.0)
    through_1 = damper.oil_density**2 * (a_p1**3 * out**2 - a_r**3 * into**2)
    through_2 = damper.oil_density * a_p2**2 * into
    through_3 = damper.oil_density * a_p2**2 * out
    columns = np.stack([through_1, through_2, through_3, np.sign(v)], axis=-1)
    return columns, damper.rest_force(displacement)


def incompressible_force(
    parameters: Parameters, damper: Damper, displacement: ArrayLike, velocity: ArrayLike
) -> FloatArray:
    """Return the force of the full model for K_e -> infinity.

    N, shape (n,), of x in m and v in m/s, shape (n,); all positive in rebound. Valid as long as
    chamber 2 does not cavitate: P_3 > rho_0 R_m3 a_p2 v in rebound.

    Examples
    --------
    >>> from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
    >>> set_m = Parameters(r_m1=1.8e4, r_m2=3.527e6, r_m3=2.597e6, k_e=3.65e8, f_f=0.0)
    >>> speed = 2.0 * 3.141592653589793 * 1.5 * 0.032
    >>> incompressible_force(set_m, PURDY_DAMPER, [0.0, 0.0], [speed, -speed]).round(3)
    array([ 892.855, -862.009])
    """
    columns, offset = incompressible_design(damper, displacement, velocity)
    weights = [parameters.r_m1**2, parameters.r_m2, parameters.r_m3, parameters.f_f]
    return np.asarray(columns @ np.array(weights) + offset + parameters.f_0)


# The appendices.


class Tube(NamedTuple):
    """A thin-walled elastic tube."""

    wall_thickness: float  # t_c, m
    inner_diameter: float  # D_i, m
    youngs_modulus: float  # E, Pa


def volume_fractions(volume_ratio: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the shares of gas and liquid, V_r/(1 + V_r) and 1/(1 + V_r), eq. (24)."""
    ratio = np.asarray(volume_ratio, dtype=np.float64)
    return ratio / (1.0 + ratio), 1.0 / (1.0 + ratio)


def gas_modulus(pressure: ArrayLike, *, gas_exponent: float = 1.4) -> FloatArray:
    """Return K_g = gamma P, Pa, for a polytropic gas at absolute pressure P in Pa, eq. (27)."""
    return np.asarray(gas_exponent * np.asarray(pressure, dtype=np.float64))


def tube_modulus(tube: Tube) -> float:
    """Return K_c = t_c E/D_i, Pa, eq. (27): the bore widens by P D_i/(2 t_c E), its area twice."""
    if not min(tube) > 0.0:
        raise ConfigurationError(
            "thickness, diameter and Young's modulus must all be positive; give SI",
            subject=tube,
            code="out-of-range",
        )
    return tube.wall_thickness * tube.youngs_modulus / tube.inner_diameter


def compliance_factor(liquid_modulus: float, tube: Tube | None) -> float:
    """Return C = 1 + K_B D_i/(t_c E), dimensionless; 1 for a rigid tube (None)."""
    return 1.0 if tube is None else 1.0 + liquid_modulus / tube_modulus(tube)


def effective_modulus(
    gas_share: ArrayLike, *, gas: ArrayLike, liquid: float, container: float = np.inf
) -> FloatArray:
    """Return K_e, Pa: 1/K_e = (V_v/V_t)/K_g + (V_f/V_t)/K_B + 1/K_c, eq. (23)."""
    share = np.asarray(gas_share, dtype=np.float64)
    return np.asarray(1.0 / (share / np.asarray(gas) + (1.0 - share) / liquid + 1.0 / container))


def mixture_modulus(
    volume_ratio: ArrayLike, *, gas: ArrayLike, liquid: float, container: float = np.inf
) -> FloatArray:
    """Return K_e = K_g K_B/((V_r K_B + K_g)/(1 + V_r) + K_g K_B/K_c), Pa, eq. (25)."""
    ratio, k_g = np.asarray(volume_ratio, dtype=float), np.asarray(gas, dtype=float)
    softness = (ratio * liquid + k_g) / (1.0 + ratio) + k_g * (liquid / container)
    return np.asarray(k_g * liquid / softness)


def dilute_modulus(
    volume_ratio: ArrayLike, *, gas: ArrayLike, liquid: float, container: float = np.inf
) -> FloatArray:
    """Return K_e = K_g K_B/(V_r K_B + K_g + K_g K_B/K_c), Pa, for V_r << 1, eq. (26)."""
    ratio, k_g = np.asarray(volume_ratio, dtype=float), np.asarray(gas, dtype=float)
    return np.asarray(k_g * liquid / (ratio * liquid + k_g + k_g * (liquid / container)))


def modulus_at_pressure(
    pressure: ArrayLike,
    *,
    volume_ratio: ArrayLike,
    liquid: float = 1.5e9,
    compliance: float = 1.1,
    gas_exponent: float = 1.4,
) -> FloatArray:
    """Return K_B gamma P/(K_B V_r + C gamma P), Pa, eq. (28); V_r and P (absolute) as they are.

    Examples
    --------
    >>> [f"{k:.1e}" for k in modulus_at_pressure(20e5, volume_ratio=[0.001, 0.005, 0.01])]
    ['9.2e+08', '4.0e+08', '2.3e+08']
    """
    k_g = gas_modulus(pressure, gas_exponent=gas_exponent)
    ratio = np.asarray(volume_ratio, dtype=np.float64)
    return np.asarray(liquid * k_g / (liquid * ratio + compliance * k_g))


def low_pressure_limit(volume_ratio: float, *, liquid: float, compliance: float) -> float:
    """Return K_e for P -> 0, eq. (29): 0 with any gas in the oil, K_B/C without."""
    return 0.0 if volume_ratio > 0.0 else liquid / compliance


def high_pressure_limit(*, liquid: float, compliance: float) -> float:
    """Return K_e for P -> infinity, eq. (30): K_B/C, the oil and the tube alone."""
    return liquid / compliance


class LinearValves(NamedTuple):
    """R_v1, R_v2, R_v3 of Appendix 2: pressure drop per volume flow, Pa s/m3 (= N s/m5)."""

    r_v1: float
    r_v2: float
    r_v3: float


def gas_piston_displacement(damper: Damper, displacement: ArrayLike) -> FloatArray:
    """Return eta = -x a_r/a_g, m, eq. (16), and (33) and (35) with its sign."""
    gas_area = damper.gas_volume / damper.gas_length
    return np.asarray(-np.asarray(displacement, dtype=np.float64) * (damper.rod_area / gas_area))


def rebound_flows(damper: Damper, velocity: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return Q_1 = a_p1 v and Q_3 = a_p2 v, m3/s, for v > 0, eq. (31)."""
    v = np.asarray(velocity, dtype=np.float64)
    return damper.annulus_area * v, damper.piston_area * v


def bump_flows(damper: Damper, velocity: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return Q_1 = -a_r v and Q_2 = -a_p2 v, m3/s, for v < 0, eq. (34)."""
    v = np.asarray(velocity, dtype=np.float64)
    return -damper.rod_area * v, -damper.piston_area * v


def rebound_pressures(
    valves: LinearValves, damper: Damper, displacement: ArrayLike, velocity: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return P_3 + R_v1 Q_1 and P_3 - R_v3 Q_3, Pa, v > 0, eq. (32); negative: it cavitates."""
    p_3 = gas_pressure(damper, displacement)
    q_1, q_3 = rebound_flows(damper, velocity)
    return p_3 + valves.r_v1 * q_1, p_3 - valves.r_v3 * q_3


def bump_pressures(
    valves: LinearValves, damper: Damper, displacement: ArrayLike, velocity: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return P_1 = P_3 + R_v1 Q_1 and P_1 + R_v2 Q_2, Pa, for v < 0, eq. (36)."""
    q_1, q_2 = bump_flows(damper, velocity)
    p_1 = gas_pressure(damper, displacement) + valves.r_v1 * q_1
    return p_1, p_1 + valves.r_v2 * q_2


def simple_slopes(valves: LinearValves, damper: Damper) -> tuple[float, float]:
    """Return df/dv at constant x in rebound and in bump, N s/m, eq. (39)."""
    a_p1, a_p2, a_r = damper.annulus_area, damper.piston_area, damper.rod_area
    rebound = a_p1**2 * valves.r_v1 + a_p2**2 * valves.r_v3
    return rebound, a_p2**2 * valves.r_v2 + a_r**2 * valves.r_v1


def simple_force(
    valves: LinearValves, damper: Damper, displacement: ArrayLike, velocity: ArrayLike
) -> FloatArray:
    """Return v times the slope of its stroke, less P_3 a_r, N, eq. (38)."""
    v = np.asarray(velocity, dtype=np.float64)
    rebound, bump = simple_slopes(valves, damper)
    gas_force = -damper.rod_area * gas_pressure(damper, displacement)
    return np.asarray(np.where(v > 0.0, rebound, bump) * v + gas_force)


# Starting values: the incompressible closed form for the valves, several bulk moduli.

# A few hundred samples a log fix four numbers well enough to start from.
_SAMPLES_A_LOG = 400
# K_e of oil with 5 % to 0.1 % of undissolved gas at 20 bar, Appendix 1 (28); the likeliest first.
_BULK_MODULI = (6e8, 6e7, 2e8, 1.8e9)
# Where the closed form gives nothing for a valve, start from a tenth of the other valves' effect.
_SMALL_SHARE = 0.1
# Start this far below the R_m3 at which chamber 2 would cavitate, where the misfit has a second,
# wrong local minimum (R_m3 up, f_f to zero).
_CAVITATION_DISTANCE = 0.8
# Starts for a damper that cavitates, in units of `cavitation_limit`: 1.5 and 5 times the onset.
_BEYOND_ONSET = (1.9, 6.0)
# What a start holds until the others have settled: at stiff settings R_m1 carries the rebound, and
# one that is off in K_e lets R_m3 run into cavitation.
REBOUND = frozenset({"r_m3", "f_f"})


def starting_values(
    traces: Sequence[Trace], damper: Damper, fixed: Mapping[str, float], k_e: float
) -> Parameters:
    """Return starting values from the incompressible limit of the model, at a bulk modulus, Pa.

    Non-negative linear least squares in (R_m1^2, R_m2, R_m3, f_f) and, unless fixed, f_0.
    """
    rows, forces = [], []
    for trace in traces:  # thinned
        stride = max(1, trace.n_samples // _SAMPLES_A_LOG)
        part = np.arange(len(trace.force))[trace.compared][::stride]
        of_log, gas = incompressible_design(
            damper.filled_to(trace.gas_pressure), trace.displacement[part], trace.velocity[part]
        )
        tare = np.ones((len(of_log), 1))  # an offset of either sign
        rows.append(of_log if "f_0" in fixed else np.hstack([of_log, tare, -tare]))
        forces.append(trace.force[part] - gas - fixed.get("f_0", 0.0))
    columns, force = np.vstack(rows), np.concatenate(forces)
    scale = np.sqrt(np.mean(columns * columns, axis=0)) + 1e-300
    places = {"r_m1": 0, "r_m2": 1, "r_m3": 2, "f_f": 3}
    powers = {n: x**2 if n == "r_m1" else x for n, x in fixed.items() if n in places}
    held = [places[name] for name in powers]
    for name, power in powers.items():
        force = force - columns[:, places[name]] * power
    free = [j for j in range(columns.shape[1]) if j not in held]
    solution = np.zeros(columns.shape[1])
    if free:
        scaled = columns[:, free] / scale[free]
        solution[free] = nonnegative_least_squares(scaled, force) / scale[free]
    with np.errstate(over="ignore"):  # a parameter held far off: the simulation will say so
        floor = _SMALL_SHARE * float(np.std(force)) / scale
    start = Parameters(
        r_m1=float(np.sqrt(max(solution[0], floor[0]))),
        r_m2=float(max(solution[1], floor[1])),
        r_m3=float(min(max(solution[2], floor[2]), cavitation_limit(traces, damper))),
        k_e=k_e,
        f_f=float(max(solution[3], 0.1 * floor[3])),
        f_0=float(solution[4] - solution[5]) if len(solution) > 4 else 0.0,
    )
    return replace(start, **dict(fixed))


def cavitation_limit(traces: Sequence[Trace], damper: Damper) -> float:
    """Return an R_m3 that keeps chamber 2 full in rebound: 0.8 P_3/(rho_0 a_p2 v) at its least."""
    limits = []
    for trace in traces:
        x, v = trace.displacement[trace.compared], trace.velocity[trace.compared]
        flow = damper.oil_density * damper.piston_area * np.maximum(v, 1e-6)
        limits.append(float(np.min(gas_pressure(damper, x) / flow)))
    return _CAVITATION_DISTANCE * min(limits)


def nonnegative_least_squares(columns: FloatArray, values: FloatArray) -> FloatArray:
    """Return x >= 0 that makes |columns x - values| least; few columns (n, k) of about one length.

    The best of all choices of columns that has no negative number: `scipy.optimize` takes longer to
    load than all starts take.

    Examples
    --------
    >>> nonnegative_least_squares(np.eye(2), np.array([3.0, -1.0])).tolist()
    [3.0, 0.0]
    """
    triangle = np.asarray(np.linalg.qr(np.column_stack([columns, values]), mode="r"))
    a, b = triangle[:, :-1], triangle[:, -1]
    best, least, places = np.zeros(a.shape[1]), float(b @ b), range(a.shape[1])
    for some in chain.from_iterable(combinations(places, size + 1) for size in places):
        solution = np.linalg.lstsq(a[:, some], b, rcond=None)[0]
        rest = a[:, some] @ solution - b
        if np.all(solution >= 0.0) and rest @ rest < least:
            best, least = np.zeros(a.shape[1]), float(rest @ rest)
            best[list(some)] = solution
    return best


# What is drawn without logs: the reference set, and the families of curves of figures 4 to 9.
#
# The reference set: synthetic parameters of a damper with twenty settings.
#
# These numbers are this project's own. They are not Purdy's: the paper shows its parameters against
# setting only as figures (14 to 16) and prints two numbers, R_m3 = 2.597e6 and f_f = 50 N, which
# are used here. R_m1, R_m2 and K_e are smooth formulas chosen so that every qualitative statement
# of the paper holds (R_m1 and R_m2 rise ever faster and jump at setting 20, K_e scatters about a
# rising quadratic). They serve for samples, examples and tests; never as an answer of a fit.
#
# With k = setting - 1:
#
#     R_m1 = 1.4e4 + 700 k + 45 k^2                   setting 20: 4.9e4     s sqrt(N)/(m kg)
#     R_m2 = 2.0e6 exp(0.1 k)                         setting 20: 1.7e7     N s/(m2 kg)
#     R_m3 = 2.597e6                                                        N s/(m2 kg)
#     K_e  = (5.0e8 + 1.2e7 k + 8e5 k^2) (1 + e_k)                          Pa
#     f_f  = 50                                                             N

REFERENCE_SETTINGS: tuple[int, ...] = tuple(range(1, 21))

REFERENCE_SOURCE = "reference set shipped with damperfit (synthetic, not measured)"

# Scatter e_k of K_e over the settings, within 15 %.
_SCATTER = (
    *(0.0, 0.08, -0.12, 0.05, -0.06, 0.14, -0.10, 0.02, -0.04, 0.09),
    *(-0.13, 0.11, -0.02, -0.08, 0.15, -0.09, 0.04, 0.12, -0.11, 0.06),
)


def reference_parameters(setting: int) -> Parameters:
    """Return the synthetic parameters of one setting, 1 (softest) to 20; SI, ``f_0`` is 0.

    A `ConfigurationError`: the setting is not one of the twenty.

    Examples
    --------
    >>> reference_parameters(1)
    Parameters(r_m1=14000.0, r_m2=2000000.0, r_m3=2597000.0, k_e=500000000.0, f_f=50.0, f_0=0.0)
    >>> round(reference_parameters(10).r_m1)
    23945
    """
    if setting not in REFERENCE_SETTINGS:
        raise ConfigurationError(
            f"setting {setting} is not in the reference set; expected a whole number, 1 to 20",
            code="no-setting",
        )
    k = REFERENCE_SETTINGS.index(setting)
    r_m1, r_m2 = 1.4e4 + 700.0 * k + 45.0 * k**2, 2.0e6 * math.exp(0.1 * k)
    if setting == REFERENCE_SETTINGS[-1]:  # The last detent shuts the port almost completely.
        r_m1, r_m2 = 4.9e4, 1.7e7
    k_e = (5.0e8 + 1.2e7 * k + 8.0e5 * k**2) * (1.0 + _SCATTER[k])
    return Parameters(r_m1=r_m1, r_m2=r_m2, r_m3=2.597e6, k_e=k_e, f_f=50.0)


class Family(NamedTuple):
    """One family of curves."""

    name: str  # the parameter
    number: int  # of the figure
    factors: tuple[float, ...]  # what the parameter is multiplied with
    of_pressures: int = 0  # number of the figure of its chamber pressures; 0: there is none


FAMILIES = (
    Family("r_m1", 4, (0.8, 1.0, 1.2)),
    Family("r_m2", 5, (0.8, 1.0, 1.2)),
    Family("r_m3", 6, (0.5, 1.0, 1.5), of_pressures=7),
    Family("k_e", 8, (0.2, 1.0, 2.0)),
    Family("f_f", 9, (0.0, 1.0, 2.0)),
)
