"""The parameters of the paper's model, with what is known of each.

Their ranges are a factor of a hundred or more beyond any car damper on both sides. The fallbacks
are the paper's published values.
"""

from __future__ import annotations

from math import inf

from damperfit.damper.quantity import (
    DAMPER,
    FRICTION,
    OFFSET,
    RIGID,
    STIFFNESS,
    VISCOUS,
    Quantity,
)

__all__ = ["OF_OIL", "OIL", "QUANTITIES"]

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
