"""Straight lines: one damping coefficient, or one for each direction.

    f = c v + f_0                          linear
    f = c_r v + f_0, v > 0;  c_b v + f_0   bilinear

The equations of every text on vehicle dynamics; no source is needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from damperfit.damper.rivals.rival import OFFSET, ComparedLogs, Rival, Slopes, damping

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.damper.model import Values
    from damperfit.damper.quantity import Quantity
    from damperfit.damper.rivals.rival import FloatArray
    from damperfit.simulation import Motion, SolverOptions

__all__ = ["Bilinear", "Linear"]


@dataclass(frozen=True)
class Linear(Rival):
    """One damping coefficient and an offset."""

    name: ClassVar[str] = "linear"
    title: ClassVar[str] = "linear damping with offset"
    source: ClassVar[str] = "textbook"
    caveat: ClassVar[str] = ""

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Return c and f_0."""
        return (damping("c", "damping coefficient"), OFFSET)

    def law(
        self,
        y: Values,
        motion: Motion,
        options: SolverOptions,  # noqa: ARG002
    ) -> tuple[FloatArray, Slopes]:
        """Return c v + f_0."""
        v = motion.velocity
        return y.c * v + y.f_0, {"c": v, "f_0": np.ones_like(v)}

    def guess(self, seen: ComparedLogs) -> tuple[Mapping[str, float], ...]:
        """Return the coefficient of the peak forces."""
        return ({"c": (seen.rebound + seen.bump) / (2.0 * seen.speed), "f_0": seen.middle},)


@dataclass(frozen=True)
class Bilinear(Rival):
    """A damping coefficient for each direction and an offset."""

    name: ClassVar[str] = "bilinear"
    title: ClassVar[str] = "bilinear damping with offset"
    source: ClassVar[str] = "textbook"
    caveat: ClassVar[str] = ""

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Return c_r, c_b and f_0."""
        return (
            damping("c_r", "damping coefficient in rebound"),
            damping("c_b", "damping coefficient in bump"),
            OFFSET,
        )

    def law(
        self,
        y: Values,
        motion: Motion,
        options: SolverOptions,  # noqa: ARG002
    ) -> tuple[FloatArray, Slopes]:
        """Return the force of either direction."""
        up, down = np.maximum(motion.velocity, 0.0), np.minimum(motion.velocity, 0.0)
        slopes = {"c_r": up, "c_b": down, "f_0": np.ones_like(up)}
        return y.c_r * up + y.c_b * down + y.f_0, slopes

    def guess(self, seen: ComparedLogs) -> tuple[Mapping[str, float], ...]:
        """Return the coefficients of the peak forces."""
        return (
            {
                "c_r": seen.rebound / seen.speed,
                "c_b": seen.bump / seen.speed,
                "f_0": seen.middle,
            },
        )
