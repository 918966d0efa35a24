"""Lines in words: what differs, by how much, or why nothing can be said."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from damperfit.comparison.reading import Sameness
from damperfit.units.shown_units import SI

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.comparison.reading import Difference, Topic
    from damperfit.units.shown_units import ShownUnits

__all__ = ["difference_of", "outcome_of", "place_of", "verdict_of"]


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
