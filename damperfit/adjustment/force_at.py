"""Force of a setting at a speed: the one answer for every table, command and check.

Two origins are never mixed in one number. *model* is the quasi-static characteristic of the damper
alone (`damperfit.damper.quasi_static`), with an interval from the covariance of its parameters and
from the misfit; beyond the tested speed it is as wide as what the logs do not determine leaves it.
*measured* is what a dyno prints (`damperfit.uncertainty.speed_forces`). A rig is tared before each
test: its offset is no part of either, nor of what a click does. Only where a model knows no gas the
offset holds the gas force, and stays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.adjustment.stage import errors_parted, split
from damperfit.damper.quasi_static import QuasiStatic, quasi_static
from damperfit.errors import SimulationError, sparing
from damperfit.simulation import NAMED_SPEEDS
from damperfit.statistics import NORMAL_95

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from damperfit.adjustment.stage import Stage
    from damperfit.damper.model import Model
    from damperfit.errors import OnError
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty import SpeedForces
    from damperfit.uncertainty.speed_forces import MeasuredForce

    FloatArray = NDArray[np.float64]

__all__ = [
    "MEASURED",
    "MODEL",
    "REPEATS",
    "STROKES",
    "Force",
    "credible_forces",
    "determined_speed",
    "force_at",
    "named_speeds",
    "offset_sentence",
    "said_offsets",
]

STROKES = ("rebound", "bump")
MODEL, MEASURED = "model", "measured"
# A model may miss the measured force by 2 % of it, near its passage through zero by 0.5 % of half
# the force's range, and by three standard errors of the difference.
_OF_FORCE, _OF_RANGE, _ERRORS = 0.02, 0.005, 3.0
# A test at 0.26 m/s peaks at 0.258 or 0.262.
REPEATS = 0.02
# A setting is determined where the interval is no wider than this share of the damping, up to so
# many times the tested speed, in these steps.
_DETERMINED, _FARTHEST, _STEPS = 0.05, 5.0, 16


@dataclass(frozen=True, slots=True, eq=False)
class Force:
    """Force of one setting at one speed.

    Attributes
    ----------
    setting : Setting
        Which.
    speed : float
        m/s, positive.
    stroke : str
        "rebound" or "bump".
    force : float
        N, positive in rebound; gas and friction are in it, the rig's offset only where `has_tare`.
    error : float
        Standard error, N; NaN where it is not known.
    rest : float
        The part of it that is the setting's alone, N; like `carried` without the offset's.
    carried : numpy.ndarray
        Shape (number of shared parameters,): what independent unit errors of the shared parameters
        do to the force, N; in the same order for all settings.
    model_force : float
        The model's, N, like `force` in all else.
    origin : str
        Whose `force` is: `MODEL` or `MEASURED`.
    misfit : float
        Error of the force from the model's misfit, N: what repeats in the residual at like speeds.
    undetermined : (float, float)
        How far the force may be below and above for what the logs do not determine, N.
    gas, friction : float
        Parts of the model's force, N: gas (and ambient) pressure on the rod at mid-stroke; seals.
    is_cavitating : bool
        A chamber is at zero pressure at this speed.
    is_tested : bool
        The setting was tested at this speed or a higher one.
    measured : MeasuredForce or None
        What was measured at this speed, the rig's tare in it; None: nothing was.
    half_range : float
        Half the range of the measured force, N.
    tare, tare_error : float
        The rig's force offset at this setting and its standard error, N.
    has_tare : bool
        It is in the force.
    whole_error : float
        Standard error of the force with the offset, N.
    holds_gas : bool
        The model knows no gas, and its offset holds the gas force: it is in the force.
    """

    setting: Setting
    speed: float
    stroke: str
    force: float
    error: float
    rest: float
    carried: FloatArray
    model_force: float = math.nan
    origin: str = MODEL
    misfit: float = 0.0
    undetermined: tuple[float, float] = (0.0, 0.0)
    gas: float = math.nan
    friction: float = math.nan
    is_cavitating: bool = False
    is_tested: bool = True
    measured: MeasuredForce | None = None
    half_range: float = math.nan
    tare: float = 0.0
    tare_error: float = 0.0
    has_tare: bool = False
    whole_error: float = math.nan
    holds_gas: bool = False

    @property
    def low(self) -> float:
        """Lower end of the 95 % interval, N."""
        return self.force - max(self.reach, self.undetermined[0])

    @property
    def high(self) -> float:
        """Upper end of the 95 % interval, N."""
        return self.force + max(self.reach, self.undetermined[1])

    @property
    def reach(self) -> float:
        """Half the 95 % interval of noise and misfit, N."""
        return NORMAL_95 * math.hypot(self.error, self.misfit)

    @property
    def is_determined(self) -> bool:
        """Whether what the logs do not determine leaves the interval as it is."""
        return max(self.undetermined) <= max(self.reach, _OF_FORCE * abs(self.damping))

    @property
    def damping(self) -> float:
        """The force without gas force and tare, N."""
        return self.bare_force - (0.0 if math.isnan(self.gas) else self.gas)

    @property
    def bare_force(self) -> float:
        """The force without the offset, N."""
        return self.force - self.tare if self.has_tare or self.holds_gas else self.force

    @property
    def measured_force(self) -> float:
        """The measured force, the tare in it where it is in `force`, N; NaN: none."""
        if self.measured is None:
            return math.nan
        return self.measured.force - (0.0 if self.has_tare or self.holds_gas else self.tare)

    @property
    def measured_error(self) -> float:
        """Standard error of the measured force as it was read, N; NaN: none."""
        return math.nan if self.measured is None else self.measured.error

    @property
    def difference(self) -> float:
        """Measured less modelled force, rig and filter in both, N; NaN: none."""
        return math.nan if self.measured is None else self.measured.difference

    @property
    def disagrees(self) -> bool:
        """Whether the model misses the measured force by more than it may."""
        if self.measured is None:
            return False
        may = max(_OF_FORCE * abs(self.measured.force), _OF_RANGE * self.half_range)
        noise = 0.0 if math.isnan(self.measured.error) else self.measured.error
        return abs(self.measured.difference) > may + _ERRORS * noise

    @property
    def is_measured(self) -> bool:
        """Whether it is the measured force."""
        return self.origin == MEASURED

    @property
    def with_tare(self) -> Force:
        """The same with the rig's offset in it, as the rig measured."""
        if self.has_tare or self.holds_gas:
            return self
        return replace(
            self,
            force=self.force + self.tare,
            model_force=self.model_force + self.tare,
            error=self.whole_error,
            has_tare=True,
        )

    @property
    def as_measured(self) -> Force:
        """The measured force in place of the model's, where there is one."""
        if self.measured is None:
            return self
        keeps = self.has_tare or self.holds_gas
        rest = math.hypot(self.measured.error, self.tare_error)  # the tare is taken off
        return replace(
            self,
            force=self.measured_force,
            error=self.measured.error if keeps else rest,
            rest=rest,
            carried=np.zeros_like(self.carried),
            origin=MEASURED,
            misfit=0.0,
            undetermined=(0.0, 0.0),
        )

    @property
    def as_read(self) -> Force:
        """The measured force behind the filter, as it was read: no model has a part in it."""
        if self.measured is None:
            return self
        return replace(self, measured=self.measured.as_read).as_measured


def named_speeds(top: float) -> tuple[float, ...]:
    """Return the named test speeds that tests up to a speed, m/s, have reached."""
    return tuple(speed for speed in NAMED_SPEEDS if speed <= (1.0 + REPEATS) * top)


def force_at(
    stages: Sequence[Stage],
    damper: Model,
    speeds: Sequence[float],
    *,
    measured: Sequence[SpeedForces] = (),
    on_error: OnError | None = None,
) -> tuple[Force, ...]:
    """Return the model's forces of settings at speeds in both strokes, what was measured beside.

    Parameters
    ----------
    stages : sequence of Stage
        Settings.
    damper : Model
        The damper's model.
    speeds : sequence of float
        m/s, positive; also such as were never tested.
    measured : sequence of SpeedForces
        Of the same settings.
    on_error : callable, optional
        Told of a setting and the error that it met; without it such an error is raised, but for
        one of the simulation.

    Returns
    -------
    tuple of Force
        By setting, speed and stroke. A setting that cannot be simulated is left out.
    """
    by_stroke = {(one.setting, one.stroke): one for one in measured}
    found: list[Force] = []
    for stage in stages:
        with sparing(stage.setting, on_error):
            try:
                found.extend(_forces_of(stage, damper, speeds, by_stroke))
            except SimulationError:
                continue
    return tuple(found)


def _forces_of(
    stage: Stage,
    damper: Model,
    speeds: Sequence[float],
    by_stroke: dict[tuple[Setting, str], SpeedForces],
) -> Iterator[Force]:
    names = (*stage.own, *stage.shared)
    known = [by_stroke.get((stage.setting, stroke)) for stroke in STROKES]
    read = {
        (speed, stroke): None if one is None else one.at(speed)
        for speed in speeds
        for stroke, one in zip(STROKES, known, strict=True)
    }
    signed = [speed if stroke == STROKES[0] else -speed for speed, stroke in read]
    curve = quasi_static(damper, stage.parameters, signed, sensitivities=names)
    # With the offset the force has a slope of one by it.
    whole = curve.slopes.copy()
    for name in stage.offsets:
        if name in names:
            whole[names.index(name)] = 1.0
    parts = errors_parted(stage)
    rests, carried = split(stage, parts, _without_offsets(stage, curve.slopes))
    errors = _sizes(*split(stage, parts, curve.slopes))
    whole_errors = _sizes(*split(stage, parts, whole))
    spans = _undetermined(stage, damper, curve)
    bends = _bends(damper, stage, curve, list(read.values()))
    for k, ((speed, stroke), seen) in enumerate(read.items()):
        one = known[STROKES.index(stroke)]
        yield Force(
            stage.setting,
            speed,
            stroke,
            force=float(curve.forces[k]),
            error=float(errors[k]),
            rest=float(rests[k]),
            carried=carried[k],
            model_force=float(curve.forces[k]),
            misfit=0.0 if one is None else one.misfit_near(speed),
            undetermined=(float(spans[0, k]), float(spans[1, k])),
            gas=curve.rest if curve.knows_gas else math.nan,
            friction=float(curve.friction[k]),
            is_cavitating=bool(curve.is_cavitating[k]),
            is_tested=not speed > (1.0 + REPEATS) * stage.top_speed,
            measured=_widened(seen, bends[k]),
            half_range=math.nan if one is None else one.half_range,
            tare=stage.offset,
            tare_error=stage.offset_error,
            whole_error=float(whole_errors[k]),
            holds_gas=not curve.knows_gas,
        )


def _widened(seen: MeasuredForce | None, bend: float) -> MeasuredForce | None:
    if seen is None or not bend:
        return seen
    return replace(seen, error=math.hypot(seen.error, bend / NORMAL_95))


def _without_offsets(stage: Stage, slopes: FloatArray) -> FloatArray:
    names = (*stage.own, *stage.shared)
    bare = np.array([0.0 if name in stage.offsets else 1.0 for name in names])
    return np.asarray(slopes * bare[:, None])


def _sizes(rests: FloatArray, carried: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(rests**2 + np.einsum("...ij,...ij->...i", carried, carried)))


def _bends(
    damper: Model, stage: Stage, curve: QuasiStatic, seen: Sequence[MeasuredForce | None]
) -> list[float]:
    """Return how far the model lies from the straight line between measured speeds, N."""
    between = {
        k: one.between
        for k, one in enumerate(seen)
        if one is not None and one.between[0] != one.between[1]
    }
    if not between:
        return [0.0] * len(seen)
    signs = np.sign(curve.speeds)
    ends = [signs[k] * speed for k, pair in between.items() for speed in pair]
    at_ends = quasi_static(damper, stage.parameters, ends).forces.reshape(-1, 2)
    bends = [0.0] * len(seen)
    for (k, (low, high)), (first, second) in zip(between.items(), at_ends.tolist(), strict=True):
        share = (abs(float(curve.speeds[k])) - low) / (high - low)
        if 0.0 < share < 1.0:
            bends[k] = abs(float(curve.forces[k]) - first - share * (second - first))
    return bends


def _undetermined(stage: Stage, damper: Model, curve: QuasiStatic) -> FloatArray:
    """Return how far forces beyond the tested speed may lie below and above, (2, m), N.

    A quantity that the logs do not determine is put to the ends of what they leave open: a blow-off
    that no log opens may open right above the pressures that they reach, or never. At tested
    speeds the logs hold the force, whichever of them it is.
    """
    spans = np.zeros((2, len(curve.speeds)))
    is_beyond = np.abs(curve.speeds) > (1.0 + REPEATS) * stage.top_speed
    if not is_beyond.any():
        return spans
    speeds = curve.speeds[is_beyond]
    for name, limits in stage.open_limits:
        for value in limits:
            values = stage.parameters.replace({name: value})
            away = quasi_static(damper, values, speeds).forces - curve.forces[is_beyond]
            spans[0, is_beyond] = np.maximum(spans[0, is_beyond], -away)
            spans[1, is_beyond] = np.maximum(spans[1, is_beyond], away)
    return spans


def determined_speed(stage: Stage, damper: Model) -> float:
    """Return the speed up to which the logs determine the force of a setting, m/s.

    Up to it the 95 % interval is within 5 % of the damping in both strokes. It is looked for from
    the tested speed, below which the logs hold the force, to five times it.

    Parameters
    ----------
    stage : Stage
        The setting, with what was tested.
    damper : Model
        The damper's model.

    Returns
    -------
    float
        The tested speed or more; NaN where nothing is known of errors or of what was tested.

    Raises
    ------
    SimulationError
        The damper cannot be simulated.
    """
    top = stage.top_speed
    if not 0.0 < top < math.inf or stage.covariance is None:
        return math.nan
    speeds = top * np.geomspace(1.0, _FARTHEST, _STEPS)
    forces = list(_forces_of(stage, damper, speeds.tolist(), {}))
    wide = [
        one.speed
        for one in forces
        if max(one.force - one.low, one.high - one.force) > _DETERMINED * abs(one.damping)
    ]
    return float(max(speeds[speeds < min(wide, default=math.inf)], default=top))


def credible_forces(forces: Sequence[Force]) -> tuple[Force, ...]:
    """Return the forces to tell: as measured at speeds and strokes where any setting disagrees.

    All settings there, so that a change from one to the next is of one kind; where one was not
    measured at that speed, they stay the model's.
    """
    groups: dict[tuple[float, str], list[Force]] = {}
    for one in forces:
        groups.setdefault((one.speed, one.stroke), []).append(one)
    at = {
        key
        for key, few in groups.items()
        if any(one.disagrees for one in few) and all(one.measured is not None for one in few)
    }
    return tuple(one.as_measured if (one.speed, one.stroke) in at else one for one in forces)


def said_offsets(offsets: Sequence[float]) -> str:
    """Return the rigs' offsets in words, as in "-3.4 to 36.6 N"."""
    low, high = (f"{one:.3g}" for one in (min(offsets), max(offsets)))
    return f"{low} N" if low == high else f"{low} to {high} N"


def offset_sentence(offsets: Sequence[float], *, holds_gas: bool = False) -> str:
    """Return what became of the rigs' offsets in forces by setting; empty where there are none."""
    if not any(offsets):
        return ""
    if holds_gas:
        return (
            f"the model knows no gas: its force offset ({said_offsets(offsets)}) holds the gas "
            "force and the rig's tare; it is in these forces, not in what a click changes"
        )
    return (
        f"the force offset ({said_offsets(offsets)}) is the rig's tare, not the damper's: it is "
        "left out of these forces, the measured ones too, and of what a click changes"
    )
