"""Which way a log counts displacement and force: put right where it is certain, else asked.

1. A damper takes energy, so mean(f v) > 0: that fixes the product of both signs.
2. What was declared is taken as it is, and doubted only where the opposite were certain. With one
   sign declared, the energy fixes the other.
3. The gas pushes the rod out. Where the log rests, the force is that of the gas within the
   friction, and tells the signs (`rest_of`).
4. In the motion the force level (`gas_force`) is -a_r P_0 in the project's signs, and of the other
   sign when the force is counted positive in bump. That is certain when

   - the level is `_CERTAIN` times what the gas gives, and more than twice its own uncertainty with
     what preloads may hide in it: those of rebound are mostly the larger ones, and lift the level
     above zero, where a gas force that is counted reversed has it;
   - the strokes are not so digressive that no valve of the model could do it;
   - rebound curves more than bump, as valve 1 has it (a_p1^3 against a_r^3).

Where nothing is certain and the loop takes energy, the log is taken as it is, with a warning. Other
logs of the batch may decide it, for a rig has one convention; a level that contradicts the signs by
more than twice its doubt (about four standard errors) withholds the grade. Where the loop gives
energy, the log is refused with the question that must be answered.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from damperfit.conditioning.delay import Delay, estimate_delay
from damperfit.conditioning.drive import dwells_of
from damperfit.conditioning.gas_force import force_level, gas_force
from damperfit.errors import ConditioningError
from damperfit.problem import Option
from damperfit.recording import Finding, Recording, Trace
from damperfit.statistics import mean_of, median

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.conditioning.gas_force import ForceLevel
    from damperfit.conditioning.options import ConditionOptions, GasFacts
    from damperfit.conditioning.timebase import UniformLog
    from damperfit.recording import Recording, Stretch, Trace

    FloatArray = NDArray[np.float64]

__all__ = [
    "CONTRADICTED",
    "TARED",
    "UNKNOWN",
    "Rest",
    "Signs",
    "describe_level",
    "describe_middle",
    "find_delay",
    "find_signs",
    "level_of",
    "middle_of",
    "put_right",
    "rest_of",
    "reversed_in",
]


# Mean of f v over mean of |f v|: near -1 or 1 for a damper, less where elasticity rules.
_CLEAR_ENERGY = 0.1
# Level over gas force, of right logs near 1: `python -m tests.conditioning.corrections_grid` shows
# it over settings, K_e, gas pressures, strokes and a second damper.
_CERTAIN = (0.5, 1.7)
# Sum of both curvatures, which the same command shows; a damper that yields first and flows then,
# as magneto-rheological ones, has less than the model's valves.
_LEAST_CURVATURE = -0.6
# Times what valves that open early may hide of a level. Of 1500 right logs of synthetic valves with
# preloads of 10 to 1000 N one is turned round with it and with what yields, and 18 without; of
# reversed ones 110 are put right after 246 (`python -m tests.conditioning.unlike_preloads`).
_OF_HIDDEN = 2.0
TARED = 0.25  # below this share of the gas force there is none to be seen
UNKNOWN = "signs-unknown"
CONTRADICTED = "direction_contradicted"
_OF_DOUBT = 2.0  # times a level's doubt (about two standard errors): the signs are contradicted
# A rest lasts so long, s, and so much of a period. Its later half is read, when what the valves
# held has leaked away.
_REST_TIME, _REST_PERIODS = 0.3, 0.1
# Of half the range of the force: what seals may hold at rest. Half the gas force must be left.
_REST_FRICTION = 0.1
_REST_LIMIT = 4.0  # times the gas force: pressures are often guessed
_CHANNELS = ("displacement", "force")
_ASK = (
    "declare rig.reverse_displacement and rig.reverse_force: true where the log counts compression "
    "(rod in) as positive, else false"
)


class Signs(NamedTuple):
    """What must be reversed, and what is to be reported.

    Attributes
    ----------
    reversed_channels : tuple of str
        "displacement", "force", both or none.
    findings : tuple of Finding
        A note for each channel reversed; a warning where the direction is not known.
    is_certain : bool
        The gas force shows the signs, in this log and so in others of the rig.
    """

    reversed_channels: tuple[str, ...]
    findings: tuple[Finding, ...] = ()
    is_certain: bool = False


@dataclass(frozen=True, slots=True)
class Rest:
    """What the force is where the log rests.

    Attributes
    ----------
    force, expected : float
        Median over the rests, and the gas force at those displacements, N.
    friction : float
        What seals may hold either way, N.
    count : int
        Rests of the log.
    """

    force: float
    expected: float
    friction: float
    count: int

    @property
    def sign(self) -> int:
        """1 where the force has the sign of the gas force, -1 the other one, 0 not clear."""
        ratio = self.force / self.expected if self.expected else 0.0
        is_clear = 0.5 < abs(ratio) < _REST_LIMIT and abs(self.force) > 2.0 * self.friction
        return int(math.copysign(1.0, ratio)) if is_clear else 0

    @property
    def sentence(self) -> str:
        """The force beside the gas force, for people."""
        return (
            f"at rest the force is {self.force - self.friction:.0f} to "
            f"{self.force + self.friction:.0f} N; the gas force alone is {self.expected:.0f} N"
        )


def rest_of(
    log: UniformLog, trace: Trace, recording: Recording, gas: GasFacts | None
) -> Rest | None:
    """Return the force where a log rests; None where it does not, or the gas is not known."""
    if gas is None:
        return None
    needed = max(_REST_TIME, _REST_PERIODS / trace.frequency) / log.interval
    dwells = dwells_of(log.displacement, log.interval)
    dwells = [(part, x) for part, x in dwells if part.stop - part.start >= needed]
    if not dwells:
        return None
    forces = [median(log.force[(part.start + part.stop) // 2 : part.stop]) for part, _ in dwells]
    places = [x for _, x in dwells]
    at = np.array(places) - (-trace.centre if recording.reverse_displacement else trace.centre)
    friction = _REST_FRICTION * 0.5 * float(np.ptp(trace.force[trace.compared]))
    return Rest(median(forces), median(gas_force(gas, at)), friction, len(forces))


def find_signs(
    trace: Trace, recording: Recording, level: ForceLevel | None, rest: Rest | None = None
) -> Signs:
    """Return which channels of a log must be reversed.

    Parameters
    ----------
    trace : Trace
        Of the recording as it stands.
    recording : Recording
        Tells which signs were declared.
    level : ForceLevel or None
        Of the trace; None where nothing is known of the gas.
    rest : Rest or None
        Of the log; None where it never rests.

    Raises
    ------
    ConditioningError
        The loop gives energy, and both signs were declared or it is not certain which is wrong.
    """
    share, joules = _energy(trace)
    free = [name for name in _CHANNELS if getattr(recording, f"reverse_{name}") is None]
    if abs(share) < _CLEAR_ENERGY:
        return Signs((), (_no_energy(share),))
    if share > 0.0:
        return _both_or_none(level, free, rest)
    gives = f"the loop gives {-joules:.3g} J a cycle as logged"
    if len(free) == 1:
        return _reversed(free, f"{gives}, and the sign of the other channel is declared")
    if not free:
        raise _question(trace, joules, "both signs are declared, and one of them wrongly")
    if rest is not None and rest.sign:
        wrong = "force" if rest.sign < 0 else "displacement"
        return _reversed((wrong,), f"{gives}, and {rest.sentence}")
    return _one(trace, level, joules, gives)


def reversed_in(recording: Recording, trace: Trace) -> list[str]:
    """Return the channels of a log that count bump positive, as declared or as found.

    Parameters
    ----------
    recording : Recording
        As it was read.
    trace : Trace
        What was made of it.
    """
    found = {one.name for one in trace.findings if one.is_correction}
    return [
        channel
        for channel in _CHANNELS
        if getattr(recording, f"reverse_{channel}") or f"{channel}_polarity" in found
    ]


def _energy(trace: Trace) -> tuple[float, float]:
    """Return mean(f v) over mean(|f v|), and J per cycle."""
    power = trace.force[trace.compared] * trace.velocity[trace.compared]
    mean = mean_of(power)
    return mean / max(mean_of(np.abs(power)), 1e-300), mean / trace.frequency


def _both_or_none(level: ForceLevel | None, free: list[str], rest: Rest | None) -> Signs:
    """Return the signs of a log that takes energy: as it is, or both reversed."""
    at_rest = rest.sign if rest is not None else 0
    is_free = len(free) == len(_CHANNELS)
    if rest is not None and at_rest < 0 and is_free:
        return _reversed(_CHANNELS, f"{rest.sentence}, and the loop absorbs energy")
    if at_rest > 0 or level is None or level.ratio > TARED:
        return Signs((), is_certain=at_rest > 0 or _is_as_expected(level))
    if not is_free:
        # A cell zeroed before mounting shows any level; a declaration is doubted for more.
        is_doubted = _is_certain(level, _CHANNELS)
        kept = "the declared signs are kept; check them again"
        return _doubt(level, kept, is_asked=False) if is_doubted else Signs(())
    if _is_certain(level, _CHANNELS):
        return _reversed(_CHANNELS, f"{_level_in_words(level)}, and the loop absorbs energy")
    return _doubt(level, f"taken as logged; {_ASK}")


def _one(trace: Trace, level: ForceLevel | None, joules: float, gives: str) -> Signs:
    """Return the one channel that is reversed in a log that gives energy."""
    if level is None:
        raise _question(trace, joules, "")
    for channel in _CHANNELS:
        if _is_certain(level, (channel,)):
            return _reversed((channel,), f"{gives}, and {_level_in_words(level)}")
    raise _question(trace, joules, f"{_level_in_words(level)}: that does not show which of the two")


def _seen(level: ForceLevel, reversed_channels: tuple[str, ...]) -> ForceLevel:
    """Return the level as it would be with channels reversed."""
    rebound, bump = level.rebound_curvature, level.bump_curvature
    if "displacement" in reversed_channels:
        rebound, bump = -bump, -rebound
    if "force" not in reversed_channels:
        return level._replace(rebound_curvature=rebound, bump_curvature=bump)
    return level._replace(
        branches=-level.branches,
        reversals=-level.reversals,
        rebound_curvature=-rebound,
        bump_curvature=-bump,
    )


def _is_certain(level: ForceLevel, reversed_channels: tuple[str, ...]) -> bool:
    """Whether the log is a gas damper's with these channels reversed, beyond doubt."""
    seen = _seen(level, reversed_channels)
    # Of one reversed channel alone the strokes are not as they seem, nor is what they hide.
    hidden = _OF_HIDDEN * seen.hidden if len(reversed_channels) == len(_CHANNELS) else 0.0
    return (
        _CERTAIN[0] < seen.ratio < _CERTAIN[1]
        and abs(seen.force) > 2.0 * (seen.uncertainty + seen.held + hidden)
        and seen.rebound_curvature + seen.bump_curvature > _LEAST_CURVATURE
        and seen.rebound_curvature > seen.bump_curvature
    )


def _is_as_expected(level: ForceLevel | None) -> bool:
    """Whether the gas force is there with its sign, which unlike preloads rather hide."""
    return level is not None and bool(
        _CERTAIN[0] < level.ratio < _CERTAIN[1] and abs(level.force) > level.doubt
    )


def _level_in_words(level: ForceLevel) -> str:
    """Return the level beside the gas force, for people."""
    unsure = level.uncertainty + level.held
    return (
        f"at zero velocity the force is {level.force - unsure:.0f} to {level.force + unsure:.0f} "
        f"N; the gas force alone is {level.expected:.0f} N"
    )


def _reversed(channels: tuple[str, ...] | list[str], reason: str) -> Signs:
    findings = tuple(
        Finding(
            f"{channel}_polarity",
            "note",
            f"{channel}: found positive in compression and reversed: {reason}; "
            f"rig.reverse_{channel} = true confirms this, false keeps it as logged",
            -1.0,
            is_correction=True,
        )
        for channel in channels
    )
    return Signs(tuple(channels), findings, is_certain=True)


def _doubt(level: ForceLevel, advice: str, *, is_asked: bool = True) -> Signs:
    name, sees = "direction", "so no gas force distinguishes rebound from compression"
    if level.ratio <= -TARED and abs(level.force) > level.uncertainty + level.held:
        sees = "as if both channels were positive in compression, but that is not certain"
        # Progressive valves curve more in rebound: where these do, a tare explains the level.
        is_tared = level.rebound_curvature > max(level.bump_curvature, 0.0)
        if is_asked and not is_tared and abs(level.force) > _OF_DOUBT * level.doubt:
            name = CONTRADICTED
    text = f"{_level_in_words(level)}, {sees}; {advice}"
    return Signs((), (Finding(name, "warning", text, level.ratio),))


def _no_energy(share: float) -> Finding:
    text = (
        f"the loop absorbs hardly any energy ({100.0 * share:.0f} % of its throughput): the signs "
        "of the channels cannot be determined, and this can hardly be a damper; check columns and "
        "skew"
    )
    return Finding("force_polarity", "warning", text, share)


def _question(trace: Trace, joules: float, doubt: str) -> ConditioningError:
    return ConditioningError(
        f"the damper delivers {-joules:.3g} J per cycle instead of absorbing energy: "
        f"force or displacement is reversed{f'; {doubt}' if doubt else ''}; {_ASK}",
        code=UNKNOWN,
        subject=trace.name,
    )


# What is wrong with the channels of a log: put right where it is certain, else reported or asked.
#
# `polarity` tells the signs from the loop's energy and from the gas force, which `gas_force`
# measures; `skew` estimates by how much the force is late. Here they are asked in turn, and the
# tare and the mid-stroke are reported. Nothing is absorbed into a parameter in silence.

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
    trace: Trace, recording: Recording, level: ForceLevel | None, rest: Rest | None = None
) -> tuple[Recording, Signs]:
    """Return the recording with the signs of the project, and what was found.

    The same recording when nothing had to be changed.

    Raises
    ------
    ConditioningError
        A sign is wrong and it is not certain which.
    """
    signs = find_signs(trace, recording, level, rest)
    for channel in signs.reversed_channels:
        changes = {channel: -getattr(recording, channel), f"reverse_{channel}": True}
        recording = replace(recording, **changes)
    return recording, signs


def describe_level(level: ForceLevel | None, options: ConditionOptions) -> tuple[Finding, ...]:
    """Return whether the gas force is in the log, was tared away, or is another one."""
    if level is None:
        return ()
    missing = level.force - level.expected
    size = -level.expected
    severity = "note" if options.offset.is_known else "warning"
    unsure = level.uncertainty + max(level.hidden, level.preloads)
    numbers = (
        f"at zero velocity the force is {level.force - unsure:.0f} to {level.force + unsure:.0f} "
        f"N; the gas force alone is {level.expected:.0f} N"
    )
    if unsure > _KNOWN * size:
        text = f"cannot tell whether the force was tared: {numbers}"
        return (Finding("tare", "note", text, missing, "N"),)
    if abs(missing) <= _NEAR * size + unsure:
        return (Finding("tare", "note", f"gas force present: {numbers}", missing, "N"),)
    if abs(level.ratio) < TARED:
        text = _removed(numbers, options)
        values = _ways_out(options, -level.expected)
        return (Finding("tare", severity, text, missing, "N", values=values),)
    what = "part of the gas force is missing" if 0.0 < missing < size else "not the gas force"
    text = (
        f"{what}: {numbers}; a tare, another gas pressure, cavitation or much elasticity: check "
        f"damper.gas_pressure, or free the offset{{free}}"
    )
    values = _ways_out(options, -level.expected)
    return (Finding("tare", severity, text, missing, "N", values=values),)


def _removed(numbers: str, options: ConditionOptions) -> str:
    if options.offset.is_known:
        return f"gas force tared away: {numbers}; {options.offset.name} accounts for it"
    return (
        f"gas force tared away: {numbers}; free the offset{{free}} or hold it{{hold}}, or the "
        "other parameters absorb it"
    )


def _ways_out(options: ConditionOptions, newtons: float) -> dict[str, Any]:
    """Return the options that free the offset and hold it, each in brackets."""
    offset = options.offset
    if not offset.name:
        return {"free": "", "hold": ""}
    return {
        "free": Option("free", ",".join((*offset.beside, offset.name)), is_aside=True),
        "hold": Option("fix", f"{newtons:.0f}N", offset.name, is_aside=True),
    }


def middle_of(displacement: FloatArray, stretches: Sequence[Stretch]) -> float:
    """Return what is taken as x = 0 where nobody has declared it, in the log's own count.

    The middle of the widest stretch. A motion that wanders, such as a road, has none that is the
    damper's: the log's own 0 is taken, if it lies anywhere near the middle of the range.
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


def find_delay(
    log: UniformLog, trace: Trace, options: ConditionOptions
) -> tuple[float, tuple[Finding, ...]]:
    """Return by how much the force must be moved ahead, s, and what was found of the skew."""
    is_auto = options.skew == "auto"
    if options.rig_filter != "none":
        skew = Delay(None, reason="the rig's filter rounds the friction's jump")
    else:
        skew = estimate_delay(log, trace)
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
        f"the force is {1e3 * skew.delay:.2f} ms late, within {1e3 * skew.uncertainty:.2f} ms, "
        "taking its jump at the ends of the stroke for Coulomb friction"
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
        text += f"; that affects K_e most: set {said} if the rig is known to do so, or {{auto}}"
    else:
        text = (
            f"the friction reverses {1e3 * skew.delay:.2f} ms late, within "
            f"{1e3 * skew.uncertainty:.2f} ms, at the ends of the stroke: the force is late, or "
            "the mounting is elastic and the force is right ({model} tries both; two frequencies "
            "or more can tell them apart). A late "
            f"force affects K_e most: only if the rig is known for it set {said}, or {{auto}}"
        )
    options_named = {"auto": Option("skew", "auto"), "model": Option("model", "auto")}
    found = Finding("skew", "warning", text, skew.delay, "s", values=options_named)
    return 0.0, (*declared, found)


def _moved(delay: float) -> Finding:
    text = f"the force is moved {1e3 * delay:g} ms ahead, as declared"
    return Finding("skew_declared", "note", text, delay, "s")
