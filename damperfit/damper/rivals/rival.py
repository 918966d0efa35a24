"""What models of the literature have in common: no geometry, and a force from a motion alone.

They are ranked beside the physical models on the same logs, and are what can be taken where nothing
physical is known. Each says where its equation comes from, and whether the original was at hand.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from damperfit.damper import quantity as roles
from damperfit.damper.model import Model
from damperfit.damper.quantity import Quantity
from damperfit.errors import SimulationError
from damperfit.simulation import Response

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.recording import Trace
    from damperfit.simulation import Motion, SolverOptions

    FloatArray = NDArray[np.float64]

__all__ = [
    "FRICTION",
    "OFFSET",
    "ComparedLogs",
    "Rival",
    "Slopes",
    "damping",
    "friction",
    "positive",
    "signed",
]

Slopes = dict[str, "FloatArray"]


class ComparedLogs(NamedTuple):
    """What is compared of some logs, end to end; SI."""

    x: FloatArray
    v: FloatArray
    f: FloatArray

    @property
    def speed(self) -> float:
        """Highest speed, m/s."""
        return float(np.max(np.abs(self.v)))

    @property
    def rebound(self) -> float:
        """Highest force above the mean of what is slow, N."""
        return max(float(np.max(self.f) - self.middle), 1.0)

    @property
    def bump(self) -> float:
        """The same in bump, N, positive."""
        return max(float(self.middle - np.min(self.f)), 1.0)

    @property
    def middle(self) -> float:
        """Mean force where the rod is slow, N: gas and offset."""
        slow = np.abs(self.v) <= np.quantile(np.abs(self.v), 0.1)
        return float(np.mean(self.f[slow]))


class Rival(Model):
    """A model of the literature: a force from displacement and velocity."""

    __slots__ = ()

    source: ClassVar[str]
    """Where its equation comes from."""
    caveat: ClassVar[str] = "The original was not at hand; the equation is as later texts give it."
    """What a reader has to know of how it was taken over; empty where there is nothing."""

    @abstractmethod
    def law(self, y: Values, motion: Motion, options: SolverOptions) -> tuple[FloatArray, Slopes]:
        """Return the force, N, and its derivative by every quantity; shape (n,) each."""

    @abstractmethod
    def guess(self, seen: ComparedLogs) -> tuple[Mapping[str, float], ...]:
        """Return numbers to start from, several where it may end in several valleys."""

    def simulate(
        self,
        values: Values,
        motion: Motion,
        *,
        sensitivities: Sequence[str],
        options: SolverOptions,
    ) -> Response:
        """Return force and sensitivities; it has no pressures."""
        for name in sensitivities:
            self.quantity(name)
        with np.errstate(all="ignore"):
            force, slopes = self.law(values, motion, options)
        n = len(force)
        if not np.all(np.isfinite(force)):
            raise SimulationError("the force is not a finite number.", subject=self.title)
        return Response(
            time=motion.start_time + motion.interval * np.arange(n, dtype=np.float64),
            displacement=motion.displacement,
            velocity=motion.velocity,
            force=force,
            pressures=np.full((3, n), np.nan),
            masses=np.full((2, n), np.nan),
            sensitivities={name: slopes[name] for name in sensitivities},
        )

    def start(self, traces: Sequence[Trace], fixed: Mapping[str, float]) -> tuple[Values, ...]:
        """Return where a fit may start, from forces and speeds of the logs."""
        parts = [trace.compared for trace in traces]
        seen = ComparedLogs(
            *(
                np.concatenate([getattr(t, name)[k] for t, k in zip(traces, parts, strict=True)])
                for name in ("displacement", "velocity", "force")
            )
        )
        starts = []
        for numbers in self.guess(seen):
            within = {
                one.name: float(np.clip(numbers[one.name], *one.plausible))
                for one in self.quantities
            }
            starts.append(self.values(within | dict(fixed)))
        return tuple(starts)


def friction(motion: Motion, options: SolverOptions) -> FloatArray:
    """Return the share of Coulomb friction that acts: the sign of the velocity, within its band."""
    return np.clip(motion.velocity / options.dead_band, -1.0, 1.0)


def positive(
    name: str, symbol: str, meaning: str, unit: str, limits: tuple[float, float], label: str = ""
) -> Quantity:
    """Return a quantity that is fitted by its logarithm."""
    return Quantity(name, symbol, label or meaning, meaning, unit, limits)


def signed(name: str, symbol: str, meaning: str, unit: str, size: float) -> Quantity:
    """Return a quantity of either sign; it is looked for within 10^4 times its size."""
    limits = (-1e4 * size, 1e4 * size)
    return Quantity(name, symbol, meaning, meaning, unit, limits, is_logarithmic=False, size=size)


def damping(name: str, meaning: str, limits: tuple[float, float] = (1e-2, 1e7)) -> Quantity:
    """Return a coefficient that goes with the oil's viscosity."""
    return replace(positive(name, name, meaning, "N s/m", limits), role=roles.VISCOUS)


OFFSET = replace(signed("f_0", "f_0", "force offset", "N", 100.0), role=roles.OFFSET)
FRICTION = replace(
    positive("f_f", "f_f", "Coulomb friction", "N", (1e-3, 1e5), "friction"), role=roles.FRICTION
)
