"""The measured force at a speed, and what the model misses there.

Of a setting that was tested at several speeds it is the peak velocity pick-off (PVP): the force at
the peak speed of each segment, between segments a straight line. Of a setting that was tested at
one speed it is the loop where it passes a speed (CVP), on the opening and on the closing branch,
and their mean. A loop has passed the filter, which smears the jump of the friction over some
milliseconds: what it takes off the model's force on the same cycles is put back, half of it is in
the interval, and nearer to a reversal than a quarter of the corner's period there is no value.

Beside it stands the residual where the force is read: measured less modelled force, rig and filter
in both. What repeats in the residual at like speeds of the same stroke is an error of the model's
force that no noise explains.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from damperfit.arrays import FloatArray
from damperfit.conditioning.filters import corner_of
from damperfit.conditioning.measured_characteristics import counted_edges, peak_velocity_forces
from damperfit.damper.model import Model
from damperfit.damper.quasi_static import quasi_static
from damperfit.errors import SimulationError
from damperfit.identification.fit_setting import Fit
from damperfit.passed_speeds import in_both_strokes
from damperfit.recording import Segment
from damperfit.simulation import NAMED_SPEEDS
from damperfit.statistics import NORMAL_95, median
from damperfit.tested.setting import Setting
from damperfit.uncertainty.covariance import Linearisation, Uncertainty
from damperfit.uncertainty.residuals import residual_scatter

PVP, CVP = "pvp", "cvp"
# Strokes and speeds that differ by less are those of one test.
_SAME_MOTION = 0.05
# Shares of the peak speed at which a loop is read besides the named speeds.
_SHARES = tuple(k / 20.0 for k in range(1, 20))
# Speeds within this factor are alike: the misfit there is the error of the force here.
_ALIKE = 2.0
# Of the corner's period; the step of a filter is over by then but for some per cent.
_NEAR_A_REVERSAL = 0.25
_PEAKS_DIFFER = 0.02
# A test at 0.26 m/s peaks at 0.258 or 0.262.
_REPEATS = 0.02
_IS_AT = 1e-9  # a speed is that of a test but for rounding


@dataclass(frozen=True, slots=True)
class MeasuredForce:
    """The measured force at a speed, N."""

    force: float  # the rig's tare in it
    error: float  # its standard error, with what was put back for the filter
    scatter: float  # standard error by the cycles alone
    rounding: float  # what was put back
    difference: float  # measured less modelled force, as they were read
    opening: float  # of a loop: the two branches; NaN of a peak
    closing: float
    peak: float  # of a peak: the largest force of the stroke; NaN of a loop
    kind: str  # `PVP` or `CVP`
    # Speeds of the segments around it, m/s; the same where it is at one.
    between: tuple[float, float]

    @property
    def as_read(self) -> MeasuredForce:
        """The same with nothing put back: no model has a part in it."""
        return replace(self, force=self.force - self.rounding, error=self.scatter, rounding=0.0)

    @property
    def peak_differs(self) -> bool:
        """Whether the largest force of the stroke is off that at the peak speed by over 2 %."""
        return abs(self.peak - self.force) > _PEAKS_DIFFER * abs(self.force)


@dataclass(frozen=True, slots=True)
class SpeedForces:
    """Measured force over speed of one setting and stroke, N."""

    setting: Setting
    stroke: str  # "rebound" or "bump"
    half_range: float  # half the range of the measured force
    speeds: tuple[float, ...]  # m/s, positive and rising
    measured: tuple[float, ...]  # with what the filter took put back,
    measured_se: tuple[float, ...]  # and its standard error; NaN for one cycle
    difference: tuple[float, ...]  # measured less modelled force as they were read
    misfit: tuple[float, ...]  # what repeats in the residual at like speeds, root mean square; or 0
    kind: str = ""  # `PVP` or `CVP`; "" of older versions: loops with what the filter made of them
    rounding: tuple[float, ...] = ()  # what was put back for the filter
    opening: tuple[float, ...] = ()  # of a loop: its branches
    closing: tuple[float, ...] = ()
    peak_forces: tuple[float, ...] = ()  # of peaks: the largest force of the stroke in the segment
    # Standard error, by the misfit, of what lies between the measured force and the damper's own
    # (tare, gas off the middle of the stroke, what yields or lags), at rising speeds. Empty of
    # older versions.
    taken_up_at: tuple[float, ...] = ()
    taken_up: tuple[float, ...] = ()

    def at(self, speed: float) -> MeasuredForce | None:
        """Return the force at a speed; None where it was not measured."""
        if not self.kind or not self.speeds:
            return None
        low, high = self.speeds[0] / (1.0 + _REPEATS), self.speeds[-1] * (1.0 + _REPEATS)
        if not low <= speed <= high:
            return None
        before = after = min(range(len(self.speeds)), key=lambda k: abs(self.speeds[k] - speed))
        if len(self.speeds) > 1 and abs(speed / self.speeds[before] - 1.0) > _IS_AT:
            before = min(max(bisect_right(self.speeds, speed), 1), len(self.speeds) - 1) - 1
            after = before + 1
        ends = self.speeds[before], self.speeds[after]
        share = 0.0 if before == after else (speed - ends[0]) / (ends[1] - ends[0])

        def read(row: tuple[float, ...]) -> float:
            return row[before] + share * (row[after] - row[before]) if row else math.nan

        scatter, rounding = read(self.measured_se), read(self.rounding)
        return MeasuredForce(
            force=read(self.measured),
            error=math.hypot(scatter, 0.5 * rounding / NORMAL_95),
            scatter=scatter,
            rounding=rounding,
            difference=read(self.difference),
            opening=read(self.opening),
            closing=read(self.closing),
            peak=read(self.peak_forces),
            kind=self.kind,
            between=ends,
        )

    def misfit_near(self, speed: float) -> float:
        """Return the misfit at a speed, or at the nearest that was measured, N."""
        return float(np.interp(speed, self.speeds, self.misfit)) if self.speeds else 0.0

    def taken_up_near(self, speed: float) -> float | None:
        """Return what was taken up there likewise, N; None where it is not known."""
        return float(np.interp(speed, self.taken_up_at, self.taken_up)) if self.taken_up else None


class _Readings(NamedTuple):
    """One steady segment: its samples, and of each stroke what is read at its peaks."""

    segment: Segment
    velocity: FloatArray
    force: FloatArray
    residuals: FloatArray
    noise: float  # variance of the residuals that does not repeat, N2
    rounding: tuple[FloatArray, ...]
    slowest: float  # m/s; a slower passage is too near to a reversal
    jacobian: FloatArray  # (n, k)
    peaks: FloatArray  # (2, 8 + k): of both strokes a row as below


# A row: these, what was put back, both branches, the stroke's largest force, and the slopes of the
# modelled force by the logarithms of the model's quantities.
_SPEED, _FORCE, _ERROR, _DIFFERENCE = range(4)
_N_NUMBERS = 8


class Slopes(NamedTuple):
    """Of a stroke's modelled force by the logarithms of the model's quantities, rig in it."""

    speeds: FloatArray  # (m,), rising, m/s
    rows: FloatArray  # (k, m), the mean of both branches, and of the tests that pass a speed


def speed_forces(
    linearised: Linearisation, *, is_structured: bool
) -> tuple[tuple[SpeedForces, Slopes], ...]:
    """Return the forces of a setting in rebound and in bump; none where no cycle repeats."""
    readings = sorted(_readings(linearised), key=lambda reading: reading.segment.peak_speed)
    if not readings:
        return ()
    tests: list[list[_Readings]] = []
    for reading in readings:
        top = reading.segment.peak_speed
        if not tests or top > (1.0 + _SAME_MOTION) * tests[-1][0].segment.peak_speed:
            tests.append([])
        tests[-1].append(reading)
    half_range = 0.5 * max(float(np.ptp(reading.force)) for reading in readings)
    is_loop = len(tests) == 1

    def misfit(speed: float, sign: float) -> float:
        """The root mean square of what repeats in a stroke at speeds like this, N."""
        squares = []
        for reading in readings if is_structured else ():
            along = sign * reading.velocity
            alike = reading.residuals[(along >= speed / _ALIKE) & (along <= speed * _ALIKE)]
            squares += [float(np.mean(alike**2)) - reading.noise] if len(alike) else []
        return math.sqrt(max(float(np.mean(squares)), 0.0)) if squares else 0.0

    forces = []
    for place, (stroke, sign) in enumerate((("rebound", 1.0), ("bump", -1.0))):
        peaks = [_mean([reading.peaks[place] for reading in test])[:, None] for test in tests]
        loops = [
            _known(_of_loop(test, sign), peak) for test, peak in zip(tests, peaks, strict=True)
        ]
        rows = (loops[0] if is_loop else _known(*peaks))[:_N_NUMBERS]
        speed, force, error, difference, back, opening, closing, largest = map(tuple, rows.tolist())
        of_stroke = SpeedForces(
            setting=linearised.fit.setting,
            stroke=stroke,
            half_range=half_range,
            speeds=speed,
            measured=force,
            measured_se=error,
            difference=difference,
            misfit=tuple(misfit(at, sign) for at in speed),
            kind=CVP if is_loop else PVP,
            rounding=back,
            opening=opening if is_loop else (),
            closing=closing if is_loop else (),
            peak_forces=() if is_loop else largest,
        )
        forces.append((of_stroke, _mean_slopes(loops)))
    return tuple(forces)


def _known(*rows: FloatArray) -> FloatArray:
    """Rows of several passages as columns, by rising speed, of those that have been read."""
    columns = np.hstack(rows)
    columns = columns[:, np.isfinite(columns[[_SPEED, _FORCE, _DIFFERENCE]]).all(axis=0)]
    return np.asarray(columns[:, np.argsort(columns[_SPEED], kind="stable")])


def _mean_slopes(loops: Sequence[FloatArray]) -> Slopes:
    # Of np.unique the first call loads numpy.ma, a sixtieth of the command.
    speeds = np.array(sorted({*np.concatenate([rows[_SPEED] for rows in loops]).tolist()}))
    total, count = np.zeros((len(loops[0]) - _N_NUMBERS, len(speeds))), np.zeros(len(speeds))
    for rows in (rows for rows in loops if rows.shape[1]):
        passed = (speeds >= rows[_SPEED, 0]) & (speeds <= rows[_SPEED, -1])
        count[passed] += 1.0
        for into, along in zip(total, rows[_N_NUMBERS:], strict=True):
            into[passed] += np.interp(speeds[passed], rows[_SPEED], along)
    return Slopes(speeds, total / np.maximum(count, 1.0))


def beside_the_rig(
    forces: SpeedForces, slopes: Slopes, fit: Fit, known: Uncertainty, damper: Model
) -> SpeedForces:
    """Return the forces with what the misfit makes uncertain between them and the damper's own.

    The fit holds the measured force: its misfit is what the residual shows there. The force of the
    damper alone is another function g(u) than the measured one J(u), and what the rig takes up
    between them has the variance (g - J) C (g - J)' with the misfit's covariance C.
    """
    speeds = slopes.speeds * (1.0 if forces.stroke == "rebound" else -1.0)
    if known.misfit is None or not known.misfit.any() or not len(speeds):
        return forces
    try:
        own = quasi_static(damper, fit.parameters, speeds, sensitivities=known.names).slopes
    except SimulationError:
        return forces
    places = [fit.parameters.names.index(name) for name in known.names]
    away = own - slopes.rows[places]
    errors = np.sqrt(np.maximum(np.einsum("im,ij,jm->m", away, known.misfit, away), 0.0))
    return replace(
        forces, taken_up_at=tuple(slopes.speeds.tolist()), taken_up=tuple(errors.tolist())
    )


def _mean(tests: Sequence[FloatArray]) -> FloatArray:
    """Return the mean of the rows of like tests, the error that of the mean."""
    rows = np.array(tests)
    means = np.asarray(rows.mean(axis=0))
    means[_ERROR] = np.sqrt(np.mean(rows[:, _ERROR] ** 2, axis=0) / len(rows))
    return means


def _readings(linearised: Linearisation) -> Iterator[_Readings]:
    for log, seen in zip(linearised.fit.logs, linearised.logs, strict=True):
        trace = log.trace
        corner = corner_of(trace.model_filter, sample_rate=1.0 / trace.interval)
        segments = zip(trace.segments, trace.places, seen.rounding, strict=True)
        for segment, place, rounding in segments:
            if not segment.n_cycles:
                continue
            velocity, force = trace.velocity[segment.window], trace.force[segment.window]
            residuals = seen.residuals[place]
            noise = residual_scatter(residuals, segment)
            # The change of speed in a sample where it passes zero.
            turns = np.flatnonzero(velocity[:-1] * velocity[1:] <= 0.0)
            slope = median(np.abs(np.diff(velocity)[turns])) if len(turns) else 0.0
            slowest = slope / trace.interval * _NEAR_A_REVERSAL / corner
            edges = counted_edges(segment) - segment.first
            clean = slice(max(int(edges[0]), 0), int(edges[-1]))
            jacobian = seen.jacobian[place]
            signals = np.vstack([force, residuals, jacobian.T])[:, clean]
            begins = edges[:-1] - edges[0]
            peaks = []
            for sign in (1.0, -1.0):
                # The error of the residual: that of the force holds the scatter of the motion.
                speed, (at_peak, residual, *slopes), errors = peak_velocity_forces(
                    sign * velocity[clean], signals, begins
                )
                largest = sign * float(np.mean(np.maximum.reduceat(sign * signals[0], begins)))
                numbers = speed, at_peak, errors[1], residual, 0.0, at_peak, at_peak, largest
                peaks.append([*numbers, *slopes])
            noise = noise if math.isfinite(noise) else 0.0
            read = velocity, force, residuals, noise, rounding, slowest
            yield _Readings(segment, *read, jacobian, np.array(peaks))


def _of_loop(test: Sequence[_Readings], sign: float) -> FloatArray:
    """Return the rows of a loop at named speeds and shares of its peak speed, below the peak."""
    usual = sorted(reading.segment.amplitude for reading in test)[len(test) // 2]
    alike = [x for x in test if abs(x.segment.amplitude / usual - 1.0) <= _SAME_MOTION]
    top = min(float(reading.peaks[:, _SPEED].min()) for reading in alike)
    slowest = math.ceil(1e6 * max(reading.slowest for reading in alike)) / 1e6
    asked = {slowest, *NAMED_SPEEDS, *(round(share * top, 6) for share in _SHARES)}
    speeds = sorted(speed for speed in asked if slowest <= speed < 0.99 * top)
    rows = []
    for reading in alike:
        signals = np.vstack([reading.force, reading.residuals, reading.jacobian.T])
        passed = in_both_strokes(reading.velocity, signals, speeds, signs=(sign,))
        counts, means, squares = (of_signs[0] for of_signs in passed)
        velocity, taken = reading.rounding
        back = in_both_strokes(velocity, taken[None], speeds, signs=(sign,))[1][0, ..., 0]
        with np.errstate(invalid="ignore", divide="ignore"):  # one passage has no scatter
            variances = squares[..., 1] / (counts - 1.0) / counts
        branches, nothing = means[..., 0] + back, np.full(len(speeds), math.nan)
        error = 0.5 * np.sqrt(variances.sum(axis=0))
        difference, *slopes = means[..., 1:].mean(axis=0).T
        whole = [speeds, branches.mean(axis=0), error, difference, back.mean(axis=0)]
        rows.append(np.array([*whole, *branches, nothing, *slopes]))
    return _mean(rows)
