"""What is wrong with the channels of a log: put right where it is certain, else reported or asked.

`polarity` tells the signs from the loop's energy and from the gas force, which `gas_force`
measures; `skew` estimates by how much the force is late. Here they are asked in turn, and the tare
and the mid-stroke are reported. Nothing is absorbed into a parameter in silence.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning.gas_force import force_level
from damperfit.conditioning.polarity import TARED, find_signs
from damperfit.conditioning.skew import Skew, estimate_skew
from damperfit.recording import Finding, Recording, Trace

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.conditioning.gas_force import ForceLevel
    from damperfit.conditioning.options import ConditionOptions
    from damperfit.conditioning.timebase import UniformLog
    from damperfit.recording import Stretch

    FloatArray = NDArray[np.float64]

__all__ = ["describe_level", "describe_middle", "find_skew", "level_of", "middle_of", "put_right"]

# A level this near to what the gas gives is no news: other gas and oil move it as much.
_NEAR = 0.15
_KNOWN = 0.35  # uncertainty over the gas force above which nothing is said of a tare
# Of the whole range: how far the middles of a motion's quarters lie apart. Sweeps have next
# to nothing, roads several times as much as this.
_ONE_MIDDLE = 0.02
_NEAR_ZERO = 1.0 / 3.0  # of the amplitude: a sensor that counts from its end is beyond 1


def level_of(trace: Trace, options: ConditionOptions) -> ForceLevel | None:
    """Return the level of the force at no speed; None where nothing is known of the gas."""
    if options.gas is None:
        return None
    is_ours = options.rig_filter == "none"
    corner = options.filter_corner if is_ours else options.rig_filter_corner
    is_none = is_ours and options.filter == "none"
    return force_level(trace, options.gas, corner=math.inf if is_none else corner)


def put_right(
    trace: Trace, recording: Recording, level: ForceLevel | None
) -> tuple[Recording, tuple[Finding, ...]]:
    """Return the recording with the signs of the project, and what was found.

    The same recording when nothing had to be changed.

    Raises
    ------
    ConditioningError
        A sign is wrong and it is not certain which.
    """
    signs = find_signs(trace, recording, level)
    for channel in signs.reversed_channels:
        changes = {channel: -getattr(recording, channel), f"reverse_{channel}": True}
        recording = replace(recording, **changes)
    return recording, signs.findings


def describe_level(level: ForceLevel | None, options: ConditionOptions) -> tuple[Finding, ...]:
    """Return whether the gas force is in the log, was tared away, or is another one."""
    if level is None:
        return ()
    missing = level.force - level.expected
    size = -level.expected
    severity = "note" if options.offset.is_known else "warning"
    unsure = level.uncertainty + max(level.hidden, level.preloads)
    numbers = (
        f"at zero velocity the force is {level.force:.0f} +- {unsure:.0f} N; the gas "
        f"force alone is {level.expected:.0f} N"
    )
    if unsure > _KNOWN * size:
        text = f"cannot tell whether the force was tared: {numbers}"
        return (Finding("tare", "note", text, missing, "N"),)
    if abs(missing) <= _NEAR * size + unsure:
        return (Finding("tare", "note", f"gas force present: {numbers}", missing, "N"),)
    if abs(level.ratio) < TARED:
        return (Finding("tare", severity, _removed(numbers, level, options), missing, "N"),)
    what = "part of the gas force is missing" if 0.0 < missing < size else "not the gas force"
    text = (
        f"{what}: {numbers}; a tare, another gas pressure, cavitation or much elasticity: check "
        f"damper.gas_pressure, or free the offset{_freeing(options)}"
    )
    return (Finding("tare", severity, text, missing, "N"),)


def _removed(numbers: str, level: ForceLevel, options: ConditionOptions) -> str:
    if options.offset.is_known:
        return f"gas force tared away: {numbers}; {options.offset.name} accounts for it"
    return (
        f"gas force tared away: {numbers}; free the offset{_freeing(options)} or hold it"
        f"{_holding(options, -level.expected)}, or the other parameters absorb it"
    )


def _freeing(options: ConditionOptions) -> str:
    offset = options.offset
    return f" (--free {','.join((*offset.beside, offset.name))})" if offset.name else ""


def _holding(options: ConditionOptions, newtons: float) -> str:
    return f" (--fix {options.offset.name}={newtons:.0f}N)" if options.offset.name else ""


def middle_of(displacement: FloatArray, stretches: Sequence[Stretch]) -> float:
    """Return what is taken as x = 0 where nobody has declared it, in the log's own count.

    The middle of the widest stretch. A motion that wanders, such as a road, has none that is the
    damper's: the log's own 0 is taken, if it lies anywhere near the middle of the range.

    Parameters
    ----------
    displacement : numpy.ndarray
        Of the log, m.
    stretches : sequence of Stretch
        What is compared, in samples of it.
    """
    widest = max(stretches, key=lambda stretch: stretch.amplitude)
    part = displacement[widest.window]
    middle = 0.5 * float(part.max() + part.min())
    if _wanders(part) and abs(middle) <= _NEAR_ZERO * widest.amplitude:
        return 0.0
    return middle


def _wanders(x: FloatArray) -> bool:
    """Whether the middle of the motion is not the same throughout."""
    quarters = np.array_split(x, 4)
    middles = [0.5 * float(part.max() + part.min()) for part in quarters]
    return max(middles) - min(middles) > _ONE_MIDDLE * float(np.ptp(x))


def describe_middle(trace: Trace, options: ConditionOptions) -> Finding:
    """Return where mid-stroke is in the log, or how far a declared centre is from it."""
    window = trace.displacement[trace.compared]
    off = 0.5 * float(window.max() + window.min())
    centre = 1e3 * trace.centre
    if options.centre is not None:
        middle = f"mid-stroke at x = {1e3 * off:.3f} mm"
        text = f"x = 0 at {centre:.3f} mm of the log, as declared; {middle}"
        return Finding("mid_stroke", "note", text, off, "m")
    widest = max(trace.stretches, key=lambda stretch: stretch.amplitude)
    if not widest.n_cycles and _wanders(trace.displacement[widest.window]):
        return _of_wandering(trace, off)
    text = f"mid-stroke of the log ({round(centre, 3) + 0.0:.3f} mm) is x = 0 of the model"
    if 0.05 < abs(trace.centre) / trace.amplitude < 0.8:
        text += "; if the log's 0 is the middle of the damper, set rig.centre = '0mm'"
    return Finding("mid_stroke", "note", text, trace.centre, "m")


def _of_wandering(trace: Trace, off: float) -> Finding:
    """A road does not say where the middle of the damper is."""
    costs = "each mm off the damper's middle shifts R_m3 by about 2 %"
    if trace.centre == 0.0:
        text = (
            "the motion has no middle of its own: the log's 0 is taken as x = 0 of the model (the "
            f"range's middle is {1e3 * off:.1f} mm); {costs}: set rig.centre if it is elsewhere"
        )
        return Finding("mid_stroke", "note", text, 0.0, "m")
    text = (
        "the motion has no middle of its own, and the log's 0 is far off: the middle of the range "
        f"({1e3 * trace.centre:.1f} mm) is taken as x = 0 of the model; {costs}: set rig.centre"
    )
    return Finding("mid_stroke", "warning", text, trace.centre, "m")


def find_skew(
    log: UniformLog, trace: Trace, options: ConditionOptions
) -> tuple[float, tuple[Finding, ...]]:
    """Return by how much the force must be moved ahead, s, and what was found of the skew.

    Parameters
    ----------
    log : UniformLog
        With the signs of the project, moved by what was declared, not filtered by us.
    trace : Trace
        Of this log.
    options : ConditionOptions
        ``skew`` says what was declared.
    """
    is_auto = options.skew == "auto"
    if options.rig_filter != "none":
        skew = Skew(None, reason="the rig's filter rounds the friction's jump")
    else:
        skew = estimate_skew(log, trace)
    declared = () if is_auto or options.skew == 0.0 else (_moved(float(options.skew)),)
    if skew.delay is None:
        text = f"it cannot be determined whether the force is late: {skew.reason}"
        severity, done = (
            ("warning", "nothing was corrected")
            if is_auto
            else ("note", "a late force looks like a low K_e")
        )
        return 0.0, (*declared, Finding("skew", severity, f"{text}; {done}", None, "s"))
    text = (
        f"the force is {1e3 * skew.delay:.2f} +- {1e3 * skew.uncertainty:.2f} ms late, taking its "
        "jump at the ends of the stroke for Coulomb friction"
    )
    if not skew.is_significant:
        text = f"force and displacement are together: {text}"
        return 0.0, (*declared, Finding("skew", "note", text, skew.delay, "s"))
    if is_auto:
        finding = Finding("skew", "note", f"{text}; corrected", skew.delay, "s", is_correction=True)
        return skew.delay, (finding,)
    whole = skew.delay + float(options.skew)  # what was declared is no longer in the log looked at
    said = f"rig.skew = '{1e3 * whole:.1f}ms'"
    if skew.delay < 0.0:
        text += f"; that affects K_e most: set {said} if the rig is known to do so, or --skew auto"
    else:
        text = (
            f"the friction turns {1e3 * skew.delay:.2f} +- {1e3 * skew.uncertainty:.2f} ms late at "
            "the ends of the stroke: the force is late, or the mounting gives and the force is "
            "right (--model auto tries both; two frequencies or more can tell them apart). A late "
            f"force affects K_e most: only if the rig is known for it set {said}, or --skew auto"
        )
    return 0.0, (*declared, Finding("skew", "warning", text, skew.delay, "s"))


def _moved(delay: float) -> Finding:
    text = f"the force is moved {1e3 * delay:g} ms ahead, as declared"
    return Finding("skew_declared", "note", text, delay, "s")
