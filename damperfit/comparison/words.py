"""Lines in words: what differs, by how much, or why nothing can be said."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from damperfit.comparison.reading import Sameness

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.comparison.reading import Difference, Topic

__all__ = ["difference_of", "outcome_of", "place_of", "verdict_of"]


def outcome_of(lines: Sequence[Difference], words: str) -> str:
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
        f"{place_of(worst.subject)}: {difference_of(worst)}{beside}"
    )


def _weight(line: Difference) -> float:
    return abs(line.percent) if math.isfinite(line.percent) else abs(line.difference)


def place_of(subject: Topic) -> str:
    """Say of what a line is, as in "setting 3, 0.26 m/s rebound"."""
    where = "" if subject.setting is None else f"setting {subject.setting}, "
    if subject.speed is not None:
        return f"{where}{subject.speed:g} m/s {subject.stroke}"
    return f"{where}{subject.label}"


def difference_of(line: Difference) -> str:
    """Say how large a difference is, with its interval."""
    if math.isfinite(line.percent):
        text = f"{line.percent:+.2f} %"
        if math.isfinite(line.percent_low):
            text += f" ({line.percent_low:+.2f} to {line.percent_high:+.2f} %)"
        if line.subject.kind == "force":
            text += f", {line.difference:+.1f} N"
        return text
    text = f"{line.difference:+.4g} {line.subject.unit}".rstrip()
    return f"{text} ({line.low:+.3g} to {line.high:+.3g})" if math.isfinite(line.low) else text


def verdict_of(line: Difference, *, says_measured: bool = True) -> str:
    """Say the verdict of a line in words, and of a force whether it was measured."""
    is_said = says_measured and line.subject.kind == "force" and line.is_measured
    return f"{_verdict(line)} (measured)" if is_said else _verdict(line)


def _verdict(line: Difference) -> str:
    if line.words:
        return line.words
    if line.verdict is Sameness.UNDETERMINED:
        return f"cannot be determined: {line.reason}"
    if line.verdict is Sameness.SAME:
        return "same within errors"
    how = _how_different(line)
    return f"different: {how}" if line.is_sure else f"different, perhaps by chance: {how}"


def _how_different(line: Difference) -> str:
    is_force = line.subject.kind == "force"
    if not math.isfinite(line.percent):
        more = "more" if line.difference > 0.0 else "less"
        return f"{abs(line.difference):.3g} {line.subject.unit} {more}"
    if is_force:
        return f"{abs(line.percent):.2g} % {'harder' if line.percent > 0 else 'softer'}"
    return f"{abs(line.percent):.2g} % {'more' if line.percent > 0 else 'less'}"
