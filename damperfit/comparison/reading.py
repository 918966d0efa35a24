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

from damperfit.units.shown_units import SI

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.tested.setting import Setting
    from damperfit.units.shown_units import ShownUnits

__all__ = [
    "SEEN",
    "Difference",
    "Reading",
    "Sameness",
    "Topic",
    "compared",
    "difference_of",
    "half_interval",
    "outcome_of",
    "place_of",
    "surely_different",
    "verdict_of",
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


# Lines in words: what differs, by how much, or why nothing can be said.


def outcome_of(lines: Sequence[Difference], words: str, units: ShownUnits = SI) -> str:
    """Say how many differ, which most, and what chance would do."""
    if lines[0].subject.kind == "force":
        measured = sum(line.is_measured for line in lines)
        if measured == len(lines):
            words += " as measured"
        elif measured:
            words += f" ({measured} of {len(lines)} as measured)"
    known = [line for line in lines if line.verdict is not Sameness.UNDETERMINED]
    if not known:
        return f"{words}: cannot be determined ({lines[0].reason})"
    different = [line for line in known if line.verdict is Sameness.DIFFERENT]
    sure = [line for line in different if line.is_sure]
    undetermined = len(lines) - len(known)
    beside = f"; of {undetermined} it cannot be determined" if undetermined else ""
    if not different:
        return f"{words}: all {len(known)} the same within errors{beside}"
    if not sure:
        return (
            f"{words}: no significant difference: {len(different)} of {len(known)} lie outside "
            f"their 95 % interval, and chance alone puts {0.05 * len(known):.2g} there{beside}"
        )
    worst = max(sure, key=_weight)
    how_many = "all" if len(sure) == len(different) else str(len(sure))
    return (
        f"{words}: {len(different)} of {len(known)} differ, {how_many} of them significantly; most "
        f"{place_of(worst.subject, units)}: {difference_of(worst, units)}{beside}"
    )


def _weight(line: Difference) -> float:
    return abs(line.percent) if math.isfinite(line.percent) else abs(line.difference)


def place_of(subject: Topic, units: ShownUnits = SI) -> str:
    """Say of what a line is, as in "setting 3, 0.26 m/s rebound"."""
    where = "" if subject.setting is None else f"setting {subject.setting}, "
    if subject.speed is not None:
        return f"{where}{units.write_speed(subject.speed)} {subject.stroke}"
    return f"{where}{subject.label}"


def difference_of(line: Difference, units: ShownUnits = SI) -> str:
    """Say how large a difference is, with its interval."""
    if math.isfinite(line.percent):
        text = f"{line.percent:+.2f} %"
        if math.isfinite(line.percent_low):
            text += f" ({line.percent_low:+.2f} to {line.percent_high:+.2f} %)"
        if line.subject.kind == "force":
            text += f", {units.write(line.difference, 'N', _form(units))}"
        return text
    unit = line.subject.unit
    text = units.write(line.difference, unit, "+.4g")
    low, high = (units.show(end, unit) for end in (line.low, line.high))
    return f"{text} ({low:+.3g} to {high:+.3g})" if math.isfinite(low) else text


def _form(units: ShownUnits) -> str:
    """How a difference of force is written: tenths of a newton, three digits of other units."""
    return "+.1f" if units.of("N") == "N" else "+.3g"


def verdict_of(line: Difference, units: ShownUnits = SI, *, says_measured: bool = True) -> str:
    """Say the verdict of a line in words, and of a force whether it was measured."""
    is_said = says_measured and line.subject.kind == "force" and line.is_measured
    said = _verdict(line, units)
    return f"{said} (measured)" if is_said else said


def _verdict(line: Difference, units: ShownUnits) -> str:
    if line.words:
        return line.words
    if line.verdict is Sameness.UNDETERMINED:
        return f"cannot be determined: {line.reason}"
    if line.verdict is Sameness.SAME:
        return "same within errors"
    how = _how_different(line, units)
    return f"different: {how}" if line.is_sure else f"different, perhaps by chance: {how}"


def _how_different(line: Difference, units: ShownUnits) -> str:
    is_force = line.subject.kind == "force"
    if line.subject.name.startswith("hysteresis") and line.first.value * line.second.value > 0.0:
        # Its sign is the way round the loop: -54 N after -57 N is a narrower loop.
        wider = abs(line.second.value) - abs(line.first.value)
        said = units.write(abs(wider), line.subject.unit, ".2g")
        return f"the loop is {said} {'wider' if wider > 0.0 else 'narrower'}"
    if not math.isfinite(line.percent):
        more = "more" if line.difference > 0.0 else "less"
        return f"{units.write(abs(line.difference), line.subject.unit, '.3g')} {more}"
    if is_force:
        return f"{abs(line.percent):.2g} % {'harder' if line.percent > 0 else 'softer'}"
    return f"{abs(line.percent):.2g} % {'more' if line.percent > 0 else 'less'}"
