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
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.quasi_static import QuasiStatic, quasi_static
from damperfit.errors import SimulationError, sparing
from damperfit.simulation import NAMED_SPEEDS
from damperfit.statistics import NORMAL_95

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.identification import Fit
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty import Assessment

    FloatArray = NDArray[np.float64]
    from collections.abc import Iterator

    from damperfit.damper.model import Model
    from damperfit.errors import OnError
    from damperfit.uncertainty import SpeedForces
    from damperfit.uncertainty.speed_forces import MeasuredForce

__all__ = [
    "MEASURED",
    "MODEL",
    "REPEATS",
    "STROKES",
    "Force",
    "Parts",
    "Sine",
    "Stage",
    "credible_forces",
    "determined_speed",
    "errors_parted",
    "fastest_sine",
    "force_at",
    "has_lost_errors",
    "named_speeds",
    "offset_sentence",
    "open_limits",
    "said_offsets",
    "split",
    "stage_of",
]


# One setting as a stage of the adjuster, and its errors parted into shared ones and its own.
#
# The error of a force comes from the covariance C of (own, shared) through the sensitivities g =
# df/du, u = ln y. For the difference of two settings the shared parameters are one and the same
# error. With theta the shared ones and K = C_own,theta C_theta^-1, the own errors split into K
# dtheta and a rest that is the setting's alone (up to 1/n for n settings in a mean)::
#
#     f  = ... + G dtheta + rest,  G = g_theta + g_own K
#     var(f_b - f_a) = rest_a + rest_b + (G_b - G_a) C_theta (G_b - G_a)'

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


# The sine that stands for the motions of tests.

_AS_FAST = 0.05  # rigs repeat a speed to 1 %
_SAME_STROKE = 0.05  # and a stroke no worse
_SINE = 0.1  # peak speed of a sine by its frequency against the one found; a triangle's is 36 % off


@dataclass(frozen=True, slots=True)
class Sine:
    """A sine.

    Attributes
    ----------
    amplitude, frequency : float
        m, Hz.
    was_run : bool
        It is a test's own motion; false where it stands for one that is no sine.
    """

    amplitude: float
    frequency: float
    was_run: bool = True

    @property
    def peak_speed(self) -> float:
        """Largest speed, m/s."""
        return 2.0 * math.pi * self.frequency * self.amplitude


def fastest_sine(tested: Sequence[tuple[float, float, float]]) -> Sine:
    """Return the sine of the fastest motion; of several as fast, that of the middle stroke.

    A motion that is no sine (a triangle, a road) stands for the sine of its stroke and speed.

    Parameters
    ----------
    tested : sequence of (float, float, float)
        Amplitude, frequency and peak speed of each motion: m, Hz, m/s.
    """
    fastest = max(speed for *_, speed in tested)
    near = [one for one in tested if one[2] >= (1.0 - _AS_FAST) * fastest]
    # Tests of one speed at several strokes have no motion in common: their means were never run.
    middle = sorted(near)[(len(near) - 1) // 2][0]
    alike = [one for one in near if abs(one[0] / middle - 1.0) <= _SAME_STROKE]
    amplitude, frequency = (median(one[k] for one in alike) for k in (0, 1))
    by_speed = max(speed for *_, speed in alike) / (2.0 * math.pi * amplitude)
    is_sine = abs(frequency / by_speed - 1.0) <= _SINE
    return Sine(amplitude, frequency if is_sine else by_speed, is_sine)
