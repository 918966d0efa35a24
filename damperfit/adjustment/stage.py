"""One setting as a stage of the adjuster, and its errors parted into shared ones and its own.

The error of a force comes from the covariance C of (own, shared) through the sensitivities
g = df/du, u = ln y. For the difference of two settings the shared parameters are one and the same
error. With theta the shared ones and K = C_own,theta C_theta^-1, the own errors split into
K dtheta and a rest that is the setting's alone (up to 1/n for n settings in a mean)::

    f  = ... + G dtheta + rest,  G = g_theta + g_own K
    var(f_b - f_a) = rest_a + rest_b + (G_b - G_a) C_theta (G_b - G_a)'
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.identification import Fit
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty import Assessment

    FloatArray = NDArray[np.float64]

__all__ = [
    "Parts",
    "Stage",
    "errors_parted",
    "has_lost_errors",
    "open_limits",
    "split",
    "stage_of",
]

# Of the shared values' covariance, directions of less than this share are nothing but rounding.
_NOTHING = 1e-15
# Of `Status`, which takes too long to import here.
_FITTED, _NOT_IDENTIFIABLE = "fitted", "not_identifiable"


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """One setting of the adjuster: its parameters and what is known of their errors.

    Attributes
    ----------
    setting : Setting
        Which.
    parameters : Values
        SI.
    own, shared : tuple of str
        Values with an error: the setting's own, and those in common to all settings.
    covariance : numpy.ndarray or None
        Of ln y (f_0: of f_0, N), own before shared, shape (k, k). None: nothing is known.
    top_speed : float
        Highest speed that the setting was tested at, m/s; infinite: not known.
    open_limits : tuple of (str, (float, float))
        Quantities that the logs do not determine, and between which values they leave them open.
    """

    setting: Setting
    parameters: Values
    own: tuple[str, ...] = ()
    shared: tuple[str, ...] = ()
    covariance: FloatArray | None = None
    top_speed: float = math.inf
    open_limits: tuple[tuple[str, tuple[float, float]], ...] = ()

    @property
    def offsets(self) -> tuple[str, ...]:
        """Names of the values that are a tare of the rig."""
        return tuple(one.name for one in self.parameters.quantities if one.is_offset)

    @property
    def kind(self) -> tuple[tuple[str, ...], tuple[str, ...], bool]:
        """What stages have in common whose errors are of one shape."""
        return self.own, self.shared, self.covariance is None

    @property
    def offset(self) -> float:
        """What the rig adds to the force, N."""
        return sum((float(getattr(self.parameters, name)) for name in self.offsets), 0.0)

    @property
    def knows_offset(self) -> bool:
        """Whether an offset was found or given: one that is held at 0 tells of no tare."""
        return self.offset != 0.0 or any(one in (*self.own, *self.shared) for one in self.offsets)

    @property
    def offset_error(self) -> float:
        """Standard error of the offset, N; 0 where it has none."""
        names = (*self.own, *self.shared)
        at = [names.index(name) for name in self.offsets if name in names]
        if self.covariance is None or not at:
            return 0.0
        return math.sqrt(max(float(self.covariance[np.ix_(at, at)].sum()), 0.0))


def stage_of(fit: Fit, assessment: Assessment) -> Stage:
    """Return a fit and what is known of its errors as one stage of the adjuster."""
    known = next((one for one in assessment.uncertainties if one.setting == fit.setting), None)
    top = max(one.peak_speed for log in fit.logs for one in log.trace.stretches)
    limits = {
        name: assessment.plausible_limits(fit, name)
        for name, status in fit.status.items()
        if status == _NOT_IDENTIFIABLE
    }
    stage = Stage(
        fit.setting, fit.parameters, top_speed=top, open_limits=open_limits(fit.parameters, limits)
    )
    if known is None or has_lost_errors(known.names, fit.status):
        return stage
    own = known.names[: len(known.names) - len(known.shared)]
    return replace(stage, own=own, shared=known.shared, covariance=known.covariance)


def open_limits(
    parameters: Values, limits: Mapping[str, tuple[float | None, float | None]]
) -> tuple[tuple[str, tuple[float, float]], ...]:
    """Return between which values quantities are left open: where one is missing the plausible."""
    found = []
    for name, (low, high) in limits.items():
        one = parameters.quantity(name)
        if not one.is_offset:
            least, most = one.plausible
            found.append((name, (least if low is None else low, most if high is None else high)))
    return tuple(found)


def has_lost_errors(names: Sequence[str], status: Mapping[str, str]) -> bool:
    """Return whether a value that was fitted has no error, as where a fit has met no minimum.

    What is left, the errors of shared values, would be told as those of its forces.

    Parameters
    ----------
    names : sequence of str
        Values with an error.
    status : mapping of str to str
        Of all values.
    """
    return any(one == _FITTED and name not in names for name, one in status.items())


@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """The covariance of a stage parted: what is its alone, and how its own follow the shared.

    Of several stages with the same own and shared values one below the other, (..., k, k).
    """

    rest: FloatArray
    follow: FloatArray
    root: FloatArray


def errors_parted(*stages: Stage) -> Parts | None:
    """Return the covariance of a stage parted; None where it has none.

    Of several stages with the same own and shared values each has one more, first index.
    """
    known = [one.covariance for one in stages if one.covariance is not None]
    if not known:
        return None
    return _parted(known[0] if len(known) == 1 else np.stack(known), len(stages[0].own))


def _parted(covariance: FloatArray, n: int) -> Parts:
    own, cross, theta = (
        covariance[..., :n, :n],
        covariance[..., :n, n:],
        covariance[..., n:, n:],
    )
    values, directions = np.linalg.eigh(theta)
    sizes = np.abs(values)
    is_known = sizes > _NOTHING * np.max(sizes, axis=-1, keepdims=True, initial=0.0)
    inverse = np.divide(1.0, values, out=np.zeros_like(values), where=is_known)
    back = np.swapaxes(directions, -1, -2)
    follow = cross @ (directions * inverse[..., None, :] @ back)
    # The symmetric root is unique; signs of directions, and like ones themselves, hang on rounding.
    root = directions * np.sqrt(np.maximum(values, 0.0))[..., None, :] @ back
    return Parts(own - follow @ np.swapaxes(cross, -1, -2), follow, root)


def split(stage: Stage, parts: Parts | None, slopes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the standard errors that are the setting's alone, and what the shared ones carry.

    Parameters
    ----------
    stage : Stage
        The setting, or one of several with the same own and shared values.
    parts : Parts or None
        Its covariance parted, or theirs.
    slopes : numpy.ndarray
        Shape (..., k, m): of m forces by own and shared values.

    Returns
    -------
    numpy.ndarray
        Shape (..., m); NaN where nothing is known.
    numpy.ndarray
        Shape (..., m, number of shared values).
    """
    n = len(stage.own)
    if parts is None:
        shape = (*slopes.shape[:-2], slopes.shape[-1])
        return np.full(shape, math.nan), np.zeros((*shape, len(stage.shared)))
    turned = np.swapaxes(slopes, -1, -2)
    own, shared = turned[..., :n], turned[..., n:]
    carried = (shared + own @ parts.follow) @ parts.root
    rest = np.einsum("...ij,...ij->...i", own @ parts.rest, own)
    return np.sqrt(np.maximum(rest, 0.0)), np.asarray(carried)
