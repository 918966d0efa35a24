"""The hysteretic bi-viscous model: stiff before it yields, soft after, on two branches.

    f = f_0 + the middle one of  c_po v - f_y,  c_pr (v -+ v_0),  c_po v + f_y

with - where the acceleration is positive and + where it is negative; f_y, c_po of the direction.

N. M. Wereley, L. Pang and G. M. Kamath, "Idealized hysteresis modeling of electrorheological and
magnetorheological dampers", J. Intell. Mater. Syst. Struct. 9 (1998) 642. There both directions
have one f_y and one c_po.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from damperfit.damper.rivals.rival import OFFSET, ComparedLogs, Rival, Slopes, positive

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.damper.model import Values
    from damperfit.damper.quantity import Quantity
    from damperfit.damper.rivals.rival import FloatArray
    from damperfit.simulation import Motion, SolverOptions

__all__ = ["Biviscous"]


@dataclass(frozen=True)
class Biviscous(Rival):
    """Two slopes a direction, and a speed by which the branches of the loop lie apart."""

    name: ClassVar[str] = "biviscous"
    title: ClassVar[str] = "hysteretic bi-viscous"
    source: ClassVar[str] = "Wereley, Pang and Kamath 1998"

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Return c_pr, v_0, c_po and f_y of both directions, and f_0."""
        return (
            positive("c_pr", "c_pr", "damping before it yields", "N s/m", (1e-1, 1e8)),
            positive("v_0", "v_0", "speed between the branches", "m/s", (1e-6, 1e1)),
            positive("c_r", "c_po,r", "damping after it yields in rebound", "N s/m", (1e-2, 1e7)),
            positive("c_b", "c_po,b", "damping after it yields in bump", "N s/m", (1e-2, 1e7)),
            positive("f_r", "f_y,r", "yield force in rebound", "N", (1e-2, 1e6)),
            positive("f_b", "f_y,b", "yield force in bump", "N", (1e-2, 1e6)),
            OFFSET,
        )

    def law(
        self,
        y: Values,
        motion: Motion,
        options: SolverOptions,  # noqa: ARG002
    ) -> tuple[FloatArray, Slopes]:
        """Return the middle one of the three lines."""
        v = motion.velocity
        side = np.sign(np.gradient(v)) if len(v) > 1 else np.zeros_like(v)
        before = y.c_pr * (v - side * y.v_0)
        high, low = y.c_r * v + y.f_r, y.c_b * v - y.f_b
        above, below = before > high, before < low
        between = np.asarray(~above & ~below, dtype=np.float64)
        slopes: dict[str, FloatArray] = {
            "c_pr": between * (v - side * y.v_0),
            "v_0": -y.c_pr * between * side,
            "c_r": above * v,
            "c_b": below * v,
            "f_r": np.asarray(above, dtype=np.float64),
            "f_b": -np.asarray(below, dtype=np.float64),
            "f_0": np.ones_like(v),
        }
        return np.where(above, high, np.where(below, low, before)) + y.f_0, slopes

    def guess(self, seen: ComparedLogs) -> tuple[Mapping[str, float], ...]:
        """Return yields at two shares of the peak forces."""
        return tuple(
            {
                "c_pr": 10.0 * (seen.rebound + seen.bump) / (2.0 * seen.speed),
                "v_0": 0.03 * seen.speed,
                "c_r": (1.0 - share) * seen.rebound / seen.speed,
                "c_b": (1.0 - share) * seen.bump / seen.speed,
                "f_r": share * seen.rebound,
                "f_b": share * seen.bump,
                "f_0": seen.middle,
            }
            for share in (0.7, 0.25)
        )
