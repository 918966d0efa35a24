"""Which way a log counts displacement and force: put right where it is certain, else asked.

1. A damper takes energy, so mean(f v) > 0: that fixes the product of both signs.
2. What was declared is taken as it is, and doubted only where the opposite were certain: then the
   grade is withheld. With one sign declared, the energy fixes the other.
3. The gas pushes the rod out. Where the log rests, the force is that of the gas within the
   friction, and shows the signs (`rest_of`).
4. In the motion the force level (`force_level`) is -a_r P_0 in the project's signs, and of the
   other sign when the force is counted positive in bump. That is certain when

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

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from damperfit.conditioning.drive import dwells_of
from damperfit.conditioning.options import ConditionOptions, GasFacts
from damperfit.conditioning.signals import BoolArray, FloatArray, IntArray
from damperfit.conditioning.timebase import UniformLog
from damperfit.errors import ConditioningError
from damperfit.passed_speeds import in_both_strokes
from damperfit.problem import Option, Problem, note, warning
from damperfit.recording import Recording, Trace
from damperfit.statistics import mean_of, median

# The force level of a steady test: what the gas, or a tare, adds to the force at no speed.
#
# At rest the force is -a_r (P_0 - P_amb). In a test it is hidden under friction, valves and the
# elasticity of the oil. Two estimates that err in opposite ways are taken, both odd under a
# change of signs; their mean is the level, its uncertainty half their distance, a share of the
# hysteresis at the ends of the stroke, and a little of the gas force:
#
# - *branches*: the constant of a least-squares fit of ``1, x, sgn(v)`` and of v and v^2 in each
#   stroke, the closed form of the incompressible damper without its bounds;
# - *reversals*: the mean of the force at the two ends of the stroke, where friction and hysteresis
#   are opposite, less the curvature of the gas spring.
#
# Over the reference set (4 N of noise, 500 Hz) the level is -130.5 to -134.3 N for -130.4 N; oil so
# soft that the strokes run into each other spoils it, and so does cavitation
# (`python -m tests.conditioning.corrections_grid`).
#
# ``rebound_curvature`` and ``bump_curvature`` are the part of the force that grows with v^2 at
# peak speed, over half the range of the force, positive when the stroke is progressive. The
# model's valves make both positive and rebound's larger: a_p1^3 against a_r^3 through valve 1.
# Those of a magneto-rheological damper are negative. Such a damper, which holds its force down to
# low speed, hardly shows a level: preloads that are unlike in both strokes, behind a filter, move
# both estimates alike, by up to half their difference. What turns faster than the filter shows,
# beyond a friction, says how large they may be.

# Whether a damper yields before it slides, as magneto-rheological ones and dry friction do: it
# holds its force down to no speed, where a valve's falls with the flow. So the force that is left
# at a tenth of the peak speed *while slowing down* is looked at, of both strokes together, over the
# force's range: a tare, the gas and elasticity in series drop out.

# Share of the force's range from which it yields. Linear valves keep a tenth and friction adds its
# own share: 0.05 to 0.17 over the reference set. Magneto-rheological logs with current have 0.59 to
# 0.71, synthetic preloaded valves with a small bleed 0.43 to 0.79.
YIELDS = 0.4
_SLOW = 0.1  # of the segment's peak speed


def held_share(trace: Trace) -> float:
    """Return the share of the measured force's range that is left at a tenth of the speed."""
    return held_shares(trace, trace.force[trace.compared][None, :])[0]


def held_shares(trace: Trace, forces: FloatArray) -> tuple[float, ...]:
    """Return the `held_share` of forces, (k, n), at the compared samples: of segments the median.

    NaN where none passes that speed both ways.
    """
    shares = []
    for segment, place in zip(trace.segments, trace.places, strict=True):
        v, part = trace.velocity[segment.window], forces[:, place]
        slow = (_SLOW * float(max(v.max(), -v.min())),)
        out, into = in_both_strokes(v, part, slow)[1][:, 1, 0]
        shares.append((out - into) / np.maximum(np.ptp(part, axis=1), 1e-300))
    return tuple(
        median([x for x in of if math.isfinite(x)]) for of in np.transpose(shares).tolist()
    )


LEAST_GAS = 30.0  # N; what a rig's usual tare may be: a gas force below it proves nothing
_MADE_UP = 1e-15  # of the largest of a matrix
# What both estimates may be wrong by together. Oil at 1e8 Pa exceeds it at setting 10
# (`python -m tests.conditioning.corrections_grid`).
_OF_HYSTERESIS = 0.25
_OF_GAS = 0.03
# Of half the range of the force. What opens at low speed and is unlike in both strokes looks like a
# level, in both estimates alike: a share of the digressive curvature. So does what a filter takes
# off the turns: a share for each harmonic that it passes fewer than these. Of synthetic digressive
# and linear strokes at 1 to 12 Hz behind 30 Hz none is called tared that is not
# (`tests/conditioning/test_findings.py`).
_OF_DIGRESSION = 0.1
_OF_HARMONICS = 0.15
_ENOUGH_HARMONICS = 20.0
# Preloads that are unlike in both strokes. What the force jumps by at a turn, within `_TURN` of the
# filter's period, is friction, up to `_OF_FRICTION` of half the range, and preloads; of these
# `_OF_PRELOADS` may look like a level. Of right logs with preloads of 10 to 1000 N in either stroke
# 7 % are reported as tared, 26 % without this; of tared ones 44 %, 64 % without.
_TURN = 0.1
_WIDEST_TURN = 0.5  # of the highest speed
_OF_FRICTION = 0.05
_OF_PRELOADS = 0.7


class ForceLevel(NamedTuple):
    """The level of the force, N, and the curvature of its strokes."""

    branches: float  # the two estimates of the force at x = 0 and no speed
    reversals: float
    uncertainty: float  # about two standard errors of their mean
    expected: float  # what the gas gives against the air, -a_r (P_0 - P_amb)
    # Share of the force's half range that grows with v^2, positive when progressive.
    rebound_curvature: float
    bump_curvature: float
    # How much of a level may be valves that open early, or what a filter took off the turns; or
    # preloads that are unlike in both strokes.
    hidden: float = 0.0
    preloads: float = 0.0
    # Half the force that the log holds down to low speed, where it yields: all of it may be one
    # stroke's, and a filter that spreads the turn makes a level of it.
    held: float = 0.0

    @property
    def force(self) -> float:
        """The level, mean of both estimates."""
        return 0.5 * (self.branches + self.reversals)

    @property
    def doubt(self) -> float:
        """By how much the level may be wrong, with all that may hide in it."""
        return self.uncertainty + max(self.hidden, self.preloads) + self.held

    @property
    def ratio(self) -> float:
        """Level over what the gas gives: 1 as expected, 0 tared or no gas, -1 counted reversed."""
        return self.force / self.expected if self.expected else 0.0

    def between(self, unsure: float) -> str:
        """The level beside the gas force, for people."""
        return (
            f"at zero velocity the force is {self.force - unsure:.0f} to "
            f"{self.force + unsure:.0f} N; the gas of [damper] alone gives {self.expected:.0f} N"
        )

    @property
    def sentence(self) -> str:
        """The same within the uncertainty of its signs."""
        return self.between(self.uncertainty + self.held)


def gas_force(gas: GasFacts, displacement: FloatArray) -> FloatArray:
    """Return a_r (P_amb - P_0 (V_g0/(V_g0 + a_r x))^gamma), N; x in m; eq. (17) corrected."""
    room = np.maximum(gas.volume + gas.rod_area * displacement, 1e-3 * gas.volume)
    pressure = gas.pressure * (gas.volume / room) ** gas.exponent
    return np.asarray(gas.rod_area * (gas.ambient - pressure))


def force_level(trace: Trace, gas: GasFacts, *, corner: float = math.inf) -> ForceLevel:
    """Return the force level of what is compared of a trace, behind a filter of this corner, Hz."""
    whole = _level_of(trace, gas, corner)
    if len(trace.segments) < 2:
        return whole
    # The motion that hides it least gives the level: valves that open below a tenth of the highest
    # speed look like a level there. The curvature is that of all of them.
    alone = (replace(trace, segments=(segment,)) for segment in trace.segments)
    clearest = min((_level_of(log, gas, corner) for log in alone), key=lambda level: level.doubt)
    curvature = {name: getattr(whole, name) for name in ("rebound_curvature", "bump_curvature")}
    return clearest._replace(**curvature)


def _level_of(trace: Trace, gas: GasFacts, corner: float) -> ForceLevel:
    channels = trace.displacement, trace.velocity, trace.force
    x, v, f = (channel[trace.compared] for channel in channels)
    half_range = max(0.5 * float(np.ptp(f)), 1e-300)
    # The constant, and the force in v^2 at peak speed of rebound and bump, N.
    u, rising, falling = v / float(np.abs(v).max()), v > 0.0, v < 0.0
    columns = np.stack(
        [np.ones_like(x), x / float(np.ptp(x)), np.sign(v), u * rising, u * falling,
         u * u * rising, u * u * falling]
    )  # fmt: skip
    # The products of the columns have the square of their condition; what that costs in digits, a
    # second step on what is left gives back. On the columns themselves it takes far longer. Columns
    # may be made up by others: a pseudo-inverse.
    sizes, ways = np.linalg.eigh(columns @ columns.T)
    is_there = np.abs(sizes) > _MADE_UP * np.abs(sizes).max()
    inverse = (ways[:, is_there] / sizes[is_there]) @ ways[:, is_there].T
    solution = inverse @ (columns @ f)
    solution += inverse @ (columns @ (f - solution @ columns))
    constant, rebound, bump = float(solution[0]), float(solution[5]), -float(solution[6])
    # Force and displacement at the ends of rebound and of bump.
    before, part, is_out = reversals(v)
    (force_out, force_in), (x_out, x_in) = (
        [mean_of(at[is_end]) for is_end in (is_out, ~is_out)]
        for at in (y[before] + part * (y[before + 1] - y[before]) for y in (f, x))
    )
    hysteresis = 0.5 * abs(force_out - force_in)
    curved = mean_of(gas_force(gas, np.array([x_out, x_in]))) + gas.force
    at_reversals = float(np.mean([force_out, force_in])) - curved
    sizes = np.array([segment.n_samples for segment in trace.segments], dtype=np.float64)
    rates = np.array([segment.frequency for segment in trace.segments])
    frequency = float(sizes @ rates / np.sum(sizes))
    # What a filter that passes few harmonics may take.
    lost = _OF_HARMONICS * max(frequency / corner - 1.0 / _ENOUGH_HARMONICS, 0.0)
    share = held_share(trace)
    # What turns faster than the filter shows is friction and preloads.
    turn = min(2.0 * math.pi * frequency * max(_TURN / corner, trace.interval), _WIDEST_TURN)
    fast = (turn * min(float(v.max()), -float(v.min())),)
    out, into = in_both_strokes(v, f[None], fast)[1][:, :, 0, 0]
    jump = 0.5 * abs(float(np.mean(out) - np.mean(into)))
    preloads = _OF_PRELOADS * max(jump - _OF_FRICTION * half_range, 0.0)
    return ForceLevel(
        branches=constant,
        reversals=at_reversals,
        uncertainty=0.5 * abs(constant - at_reversals)
        + _OF_HYSTERESIS * hysteresis
        + _OF_GAS * gas.inside,
        expected=-gas.force,
        rebound_curvature=rebound / half_range,
        bump_curvature=bump / half_range,
        hidden=_OF_DIGRESSION * 0.5 * (max(-rebound, 0.0) + max(-bump, 0.0)) + lost * half_range,
        preloads=preloads if math.isfinite(jump) else 0.0,
        held=share * half_range if share >= YIELDS else 0.0,
    )


def reversals(v: FloatArray) -> tuple[IntArray, FloatArray, BoolArray]:
    """Return the samples before reversals, the part of a sample behind, and which end a rebound."""
    is_out = v > 0.0  # a sample at rest, v = 0, belongs to what follows a rebound
    before = np.flatnonzero(is_out[:-1] != is_out[1:])
    return before, v[before] / (v[before] - v[before + 1]), is_out[before]


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
# reversed ones 110 are put right after 246.
_OF_HIDDEN = 2.0
_TARED = 0.25  # below this share of the gas force there is none to be seen
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
_AS_REVERSED = "as if both channels were positive in compression"
_KEPT = "the declared signs are kept; check them again"
_ASK = (
    "declare rig.reverse_displacement and rig.reverse_force: true where the log counts compression "
    "(rod in) as positive, else false"
)


class Signs(NamedTuple):
    """What must be reversed, and what is to be reported."""

    reversed_channels: tuple[str, ...] = ()
    findings: tuple[Problem, ...] = ()
    is_certain: bool = False  # the gas force shows them, in this log and so in others of the rig


class _Rest(NamedTuple):
    """The force where the log rests, and its sign (0: not clear)."""

    sign: int
    sentence: str  # the force beside the gas force, for people
    agrees: bool  # with the gas of [damper], and is more than what seals may hold


def rest_of(
    log: UniformLog, trace: Trace, recording: Recording, gas: GasFacts | None
) -> _Rest | None:
    """Return the force where a log rests; None where it does not, or the gas is not known."""
    if gas is None:
        return None
    needed = max(_REST_TIME, _REST_PERIODS / trace.frequency) / log.interval
    dwells = dwells_of(log.displacement, log.interval)
    dwells = [(part, x) for part, x in dwells if part.stop - part.start >= needed]
    if not dwells:
        return None
    force = median(
        [median(log.force[(part.start + part.stop) // 2 : part.stop]) for part, _ in dwells]
    )
    centre = -trace.centre if recording.reverse_displacement else trace.centre
    expected = median(gas_force(gas, np.array([x for _, x in dwells]) - centre))
    friction = _REST_FRICTION * 0.5 * float(np.ptp(trace.force[trace.compared]))
    ratio = force / expected if expected else 0.0
    is_clear = 0.5 < abs(ratio) < _REST_LIMIT and abs(force) > 2.0 * friction
    text = (
        f"at rest the force is {force - friction:.0f} to {force + friction:.0f} N; the gas of "
        f"[damper] alone gives {expected:.0f} N"
    )
    agrees = 0.5 < ratio < _REST_LIMIT and abs(force) > friction
    return _Rest(int(math.copysign(1.0, ratio)) if is_clear else 0, text, agrees)


def find_signs(  # noqa: PLR0911 - one return a case, in the order of the text above
    trace: Trace, recording: Recording, level: ForceLevel | None, rest: _Rest | None
) -> Signs:
    """Return which channels of a log must be reversed; its trace is that of the log as logged."""
    power = trace.force[trace.compared] * trace.velocity[trace.compared]
    share = mean_of(power) / max(mean_of(np.abs(power)), 1e-300)
    joules = mean_of(power) / trace.frequency
    free = [name for name in _CHANNELS if getattr(recording, f"reverse_{name}") is None]
    at_rest = rest.sign if rest is not None else 0
    if abs(share) < _CLEAR_ENERGY:
        text = (
            f"the loop absorbs hardly any energy ({100.0 * share:.0f} % of its throughput): the "
            "signs of the channels cannot be determined, and this can hardly be a damper; check "
            "columns and skew"
        )
        return Signs(findings=(warning("force_polarity", text, value=share),))
    if share > 0.0:
        is_free = len(free) == len(_CHANNELS)
        if rest is not None and at_rest < 0 and (is_free or not _is_tared(level)):
            text = f"{rest.sentence}, {_AS_REVERSED}; {_KEPT}"
            kept = Signs(findings=(warning(CONTRADICTED, text, value=-1.0),))
            why = f"{rest.sentence}, and the loop absorbs energy"
            return _reversed(_CHANNELS, why) if is_free else kept
        # A rest beside the gas force counts more than the ends of strokes, where valves hold force.
        if at_rest > 0 or level is None or level.ratio > _TARED or (rest and rest.agrees):
            # Unlike preloads rather hide a gas force that is there with its sign.
            is_there = level is not None and (
                _CERTAIN[0] < level.ratio < _CERTAIN[1] and abs(level.force) > level.doubt
            )
            return Signs(is_certain=bool(at_rest > 0 or is_there))
        is_turned = _is_certain(level, _CHANNELS)
        if is_free and is_turned:
            return _reversed(_CHANNELS, f"{level.sentence}, and the loop absorbs energy")
        if is_free or is_turned:
            return _doubtful(level, is_declared=not is_free)
        return Signs()  # a cell zeroed before mounting shows any level
    gives = f"the loop gives {-joules:.3g} J a cycle as logged"
    if len(free) == 1:
        return _reversed(free, f"{gives}, and the sign of the other channel is declared")
    doubt = ""
    if not free:
        doubt = "; both signs are declared, and one of them wrongly"
    elif rest is not None and at_rest:
        wrong = "force" if at_rest < 0 else "displacement"
        return _reversed((wrong,), f"{gives}, and {rest.sentence}")
    elif level is not None:
        for channel in _CHANNELS:
            if _is_certain(level, (channel,)):
                return _reversed((channel,), f"{gives}, and {level.sentence}")
        doubt = f"; {level.sentence}: that does not show which of the two"
    raise ConditioningError(
        f"the damper delivers {-joules:.3g} J per cycle instead of absorbing energy: "
        f"force or displacement is reversed{doubt}; {_ASK}",
        code=UNKNOWN,
        subject=trace.name,
    )


def _is_certain(level: ForceLevel, reversed_channels: tuple[str, ...]) -> bool:
    """Whether the log is a gas damper's with these channels reversed, beyond doubt."""
    rebound, bump, sign = level.rebound_curvature, level.bump_curvature, 1.0
    if "displacement" in reversed_channels:
        rebound, bump = -bump, -rebound
    if "force" in reversed_channels:
        rebound, bump, sign = -rebound, -bump, -1.0
    # Of one reversed channel alone the strokes are not as they seem, nor is what they hide.
    hidden = _OF_HIDDEN * level.hidden if len(reversed_channels) == len(_CHANNELS) else 0.0
    return (
        _CERTAIN[0] < sign * level.ratio < _CERTAIN[1]
        and abs(level.force) > 2.0 * (level.uncertainty + level.held + hidden)
        and rebound + bump > _LEAST_CURVATURE
        and rebound > bump
    )


def _reversed(channels: tuple[str, ...] | list[str], reason: str) -> Signs:
    findings = tuple(
        note(
            f"{channel}_polarity",
            f"{channel}: found positive in compression and reversed: {reason}; "
            f"rig.reverse_{channel} = true confirms this, false keeps it as logged",
            value=-1.0,
            is_correction=True,
        )
        for channel in channels
    )
    return Signs(tuple(channels), findings, is_certain=True)


def _doubtful(level: ForceLevel, *, is_declared: bool) -> Signs:
    """Return the signs as they are, with a warning; of declared ones the opposite is certain."""
    name, sees = "direction", "so no gas force distinguishes rebound from compression"
    if level.ratio <= -_TARED and abs(level.force) > level.uncertainty + level.held:
        sees = f"{_AS_REVERSED}, but that is not certain"
        is_beyond_tare = -level.expected >= LEAST_GAS and not _is_tared(level)
        if is_beyond_tare and abs(level.force) > _OF_DOUBT * level.doubt:
            name = CONTRADICTED
    advice = _KEPT if is_declared else ""
    text = f"{level.sentence}, {sees}; {advice or f'taken as logged; {_ASK}'}"
    return Signs(findings=(warning(name, text, value=level.ratio),))


def _is_tared(level: ForceLevel | None) -> bool:
    """Whether a tare explains the level: progressive valves, as these do, curve more in rebound."""
    return level is not None and level.rebound_curvature > max(level.bump_curvature, 0.0)


def reversed_in(recording: Recording, trace: Trace) -> list[str]:
    """Return the channels of a log that count bump positive, as declared or as found."""
    corrected = {x.code for x in trace.findings if x.values.get("is_correction")}
    return [
        name
        for name in _CHANNELS
        if getattr(recording, f"reverse_{name}") or f"{name}_polarity" in corrected
    ]


# A level this near to what the gas gives is no news: other gas and oil move it as much.
_NEAR = 0.15
_KNOWN = 0.35  # uncertainty over the gas force above which nothing is said of a tare


def level_of(trace: Trace, options: ConditionOptions) -> ForceLevel | None:
    """Return the level of the force at no speed; None where nothing is known of the gas."""
    if options.gas is None:
        return None
    return force_level(trace, options.gas, corner=options.passed_corner)


def describe_level(level: ForceLevel | None, options: ConditionOptions) -> tuple[Problem, ...]:
    """Return whether the gas force is in the log, was tared away, or is another one."""
    if level is None:
        return ()
    missing, size, offset = level.force - level.expected, -level.expected, options.offset
    unsure = level.uncertainty + max(level.hidden, level.preloads)
    numbers = level.between(unsure)
    severity = "note"
    values: dict[str, Any] = {}
    if unsure > _KNOWN * size:
        text = f"the log does not show whether the force was tared: {numbers}"
    elif abs(missing) <= _NEAR * size + unsure:
        text = f"gas force present: {numbers}"
    else:
        severity = "note" if offset.is_known else "warning"
        values = {"free": "", "hold": ""}
        if offset.name:  # the options that free the offset and hold it, each in brackets
            every = ",".join((*offset.beside, offset.name))
            values["free"] = Option("free", every, is_aside=True)
            values["hold"] = Option("fix", f"{size:.0f}N", offset.name, is_aside=True)
        if abs(level.ratio) >= _TARED:
            is_part = 0.0 < missing < size
            what = "part of the gas force is missing" if is_part else "not the gas force"
            text = (
                f"{what}: {numbers}; a tare, another gas pressure, cavitation or much elasticity: "
                "check damper.gas_pressure, or free the offset{free}"
            )
        elif offset.is_known:
            text = f"gas force tared away: {numbers}; {offset.name} accounts for it"
        else:
            text = (
                f"gas force tared away: {numbers}; free the offset{{free}} or hold it{{hold}}, or "
                "the other parameters absorb it"
            )
    return (Problem("tare", text, severity, values={"value": missing, "unit": "N", **values}),)
