"""Two numbers beside each other: how far apart, whether that is more than chance, and in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from damperfit.comparison.measured import Reading, Topic, reach_of
from damperfit.units.shown_units import SI, ShownUnits

# "Same" is said only where a difference of so much of the damping, or of the value, would be seen.
_SEEN = 0.05
_LEVEL = 0.05  # of all verdicts of a comparison together
_MOST_LOG = 700.0  # beyond it exp overflows

SAME, DIFFERENT, UNDETERMINED = "same", "different", "undetermined"  # verdicts, for scripts


class Difference(NamedTuple):
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
    verdict: str = UNDETERMINED  # at 95 %, each line by itself
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


def compared(
    subject: Topic, first: Reading, second: Reading, *, is_same_motion: bool = False
) -> Difference:
    """Return the difference of two readings; of one model and motion, common misfit cancels."""
    a, b = first.value, second.value
    reason = first.objection or second.objection
    if not (math.isfinite(a) and math.isfinite(b)):
        return Difference(subject, first, second, reason=reason or "not known for both")
    is_log = subject.is_logarithmic and a > 0.0 and b > 0.0
    units = (a, b) if is_log else (1.0, 1.0)
    misfits = [reading.misfit / unit for reading, unit in zip((first, second), units, strict=True)]
    misfit, miss_change = math.hypot(*misfits), second.misses - first.misses
    if first.is_measured and second.is_measured:
        misfit = 0.0
    elif is_same_motion and any(misfits) and math.isnan(miss_change):
        misfit = abs(misfits[1] - misfits[0])
    elif is_same_motion and any(misfits):
        noise = (r.misses_error for r in (first, second) if math.isfinite(r.misses_error))
        misfit = math.sqrt(max(miss_change**2 - sum(error**2 for error in noise), 0.0))
    second_errors = [*second.errors(1.0 / units[1]), (misfit, math.inf)]
    errors = [*first.errors(1.0 / units[0]), *second_errors]
    step = math.log(b / a) if is_log else b - a
    reach, chance = reach_of(errors, step)
    if is_log:
        percent = 100.0 * (b / a - 1.0)
        low, high = (math.exp(min(log, _MOST_LOG)) - 1.0 for log in (step - reach, step + reach))
        share = reach
        numbers = (a * low, a * high, percent, 100.0 * low, 100.0 * high)
    else:
        scale = first.scale if math.isfinite(first.scale) else a
        percent = share = math.nan
        if scale:
            # The first number is the denominator too: its error counts 1 + share times.
            percent = 100.0 * step / scale
            share = reach_of([*first.errors(1.0 + step / scale), *second_errors])[0] / abs(scale)
        if subject.kind == "parameter":  # an offset may pass zero: per cent of it say nothing
            percent = math.nan
        limits = (percent - 100.0 * share, percent + 100.0 * share)
        numbers = (step - reach, step + reach, percent, *limits)
    verdict = UNDETERMINED
    if not reason and not math.isfinite(reach):
        reason = "no errors are known"
    elif not reason and abs(step) > reach:
        verdict = DIFFERENT
    elif not reason and share > _SEEN:
        # At its passage through zero a force has no per cent to speak of: newtons say it.
        size = f"{reach:.2g} {subject.unit}" if math.isnan(percent) else f"{100.0 * share:.2g} %"
        reason = f"a difference of {size} would go unnoticed"
    elif not reason:
        verdict = SAME
    return Difference(subject, first, second, *numbers, chance, verdict, reason)


def surely_different(lines: Sequence[Difference]) -> tuple[Difference, ...]:
    """Return the lines with `Difference.is_sure` set, by Holm's procedure over all of them.

    Among many lines one in twenty differs by chance. What is left here is so in one comparison of
    twenty, however the lines are correlated.
    """
    chances = sorted(line.chance for line in lines if math.isfinite(line.chance))
    limit = -1.0  # the largest chance of those that are sure
    for rank, chance in enumerate(chances):
        if chance > _LEVEL / (len(chances) - rank):
            break
        limit = chance
    return tuple(
        line._replace(is_sure=line.chance <= limit and line.verdict == DIFFERENT) for line in lines
    )


# Lines in words: what differs, by how much, or why nothing can be said.


def outcome_of(lines: Sequence[Difference], words: str, units: ShownUnits = SI) -> str:
    """Say how many differ, which most, and what chance would do."""
    n_measured = sum(line.is_measured for line in lines) if lines[0].subject.kind == "force" else 0
    if n_measured:
        share = f" ({n_measured} of {len(lines)} as measured)"
        words += " as measured" if n_measured == len(lines) else share
    clear, n = [line for line in lines if line.verdict != UNDETERMINED], len(lines)
    if not clear:
        return f"{words}: cannot be determined ({lines[0].reason})"
    different = [line for line in clear if line.verdict == DIFFERENT]
    sure = [line for line in different if line.is_sure]
    unclear = f"; {n - len(clear)} cannot be determined" if n > len(clear) else ""
    if not different:
        which = f"{len(clear)} of {n}" if unclear else f"all {n}"
        return f"{words}: {which} the same within errors{unclear}"
    if not sure:
        return (
            f"{words}: no significant difference: {len(different)} of {n} lie outside "
            f"their 95 % interval, where chance alone puts {0.05 * len(clear):.2g}{unclear}"
        )
    worst = max(
        sure, key=lambda line: abs(line.difference if math.isnan(line.percent) else line.percent)
    )
    how_many = "all" if len(sure) == len(different) else str(len(sure))
    return (
        f"{words}: {len(different)} of {n} differ, {how_many} of them significantly; most "
        f"{worst.subject.place(units)}: {difference_of(worst, units)}{unclear}"
    )


def difference_of(line: Difference, units: ShownUnits = SI) -> str:
    """Say how large a difference is, with its interval."""
    unit = line.subject.unit
    if math.isnan(line.percent):
        text = units.write(line.difference, unit, "+.4g")
        low, high = (units.show(end, unit) for end in (line.low, line.high))
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
    text = line.words or "same within errors"
    if not line.words and line.verdict == UNDETERMINED:
        text = f"cannot be determined: {line.reason}"
    elif not line.words and line.verdict == DIFFERENT:
        if subject.name.startswith("hysteresis") and a * b > 0.0:
            # Its sign is the way round the loop: -54 N after -57 N is a narrower loop.
            size = units.write(abs(abs(b) - abs(a)), subject.unit, ".2g")
            change = f"the loop is {size} {'wider' if abs(b) > abs(a) else 'narrower'}"
        elif math.isnan(line.percent):
            size = units.write(abs(line.difference), subject.unit, ".3g")
            change = f"{size} {'more' if line.difference > 0.0 else 'less'}"
        else:
            words = ("softer", "harder") if subject.kind == "force" else ("less", "more")
            two_digits = f"{float(f'{abs(line.percent):.2g}'):.15g}"  # without a power of ten
            change = f"{two_digits} % {words[line.percent > 0.0]}"
        text = f"different{'' if line.is_sure else ', perhaps by chance'}: {change}"
    is_marked = says_measured and subject.kind == "force" and line.is_measured
    return f"{text} (measured)" if is_marked else text
