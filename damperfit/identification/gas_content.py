"""The bulk modulus of every setting from one gas content: Appendix 1 of the paper, eq. (28).

    1/K_e = V_r/(gamma P) + C/K_B

V_r (trapped gas over oil) and K_B/C (oil and tube without gas) are common to all settings; P is the
setting's mean working pressure: the mean over the compared time of the absolute pressure in
chambers 1 and 2, which K_e is of, weighted by their volumes. With s = K_e V_r/(gamma P), the share
of the compliance that the gas has::

    d ln K_e = -s d ln V_r + (1 - s) d ln(K_B/C)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from damperfit.identification.simulated_log import compare

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.damper.model import Values
    from damperfit.damper.purdy.parameters import Damper
    from damperfit.identification.fit_problem import FitProblem
    from damperfit.tested.setting import Setting

__all__ = [
    "GAS_FOLLOWER",
    "GAS_NAMES",
    "GasLaw",
    "first_law",
    "working_pressure",
]

# What follows from the gas content.
GAS_FOLLOWER = "k_e"
# In the order of the joint fit's shared variables.
GAS_NAMES = ("volume_ratio", "stiffness")
# Neither share of the compliance starts at less than this: a logarithm must leave its end.
_LEAST_SHARE = 0.05


class GasLaw(NamedTuple):
    """K_e of every setting from the gas in the oil.

    Attributes
    ----------
    volume_ratio : float
        V_r, trapped gas over oil, dimensionless.
    stiffness : float
        K_B/C, bulk modulus of oil and tube without gas, Pa.
    gas_exponent : float
        gamma.
    pressures : mapping of Setting to float
        Mean working pressure P by setting, absolute, Pa.
    """

    volume_ratio: float
    stiffness: float
    gas_exponent: float
    pressures: Mapping[Setting, float]

    def modulus(self, setting: Setting) -> float:
        """K_e of a setting, Pa."""
        from damperfit.damper.purdy.appendices import modulus_at_pressure

        # Eq. (28) with K_B/C in place of K_B and V_r/C in place of V_r has C = 1.
        return float(
            modulus_at_pressure(
                self.pressures[setting],
                volume_ratio=self.volume_ratio,
                liquid=self.stiffness,
                compliance=1.0,
                gas_exponent=self.gas_exponent,
            )
        )

    def share(self, setting: Setting) -> float:
        """Share of a setting's compliance that the gas has, 0 to 1."""
        gas = self.gas_exponent * self.pressures[setting]
        return self.modulus(setting) * self.volume_ratio / gas


def working_pressure(problem: FitProblem, parameters: Values) -> float:
    """Return the mean pressure in chambers 1 and 2 over the compared time, by volume, Pa.

    Raises
    ------
    SimulationError
        When the model cannot be integrated.
    """
    damper = cast("Damper", problem.model)
    work, volume = 0.0, 0.0
    for trace in problem.traces:
        seen = compare(parameters, trace, damper, solver=problem.solver).response
        x = trace.displacement[trace.compared]
        volumes = np.stack(
            [
                damper.chamber_1_volume - x * damper.annulus_area,
                damper.chamber_2_volume + x * damper.piston_area,
            ]
        )
        work += float(np.sum(seen.pressures[:2, trace.compared] * volumes))
        volume += float(np.sum(volumes))
    return work / volume


def first_law(
    moduli: Mapping[Setting, float], pressures: Mapping[Setting, float], gas_exponent: float
) -> GasLaw:
    """Return the law that is nearest to known K_e: a straight line of 1/K_e over 1/(gamma P).

    Relative errors count: each equation is multiplied by its K_e.
    """
    settings = sorted(moduli)
    k_e = np.array([moduli[setting] for setting in settings])
    softness = 1.0 / (gas_exponent * np.array([pressures[setting] for setting in settings]))
    columns = np.column_stack([softness * k_e, k_e])
    scale = np.sqrt(np.mean(columns * columns, axis=0))
    gas, oil = np.linalg.lstsq(columns / scale, np.ones(len(k_e)), rcond=None)[0] / scale
    least = _LEAST_SHARE / np.mean(columns, axis=0)
    gas, oil = max(float(gas), float(least[0])), max(float(oil), float(least[1]))
    return GasLaw(gas, 1.0 / oil, gas_exponent, dict(pressures))
