"""Errors of many settings at once: those that have errors of the same values, in arrays.

The formulas are those of `damperfit.uncertainty.intervals`, with the settings as first index.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.identification.gas_content import GAS_FOLLOWER, GAS_NAMES
from damperfit.identification.outcome import Status

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.identification import Fit, Sharing
    from damperfit.uncertainty.linearisation import Linearisation

    FloatArray = NDArray[np.float64]

__all__ = ["ROUNDED_OFF", "Errors", "Kind", "by_kind", "own_names", "shared_slopes", "solved"]

# Of the largest eigenvalue, of matrices with a diagonal of ones: what is less is rounding.
ROUNDED_OFF = 1e-14


Errors = tuple["FloatArray", "FloatArray", "FloatArray"]


@dataclass(frozen=True, slots=True, eq=False)
class Kind:
    """Settings, s of them, that have errors of the same values, one below the other.

    Own values f come before the k shared ones; ``common`` are those of all settings, the last.
    """

    linearised: Sequence[Linearisation]
    rows: FloatArray  # T, (s, variables, n)
    slopes: FloatArray  # A, (s, n, variables)
    own: tuple[str, ...]
    shared: tuple[str, ...]
    common: tuple[str, ...]

    @classmethod
    def of(
        cls, linearised: Sequence[Linearisation], sharing: Sharing, rows: Sequence[FloatArray]
    ) -> Kind:
        """Lay settings together."""
        first = linearised[0]
        shared = sharing.found_at(first.fit.setting)
        common = tuple(name for name in shared if name in sharing.common)
        shared = (*(name for name in shared if name not in common), *common)
        slopes = np.stack([shared_slopes(one.fit, sharing) for one in linearised])
        own = own_names(first.fit, sharing)
        return cls(linearised, np.stack(rows), slopes, own, shared, common)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the rows and columns of covariances."""
        return (*self.own, *self.shared)

    def errors(self, noise: FloatArray, bent: FloatArray, of_all: FloatArray) -> Errors:
        """Return covariance of noise, variances of misfit, and ratios of the errors by cycles.

        From a setting's own scores (through own fit and shared rows) and the other settings': those
        of noise first, then those of the misfit; last what all settings together do to the shared
        ones where something is held at a wrong value: of one damper, it is wrong alike everywhere.
        """
        first, rows, slopes = self.linearised[0], self.rows, self.slopes
        information, scores = self._stacked("information"), self._stacked("scores")
        direct = _solved(information, first.places(self.own))
        carried = -direct @ information @ slopes
        of_shared = slopes[:, first.places(self.shared)]
        from_own = np.concatenate([direct + carried @ rows, of_shared @ rows], axis=1)
        from_others = np.concatenate([carried, of_shared], axis=1)
        covariance = _carried(from_own, scores) + _carried(from_others, noise)
        misfit = _carried(from_others, bent)
        if first.misfit is not None:
            misfit = _carried(from_own, self._stacked("misfit")) + misfit
        if first.supposed is not None:
            nothing = np.zeros((len(direct), len(self.shared), direct.shape[2]))
            shifts = np.concatenate([direct, nothing], axis=1) @ self._stacked("supposed")
            shifts = shifts + from_others @ of_all
            misfit = misfit + shifts @ _turned(shifts)
        ratios = np.full(covariance.shape[:2], math.nan)
        parts = (_variances(_carried(direct, of)) for of in (self._stacked("cycle_scores"), scores))
        with np.errstate(invalid="ignore", divide="ignore"):
            ratios[:, : len(self.own)] = np.sqrt(np.divide(*parts))
        return covariance, _variances(misfit), ratios

    def _stacked(self, name: str) -> FloatArray:
        return np.stack([getattr(one, name) for one in self.linearised])


def _carried(rows: FloatArray, covariance: FloatArray) -> FloatArray:
    return np.asarray(rows @ covariance @ _turned(rows))


def _turned(matrices: FloatArray) -> FloatArray:
    return np.swapaxes(matrices, -1, -2)


def _variances(covariances: FloatArray) -> FloatArray:
    return np.diagonal(covariances, axis1=-2, axis2=-1)


def by_kind(linearised: Sequence[Linearisation], sharing: Sharing) -> list[list[int]]:
    """Places of the settings that have errors of the same values."""
    kinds: dict[tuple[object, ...], list[int]] = {}
    for place, one in enumerate(linearised):
        kind = (
            one.names,
            own_names(one.fit, sharing),
            sharing.found_at(one.fit.setting),
            one.misfit is None,
            None if one.supposed is None else one.supposed.shape,
        )
        kinds.setdefault(kind, []).append(place)
    return list(kinds.values())


def own_names(fit: Fit, sharing: Sharing) -> tuple[str, ...]:
    """Return the parameters that a setting's own fit found or sought, but for those at a bound.

    None where that fit is no minimum, for nothing holds there.
    """
    if not fit.outcome.is_minimum:
        return ()
    shared = sharing.found_at(fit.setting)
    return tuple(
        name
        for name in fit.parameters.names
        if fit.status[name] in {Status.FITTED, Status.NOT_IDENTIFIABLE} and name not in shared
    )


def shared_slopes(fit: Fit, sharing: Sharing) -> FloatArray:
    """Return A = du/dtheta of a setting, shape (n, k): what its u move with the shared variables.

    Parameters
    ----------
    fit : Fit
        The setting's.
    sharing : Sharing
        What is shared, and the law of K_e if there is one.
    """
    names = fit.parameters.names
    slopes = np.zeros((len(names), len(sharing.variables)))
    for k, one in enumerate(sharing.unknowns):
        if one.name in names and one.holds_at(fit.setting):
            slopes[names.index(one.name), k] = 1.0
    if sharing.gas is not None and fit.setting in sharing.gas.pressures:
        share = sharing.gas.share(fit.setting)
        slopes[names.index(GAS_FOLLOWER), -len(GAS_NAMES) :] = (-share, 1.0 - share)
    return slopes


def solved(linearised: Linearisation, names: Sequence[str]) -> FloatArray:
    """Return H_ff^-1 E_f of some parameters, shape (k, n); a pseudo-inverse where H is singular.

    Parameters
    ----------
    linearised : Linearisation
        H, shape (n, n), and its order.
    names : sequence of str
        The parameters f.
    """
    return _solved(linearised.information, linearised.places(names))


def _solved(information: FloatArray, places: NDArray[np.intp]) -> FloatArray:
    """The same of matrices H, (..., n, n), and rows of f in them."""
    block = information[..., places[:, None], places]
    scale = 1.0 / np.sqrt(np.maximum(_variances(block), 1e-300))
    across = scale[..., :, None]
    values, vectors = np.linalg.eigh(block * (across * scale[..., None, :]))
    sizes = np.abs(values)
    is_seen = sizes > ROUNDED_OFF * sizes.max(axis=-1, keepdims=True, initial=0.0)
    parts = across * vectors
    over = np.divide(
        parts, values[..., None, :], out=np.zeros_like(parts), where=is_seen[..., None, :]
    )
    result = np.zeros((*block.shape[:-1], information.shape[-1]))
    result[..., places] = over @ _turned(parts)
    return result
