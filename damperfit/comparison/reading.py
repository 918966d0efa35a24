"""A number of a run with its error, and two of them compared: same, different, undetermined.

Two runs are two tests, so that their errors add. What both have in common does not: at the same
motion a wrong model misses the same force in both, and only by how much it misses them differently
is an error of the difference (`Reading.misses`). Errors were estimated from so many cycles, which
Student's t counts; of sums of such errors by Welch and Satterthwaite.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING

from scipy.special import stdtr, stdtrit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.tested.setting import Setting

__all__ = [
    "SEEN",
    "Difference",
    "Reading",
    "Sameness",
    "Topic",
    "compared",
    "half_interval",
    "surely_different",
]

# "Same" is said only where a difference of so much of the damping, or of the value, would be seen.
SEEN = 0.05
_OF_95 = 0.975
_LEVEL = 0.05  # of all verdicts of a comparison together


class Sameness(Enum):
    """What two readings say of each other; the value is for scripts."""

    SAME = "same"
    DIFFERENT = "different"
    UNDETERMINED = "untold"


@dataclass(frozen=True, slots=True)
class Topic:
    """What is compared.

    Attributes
    ----------
    kind : str
        "force", "parameter" or "figure".
    name : str
        For scripts: "force", "r_m1", "energy".
    label, unit : str
        For people.
    setting : Setting or None
        Of which; None: of all.
    speed : float or None
        m/s, positive, of a force.
    stroke : str
        "rebound" or "bump", of a force.
    is_logarithmic : bool
        Its errors are those of its logarithm.
    """

    kind: str
    name: str
    label: str
    unit: str
    setting: Setting | None = None
    speed: float | None = None
    stroke: str = ""
    is_logarithmic: bool = False


@dataclass(frozen=True, slots=True)
class Reading:
    """A number of one run.

    Attributes
    ----------
    value : float
        In the unit of its subject.
    error : float
        Standard error of noise, in the same unit; NaN where it is not known.
    freedom : float
        Degrees of freedom that the error has.
    repeat, repeat_freedom : float
        Standard error of what tests of one setting differ by beyond their noise, and its degrees.
    misfit : float
        Error from the model's misfit, in the same unit.
    misses : float
        Measured less modelled, with its sign, where both are known at the motion of the test.
    misses_error : float
        Standard error of that.
    disagrees : bool
        The model misses the measured force by more than it may.
    scale : float
        What per cents are of: the damping of a force, with its sign; half the force's range for a
        hysteresis; the usual size of an offset. NaN: of the value.
    is_measured : bool
        The number is measured, not modelled.
    objection : str
        Why nothing can be said of it; empty where something can.
    """

    value: float
    error: float = math.nan
    freedom: float = math.inf
    repeat: float = 0.0
    repeat_freedom: float = math.inf
    misfit: float = 0.0
    misses: float = math.nan
    misses_error: float = math.nan
    disagrees: bool = False
    scale: float = math.nan
    is_measured: bool = False
    objection: str = ""


@dataclass(frozen=True, slots=True)
class Difference:
    """Two readings of one subject, the second beside the first.

    Attributes
    ----------
    subject : Topic
        What.
    first, second : Reading
        Of the reference and of the other run.
    difference, low, high : float
        Second less first with its 95 % interval; NaN where no error is known.
    percent, percent_low, percent_high : float
        The same in per cent, for a force of the reference's damping: positive is harder; for a
        hysteresis of half the force's range. NaN where there is nothing to take it of.
    chance : float
        How often chance alone makes a difference as large, 0 to 1; NaN where it is not known.
    verdict : Sameness
        At 95 %, each line by itself.
    reason : str
        Why nothing can be said; empty where something is.
    is_sure : bool
        Different also when it is remembered how many lines there are.
    words : str
        The verdict, where the subject has words of its own.
    """

    subject: Topic
    first: Reading
    second: Reading
    difference: float
    low: float = math.nan
    high: float = math.nan
    percent: float = math.nan
    percent_low: float = math.nan
    percent_high: float = math.nan
    chance: float = math.nan
    verdict: Sameness = Sameness.UNDETERMINED
    reason: str = ""
    is_sure: bool = False
    words: str = ""

    @property
    def is_measured(self) -> bool:
        """Whether measured numbers are compared."""
        return self.first.is_measured and self.second.is_measured


def compared(
    subject: Topic, first: Reading, second: Reading, *, is_same_motion: bool = False
) -> Difference:
    """Return two readings beside each other.

    Parameters
    ----------
    subject : Topic
        Of what.
    first, second : Reading
        Of the reference and of the other run.
    is_same_motion : bool
        Both are of one model and motion: what the model misses alike cancels.
    """
    a, b = first.value, second.value
    if not (math.isfinite(a) and math.isfinite(b)):
        reason = first.objection or second.objection or "not known for both"
        return Difference(subject, first, second, math.nan, reason=reason)
    is_log = subject.is_logarithmic and a > 0.0 and b > 0.0
    bend = _bend(first, second, is_same_motion=is_same_motion, is_log=is_log)
    if is_log:
        line = _by_logarithm(subject, first, second, bend)
    else:
        line = _by_difference(subject, first, second, bend)
    objection = first.objection or second.objection
    return replace(line, verdict=Sameness.UNDETERMINED, reason=objection) if objection else line


def _by_logarithm(subject: Topic, first: Reading, second: Reading, bend: float) -> Difference:
    a, b = first.value, second.value
    step = math.log(b / a)
    parts = [*_parts(first, 1.0 / a), *_parts(second, 1.0 / b), (bend, math.inf)]
    spread, freedom = _error_of_sum(parts)
    reach = _reach(spread, freedom)
    ends = [math.exp(min(step + sign * reach, 700.0)) - 1.0 for sign in (-1.0, 1.0)]
    line = Difference(
        subject,
        first,
        second,
        b - a,
        a * ends[0],
        a * ends[1],
        percent=100.0 * (b / a - 1.0),
        percent_low=100.0 * ends[0],
        percent_high=100.0 * ends[1],
        chance=_chance(step, spread, freedom),
    )
    return _judged(line, distance=step, reach=reach, share=reach)


def _by_difference(subject: Topic, first: Reading, second: Reading, bend: float) -> Difference:
    a, b = first.value, second.value
    spread, freedom = _error_of_sum([*_parts(first), *_parts(second), (bend, math.inf)])
    reach = _reach(spread, freedom)
    difference = b - a
    scale = first.scale if math.isfinite(first.scale) else a
    percent = percent_reach = math.nan
    if scale:
        # The first number is the denominator too: its error counts 1 + share times.
        ratio = 1.0 + difference / scale
        of_both = _error_of_sum([*_parts(first, ratio), *_parts(second), (bend, math.inf)])
        percent = 100.0 * difference / scale
        percent_reach = 100.0 * _reach(*of_both) / abs(scale)
    line = Difference(
        subject,
        first,
        second,
        difference,
        difference - reach,
        difference + reach,
        percent,
        percent - percent_reach,
        percent + percent_reach,
        _chance(difference, spread, freedom),
    )
    if subject.kind == "parameter":  # an offset may pass zero: per cent of it say nothing
        line = replace(line, percent=math.nan, percent_low=math.nan, percent_high=math.nan)
    return _judged(line, distance=difference, reach=reach, share=percent_reach / 100.0)


def _judged(line: Difference, *, distance: float, reach: float, share: float) -> Difference:
    if not math.isfinite(reach):
        return replace(line, reason="no errors are known")
    if abs(distance) > reach:
        return replace(line, verdict=Sameness.DIFFERENT)
    # At its passage through zero a force has no per cent to speak of: newtons say it.
    if share > SEEN:
        said = f"a difference of {100.0 * share:.2g} % would go unnoticed"
        return replace(line, reason=said)
    return replace(line, verdict=Sameness.SAME)


def _parts(one: Reading, factor: float = 1.0) -> list[tuple[float, float]]:
    """Standard errors of a reading, each with its degrees of freedom."""
    return [(factor * one.error, one.freedom), (factor * one.repeat, one.repeat_freedom)]


def _bend(first: Reading, second: Reading, *, is_same_motion: bool, is_log: bool) -> float:
    """Standard error of the difference from the model's misfit."""
    if first.is_measured and second.is_measured:
        return 0.0
    sizes = (first.misfit, second.misfit)
    if is_log:
        sizes = (first.misfit / first.value, second.misfit / second.value)
    if not is_same_motion or not any(sizes):
        return math.hypot(*sizes)
    apart = second.misses - first.misses
    if math.isfinite(apart):
        noise = (first.misses_error, second.misses_error)
        known = sum(one**2 for one in noise if math.isfinite(one))
        return math.sqrt(max(apart**2 - known, 0.0))
    return abs(sizes[1] - sizes[0])


def _error_of_sum(parts: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return the standard error of a sum, and its degrees of freedom."""
    total = sum(error**2 for error, _ in parts)
    if not total > 0.0:
        return math.sqrt(total) if total == 0.0 else math.nan, math.inf
    squares = sum(error**4 / freedom for error, freedom in parts if math.isfinite(freedom))
    return math.sqrt(total), total**2 / squares if squares > 0.0 else math.inf


def _reach(spread: float, freedom: float) -> float:
    """Half of the 95 % interval."""
    return spread * float(stdtrit(min(freedom, 1e9), _OF_95))


def _chance(distance: float, spread: float, freedom: float) -> float:
    if not math.isfinite(spread):
        return math.nan
    if spread == 0.0:
        return 1.0 if distance == 0.0 else 0.0
    return 2.0 * float(stdtr(min(freedom, 1e9), -abs(distance) / spread))


def half_interval(one: Reading) -> float:
    """Return half of the 95 % interval of a reading by itself; NaN where no error is known."""
    parts = _parts(one)
    return _reach(*_error_of_sum(parts if one.is_measured else [*parts, (one.misfit, math.inf)]))


def surely_different(lines: Sequence[Difference]) -> tuple[Difference, ...]:
    """Return the lines with `Difference.is_sure` set, by Holm's procedure over all of them.

    Among many lines one in twenty differs by chance. What is left here is so in one comparison of
    twenty, however the lines hang together.
    """
    known = sorted(
        (i for i, one in enumerate(lines) if math.isfinite(one.chance)),
        key=lambda i: lines[i].chance,
    )
    sure = set()
    for rank, i in enumerate(known):
        if lines[i].chance > _LEVEL / (len(known) - rank):
            break
        if lines[i].verdict is Sameness.DIFFERENT:
            sure.add(i)
    return tuple(replace(one, is_sure=i in sure) for i, one in enumerate(lines))
