"""Damper curves without hysteresis: degressive, and four slopes with a knee in each direction.

    f = c v/(1 + |v|/v_k) + f_f sgn v + f_0               c, v_k of the direction
    f = c_1 v up to v_k, c_2 beyond, + f_f sgn v + f_0    c_1, c_2, v_k of the direction

Curves of these forms are what dyno software and vehicle simulations hold as tables; the degressive
one is the simplest that has a finite slope at rest and at high speed less and less of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from damperfit.damper.rivals.rival import (
    FRICTION,
    OFFSET,
    ComparedLogs,
    Rival,
    Slopes,
    friction,
    positive,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.damper.model import Values
    from damperfit.damper.quantity import Quantity
    from damperfit.damper.rivals.rival import FloatArray
    from damperfit.simulation import Motion, SolverOptions

__all__ = ["Degressive", "FourSlopes"]

_WAYS = (("r", "rebound"), ("b", "bump"))


@dataclass(frozen=True)
class Degressive(Rival):
    """A slope at rest and a speed beyond which it fades, for each direction."""

    name: ClassVar[str] = "degressive"
    title: ClassVar[str] = "degressive curve with friction"
    source: ClassVar[str] = "textbook"
    caveat: ClassVar[str] = ""

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Return c and v_k of both directions, friction and offset."""
        own = [
            one
            for k, way in _WAYS
            for one in (
                positive(f"c_{k}", f"c_{k}", f"slope at rest in {way}", "N s/m", (1e-1, 1e7)),
                positive(
                    f"v_{k}", f"v_{k}", f"speed of half that slope in {way}", "m/s", (1e-4, 1e3)
                ),
            )
        ]
        return (*own, FRICTION, OFFSET)

    def law(self, y: Values, motion: Motion, options: SolverOptions) -> tuple[FloatArray, Slopes]:
        """Return the force on the curve."""
        v, rub = motion.velocity, friction(motion, options)
        force, slopes = y.f_f * rub + y.f_0, {"f_f": rub, "f_0": np.ones_like(v)}
        for k, part in (("r", np.maximum(v, 0.0)), ("b", np.minimum(v, 0.0))):
            c, v_k = getattr(y, f"c_{k}"), getattr(y, f"v_{k}")
            share = part / (1.0 + np.abs(part) / v_k)
            force = force + c * share
            slopes[f"c_{k}"] = share
            slopes[f"v_{k}"] = c * share * np.abs(share) / v_k**2
        return force, slopes

    def guess(self, seen: ComparedLogs) -> tuple[Mapping[str, float], ...]:
        """Return a curve that has lost half of its slope at the highest speed, and one earlier."""
        return tuple(
            {
                "c_r": (1.0 + 1.0 / at) * seen.rebound / seen.speed,
                "c_b": (1.0 + 1.0 / at) * seen.bump / seen.speed,
                "v_r": at * seen.speed,
                "v_b": at * seen.speed,
                "f_f": 0.02 * (seen.rebound + seen.bump),
                "f_0": seen.middle,
            }
            for at in (1.0, 0.2)
        )


@dataclass(frozen=True)
class FourSlopes(Rival):
    """Two slopes and the knee between them, for each direction."""

    name: ClassVar[str] = "four_slopes"
    title: ClassVar[str] = "four slopes with friction"
    source: ClassVar[str] = "textbook"
    caveat: ClassVar[str] = ""

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Return both slopes and the knee of both directions, friction and offset."""
        own = [
            one
            for k, way in _WAYS
            for one in (
                positive(
                    f"c_{k}1", f"c_{k}1", f"slope up to the knee in {way}", "N s/m", (1e-1, 1e7)
                ),
                positive(
                    f"c_{k}2", f"c_{k}2", f"slope beyond the knee in {way}", "N s/m", (1e-2, 1e7)
                ),
                positive(f"v_{k}", f"v_{k}", f"speed of the knee in {way}", "m/s", (1e-4, 1e2)),
            )
        ]
        return (*own, FRICTION, OFFSET)

    def law(self, y: Values, motion: Motion, options: SolverOptions) -> tuple[FloatArray, Slopes]:
        """Return the force on the lines."""
        v, rub = motion.velocity, friction(motion, options)
        force, slopes = y.f_f * rub + y.f_0, {"f_f": rub, "f_0": np.ones_like(v)}
        for k, part in (("r", np.maximum(v, 0.0)), ("b", np.minimum(v, 0.0))):
            first, second = getattr(y, f"c_{k}1"), getattr(y, f"c_{k}2")
            v_k = getattr(y, f"v_{k}")
            slow = np.clip(part, -v_k, v_k)
            fast = part - slow
            force = force + first * slow + second * fast
            slopes[f"c_{k}1"], slopes[f"c_{k}2"] = slow, fast
            slopes[f"v_{k}"] = (first - second) * np.sign(fast)
        return force, slopes

    def guess(self, seen: ComparedLogs) -> tuple[Mapping[str, float], ...]:
        """Return knees at two shares of the highest speed, with a fifth of the slope beyond."""
        return tuple(
            {
                f"{name}_{k}{end}": number
                for k, peak in (("r", seen.rebound), ("b", seen.bump))
                for name, end, number in (
                    ("c", 1, peak / (seen.speed * (at + 0.2 * (1.0 - at)))),
                    ("c", 2, 0.2 * peak / (seen.speed * (at + 0.2 * (1.0 - at)))),
                    ("v", "", at * seen.speed),
                )
            }
            | {"f_f": 0.02 * (seen.rebound + seen.bump), "f_0": seen.middle}
            for at in (0.4, 0.1)
        )
