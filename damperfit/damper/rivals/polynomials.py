"""Polynomials: in velocity, in displacement and velocity, and the restoring-force surface.

    f = sum_i a_i v^i                              i <= 5
    f = sum_ij b_ij x^i v^j                        i + j <= 3
    f = sum_ij c_ij T_i(x/X) T_j(v/V)              i + j <= 6

The surface with Chebyshev polynomials T is that of S. F. Masri and T. K. Caughey, "A nonparametric
identification technique for nonlinear dynamic problems", J. Appl. Mech. 46 (1979) 433. Here the
coefficients are fitted to the samples themselves, not to a grid laid over them.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.polynomial import chebyshev

from damperfit.damper.rivals.rival import ComparedLogs, Rival, Slopes, signed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.damper.model import Values
    from damperfit.damper.quantity import Quantity
    from damperfit.damper.rivals.rival import FloatArray
    from damperfit.simulation import Motion, SolverOptions

__all__ = ["PolynomialInSpeed", "PolynomialInStrokeAndSpeed", "RestoringForceSurface"]


@dataclass(frozen=True)
class _Terms(Rival):
    """A sum of terms with a number each: what they are worth follows from least squares at once."""

    @property
    @abstractmethod
    def powers(self) -> tuple[tuple[int, int], ...]:
        """Degrees in displacement and velocity, a pair a term."""

    @abstractmethod
    def terms(self, x: FloatArray, v: FloatArray) -> FloatArray:
        """Return the terms, a row each."""

    def law(
        self,
        y: Values,
        motion: Motion,
        options: SolverOptions,  # noqa: ARG002
    ) -> tuple[FloatArray, Slopes]:
        """Return the sum."""
        rows = self.terms(motion.displacement, motion.velocity)
        return np.asarray(y.numbers) @ rows, dict(zip(self.names, rows, strict=True))

    def guess(self, seen: ComparedLogs) -> tuple[Mapping[str, float], ...]:
        """Return the least-squares numbers of the samples as they are compared."""
        rows = self.terms(seen.x, seen.v)
        numbers = np.linalg.lstsq(rows.T, seen.f, rcond=None)[0]
        return (dict(zip(self.names, map(float, numbers), strict=True)),)


@dataclass(frozen=True)
class PolynomialInSpeed(_Terms):
    """A polynomial of fifth degree in velocity."""

    name: ClassVar[str] = "polynomial_v"
    title: ClassVar[str] = "polynomial in velocity, degree 5"
    source: ClassVar[str] = "textbook"
    caveat: ClassVar[str] = ""

    @property
    def powers(self) -> tuple[tuple[int, int], ...]:
        """Degrees 0 to 5 of the velocity."""
        return tuple((0, j) for j in range(6))

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Return a_0 to a_5."""
        return tuple(
            signed(f"a_{j}", f"a_{j}", f"coefficient of v^{j}", _unit(0, j), 1e3)
            for _, j in self.powers
        )

    def terms(self, x: FloatArray, v: FloatArray) -> FloatArray:  # noqa: ARG002
        """Return powers of the velocity."""
        return np.vander(v, 6, increasing=True).T


@dataclass(frozen=True)
class PolynomialInStrokeAndSpeed(_Terms):
    """A polynomial of third degree in displacement and velocity."""

    name: ClassVar[str] = "polynomial_xv"
    title: ClassVar[str] = "polynomial in displacement and velocity, degree 3"
    source: ClassVar[str] = "textbook"
    caveat: ClassVar[str] = ""

    @property
    def powers(self) -> tuple[tuple[int, int], ...]:
        """All pairs up to the third degree."""
        return _pairs(3)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Return b_ij."""
        return tuple(
            signed(
                f"b_{i}{j}", f"b_{i}{j}", f"coefficient of x^{i} v^{j}", _unit(i, j), 1e3 * 30.0**i
            )
            for i, j in self.powers
        )

    def terms(self, x: FloatArray, v: FloatArray) -> FloatArray:
        """Return products of powers."""
        return np.array([x**i * v**j for i, j in self.powers])


@dataclass(frozen=True)
class RestoringForceSurface(_Terms):
    """Chebyshev polynomials up to the sixth degree over displacement and velocity.

    Attributes
    ----------
    half_stroke, top_speed : float
        X and V, m and m/s: where the polynomials' argument is 1. Far beyond what was fitted they
        say nothing.
    """

    half_stroke: float = 0.05
    top_speed: float = 0.5

    name: ClassVar[str] = "restoring_force_surface"
    title: ClassVar[str] = "restoring-force surface, degree 6"
    source: ClassVar[str] = "Masri and Caughey 1979"

    @property
    def powers(self) -> tuple[tuple[int, int], ...]:
        """All pairs up to the sixth degree."""
        return _pairs(6)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Return c_ij."""
        return tuple(
            signed(f"c_{i}{j}", f"c_{i}{j}", f"coefficient of T_{i}(x/X) T_{j}(v/V)", "N", 1e4)
            for i, j in self.powers
        )

    def terms(self, x: FloatArray, v: FloatArray) -> FloatArray:
        """Return products of Chebyshev polynomials."""
        over_x = chebyshev.chebvander(x / self.half_stroke, 6)
        over_v = chebyshev.chebvander(v / self.top_speed, 6)
        return np.array([over_x[:, i] * over_v[:, j] for i, j in self.powers])


def _pairs(degree: int) -> tuple[tuple[int, int], ...]:
    return tuple((i, n - i) for n in range(degree + 1) for i in range(n + 1))


def _unit(i: int, j: int) -> str:
    """N, or N s^j/m^(i + j)."""
    if i + j == 0:
        return "N"
    over = f"m{i + j}" if i + j > 1 else "m"
    return f"N{f' s{j}' if j > 1 else ' s' if j else ''}/{over}"
