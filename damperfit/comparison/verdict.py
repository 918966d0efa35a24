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
from typing import TYPE_CHECKING, NamedTuple

from scipy.special import stdtr, stdtrit

from damperfit.units.shown_units import SI

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.tested.setting import Setting
    from damperfit.units.shown_units import ShownUnits

# "Same" is said only where a difference of so much of the damping, or of the value, would be seen.
SEEN = 0.05
_LEVEL = 0.05  # of all verdicts of a comparison together
_MOST_LOG = 700.0  # beyond it exp overflows


class Sameness(Enum):
    """What two readings say of each other; the value is for scripts."""

    SAME = "same"
    DIFFERENT = "different"
    UNDETERMINED = "undetermined"


class Topic(NamedTuple):
    """What is compared."""

    kind: str  # measured, force, parameter or figure
    name: str  # for scripts: force, r_m1, energy
    label: str
    unit: str
    setting: Setting | None = None  # None: of all
    speed: float | None = None  # m/s, positive, of a force
    stroke: str = ""  # rebound or bump, of a force
    is_logarithmic: bool = False  # its errors are those of its logarithm

    def place(self, units: ShownUnits = SI) -> str:
        """Say of what a line is, as in "setting 3, 0.26 m/s rebound"."""
        where = "" if self.setting is None else f"setting {self.setting}, "
        if self.speed is None:
            return f"{where}{self.label}"
        return f"{where}{units.write_speed(self.speed)} {self.stroke}"


@dataclass(frozen=True, slots=True)
class Reading:
    """A number of one run, with errors in its own unit."""

    value: float
    error: float = math.nan  # standard error of noise; NaN: not known
    freedom: float = math.inf  # degrees of freedom that the error has
    repeat: float = 0.0  # standard error of what tests of one setting differ by beyond their noise
    repeat_freedom: float = math.inf
    misfit: float = 0.0  # error from the model's misfit
    misses: float = math.nan  # measured less modelled, with its sign, at the motion of the test
    misses_error: float = math.nan
    disagrees: bool = False  # the model misses the measured force by more than it may
    # What per cents are of: the damping of a force, with its sign; half the force's range for a
    # hysteresis; the usual size of an offset. NaN: of the value.
    scale: float = math.nan
    is_measured: bool = False
    objection: str = ""  # why nothing can be said of it

    def errors(self, factor: float = 1.0) -> list[tuple[float, float]]:
        """Return its standard errors without the misfit, each with its degrees of freedom."""
        return [(factor * self.error, self.freedom), (factor * self.repeat, self.repeat_freedom)]

    @property
    def half_interval(self) -> float:
        """Half of the 95 % interval of the reading by itself; NaN where no error is known."""
        return _reach([*self.errors(), (0.0 if self.is_measured else self.misfit, math.inf)])[0]


@dataclass(frozen=True, slots=True)
class Difference:
    """Two readings of one subject, the second beside the first (of the reference)."""

    subject: Topic
    first: Reading
    second: Reading
    low: float = math.nan  # 95 % interval of the difference; NaN where no error is known
    high: float = math.nan
    # The same in per cent, for a force of the reference's damping: positive is harder; for a
    # hysteresis of half the force's range. NaN where there is nothing to take it of.
    percent: float = math.nan
    percent_low: float = math.nan
    percent_high: float = math.nan
    chance: float = math.nan  # how often chance alone makes a difference as large; NaN: not known
    verdict: Sameness = Sameness.UNDETERMINED  # at 95 %, each line by itself
    reason: str = ""  # why nothing can be said
    is_sure: bool = False  # different also when it is remembered how many lines there are
    words: str = ""  # the verdict, where the subject has words of its own

    @property
    def difference(self) -> float:
        """Second less first."""
        return self.second.value - self.first.value

    @property
    def is_measured(self) -> bool:
        """Whether measured numbers are compared."""
        return self.first.is_measured and self.second.is_measured


def _reach(parts: Sequence[tuple[float, float]], distance: float = 0.0) -> tuple[float, float]:
    """Half of the 95 % interval of a sum, and how often chance makes it as far from zero."""
    total = sum(error**2 for error, _ in parts)
    squares = sum(error**4 / freedom for error, freedom in parts if math.isfinite(freedom))
    error, freedom = math.sqrt(total), min(total**2 / squares, 1e9) if squares > 0.0 else 1e9
    chance = math.nan
    if error == 0.0:
        chance = float(distance == 0.0)
    elif math.isfinite(error):
        chance = 2.0 * float(stdtr(freedom, -abs(distance) / error))
    return error * float(stdtrit(freedom, 0.975)), chance


def compared(
    subject: Topic, first: Reading, second: Reading, *, is_same_motion: bool = False
) -> Difference:
    """Return two readings beside each other; of one model and motion, common misfit cancels."""
    a, b = first.value, second.value
    reason = first.objection or second.objection
    if not (math.isfinite(a) and math.isfinite(b)):
        return Difference(subject, first, second, reason=reason or "not known for both")
    is_log = subject.is_logarithmic and a > 0.0 and b > 0.0
    units = (a, b) if is_log else (1.0, 1.0)
    misfits = [one.misfit / unit for one, unit in zip((first, second), units, strict=True)]
    misfit, apart = math.hypot(*misfits), second.misses - first.misses
    if first.is_measured and second.is_measured:
        misfit = 0.0
    elif is_same_motion and any(misfits) and math.isnan(apart):
        misfit = abs(misfits[1] - misfits[0])
    elif is_same_motion and any(misfits):
        noise = (one.misses_error for one in (first, second) if math.isfinite(one.misses_error))
        misfit = math.sqrt(max(apart**2 - sum(error**2 for error in noise), 0.0))
    own, others = first.errors(1.0 / units[0]), second.errors(1.0 / units[1])
    others.append((misfit, math.inf))
    step = math.log(b / a) if is_log else b - a
    reach, chance = _reach([*own, *others], step)
    if is_log:
        low, high = (math.exp(min(end, _MOST_LOG)) - 1.0 for end in (step - reach, step + reach))
        share = reach
        numbers = (a * low, a * high, 100.0 * (b / a - 1.0), 100.0 * low, 100.0 * high)
    else:
        scale = first.scale if math.isfinite(first.scale) else a
        percent = share = math.nan
        if scale:
            # The first number is the denominator too: its error counts 1 + share times.
            of_both = [*first.errors(1.0 + step / scale), *others]
            percent, share = 100.0 * step / scale, _reach(of_both)[0] / abs(scale)
        if subject.kind == "parameter":  # an offset may pass zero: per cent of it say nothing
            percent = math.nan
        ends = (percent - 100.0 * share, percent + 100.0 * share)
        numbers = (step - reach, step + reach, percent, *ends)
    verdict = Sameness.UNDETERMINED
    if not reason and not math.isfinite(reach):
        reason = "no errors are known"
    elif not reason and abs(step) > reach:
        verdict = Sameness.DIFFERENT
    elif not reason and share > SEEN:
        # At its passage through zero a force has no per cent to speak of: newtons say it.
        reason = f"a difference of {100.0 * share:.2g} % would go unnoticed"
    elif not reason:
        verdict = Sameness.SAME
    return Difference(subject, first, second, *numbers, chance, verdict, reason)


def surely_different(lines: Sequence[Difference]) -> tuple[Difference, ...]:
    """Return the lines with `Difference.is_sure` set, by Holm's procedure over all of them.

    Among many lines one in twenty differs by chance. What is left here is so in one comparison of
    twenty, however the lines hang together.
    """
    known = [k for k, line in enumerate(lines) if math.isfinite(line.chance)]
    sure = set()
    for rank, k in enumerate(sorted(known, key=lambda k: lines[k].chance)):
        if lines[k].chance > _LEVEL / (len(known) - rank):
            break
        sure.add(k)
    return tuple(
        replace(line, is_sure=k in sure and line.verdict is Sameness.DIFFERENT)
        for k, line in enumerate(lines)
    )


# Lines in words: what differs, by how much, or why nothing can be said.


def outcome_of(lines: Sequence[Difference], words: str, units: ShownUnits = SI) -> str:
    """Say how many differ, which most, and what chance would do."""
    n_measured = sum(one.is_measured for one in lines) if lines[0].subject.kind == "force" else 0
    if n_measured:
        part = f" ({n_measured} of {len(lines)} as measured)"
        words += " as measured" if n_measured == len(lines) else part
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
    worst = max(
        sure, key=lambda one: abs(one.difference if math.isnan(one.percent) else one.percent)
    )
    how_many = "all" if len(sure) == len(different) else str(len(sure))
    return (
        f"{words}: {len(different)} of {len(known)} differ, {how_many} of them significantly; most "
        f"{worst.subject.place(units)}: {difference_of(worst, units)}{beside}"
    )


def difference_of(line: Difference, units: ShownUnits = SI) -> str:
    """Say how large a difference is, with its interval."""
    if math.isnan(line.percent):
        text = units.write(line.difference, line.subject.unit, "+.4g")
        low, high = (units.show(end, line.subject.unit) for end in (line.low, line.high))
        return f"{text} ({low:+.3g} to {high:+.3g})" if math.isfinite(low) else text
    text = f"{line.percent:+.2f} %"
    if math.isfinite(line.percent_low):
        text += f" ({line.percent_low:+.2f} to {line.percent_high:+.2f} %)"
    if line.subject.kind == "force":
        form = "+.1f" if units.of("N") == "N" else "+.3g"
        text += f", {units.write(line.difference, 'N', form)}"
    return text


def verdict_of(line: Difference, units: ShownUnits = SI, *, says_measured: bool = True) -> str:
    """Say the verdict of a line in words, and of a force whether it was measured."""
    subject, a, b = line.subject, line.first.value, line.second.value
    if subject.name.startswith("hysteresis") and a * b > 0.0:
        # Its sign is the way round the loop: -54 N after -57 N is a narrower loop.
        size = units.write(abs(abs(b) - abs(a)), subject.unit, ".2g")
        how = f"the loop is {size} {'wider' if abs(b) > abs(a) else 'narrower'}"
    elif math.isnan(line.percent):
        size = units.write(abs(line.difference), subject.unit, ".3g")
        how = f"{size} {'more' if line.difference > 0.0 else 'less'}"
    else:
        words = ("harder", "softer") if subject.kind == "force" else ("more", "less")
        two_digits = f"{float(f'{abs(line.percent):.2g}'):.15g}"  # without a power of ten
        how = f"{two_digits} % {words[0] if line.percent > 0 else words[1]}"
    said = (
        line.words
        or {
            Sameness.UNDETERMINED: f"cannot be determined: {line.reason}",
            Sameness.SAME: "same within errors",
            Sameness.DIFFERENT: f"different{'' if line.is_sure else ', perhaps by chance'}: {how}",
        }[line.verdict]
    )
    is_told = says_measured and subject.kind == "force" and line.is_measured
    return f"{said} (measured)" if is_told else said
