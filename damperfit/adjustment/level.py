"""Force of one setting at one speed, as the model gives it and as it was measured."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.statistics import NORMAL_95

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = ["STROKES", "Level", "offset_sentence", "said_offsets"]

STROKES = ("rebound", "bump")
# A model may miss the measured force by 2 % of it, near its passage through zero by 0.5 % of half
# the force's range, and by three standard errors of the difference.
_OF_FORCE, _OF_RANGE, _ERRORS = 0.02, 0.005, 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Level:
    """Force of one setting at one speed, mean of the opening and the closing branch.

    Attributes
    ----------
    setting : Setting
        Which.
    speed : float
        m/s, positive.
    stroke : str
        "rebound" or "bump".
    force : float
        N, positive in rebound; the gas force is in it, the rig's offset only where `is_whole`.
    error : float
        Standard error, N; NaN where it is not known.
    rest : float
        The part of it that is the setting's alone, N; like `carried` without the offset's.
    carried : numpy.ndarray
        Shape (number of shared parameters,): what independent unit errors of the shared parameters
        do to the force, N; in the same order for all settings.
    is_cavitating : bool
        A chamber is empty of pressure somewhere on this motion.
    misfit : float
        Error of the force from the model's misfit, N: what repeats in the residual at like speeds.
    measured, measured_error : float
        Force as measured at this motion, less the offset as `force` is, and its standard error, N;
        NaN where it was not measured.
    difference : float
        Measured less modelled force on the cycles of the test, N.
    half_range : float
        Half the range of the measured force, N.
    is_measured : bool
        Whether `force` is the measured one.
    tare, tare_error : float
        The force offset of the setting and its standard error, N.
    whole_error : float
        Standard error of the force with the offset, N.
    is_whole : bool
        The offset is in the forces.
    holds_gas : bool
        The model knows no gas, and its offset holds the gas force.
    """

    setting: Setting
    speed: float
    stroke: str
    force: float
    error: float
    rest: float
    carried: FloatArray
    is_cavitating: bool
    misfit: float = 0.0
    measured: float = math.nan
    measured_error: float = math.nan
    difference: float = math.nan
    half_range: float = math.nan
    is_measured: bool = False
    tare: float = 0.0
    tare_error: float = 0.0
    whole_error: float = math.nan
    is_whole: bool = False
    holds_gas: bool = False

    @property
    def bare_force(self) -> float:
        """The force without the offset, N."""
        return self.force - self.tare if self.is_whole else self.force

    @property
    def whole(self) -> Level:
        """The same with the offset in its forces."""
        if self.is_whole:
            return self
        return replace(
            self,
            force=self.force + self.tare,
            error=self.whole_error,
            measured=self.measured + self.tare,
            is_whole=True,
        )

    @property
    def low(self) -> float:
        """Lower end of the 95 % interval, N."""
        return self.force - self._reach

    @property
    def high(self) -> float:
        """Upper end of the 95 % interval, N."""
        return self.force + self._reach

    @property
    def _reach(self) -> float:
        """Half the 95 % interval, of noise and misfit, N."""
        return NORMAL_95 * math.hypot(self.error, self.misfit)

    @property
    def disagrees(self) -> bool:
        """Whether the model misses the measured force by more than it may."""
        may = max(_OF_FORCE * abs(self.measured), _OF_RANGE * self.half_range)
        noise = 0.0 if math.isnan(self.measured_error) else self.measured_error
        return abs(self.difference) > may + _ERRORS * noise

    @property
    def rounding(self) -> float:
        """What filter and motion of the test do to the force here, as the model has it, N.

        The measured force has passed the filter, which rounds knees; beside the model's on the
        same cycles stands its force of the plain sine, which no filter has rounded.
        """
        return self.measured - self.difference - self.force

    @property
    def as_measured(self) -> Level:
        """The same with the measured force in place of the model's, where there is one."""
        if math.isnan(self.measured):
            return self
        rounding = 0.0 if math.isnan(self.rounding) else abs(self.rounding)
        rest = math.hypot(self.measured_error, self.tare_error)  # the tare is taken off
        return replace(
            self,
            force=self.measured,
            error=self.measured_error if self.is_whole else rest,
            rest=rest,
            carried=np.zeros_like(self.carried),
            misfit=rounding,
            is_measured=True,
        )


def said_offsets(offsets: Sequence[float]) -> str:
    """Return the rigs' offsets in words, as in "-3.4 to 36.6 N"."""
    low, high = (f"{one:.3g}" for one in (min(offsets), max(offsets)))
    return f"{low} N" if low == high else f"{low} to {high} N"


def offset_sentence(
    offsets: Sequence[float], *, is_whole: bool = False, holds_gas: bool = False
) -> str:
    """Return what became of the rigs' offsets in forces by setting; empty where there are none."""
    if not any(offsets):
        return ""
    if holds_gas:
        return (
            f"the model knows no gas: its force offset ({said_offsets(offsets)}) holds the gas "
            "force and the rig's tare; it is in these forces, not in what a click changes"
        )
    if is_whole:
        return (
            f"the force offset ({said_offsets(offsets)}) is the rig's tare: it is in these forces, "
            "as the rig measured them, and not in what a click changes"
        )
    return (
        f"the force offset ({said_offsets(offsets)}) is the rig's tare, not the damper's: it is "
        "left out of these forces, the measured ones too, and of what a click changes"
    )
