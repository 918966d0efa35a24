"""By how much the force is late against the displacement.

At one frequency a late force looks like softer oil: both open the loop, and no fit of one sine
test separates them. Friction does: it changes its sign with the motion, at once, while oil takes
a millisecond or more. So the force jumps by 2 f_f where the velocity is zero plus the skew. Around
each end of the stroke a smooth curve with a kink stands for the hydraulic force, and the time of
the jump is scanned, one skew for the ends of rebound and those of bump::

    f(t) = sum_k a_k z^k + b |z| + c z|z| + F step((t - t_end - skew)/width)

Cycles fall differently between the samples, so the jump is known better than to a sample. It is
left open without a jump that stands out of the noise, where the jump of rebound and bump differ
(what jumps is then not friction), and where it is rounded, by a filter in the rig or by seals that
stretch before they slide: friction that only slides after 0.1 mm is 8 ms behind at 32 mm and
1.5 Hz. A rounding of more than `_SHARP` speaks against every estimate, and a smaller one is added
to its uncertainty.

Where the mounting gives, the piston turns after the rod's end, by C/k_s of a valve that resists
with C at low speed, and friction with it; the force is right all the same. No jump separates the
two: a stiff mounting goes through the friction within a millisecond or two. An early force
is never that.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from damperfit.compiled_core import compiled_core
from damperfit.conditioning.options import ConditionOptions
from damperfit.conditioning.polarity import reversals
from damperfit.conditioning.signals import FloatArray
from damperfit.conditioning.timebase import UniformLog
from damperfit.problem import Option, Problem, note, warning
from damperfit.recording import Trace
from damperfit.statistics import mean_of

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
# 10 ms to pass its play 0.2, of a dwell 0. That within the reach, of a sine's: of triangles with
# corners of 12 ms 1.8 at 5 Hz, and more at less.
_STANDS, _TURNS = 0.2, 1.5


def find_delay(
    log: UniformLog, trace: Trace, options: ConditionOptions
) -> tuple[float, tuple[Problem, ...]]:
    """Return by how much the force must be moved ahead, s, and what was found of the skew."""
    is_auto = options.skew == "auto"
    known = 0.0 if is_auto else float(options.skew)
    declared: tuple[Problem, ...] = ()
    if known:
        text = f"the force is moved {1e3 * known:g} ms ahead, as declared"
        declared = (note("skew_declared", text, value=known, unit="s"),)
    seen: tuple[float, float] | str = "the rig's filter rounds the friction's jump"
    if options.rig_filter == "none":
        seen = estimate_delay(log, trace)
    if isinstance(seen, str):
        done = "nothing was corrected" if is_auto else "a late force looks like a low K_e"
        text = f"it cannot be determined whether the force is late: {seen}; {done}"
        return 0.0, (*declared, (warning if is_auto else note)("skew", text, unit="s"))
    delay, uncertainty = seen
    side = "early" if delay < 0.0 else "late"
    late = f"{1e3 * abs(delay):.2f} ms {side}, within {1e3 * uncertainty:.2f} ms, "
    text = f"the force is {late}taking its jump at the ends of the stroke for Coulomb friction"
    if not abs(delay) > max(uncertainty, _LEAST):
        text = f"force and displacement are together: {text}"
        return 0.0, (*declared, note("skew", text, value=delay, unit="s"))
    if is_auto:
        finding = note("skew", f"{text}; corrected", value=delay, unit="s", is_correction=True)
        return delay, (finding,)
    # What was declared is no longer in the log looked at.
    setting = f"rig.skew = '{1e3 * (delay + known):.1f}ms'"
    if delay > 0.0:
        text = (
            f"the friction reverses {late}at the ends of the stroke: the force is late, or the "
            "mounting is elastic and the force is right ({model} tries both; two frequencies or "
            "more can distinguish them)"
        )
    text += f"; a delay affects K_e most: only if the rig has it set {setting}, or {{auto}}"
    values = {"auto": Option("skew", "auto"), "model": Option("model", "auto")}
    return 0.0, (*declared, warning("skew", text, value=delay, unit="s", **values))


class _Side(NamedTuple):
    """The samples beside the ends of rebound, or of bump: what the smooth part leaves of them."""

    lag: FloatArray  # rising
    columns: FloatArray  # of the smooth part, each of size 1 and square to the others; the force
    sums: FloatArray  # of the columns up to each sample, by rising lag
    power: float


class _Scan(NamedTuple):
    """Sums of squares over the delays tried, and the jump at each end, N."""

    delays: FloatArray
    rest: FloatArray
    jumps: FloatArray


def estimate_delay(  # noqa: PLR0911 - one return a reason
    log: UniformLog, trace: Trace
) -> tuple[float, float] | str:
    """Return by how much the force is late, s, and about three standard errors of it; or why not.

    From the log as it was recorded, not filtered by us; how samples and cycles fall is in the
    error.
    """
    ends, error = _ends(trace)
    beside = [_beside(log, end) for end in ends]
    if min(len(lag) for lag, _ in beside) < _FEWEST:
        return "too few samples beside the ends of the stroke"
    way, half = _ways_left(log, ends)
    if half < _STANDS * way:
        return "the displacement rests at the ends of the stroke"
    delays = np.arange(-_FARTHEST, _FARTHEST + 0.5 * _STEP, _STEP)
    smooth = [_without_smooth(*side, kink=None) for side in beside]
    kink = float(delays[np.argmin(_scan(smooth, delays, width=0.0).rest)])
    sides = [_without_smooth(*side, kink=kink) for side in beside]
    total, n = sum(side.power for side in sides), sum(len(side.lag) for side in sides)
    scans, least = {}, {}
    for width, step in _WIDTHS.items():
        reach = round(4.0 * _STEP / step)
        tried = np.asarray(kink + step * np.arange(-reach, reach + 1), np.float64)
        scans[width] = _scan(sides, tried, width=width)
        least[width] = float(scans[width].rest.min())
    if least[0.0] <= _ROUNDED * least[_AS_IT_IS]:  # no sample on the jump that is worth a word
        least[_AS_IT_IS] = np.inf
    width = min(least, key=lambda tried: least[tried])
    scan = scans[width]
    best = int(np.argmin(scan.rest))
    variance = least[width] / (n - 14)
    jumps, delay = scan.jumps[:, best], float(scan.delays[best])
    if total - least[width] < _CLEAR * variance:
        return "no friction stands out at the ends of the stroke"
    if not jumps.min() > _ALIKE * jumps.max():
        return "the jump at the ends of the stroke is not friction alone"
    if width > _SHARP or min(least[0.0], least[_AS_IT_IS]) > _ROUNDED * least[width]:
        reason = "a filter of the rig, or seals that yield before they slide"
        return f"the friction's jump is rounded by {reason}"
    if abs(delay) > _FARTHEST - 1.5 * _STEP:
        return f"it would be more than {1e3 * _FARTHEST:.0f} ms"
    fine = _scan(sides, delay + np.linspace(-2.0 * _STEP, 2.0 * _STEP, 81), width=width)
    rest = np.concatenate([scan.rest, fine.rest])
    like = np.concatenate([scan.delays, fine.delays])[rest <= rest.min() + 9.0 * variance]
    low, high = float(like.min()), float(like.max())
    middle = 0.5 * (low + high)
    # To the samples beside it: between two of them all delays are alike. Where the rate is a
    # multiple of the frequency every cycle has its samples at the same places, and the gap between
    # them is a whole sample interval.
    lags = np.sort(np.concatenate([side.lag for side in sides]))
    below, above = lags[lags <= low], lags[lags >= high]
    low = float(below[-1]) if len(below) else low
    high = float(above[0]) if len(above) else high
    # What the smooth part may lean where few samples hold it, or where the oil's force reverses
    # as sharply as the friction.
    of_sine = trace.amplitude * (1.0 - math.cos(2.0 * math.pi * trace.frequency * _REACH))
    lean = _SHARP if way > _TURNS * of_sine else max(_SYSTEMATIC, 0.1 * log.interval)
    wide = math.hypot(max(high - middle, middle - low), 3.0 * error)
    return middle, wide + lean + 0.5 * width


def _ends(trace: Trace) -> tuple[list[FloatArray], float]:
    """Return when rebound ends and when bump ends, s, on a line over the cycles; and its error."""
    segment, ends, variance = trace.fastest, [], 0.0
    before, part, is_out = reversals(trace.velocity)
    inside = (before >= segment.first) & (before < segment.stop - 1)
    times = trace.start_time + (before + part)[inside] * trace.interval
    for is_end in (is_out[inside], ~is_out[inside]):
        at = times[is_end]
        if len(at) >= 3 and segment.n_cycles:
            cycle = np.rint((at - at[0]) * trace.frequency)
            off = cycle - mean_of(cycle)
            slope = float(off @ (at - at[0])) / max(float(off @ off), 0.5)  # 0: ends of one cycle
            line = np.asarray(mean_of(at) + slope * off)
            variance += 0.25 * float(np.var(at - line)) / len(at)
            at = line
        ends.append(at)
    return ends, math.sqrt(variance)


def _ways_left(log: UniformLog, ends: Sequence[FloatArray]) -> FloatArray:
    """Return the ways left within the reach of an end, and within half of it, m."""
    # Friction turns anywhere in a rest. As logged: a filter rounds a short rest off.
    far, x, ways = 2 * int(0.5 * _REACH / log.interval), log.displacement, np.zeros(2)
    for side in ends:
        at = np.rint((side - log.start_time) / log.interval).astype(np.int64)
        at = at[(at >= far) & (at + far < len(x))]
        ways += [0.5 * abs(mean_of(x[at] - 0.5 * (x[at - n] + x[at + n]))) for n in (far, far // 2)]
    return ways


def _beside(log: UniformLog, ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return time since the end and force of the samples around the ends, by rising time."""
    reach = int(_REACH / log.interval)
    nearest = np.rint((ends - log.start_time) / log.interval).astype(np.int64)
    index = nearest[:, np.newaxis] + np.arange(-reach, reach + 1)
    lag = log.start_time + index * log.interval - ends[:, np.newaxis]
    is_whole = (index[:, 0] >= 0) & (index[:, -1] < len(log.force))
    lag, force = lag[is_whole], log.force[index[is_whole]]
    if (block := int(_FINEST / log.interval)) > 1:
        n = lag.shape[1] // block * block
        lag, force = (a[:, :n].reshape(-1, block).mean(axis=1) for a in (lag, force))
    lag, force = lag.ravel(), force.ravel()
    order = np.argsort(lag)
    return lag[order], force[order]


def _without_smooth(lag: FloatArray, force: FloatArray, *, kink: float | None) -> _Side:
    """Project the hydraulic force beside an end out: 4 smooth columns, 6 with a kink."""
    lag, force = np.ascontiguousarray(lag), np.ascontiguousarray(force)
    row = _COLUMNS[kink is not None] + 1
    columns, sums = np.empty((len(lag), row)), np.empty((len(lag) + 1, row))
    power = compiled_core().without_smooth(lag, force, columns, sums, _REACH, kink or 0.0)
    return _Side(lag, columns, sums, power)


def _scan(sides: Sequence[_Side], delays: FloatArray, *, width: float) -> _Scan:
    """Residual of the force for each delay; a step that the smooth part absorbs is none."""
    rests, jumps = np.empty((2, len(sides), len(delays)))
    for side, rest, jump in zip(sides, rests, jumps, strict=True):
        compiled_core().steps(
            *(side.lag, side.columns, side.sums, delays, rest, jump, np.empty(len(side.lag))),
            *(side.power, width, _MADE_UP),
        )
    jumps[0] *= -1.0
    total = sum(side.power for side in sides)
    return _Scan(delays, np.maximum(rests.sum(axis=0), 1e-15 * total), jumps)
