"""A motion of straight lines: at even speeds, with corners that are sharp between two samples.

At the corners of a triangle the force tells most of K_e, and a speed that jumps between two samples
is in no sample. But where the recorded motion is straight on both sides within its noise, the lines
cross where it turned: to a thousandth of a sample, of 128 samples with 3 um of noise that turn by
0.5 m/s. What drives the model is then these lines, and a jump of the speed where they cross.

It is taken for straight only as a whole: lines whose samples lie off them by no more than noise
does, and corners whose nearest samples do too. A turn that a rig takes 0.5 ms for at 1 kHz lies
30 um off its lines and drives the model as any motion does (`damperfit.conditioning.drive`).
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from damperfit.conditioning.channels import noise_of
from damperfit.recording import Drive

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["drive_of_lines"]

_LEVERS = (4e-3, 16e-3)  # s; a turn is looked for in samples so far apart; noise needs the longer
_CLEAR = 10.0  # times the noise of that look
_ROUNDING = 1e-6  # of the stroke: what numbers of a log are rounded to counts as noise
_FEWEST = 10  # samples of a line
_SCATTER = 4.0  # errors by which the noise of a line may exceed that of the log
_NOISE_KNOWN = 0.1  # share to which that is known
_FARTHEST = 5.0  # times the noise, of the samples beside a corner
_BESIDE = 1.5  # samples between where it is seen to turn and where the lines cross
_AT_SAMPLE = 5.0  # errors of where the lines cross: nearer to a sample than that, it is there
_LENGTHENED = 2  # times that a part is lengthened, by what shows a turn and a line behind it
_AT_REST = 5.0  # errors of a slope: a line that rises by less rests


class _Line(NamedTuple):
    """A straight part: its middle, where it is there, slope, samples, and their squared reach."""

    middle: float
    level: float
    slope: float
    n: int
    power: float

    def at(self, sample: Any) -> Any:
        """Return the place at samples, m."""
        return self.level + self.slope * (sample - self.middle)

    def error(self, sample: float) -> float:
        """Return its error there for a noise of 1."""
        return math.sqrt(1.0 / self.n + (sample - self.middle) ** 2 / self.power)

    def at_rest(self, noise: float) -> _Line:
        """Return the line, level where it only seems to rise: friction would slide one way."""
        is_level = abs(self.slope) <= _AT_REST * noise / math.sqrt(self.power)
        return self._replace(slope=0.0) if is_level else self


def drive_of_lines(displacement: FloatArray, interval: float, part: slice) -> Drive | None:
    """Return the drive of a log that moves in straight lines; None where it does not.

    Parameters
    ----------
    displacement : numpy.ndarray
        As logged, shape (n,), m.
    interval : float
        s.
    part : slice
        The samples that drive the model. Beyond them the drive is what was logged, without sense,
        but for a few samples where a line would be too short to be told by those of the part.
    """
    first, stop, _ = part.indices(len(displacement))
    for seconds in _LEVERS:
        lever = max(2, round(seconds / interval))
        for times in range(_LENGTHENED + 1):
            more = times * (lever + _FEWEST)
            longer = slice(max(first - more, 0), min(stop + more, len(displacement)))
            x = displacement[longer]
            noise = max(noise_of(x), _ROUNDING * float(np.ptp(x)))
            turns = _turns(x, lever, noise)
            if not turns:
                break
            found = _found(x, turns, lever, noise)
            if found is not None:
                return _driving(displacement, interval, longer, *found)
    return None


def _found(
    x: FloatArray, turns: list[int], lever: int, noise: float
) -> tuple[list[_Line], FloatArray] | None:
    """Return the lines and where they cross; None where a part of it is not straight."""
    turns = _refined(x, turns, lever)
    lines = _lines(x, turns, noise)
    if not lines:
        return None
    lines = [line.at_rest(noise) for line in lines]
    jumps = _crossings(x, turns, lines, noise)
    return None if jumps is None else (lines, jumps)


def _driving(
    displacement: FloatArray, interval: float, part: slice, lines: list[_Line], jumps: FloatArray
) -> Drive:
    first, n = part.start, part.stop - part.start
    whole, speed = displacement.copy(), np.zeros(len(displacement))
    # A sample at which it turns has the speed after it.
    edges = [0, *np.ceil(jumps[:, 0]).astype(np.int64).tolist(), n]
    for line, (begin, end) in zip(lines, pairwise(edges), strict=True):
        whole[first + begin : first + end] = line.at(np.arange(begin, end))
        speed[first + begin : first + end] = line.slope / interval
    jumps[:, 0] += first
    jumps[:, 2:] /= interval
    return Drive(whole, speed, math.inf, jumps)


def _turns(x: FloatArray, lever: int, noise: float) -> list[int] | None:
    """Return the samples nearest to where the motion turns; None where it bends or none does."""
    if len(x) < 4 * lever + _FEWEST:
        return None
    bend = np.abs(x[: -2 * lever] - 2.0 * x[lever:-lever] + x[2 * lever :])
    over = np.flatnonzero(bend > _CLEAR * math.sqrt(6.0) * noise)
    if not len(over):
        return None
    turns = []
    for run in np.split(over, np.flatnonzero(np.diff(over) > lever) + 1):
        # A sharp corner is seen over two levers, a bend over its own length too.
        if len(run) > 2 * lever + 1:
            return None
        turns.append(int(run[np.argmax(bend[run])]) + lever)
    return turns


def _refined(x: FloatArray, turns: list[int], lever: int) -> list[int]:
    """Return the turns where lines that keep off them cross: noise moves the top of a long look."""
    lines = _lines(x, turns, math.inf, margin=lever // 2)
    if lines is None:
        return turns
    found = []
    for turn, (one, two) in zip(turns, pairwise(lines), strict=True):
        step = two.slope - one.slope
        moved = (one.at(turn) - two.at(turn)) / step if step else math.inf
        found.append(round(turn + moved) if abs(moved) <= lever else turn)
    return found


def _lines(x: FloatArray, turns: list[int], noise: float, *, margin: int = 1) -> list[_Line] | None:
    """Return the lines before, between and behind turns; None where one is not straight."""
    lines = []
    for before, behind in pairwise([-margin - 1, *turns, len(x) + margin]):
        at = np.arange(before + margin + 1, behind - margin)
        n = len(at)
        if n < _FEWEST:
            return None
        middle = 0.5 * float(at[0] + at[-1])
        reach = at - middle
        power = float(reach @ reach)
        level, slope = float(np.mean(x[at])), float(reach @ x[at]) / power
        rest = x[at] - level - slope * reach
        allowed = 1.0 + _NOISE_KNOWN + _SCATTER / math.sqrt(2.0 * n)
        if math.sqrt(float(rest @ rest) / n) > allowed * noise:
            return None
        lines.append(_Line(middle, level, slope, n, power))
    return lines


def _crossings(
    x: FloatArray, turns: list[int], lines: list[_Line], noise: float
) -> FloatArray | None:
    """Return where each line crosses the next, counted as in `Motion.jumps`, m a sample.

    None where lines cross elsewhere than the motion turns, or its samples there lie beside them.
    """
    jumps = np.empty((len(turns), 4))
    for k, (turn, (one, two)) in enumerate(zip(turns, pairwise(lines), strict=True)):
        step = two.slope - one.slope
        at = turn + (one.at(turn) - two.at(turn)) / step if step else math.inf
        if not abs(at - turn) < _BESIDE:
            return None
        beside = np.arange(turn - 1, turn + 2)
        there = np.where(beside < at, one.at(beside), two.at(beside))
        if np.max(np.abs(x[beside] - there)) > _FARTHEST * noise:
            return None
        error = noise * math.hypot(one.error(at), two.error(at)) / abs(step)
        if abs(at - round(at)) <= _AT_SAMPLE * error:
            at = float(round(at))
        jumps[k] = at, 0.5 * (one.at(at) + two.at(at)), one.slope, two.slope
    return jumps
