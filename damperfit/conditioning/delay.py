"""By how much the force is late against the displacement, and taking it back.

At one frequency a late force looks like softer oil: both open the loop, and no fit of one sine
test tells them apart. What tells them apart is friction: it changes its sign with the motion, at
once, while oil takes a millisecond or more. So the force jumps by 2 f_f where the velocity is zero
plus the skew. Around each end of the stroke a smooth curve with a kink stands for the hydraulic
force, and the time of the jump is scanned::

    f(t) = sum_k a_k z^k + b |z| + c z|z| + F step((t - t_end - skew)/width)

once for the ends of rebound and once for those of bump, one skew for both. Cycles fall differently
between the samples, so the jump is known better than to a sample.

It is left open without a jump that stands out of the noise, where the jump of
rebound and bump differ (what jumps is then not friction), and where it is rounded, by a filter in
the rig or by seals that stretch before they slide. Such seals look late: friction that only slides
after 0.1 mm is 8 ms behind at 32 mm and 1.5 Hz. A rounding of more than `_SHARP` therefore speaks
against every estimate, and a smaller one is added to its uncertainty.

Where the mounting gives, the piston turns after the rod's end, by C/k_s of a valve that resists
with C at low speed, and friction with it; the force is right all the same. No jump tells one from
the other: a stiff mounting goes through the friction within a millisecond or two. An early force
is never that.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.compiled_core import compiled_core
from damperfit.conditioning.timebase import UniformLog
from damperfit.statistics import mean_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

__all__ = [
    "Delay",
    "dwells_at_ends",
    "estimate_delay",
    "without_delay",
]


_REACH = 0.020  # s beside an end of the stroke; the oil's part is smooth on this scale
_FARTHEST = 0.010  # s
_STEP = 5e-4  # s, of the scan
_LEAST = 5e-4  # s; noise makes sound logs seem late by less
# s, of the rounded step and of the scan. The second is the friction's own width in the dead band:
# a sample right on the jump shows half of it.
_WIDTHS = {0.0: _STEP, 1e-4: 1e-4, 1e-3: _STEP, 3e-3: _STEP, 8e-3: _STEP}
_AS_IT_IS = 1e-4
_SHARP = 1e-3
_CLEAR = 50.0  # gain of the step in squared deviations of the noise; 16 is chance at four sigma
_ROUNDED = 1.5  # misfit of the sharp jump over that of the best one
_ALIKE = 0.4  # smaller over larger jump
_FINEST = 4e-4  # s; samples closer than this are averaged, for the time it takes
_SYSTEMATIC = 1e-4  # s; what the smooth part may lean
_COLUMNS = (4, 6)  # of the smooth part: without a kink, and with one
_MADE_UP = 1e-9  # of a step's power, left over where rounding is all that is left
_FEWEST = 40  # samples beside the ends of rebound, and of bump
# Way left within half of the reach, of that within the reach: of a sine 0.25, of a crank that takes
# 10 ms to pass its play 0.2, of a dwell 0.
_STANDS = 0.2


class Delay(NamedTuple):
    """What is known of the delay between the channels.

    Attributes
    ----------
    delay : float or None
        Seconds by which the force is late; negative where the displacement is. None: not found.
    uncertainty : float
        s, about three standard errors; how samples and cycles fall is part of it.
    reason : str
        Why it is not found; empty where it is.
    """

    delay: float | None
    uncertainty: float = 0.0
    reason: str = ""

    @property
    def is_significant(self) -> bool:
        """Whether the force is late, or early, beyond doubt."""
        return self.delay is not None and abs(self.delay) > max(self.uncertainty, _LEAST)


class _Side(NamedTuple):
    """The samples beside the ends of rebound, or of bump: what the smooth part leaves of them."""

    lag: FloatArray  # rising
    columns: FloatArray  # of the smooth part, each of size 1 and square to the others; the force
    sums: FloatArray  # of the columns up to each sample, by rising lag
    power: float


class _Scan(NamedTuple):
    """Sums of squares over the delays tried, and the jump at each end, N."""

    rest: FloatArray
    total: float
    jumps: FloatArray
    n: int


def estimate_delay(log: UniformLog, trace: Trace) -> Delay:
    """Return the delay of the force from the friction's jump at the ends of the stroke.

    Parameters
    ----------
    log : UniformLog
        As logged, not filtered by us.
    trace : Trace
        Of the same log; its velocity tells the ends of the stroke.
    """
    ends = _ends(trace)
    beside = [_in_order(*_beside(log, end)) for end in ends]
    is_short = min(len(lag) for lag, _ in beside) < _FEWEST
    if is_short or dwells_at_ends(log, np.concatenate(ends)):
        found = "too few samples beside" if is_short else "the displacement rests at"
        return Delay(None, reason=f"{found} the ends of the stroke")
    delays = np.arange(-_FARTHEST, _FARTHEST + 0.5 * _STEP, _STEP)
    smooth = [_without_smooth(*side, kink=None) for side in beside]
    kink = float(delays[np.argmin(_scan(smooth, delays, width=0.0).rest)])
    sides = [_without_smooth(*side, kink=kink) for side in beside]
    nears = {width: _around(kink, 4.0 * _STEP, step) for width, step in _WIDTHS.items()}
    scans = {width: _scan(sides, near, width=width) for width, near in nears.items()}
    least = {width: float(scan.rest.min()) for width, scan in scans.items()}
    if least[0.0] <= _ROUNDED * least[_AS_IT_IS]:  # no sample on the jump that is worth a word
        least[_AS_IT_IS] = np.inf
    width = min(least, key=lambda tried: least[tried])
    scan, near = scans[width], nears[width]
    at = int(np.argmin(scan.rest))
    variance = least[width] / (scan.n - 14)
    jumps = scan.jumps[:, at]
    if scan.total - least[width] < _CLEAR * variance:
        return Delay(None, reason="no friction stands out at the ends of the stroke")
    if not jumps.min() > _ALIKE * jumps.max():
        return Delay(None, reason="what jumps at the ends of the stroke is not friction alone")
    sharp = min(least[0.0], least[_AS_IT_IS])
    if width > _SHARP or sharp > _ROUNDED * least[width]:
        reason = "a filter in the rig, or seals that stretch before they slide"
        return Delay(None, reason=f"the friction's jump is rounded by {reason}")
    if abs(near[at]) > _FARTHEST - 1.5 * _STEP:
        return Delay(None, reason=f"it would be more than {1e3 * _FARTHEST:.0f} ms")
    fine = near[at] + np.linspace(-2.0 * _STEP, 2.0 * _STEP, 81)
    rest = np.concatenate([scan.rest, _scan(sides, fine, width=width).rest])
    like = np.concatenate([near, fine])[rest <= rest.min() + 9.0 * variance]
    low, high = _between_samples(sides, float(like.min()), float(like.max()))
    middle = 0.5 * float(like.min() + like.max())
    half = max(high - middle, middle - low)
    return Delay(middle, half + _given(log.interval) + 0.5 * width)


def _around(middle: float, reach: float, step: float) -> FloatArray:
    n = round(reach / step)
    return np.asarray(middle + step * np.arange(-n, n + 1))


def _between_samples(sides: Sequence[_Side], low: float, high: float) -> tuple[float, float]:
    """Widen a range of delays to the samples beside it: between two of them all are alike.

    Where the rate is a multiple of the frequency every cycle has its samples at the same places,
    and the gap between them is a whole sample interval.
    """
    lags = np.sort(np.concatenate([side.lag for side in sides]))
    below, above = lags[lags <= low], lags[lags >= high]
    return (
        float(below[-1]) if len(below) else low,
        float(above[0]) if len(above) else high,
    )


def _given(interval: float) -> float:
    """Return what the smooth part may lean where few samples hold it, s."""
    return max(_SYSTEMATIC, 0.1 * interval)


def _ends(trace: Trace) -> tuple[FloatArray, FloatArray]:
    """Return when rebound ends and when bump ends, s; on a straight line over the cycles."""
    v = trace.velocity
    is_out = v > 0.0  # a sample at rest, v = 0, belongs to what follows a rebound
    before = np.flatnonzero(is_out[:-1] != is_out[1:])
    stretch = trace.fastest
    before = before[(before >= stretch.first) & (before < stretch.stop - 1)]
    part = v[before] / (v[before] - v[before + 1])
    at = trace.start_time + (before + part) * trace.interval
    return _straight(at[is_out[before]], trace), _straight(at[~is_out[before]], trace)


def dwells_at_ends(log: UniformLog, ends: FloatArray) -> bool:
    """Whether a motion rests at its ends: a dwell, or a crank that goes through its play.

    Friction turns anywhere in such a rest, so that its jump tells no delay.

    Parameters
    ----------
    log : UniformLog
        As logged: a filter rounds a short rest off.
    ends : numpy.ndarray
        When rebound and bump end, s.
    """
    far = int(_REACH / log.interval)
    at = np.rint((ends - log.start_time) / log.interval).astype(np.int64)
    at = at[(at >= far) & (at + far < len(log.displacement))]
    x = log.displacement
    half, whole = (mean_of(np.abs(x[at] - 0.5 * (x[at - n] + x[at + n]))) for n in (far // 2, far))
    # Of five samples half are two: a sine has 0.16 of it there, where it has 0.25 of four.
    return half < _STANDS * (2 * (far // 2) / far) ** 2 * whole


def _straight(at: FloatArray, trace: Trace) -> FloatArray:
    if len(at) < 3 or not trace.fastest.n_cycles:
        return at
    cycle = np.rint((at - at[0]) * trace.frequency)
    if np.ptp(cycle) == 0.0:  # a dwell crosses the end of one cycle several times
        return at
    off = cycle - mean_of(cycle)
    return np.asarray(mean_of(at) + (float(off @ (at - at[0])) / float(off @ off)) * off)


def _beside(log: UniformLog, ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return time since the end and force of the samples around the ends, shape (n,) each."""
    reach = int(_REACH / log.interval)
    nearest = np.rint((ends - log.start_time) / log.interval).astype(np.int64)
    index = nearest[:, np.newaxis] + np.arange(-reach, reach + 1)
    lag = log.start_time + index * log.interval - ends[:, np.newaxis]
    is_whole = (index[:, 0] >= 0) & (index[:, -1] < len(log.force))
    lag, force = lag[is_whole], log.force[index[is_whole]]
    if (block := int(_FINEST / log.interval)) > 1:
        n = lag.shape[1] // block * block
        lag, force = (a[:, :n].reshape(-1, block).mean(axis=1) for a in (lag, force))
    return lag.ravel(), force.ravel()


def _without_smooth(lag: FloatArray, force: FloatArray, *, kink: float | None) -> _Side:
    """Project the hydraulic force beside an end out: 4 smooth columns, 6 with a kink."""
    lag, force = np.ascontiguousarray(lag), np.ascontiguousarray(force)
    row = _COLUMNS[kink is not None] + 1
    columns, sums = np.empty((len(lag), row)), np.empty((len(lag) + 1, row))
    power = compiled_core().without_smooth(lag, force, columns, sums, _REACH, kink or 0.0)
    return _Side(lag, columns, sums, power)


def _in_order(lag: FloatArray, force: FloatArray) -> tuple[FloatArray, FloatArray]:
    order = np.argsort(lag)
    return lag[order], force[order]


def _scan(sides: Sequence[_Side], delays: FloatArray, *, width: float) -> _Scan:
    """Return what is left of the force for each delay.

    A step that the smooth part makes up tells nothing: what is left of both is rounding.
    """
    rests, jumps = np.empty((2, len(sides), len(delays)))
    for side, rest, jump in zip(sides, rests, jumps, strict=True):
        compiled_core().steps(
            *(side.lag, side.columns, side.sums, delays, rest, jump, np.empty(len(side.lag))),
            *(side.power, width, _MADE_UP),
        )
    jumps[0] *= -1.0
    total = sum(side.power for side in sides)
    rest = np.maximum(rests.sum(axis=0), 1e-15 * total)
    return _Scan(rest, total, jumps, sum(len(side.lag) for side in sides))


def without_delay(log: UniformLog, delay: float) -> UniformLog:
    """Return the log with the force moved ``delay`` seconds ahead, by a cubic spline.

    What has no partner at the ends of the log is left out.
    """
    from scipy.interpolate import CubicSpline

    samples = np.arange(len(log.force), dtype=np.float64)
    wanted = samples + delay / log.interval
    is_there = (wanted >= 0.0) & (wanted <= samples[-1])
    first = int(np.argmax(is_there))
    return UniformLog(
        start_time=log.start_time + first * log.interval,
        interval=log.interval,
        displacement=log.displacement[is_there],
        force=np.ascontiguousarray(CubicSpline(samples, log.force)(wanted[is_there])),
        findings=log.findings,
    )
