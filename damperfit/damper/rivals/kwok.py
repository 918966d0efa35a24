"""A hyperbolic tangent for the hysteresis.

    f = c v + k x + alpha tanh(beta v + delta sgn x) + f_0

N. M. Kwok, Q. P. Ha, T. H. Nguyen, J. Li and B. Samali, "A novel hysteretic model for
magnetorheological fluid dampers and parameter identification using particle swarm optimization",
Sensors and Actuators A 132 (2006) 441.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from damperfit.damper.rivals.rival import OFFSET, ComparedLogs, Rival, Slopes, positive, signed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.damper.model import Values
    from damperfit.damper.quantity import Quantity
    from damperfit.damper.rivals.rival import FloatArray
    from damperfit.simulation import Motion, SolverOptions

__all__ = ["Kwok"]

_MIDDLE = 1e-4  # m: within, the sign of x is x/_MIDDLE, so that the force does not jump


@dataclass(frozen=True)
class Kwok(Rival):
    """Viscous, elastic and hysteretic force side by side."""

    name: ClassVar[str] = "kwok"
    title: ClassVar[str] = "Kwok's hyperbolic tangent"
    source: ClassVar[str] = "Kwok et al. 2006"

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Return c, k, alpha, beta, delta and f_0."""
        return (
            positive("c", "c", "viscous damping", "N s/m", (1e-3, 1e7)),
            signed("k", "k", "stiffness", "N/m", 1e3),
            positive("alpha", "alpha", "height of the hysteresis", "N", (1e-2, 1e6)),
            positive("beta", "beta", "steepness by velocity", "s/m", (1e-2, 1e5)),
            signed("delta", "delta", "width of the hysteresis", "1", 1.0),
            OFFSET,
        )

    def law(
        self,
        y: Values,
        motion: Motion,
        options: SolverOptions,  # noqa: ARG002
    ) -> tuple[FloatArray, Slopes]:
        """Return the sum."""
        x, v = motion.displacement, motion.velocity
        side = np.clip(x / _MIDDLE, -1.0, 1.0)
        bend = np.tanh(y.beta * v + y.delta * side)
        steep = y.alpha * (1.0 - bend**2)
        slopes = {
            "c": v,
            "k": x,
            "alpha": bend,
            "beta": steep * v,
            "delta": steep * side,
            "f_0": np.ones_like(v),
        }
        return y.c * v + y.k * x + y.alpha * bend + y.f_0, slopes

    def guess(self, seen: ComparedLogs) -> tuple[Mapping[str, float], ...]:
        """Return three steepnesses; the rest by least squares with them held."""
        found = []
        for beta in (2.0 / seen.speed, 8.0 / seen.speed, 30.0 / seen.speed):
            rows = np.array(
                [seen.v, seen.x, np.tanh(beta * seen.v), np.ones_like(seen.v)],
            )
            c, k, alpha, offset = map(float, np.linalg.lstsq(rows.T, seen.f, rcond=None)[0])
            known = {"c": abs(c), "k": k, "alpha": abs(alpha), "beta": beta, "f_0": offset}
            found.append(known | {"delta": 0.1})
        return tuple(found)
