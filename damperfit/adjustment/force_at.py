"""Force of a setting at a speed: the one answer for every table, command and check.

Two origins are never mixed in one number. *model* is the quasi-static characteristic of the damper
alone (`damperfit.damper.quasi_static`), with an interval from the covariance of its parameters and
from the misfit; beyond the tested speed it is as wide as what the logs do not determine leaves it.
*measured* is what a dyno prints (`damperfit.uncertainty.speed_forces`). A rig is tared before each
test: its offset is no part of either, nor of what a click does. Only where a model knows no gas the
offset holds the gas force, and stays.

Two settings share the errors of shared parameters. With C the covariance of (own, shared), g the
slopes of a force by them, theta the shared ones and K = C_own,theta C_theta^-1, the own errors are
K dtheta and a rest that is the setting's alone::

    f = ... + G dtheta + rest,  G = g_theta + g_own K
    var(f_b - f_a) = rest_a + rest_b + (G_b - G_a) C_theta (G_b - G_a)'
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from statistics import median
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.arrays import FloatArray
from damperfit.damper.quasi_static import QuasiStatic, quasi_static
from damperfit.errors import SimulationError, sparing
from damperfit.simulation import NAMED_SPEEDS
from damperfit.statistics import NORMAL_95

if TYPE_CHECKING:
    from damperfit.damper.model import Model, Values
    from damperfit.errors import OnError
    from damperfit.identification.fit_setting import Fit
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty.assessment import Assessment
    from damperfit.uncertainty.speed_forces import MeasuredForce, SpeedForces

STROKE_WORDS = {"rebound": "rebound", "bump": "compression"}  # keys are the paper's, words people's
STROKES = tuple(STROKE_WORDS)
MODEL, MEASURED = "model", "measured"
# Of `Status`, which takes too long to import here.
_FITTED, _NOT_IDENTIFIABLE = "fitted", "not_identifiable"
# A test at 0.26 m/s peaks at 0.258 or 0.262.
REPEATS = 0.02
# Of the shared values' covariance, directions of less than this share are nothing but rounding.
_NOTHING = 1e-15
# A model may miss the measured force by 2 % of it, near its passage through zero by 0.5 % of half
# the force's range, and by three standard errors of the difference.
_OF_FORCE, _OF_RANGE, _ERRORS = 0.02, 0.005, 3.0
# A setting is determined where the interval is no wider than this share of the damping, up to so
# many times the tested speed, in these steps.
_DETERMINED, _FARTHEST, _STEPS = 0.05, 5.0, 16
# Beyond the tested speed the force may rise by half of what the model says, or by twice of it.
_SLOPES = (0.5, 2.0)


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """One setting of the adjuster: its parameters and their errors."""

    setting: Setting
    parameters: Values  # SI
    own: tuple[str, ...] = ()  # values with an error: the setting's own,
    shared: tuple[str, ...] = ()  # and those in common to all settings
    # Of ln y (f_0: of f_0, N), own before shared, shape (k, k). None: no errors are known.
    covariance: FloatArray | None = None
    top_speed: float = math.inf  # highest speed that it was tested at, m/s; infinite: not known
    # Quantities that the logs do not determine, with their limits.
    open_limits: tuple[tuple[str, tuple[float, float]], ...] = ()
    # Standard errors of values from the model's misfit, SI.
    misfits: Mapping[str, float] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Values with an error, in the order of the covariance."""
        return (*self.own, *self.shared)

    @property
    def offsets(self) -> tuple[str, ...]:
        """Names of the values that are a tare of the rig."""
        return tuple(q.name for q in self.parameters.quantities if q.is_offset)

    @property
    def offset(self) -> float:
        """What the rig adds to the force, N."""
        return sum((float(getattr(self.parameters, name)) for name in self.offsets), 0.0)

    @property
    def knows_offset(self) -> bool:
        """Whether an offset was fitted or given: one that is fixed at 0 is no tare."""
        return self.offset != 0.0 or any(name in self.names for name in self.offsets)


def stage_of(fit: Fit, assessment: Assessment) -> Stage:
    """Return a fit and its errors as one stage of the adjuster."""
    limits = {
        name: assessment.plausible_limits(fit, name)
        for name, status in fit.status.items()
        if status == _NOT_IDENTIFIABLE
    }
    stage = Stage(
        fit.setting,
        fit.parameters,
        top_speed=max(segment.peak_speed for log in fit.logs for segment in log.trace.segments),
        open_limits=open_limits(fit.parameters, limits),
    )
    uncertainty = next((u for u in assessment.uncertainties if u.setting == fit.setting), None)
    if uncertainty is None or has_lost_errors(uncertainty.names, fit.status):
        return stage
    return replace(
        stage,
        own=uncertainty.names[: len(uncertainty.names) - len(uncertainty.shared)],
        shared=uncertainty.shared,
        covariance=uncertainty.covariance,
        misfits={name: interval.misfit for name, interval in uncertainty.intervals.items()},
    )


def open_limits(
    parameters: Values, limits: Mapping[str, tuple[float | None, float | None]]
) -> tuple[tuple[str, tuple[float, float]], ...]:
    """Return lower and upper limit of quantities; where one is missing, the plausible one."""
    spans = []
    for name, (low, high) in limits.items():
        quantity = parameters.quantity(name)
        if not quantity.is_offset:
            least, most = quantity.plausible
            spans.append((name, (least if low is None else low, most if high is None else high)))
    return tuple(spans)


def has_lost_errors(names: Sequence[str], status: Mapping[str, str]) -> bool:
    """Return whether a value that was fitted has no error, as where a fit has met no minimum."""
    # What is left, the errors of shared values, would pass for those of its forces.
    return any(state == _FITTED and name not in names for name, state in status.items())


@dataclass(frozen=True, slots=True, eq=False)
class Force:
    """Force of one setting at one speed, N, positive in rebound; all errors are standard errors."""

    setting: Setting
    speed: float  # m/s, positive
    stroke: str  # rebound or bump
    force: float  # gas and friction are in it, the rig's offset less `tare_out`
    error: float  # NaN where it is not known
    rest: float  # the part of it that is the setting's alone; like `carried` without the offset's
    # Shape (number of shared parameters,): what independent unit errors of the shared parameters
    # do to the force; in the same order for all settings.
    carried: FloatArray
    model_force: float = math.nan  # like `force` in all else
    origin: str = MODEL  # whose `force` is: `MODEL` or `MEASURED`
    # From the model's misfit: what repeats in the residual at like speeds, its share in what the
    # rig takes up between the measured force and this one, such as the tare, and below the slowest
    # measured speed its share in the friction.
    misfit: float = 0.0
    # How far it may be below and above for what the logs do not determine.
    undetermined: tuple[float, float] = (0.0, 0.0)
    rise: float = 0.0  # from the highest tested speed on, where no log shows that the law holds
    gas: float = math.nan  # part of the model's force: gas and ambient pressure on the rod
    friction: float = math.nan  # likewise: seals
    is_cavitating: bool = False  # a chamber is at zero pressure at this speed
    is_tested: bool = True  # at this speed or a higher one
    measured: MeasuredForce | None = None  # at this speed, the rig's tare in it
    half_range: float = math.nan  # of the measured force
    tare: float = 0.0  # the rig's force offset at this setting,
    tare_out: float = 0.0  # and what of it is not in the force
    tare_error: float = 0.0
    tare_misfit: float = 0.0
    taken_up: float = 0.0  # the rig's part of `misfit`
    whole_error: float = math.nan  # of the force with the offset
    holds_gas: bool = False  # the model knows no gas: the offset holds it, and is in the force

    @property
    def gas_out(self) -> Force:
        """The same with the gas force taken out of it, and of what was measured."""
        measured = self.measured
        if measured is not None:
            names = ("force", "opening", "closing", "peak")
            measured = replace(measured, **{n: getattr(measured, n) - self.gas for n in names})
        force, model = self.force - self.gas, self.model_force - self.gas
        return replace(self, force=force, model_force=model, measured=measured, gas=math.nan)

    @property
    def reach(self) -> float:
        """Half the 95 % interval of noise and misfit, N."""
        return NORMAL_95 * math.hypot(self.error, self.misfit)

    @property
    def extrapolated(self) -> tuple[float, float]:
        """How far it may be below and above where the law does not continue as fitted, N."""
        steps = [(slope - 1.0) * self.rise for slope in _SLOPES]
        return -min(steps), max(steps)

    @property
    def low(self) -> float:
        """Lower end of the 95 % interval, N."""
        return self.force - max(self.reach, self.undetermined[0], self.extrapolated[0])

    @property
    def high(self) -> float:
        """Upper end of the 95 % interval, N."""
        return self.force + max(self.reach, self.undetermined[1], self.extrapolated[1])

    @property
    def is_determined(self) -> bool:
        """Whether what the logs do not determine leaves the interval as it is."""
        return max(self.undetermined) <= max(self.reach, _OF_FORCE * abs(self.damping))

    @property
    def bare_force(self) -> float:
        """The force without the offset, N."""
        return self.force - (self.tare - self.tare_out)

    @property
    def damping(self) -> float:
        """The force without gas force and tare, N."""
        return self.bare_force - (0.0 if math.isnan(self.gas) else self.gas)

    @property
    def measured_force(self) -> float:
        """The measured force, the tare in it where it is in `force`, N; NaN: none."""
        return math.nan if self.measured is None else self.measured.force - self.tare_out

    @property
    def measured_error(self) -> float:
        """Standard error of the measured force, with that of the tare taken out, N; NaN: none."""
        error = math.nan if self.measured is None else self.measured.error
        return math.hypot(error, self.tare_error, self.tare_misfit)

    @property
    def difference(self) -> float:
        """Measured less modelled force, rig and filter in both, N; NaN: none."""
        return math.nan if self.measured is None else self.measured.difference

    @property
    def disagrees(self) -> bool:
        """Whether the model misses the measured force by more than it may."""
        if (measured := self.measured) is None:
            return False
        may = max(_OF_FORCE * abs(measured.force), _OF_RANGE * self.half_range)
        # The difference was taken at measured speeds: the bend between them is no part of it.
        noise = math.hypot(measured.scatter, 0.5 * measured.rounding / NORMAL_95)
        noise = 0.0 if math.isnan(noise) else noise
        return abs(measured.difference) > may + _ERRORS * noise

    @property
    def is_measured(self) -> bool:
        """Whether it is the measured force."""
        return self.origin == MEASURED

    @property
    def with_tare(self) -> Force:
        """The same with the rig's offset in it, as the rig measured."""
        return replace(
            self,
            force=self.force + self.tare_out,
            model_force=self.model_force + self.tare_out,
            error=self.whole_error,
            misfit=math.sqrt(max(self.misfit**2 - self.taken_up**2, 0.0)),
            tare_out=0.0,
            tare_error=0.0,
            tare_misfit=0.0,
            taken_up=0.0,
        )

    @property
    def as_measured(self) -> Force:
        """The measured force in place of the model's, where there is one."""
        if self.measured is None:
            return self
        return replace(
            self,
            force=self.measured_force,
            error=self.measured_error,
            rest=self.measured_error,
            carried=np.zeros_like(self.carried),
            origin=MEASURED,
            misfit=0.0,
            undetermined=(0.0, 0.0),
        )

    @property
    def as_read(self) -> Force:
        """The measured force behind the filter, as it was read, without a model's correction."""
        if self.measured is None:
            return self
        return replace(self, measured=self.measured.as_read).as_measured


def named_speeds(top: float, speeds: Sequence[float] = NAMED_SPEEDS) -> tuple[float, ...]:
    """Return the speeds, by default the named ones, that tests up to a speed, m/s, have reached."""
    return tuple(speed for speed in speeds if speed <= (1.0 + REPEATS) * top)


def force_at(
    stages: Sequence[Stage],
    damper: Model,
    speeds: Sequence[float],
    *,
    measured: Sequence[SpeedForces] = (),
    on_error: OnError | None = None,
) -> tuple[Force, ...]:
    """Return the model's forces of settings at speeds in both strokes, with the measured ones.

    Speeds, m/s, are positive, also such as were never tested. A setting that cannot be simulated is
    left out; another error is passed to `on_error`, or raised.
    """
    by_stroke = {(test.setting, test.stroke): test for test in measured}
    forces: list[Force] = []
    for stage in stages:
        with sparing(stage.setting, on_error), suppress(SimulationError):
            forces += _forces_of(stage, damper, speeds, by_stroke)
    return tuple(forces)


def _forces_of(
    stage: Stage,
    damper: Model,
    speeds: Sequence[float],
    by_stroke: Mapping[tuple[Setting, str], SpeedForces],
) -> list[Force]:
    values, offsets = stage.parameters, stage.offsets
    places = [(speed, stroke) for speed in speeds for stroke in STROKES]
    tests = [by_stroke.get((stage.setting, stroke)) for _, stroke in places]
    picked = [
        None if test is None else test.at(speed)
        for test, (speed, _) in zip(tests, places, strict=True)
    ]
    signed = [speed if stroke == STROKES[0] else -speed for speed, stroke in places]
    curve = quasi_static(damper, values, signed, sensitivities=stage.names)
    is_offset = np.array([name in offsets for name in stage.names], dtype=bool)
    own_errors, carried = _errors(stage, np.where(is_offset[:, None], 0.0, curve.slopes))
    without_offset = np.hypot(own_errors, np.linalg.norm(carried, axis=1))
    alone, shared = _errors(stage, np.where(is_offset[:, None], 1.0, curve.slopes))
    with_offset = np.hypot(alone, np.linalg.norm(shared, axis=1))
    below, above = _undetermined(stage, damper, curve)
    rises = _rises(stage, damper, curve)
    bends = _bends(damper, stage, curve, picked)
    tare_out = tare_error = tare_misfit = 0.0
    if curve.knows_gas:
        tare_out = stage.offset
        if stage.covariance is not None and is_offset.any():
            variance = float(stage.covariance[np.ix_(is_offset, is_offset)].sum())
            tare_error = math.sqrt(max(variance, 0.0))
        tare_misfit = math.hypot(*(stage.misfits.get(name, 0.0) for name in offsets))
    # Error of the friction from the misfit, as a share of it.
    frictions = (q.name for q in values.quantities if q.is_friction)
    seals = max(
        (stage.misfits.get(n, 0.0) / (abs(float(getattr(values, n))) or 1.0) for n in frictions),
        default=0.0,
    )
    forces = []
    for k, ((speed, stroke), test, pick) in enumerate(zip(places, tests, picked, strict=True)):
        taken_up = None if test is None else test.taken_up_near(speed)
        taken_up = tare_misfit if taken_up is None else taken_up
        misfit = taken_up
        if pick is not None:  # of few cycles the bend alone is known
            noise = 0.0 if math.isnan(pick.error) and bends[k] > 0.0 else pick.error
            pick = replace(pick, error=math.hypot(noise, bends[k] / NORMAL_95))  # noqa: PLW2901
        if test is not None:
            misfit = math.hypot(misfit, test.misfit_near(speed))
            if test.speeds and speed * (1.0 + REPEATS) < test.speeds[0]:
                misfit = math.hypot(misfit, seals * curve.friction[k])
        forces.append(
            Force(
                stage.setting,
                speed,
                stroke,
                force=float(curve.forces[k]),
                error=float((without_offset if curve.knows_gas else with_offset)[k]),
                rest=float(own_errors[k]),
                carried=carried[k],
                model_force=float(curve.forces[k]),
                misfit=misfit,
                undetermined=(float(below[k]), float(above[k])),
                rise=float(rises[k]),
                gas=curve.rest if curve.knows_gas else math.nan,
                friction=float(curve.friction[k]),
                is_cavitating=bool(curve.is_cavitating[k]),
                is_tested=not speed > (1.0 + REPEATS) * stage.top_speed,
                measured=pick,
                half_range=math.nan if test is None else test.half_range,
                tare=stage.offset,
                tare_out=tare_out,
                tare_error=tare_error,
                tare_misfit=tare_misfit,
                taken_up=taken_up,
                whole_error=float(with_offset[k]),
                holds_gas=not curve.knows_gas,
            )
        )
    return forces


def _errors(stage: Stage, slopes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Errors of m forces from the setting's own values, (m,), and from shared ones."""
    # By slopes of shape (k, m); NaN where nothing is known.
    n, m = len(stage.own), slopes.shape[1]
    if stage.covariance is None:
        return np.full(m, math.nan), np.zeros((m, len(stage.shared)))
    own_block, cross = stage.covariance[:n, :n], stage.covariance[:n, n:]
    values, directions = np.linalg.eigh(stage.covariance[n:, n:])
    is_known = np.abs(values) > _NOTHING * np.max(np.abs(values), initial=0.0)
    inverse = np.divide(1.0, values, out=np.zeros_like(values), where=is_known)
    follow = cross @ (directions * inverse) @ directions.T
    # The symmetric root is unique; signs of directions, and like ones themselves, hang on rounding.
    root = (directions * np.sqrt(np.maximum(values, 0.0))) @ directions.T
    by_own, by_shared = slopes[:n].T, slopes[n:].T
    variances = np.einsum("ij,ij->i", by_own @ (own_block - follow @ cross.T), by_own)
    return np.sqrt(np.maximum(variances, 0.0)), np.asarray((by_shared + by_own @ follow) @ root)


def _bends(
    damper: Model, stage: Stage, curve: QuasiStatic, picked: Sequence[MeasuredForce | None]
) -> FloatArray:
    """Return how far the model lies from the straight line between measured speeds, N."""
    bends = np.zeros(len(picked))
    pairs = ((k, pick.between) for k, pick in enumerate(picked) if pick)
    between = {k: speeds for k, speeds in pairs if len(set(speeds)) > 1}
    if not between:
        return bends
    signs = np.sign(curve.speeds)
    measured = [signs[k] * speed for k, pair in between.items() for speed in pair]
    modelled = quasi_static(damper, stage.parameters, measured).forces.reshape(-1, 2)
    for (k, pair), forces in zip(between.items(), modelled, strict=True):
        bends[k] = abs(curve.forces[k] - np.interp(abs(curve.speeds[k]), pair, forces))
    return bends


def _undetermined(stage: Stage, damper: Model, curve: QuasiStatic) -> FloatArray:
    """How far forces beyond the tested speed may lie below and above, (2, m), N."""
    # A quantity that the logs do not determine is put at both of its limits: a blow-off that no log
    # opens may open right above the tested pressures, or never. At tested speeds the logs determine
    # the force, whichever value it has.
    spans = np.zeros((2, len(curve.speeds)))
    is_beyond = np.abs(curve.speeds) > (1.0 + REPEATS) * stage.top_speed
    for name, limits in stage.open_limits if is_beyond.any() else ():
        for value in limits:
            values = stage.parameters.replace({name: value})
            extremes = quasi_static(damper, values, curve.speeds[is_beyond]).forces
            change = extremes - curve.forces[is_beyond]
            spans[:, is_beyond] = np.maximum(spans[:, is_beyond], [-change, change])
    return spans


def _rises(stage: Stage, damper: Model, curve: QuasiStatic) -> FloatArray:
    """What forces beyond the tested speed are more than the force there, N; 0 below it."""
    is_beyond = np.abs(curve.speeds) > (1.0 + REPEATS) * stage.top_speed
    if not is_beyond.any():
        return np.zeros(len(is_beyond))
    at_top = quasi_static(damper, stage.parameters, np.sign(curve.speeds) * stage.top_speed).forces
    return np.where(is_beyond, curve.forces - at_top, 0.0)


def determined_speed(stage: Stage, damper: Model) -> float:
    """Return the speed up to which the logs determine the force of a setting, m/s; NaN: not known.

    Up to it, from the tested speed to five times it, the 95 % interval is within 5 % of the damping
    in both strokes, if the law continues as fitted. A SimulationError: it cannot be simulated.
    """
    top = stage.top_speed
    if not 0.0 < top < math.inf or stage.covariance is None:
        return math.nan
    speeds = top * np.geomspace(1.0, _FARTHEST, _STEPS)
    wide = [
        force.speed
        for force in _forces_of(stage, damper, speeds.tolist(), {})
        if max(force.reach, *force.undetermined) > _DETERMINED * abs(force.damping)
    ]
    return float(max(speeds[speeds < min(wide, default=math.inf)], default=top))


def credible_forces(forces: Sequence[Force]) -> tuple[Force, ...]:
    """Return the forces to show: as measured at speeds and strokes where any setting disagrees."""
    # All settings there, so that a change from one to the next is of one kind; where one was not
    # measured at that speed, they stay the model's.
    groups: dict[tuple[float, str], list[Force]] = defaultdict(list)
    for force in forces:
        groups[force.speed, force.stroke].append(force)
    disagreeing = {
        key
        for key, group in groups.items()
        if any(force.disagrees for force in group) and all(force.measured for force in group)
    }
    return tuple(f.as_measured if (f.speed, f.stroke) in disagreeing else f for f in forces)


def offsets_in_words(offsets: Sequence[float]) -> str:
    """Return the rigs' offsets in words, as in "-3.4 to 36.6 N"."""
    low, high = (f"{offset:.3g}" for offset in (min(offsets), max(offsets)))
    return f"{low} N" if low == high else f"{low} to {high} N"


def offset_sentence(offsets: Sequence[float], *, holds_gas: bool = False) -> str:
    """Return what became of the rigs' offsets in forces by setting; empty where there are none."""
    if not any(offsets):
        return ""
    words = f"force offset ({offsets_in_words(offsets)})"
    if holds_gas:
        return (
            f"the model knows no gas: its {words} holds the gas force and the rig's tare; it is in "
            "these forces, not in what a click changes"
        )
    return (
        f"the {words} is the rig's tare, not the damper's: it is left out of these forces, the "
        "measured ones too, and of what a click changes"
    )


# Rigs repeat a speed to 1 %, and a stroke no worse.
_AS_FAST, _SAME_STROKE = 0.05, 0.05
_SINE = 0.1  # peak speed of a sine by its frequency against the one found; a triangle's is 36 % off


class Sine(NamedTuple):
    """The sine that stands for the motions of tests."""

    amplitude: float  # m
    frequency: float  # Hz

    @property
    def peak_speed(self) -> float:
        """Largest speed, m/s."""
        return 2.0 * math.pi * self.frequency * self.amplitude


def fastest_sine(tested: Sequence[tuple[float, float, float]]) -> Sine:
    """Return the sine of the fastest motion, by amplitude, frequency, peak speed (m, Hz, m/s)."""
    # What is no sine (a triangle, a road) stands for the sine of its stroke and speed.
    fastest = max(speed for *_, speed in tested)
    near = [motion for motion in tested if motion[2] >= (1.0 - _AS_FAST) * fastest]
    # Tests of one speed at several strokes have no motion in common: their means were never run.
    middle = sorted(near)[(len(near) - 1) // 2][0]
    of_stroke = [motion for motion in near if abs(motion[0] / middle - 1.0) <= _SAME_STROKE]
    amplitude, frequency = (median(motion[k] for motion in of_stroke) for k in (0, 1))
    by_speed = max(speed for *_, speed in of_stroke) / (2.0 * math.pi * amplitude)
    is_sine = abs(frequency / by_speed - 1.0) <= _SINE
    return Sine(amplitude, frequency if is_sine else by_speed)
