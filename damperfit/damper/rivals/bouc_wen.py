"""Bouc and Wen's hysteresis beside viscous damping and a spring.

    f = c v + k x + alpha z + f_0,    c of the direction
    z' = rho (v - sigma |v| |z|^(n-1) z + (sigma - 1) v |z|^n)

z runs between -1 and 1. Y. K. Wen, "Method for random vibration of hysteretic systems", J. Eng.
Mech. Div. ASCE 102 (1976) 249, after R. Bouc 1967; in this normalised form F. Ikhouane and
J. Rodellar, "Systems with Hysteresis", Wiley 2007.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from damperfit.damper.rivals.following import follow
from damperfit.damper.rivals.rival import OFFSET, ComparedLogs, Rival, Slopes, positive, signed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.damper.model import Values
    from damperfit.damper.quantity import Quantity
    from damperfit.damper.rivals.rival import FloatArray
    from damperfit.simulation import Motion, SolverOptions

__all__ = ["BoucWen"]


_AT_ONCE = 1e10  # 1/m


def _to_its_edges(quantity: Quantity) -> Quantity:
    """Return a number that dampers have at its edges too: back on a straight line, a sharp turn."""
    return replace(quantity, has_own_edges=True)


@dataclass(frozen=True)
class BoucWen(Rival):
    """Hysteresis that depends on the path alone, with damping and a spring beside it."""

    name: ClassVar[str] = "bouc_wen"
    title: ClassVar[str] = "Bouc-Wen"
    source: ClassVar[str] = "Wen 1976; Ikhouane and Rodellar 2007"

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Return alpha, rho, sigma - 1/2, n - 1, c of both directions, k and f_0."""
        return (
            positive("alpha", "alpha", "height of the hysteresis", "N", (1e-2, 1e6)),
            replace(
                positive("rho", "rho", "1/rho is the stroke it takes to turn", "1/m", (1.0, 1e6)),
                ideal=_AT_ONCE,
            ),
            _to_its_edges(positive("sigma", "sigma", "shape of the turn", "1", (0.5, 1e2))),
            _to_its_edges(positive("n", "n", "sharpness of the turn", "1", (1.0, 2e1))),
            positive("c_r", "c_r", "viscous damping in rebound", "N s/m", (1e-3, 1e7)),
            positive("c_b", "c_b", "viscous damping in bump", "N s/m", (1e-3, 1e7)),
            signed("k", "k", "stiffness", "N/m", 1e3),
            OFFSET,
        )

    def law(self, y: Values, motion: Motion, options: SolverOptions) -> tuple[FloatArray, Slopes]:
        """Return the sum."""
        x, v = motion.displacement, motion.velocity
        z, by = follow(np.array([y.rho, y.sigma, y.n]), (), motion, options)
        up, down = np.maximum(v, 0.0), np.minimum(v, 0.0)
        slopes = {
            "alpha": z,
            "rho": y.alpha * by[0],
            "sigma": y.alpha * by[1],
            "n": y.alpha * by[2],
            "c_r": up,
            "c_b": down,
            "k": x,
            "f_0": np.ones_like(v),
        }
        return y.c_r * up + y.c_b * down + y.k * x + y.alpha * z + y.f_0, slopes

    def guess(self, seen: ComparedLogs) -> tuple[Mapping[str, float], ...]:
        """Return two heights that turn within a hundredth and a tenth of the stroke."""
        stroke = float(np.ptp(seen.x))
        return tuple(
            {
                "alpha": share * (seen.rebound + seen.bump) / 2.0,
                "rho": turn / stroke,
                "sigma": 1.0,
                "n": 1.5,
                "c_r": (1.0 - share) * seen.rebound / seen.speed,
                "c_b": (1.0 - share) * seen.bump / seen.speed,
                "k": 0.0,
                "f_0": seen.middle,
            }
            for share, turn in ((0.3, 100.0), (0.7, 10.0))
        )
