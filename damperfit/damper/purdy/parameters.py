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
from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf
from typing import TYPE_CHECKING, ClassVar

from damperfit.damper.cylinder import Cylinder, filling
from damperfit.damper.model import OilModel, Values
from damperfit.damper.quantity import (
    DAMPER,
    FRICTION,
    OFFSET,
    RIGID,
    STIFFNESS,
    VISCOUS,
    Quantity,
)
from damperfit.errors import SimulationError, did_you_mean, refuse_wrong_arguments

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from damperfit.damper.cavitation import Cavitation
    from damperfit.damper.model import FurtherStart
    from damperfit.damper.network import Network
    from damperfit.recording import Trace
    from damperfit.simulation import Motion, Response, SolverOptions

__all__ = [
    "DAMPER_RANGES",
    "OF_OIL",
    "OIL",
    "PURDY_DAMPER",
    "QUANTITIES",
    "Damper",
    "Parameters",
]

# Eq. (28): 2 % of free gas at 4.6 bar leave 31 MPa. No oil is stiffer than twice mineral oil.
OIL = (3e7, 3e9)
OF_OIL = "oil has 1500 MPa, and 30 with 2 % of free gas in it"

_VALVE_1, _VALVE = "s sqrt(N)/(m kg)", "N s/(m2 kg)"

QUANTITIES = (
    Quantity(
        "r_m1", "R_m1", "valve 1 (adjuster)", "resistance of valve 1, the adjuster", _VALVE_1,
        (1e1, 1e7), power=3, shown_unit="10³ s √N / (m kg)",
    ),
    Quantity(
        "r_m2", "R_m2", "valve 2 (bump)", "resistance of valve 2, in the piston, open in bump",
        _VALVE, (1e3, 1e10), power=6, shown_unit="10⁶ N s / (m² kg)", role=VISCOUS,
    ),
    Quantity(
        "r_m3", "R_m3", "valve 3 (rebound)", "resistance of valve 3, open in rebound", _VALVE,
        (1e3, 1e10), scope=DAMPER, fallback=2.597e6, power=6, shown_unit="10⁶ N s / (m² kg)",
        role=VISCOUS,
    ),
    Quantity(
        "k_e", "K_e", "bulk modulus of oil and chamber",
        "effective bulk modulus of oil, air and tube", "Pa", (1e6, 1e11), power=6,
        shown_unit="MPa", is_open=True, trend_degree=2, believable=OIL, belief=OF_OIL,
        role=STIFFNESS, ideal=RIGID,
    ),
    Quantity(
        "f_f", "f_f", "friction", "Coulomb friction of seals and bearings", "N", (1e-3, 1e4),
        scope=DAMPER, may_vanish=True, fallback=50.0, shown_unit="N",
        role=FRICTION,
    ),
    # A force offset is about as much as the rod's gas force.
    Quantity(
        "f_0", "f_0", "force offset", "constant offset added to the force, the rig's tare", "N",
        (-inf, inf), is_logarithmic=False, size=100.0, default=0.0, shown_unit="N",
        role=OFFSET,
    ),
)  # fmt: skip

# What any damper has, from a model car's to a bridge's, with room to spare, in SI. What lies
# outside was misread: mm as m, bar as Pa. Pressures are absolute, hence never nothing.
DAMPER_RANGES: dict[str, tuple[float, float, str]] = {
    "rod_diameter": (1e-3, 0.5, "m"),
    "piston_diameter": (2e-3, 1.0, "m"),
    "gas_piston_diameter": (2e-3, 1.0, "m"),
    "chamber_1_length": (2e-3, 5.0, "m"),
    "chamber_2_length": (2e-3, 5.0, "m"),
    "gas_length": (1e-3, 5.0, "m"),
    "oil_density": (500.0, 2000.0, "kg/m3"),
    "gas_pressure": (1e4, 1e8, "Pa"),
    "gas_exponent": (1.0, 1.67, ""),  # slow compression of any gas, fast of one with single atoms
    "ambient_pressure": (0.0, 1e7, "Pa"),
}


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
class Damper(Cylinder, OilModel):
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

    name: ClassVar[str] = "purdy"
    title: ClassVar[str] = "the paper's damper: one orifice, two linear checks"
    procedures: ClassVar[tuple[str, ...]] = ("paper", "joint", "plain")
    conditions: ClassVar[tuple[str, ...]] = ("gas_pressure", "gas_exponent")
    ranges: ClassVar[Mapping[str, tuple[float, float, str]]] = DAMPER_RANGES
    bulk_moduli: ClassVar[tuple[str, ...]] = ("free", "appendix1")

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """R_m1, R_m2, R_m3, K_e, f_f, f_0."""
        return QUANTITIES

    @property
    def values_type(self) -> type[Values]:
        """`Parameters`."""
        return Parameters

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

    def simulate(
        self,
        values: Values,
        motion: Motion,
        *,
        sensitivities: Sequence[str],
        options: SolverOptions,
    ) -> Response:
        """Integrate the paper's equations: `damperfit.damper.network.simulate_network`."""
        from damperfit.damper.network import simulate_network

        known = (*self.names, *self.conditions)
        for name in sensitivities:
            if name not in known:
                raise SimulationError(
                    f"no sensitivity by {name!r}; there are {', '.join(known)}."
                    f"{did_you_mean(name, known)}",
                    code="unknown-quantity",
                )
        filled = filling(motion, self.gas_pressure)
        numbers = {**dict(values), "gas_pressure": filled * self.gas_pressure}
        response = simulate_network(
            _network(self.ambient_pressure), numbers, self, motion, sensitivities=sensitivities,
            options=replace(options, rounding=_ROUNDING),
        )  # fmt: skip
        if "gas_pressure" in response.sensitivities:
            response.sensitivities["gas_pressure"] *= filled
        return response

    def start(self, traces: Sequence[Trace], fixed: Mapping[str, float]) -> tuple[Values, ...]:
        """Start from the incompressible closed form, with several bulk moduli."""
        from damperfit.damper.purdy.starting import starts

        return starts(traces, self, fixed)

    def further_starts(
        self, start: Values, traces: Sequence[Trace], free: Sequence[str]
    ) -> tuple[FurtherStart, ...]:
        """Come from below the onset of cavitation; then start beyond it."""
        from damperfit.damper.purdy.starting import further_starts

        return further_starts(start, traces, self, free)

    def examine(
        self,
        values: Values,
        seen: Sequence[tuple[Trace, Response]],
        *,
        solver: SolverOptions,
    ) -> Cavitation:
        """With the margin of R_m3 and the gas pressure at which a chamber just stays full."""
        from damperfit.damper.cavitation import examine_cavitation

        return examine_cavitation(values, seen, self, solver=solver)

    def rest_force(self, displacement: ArrayLike) -> NDArray[np.float64]:
        """Gas against ambient pressure on the rod, N."""
        from damperfit.damper.purdy.closed_forms import gas_pressure

        return self.rod_area * (self.ambient_pressure - gas_pressure(self, displacement))

    @property
    def gas_volume(self) -> float:
        """V_g0, gas at x = 0, m3."""
        return self.gas_length * math.pi / 4.0 * self.gas_piston_diameter**2


# The root of valve 1 is rounded within 1 Pa of zero, so that its slope stays finite at a reversal:
# 100 Pa cost 0.01 to 0.02 N, 1 Pa cannot be seen (`tests/damper/test_core.py`).
_ROUNDING = 1.0


@lru_cache(maxsize=8)
def _network(ambient_pressure: float) -> Network:
    from damperfit.damper.network import purdy

    return replace(purdy(), ambient_pressure=ambient_pressure)


# What dataclasses write says TypeError, of __init__.
Damper.__init__ = refuse_wrong_arguments("damperfit.Damper")(Damper.__init__)  # type: ignore[method-assign]

PURDY_DAMPER = Damper()
