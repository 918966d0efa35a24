"""What the residuals say that the MSE does not: noise or missing physics, and which.

The residual is laid over itself cycle by cycle. What differs between cycles is noise (of both
channels); what repeats is lack of fit. With C cycles of scatter s^2 the mean residual of pure noise
has the power s^2/C, which is taken off::

    repeating = mean over phases of (mean residual)^2 - s^2/C

What the model may lack are flaws. The signature of a flaw is the force that one unit of it would
add, behind the filter and with everything the fit could absorb projected out. The share of the
repeating misfit that one signature explains is what a refit with that flaw in the model would gain.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from damperfit.arrays import FloatArray
from damperfit.conditioning.filters import apply_filter
from damperfit.conditioning.polarity import YIELDS, held_shares
from damperfit.identification.fit_setting import EXCELLENT, Fit
from damperfit.identification.outcome import Status
from damperfit.identification.sharing import listed_settings
from damperfit.problem import Problem, warning
from damperfit.recording import Segment, Trace
from damperfit.statistics import (
    fisher_chance,
    independent_share,
    mean_of,
    median,
    student_quantile,
    variance_of,
)
from damperfit.tested.setting import Setting
from damperfit.uncertainty.covariance import Linearisation

# Flaws

# Speeds over which seal friction falls from its breakaway level, m/s.
_STRIBECK_SPEEDS = (0.01, 0.03, 0.1)
# A signature that explains less of the repeating misfit than this names nothing.
_NAMED = 0.5
# Signatures within this factor of the best are as likely: an offset of the force explains
# nearly all of a wrong gas pressure, and that all of an offset.
_TIE = 0.85


class _Flaw(NamedTuple):
    """A flaw, its unit, and its words."""

    family: str
    unit: float
    text: str
    ways: tuple[str, str] = ("more", "less")
    # Beyond which no rig has it, whatever it explains: a law that the model lacks. None: half the
    # range of the force.
    largest: float | None = None

    def words(self, amount: float) -> str:
        """Say how large it is, in two digits."""
        return self.text.format(size=rounded(amount), way=self.ways[not amount > 0.0])


def rounded(amount: float) -> str:
    """Two digits, without sign or exponent: 750, not 7.5e+02."""
    return f"{float(f'{abs(amount):.2g}'):.12g}"


FLAWS: Mapping[str, _Flaw] = {
    "delay": _Flaw(
        "reversals", 1e3, "a channel delay (the force is {size} ms {way} against the displacement)",
        ("late", "early"), largest=25.0,  # ms; force channels are 8 to 14 ms late at worst
    ),
    "gas_pressure": _Flaw(
        "position", 100.0, "a wrong gas pressure ({size} % {way} than configured)",
        largest=100.0,  # %; at -100 % there is no gas
    ),
    "gas_exponent": _Flaw(
        "position", 100.0, "a wrong gas exponent (by {size} %)",
        largest=50.0,  # %; from 1.0 to 1.67 is all there is
    ),
    "gas_volume": _Flaw("position", 1.0, "a wrong gas or rod volume ({size} N at full stroke)"),
    "offset": _Flaw("position", 1.0, "a force offset that is not in the model ({size} N)"),
    "friction_with_speed": _Flaw(
        "the sign of v", 1.0, "friction that depends on velocity ({size} N {way} at low speed)"
    ),
    "friction_with_position": _Flaw(
        "the sign of v", 1.0, "friction that changes along the stroke ({size} N {way} at its ends)"
    ),
    "friction_with_pressure": _Flaw(
        "the sign of v", 1e6, "friction that grows with the pressure (by {size} mm2 of a seal)",
        largest=150.0,  # mm2; a ring of 2 mm in a bore of 40 mm with a friction of 0.5 has 125
    ),
    "compressibility": _Flaw(
        "reversals", 100.0,
        "a bulk modulus that changes with pressure (by {size} % at the peak force)",
        largest=300.0,  # %; oil with gas in it stiffens by its pressure
    ),
    "load_cell": _Flaw(
        "the force", 100.0, "a load cell that is not linear ({size} % at the peak force)",
        largest=10.0,  # %; a cell that anyone uses is linear to 1 %
    ),
    "force_gain": _Flaw(
        "the force", 100.0,
        "a force channel whose gain is {size} % too {way} in this log beside the others",
        ("high", "low"), largest=50.0,  # %
    ),
    "valve_law_rebound": _Flaw("v squared", 1.0, "the rebound valve ({size} N at peak)"),
    "valve_law_bump": _Flaw("v squared", 1.0, "the compression valve ({size} N at peak)"),
}  # fmt: skip
# Large enough, or turned round, these two look like most that a valve or a sharp turn leaves.
_OF_ANY = frozenset({"load_cell", "friction_with_pressure"})
# A gas spring of another stiffness is so many times as stiff as declared; beyond it is none.
STIFFEST, _SOFTEST = 5.0, 0.2
_LARGEST_OF_HELD = 1000.0  # %; ten times what it is held at
# None of these is the cause where a damper yields before it slides: all of them shape the reversal.
_OF_VALVES = frozenset(
    {"delay", "gas_pressure", "gas_exponent", "gas_volume", "gas_stiffness", "compressibility"}
    | {"valve_law_rebound", "valve_law_bump"}
)


@dataclass(frozen=True, slots=True)
class Hint:
    """One flaw that would leave such residuals."""

    name: str  # short: delay, gas_pressure, ...
    family: str  # what the misfit is locked to: position, sign of v, reversals or v squared
    share: float  # of the repeating misfit that it explains, 0 to 1
    amount: float  # in its own unit (ms, per cent or N), as a refit would find it to first order
    words: str  # for people


def signatures(
    trace: Trace,
    force: FloatArray,
    stiff: Sequence[FloatArray] = (),
    pressures: NDArray[np.floating[Any]] | None = None,
) -> dict[str, list[FloatArray]]:
    """Return the force that one unit of each flaw adds, behind the filter, where it is compared.

    `force`, (n,), modelled or measured, N; `stiff`, (n,) each, its derivatives by ln of
    stiffnesses; `pressures`, (2 or more, samples of the trace), of the chambers, Pa. Units are
    those of the SI, of what a stiffness changes by the whole at the peak force.
    """
    x, v = trace.displacement, trace.velocity
    turned = np.tanh(v / 1e-3)

    def passed(values: FloatArray) -> FloatArray:
        return apply_filter(trace.model_filter, values)[trace.compared]

    # Segment by segment: where one ends and the next begins nothing was logged in between.
    rate = np.concatenate([np.gradient(force[place], trace.interval) for place in trace.places])
    pressure = np.abs(force - force.mean())
    share = pressure / max(float(pressure.max()), 1e-300)
    columns = {
        "delay": [-rate],
        "gas_volume": [passed(x)],
        "offset": [np.ones(len(force))],
        "load_cell": [force * np.abs(force), force**2],
        "friction_with_speed": _at_low_speed(trace),
        "friction_with_position": [passed(turned * np.abs(x))],
        "valve_law_rebound": [passed(np.maximum(v, 0.0) ** 2)],
        "valve_law_bump": [passed(np.minimum(v, 0.0) ** 2)],
    }
    if stiff:
        columns["compressibility"] = [column * share for column in stiff]
    if pressures is not None:  # on the seal of the piston, of the rod, or of a floating piston
        first, second = pressures[:2]
        on_seals = np.abs(first - second), first, second
        columns["friction_with_pressure"] = [passed(turned * pressing) for pressing in on_seals]
    return columns


def _at_low_speed(trace: Trace) -> list[FloatArray]:
    """Friction of 1 N at rest that falls over each of `_STRIBECK_SPEEDS`."""
    v = trace.velocity
    falling = (np.tanh(v / 1e-3) * np.exp(-np.abs(v) / speed) for speed in _STRIBECK_SPEEDS)
    return [apply_filter(trace.model_filter, column)[trace.compared] for column in falling]


def gain(column: FloatArray, absorbed: FloatArray, residuals: FloatArray) -> tuple[float, float]:
    """Return by how much a signature, (n,), lowers the sum of squares, and its amount."""
    left = column - absorbed @ (absorbed.T @ column)  # an orthonormal basis of what fits absorb
    power = float(left @ left)
    if power <= 1e-12 * float(column @ column):
        return 0.0, 0.0  # the fit absorbs it whole
    amount = float(left @ residuals) / power
    return amount * amount * power, amount


def seek_flaws(
    linearised: Linearisation,
    repeats: float,
    *,
    doubted: tuple[str, ...] = (),
    has_yielded: bool = False,
) -> tuple[tuple[Hint, ...], dict[str, FloatArray]]:
    """Return the flaws that explain what repeats (mean square, N^2), best first, and their pulls.

    A pull, (k,), is what the flaw adds to the summed scores. Flaws that cannot be separated
    from the best stand beside it; none where the best explains less than half. `doubted` are shared
    parameters of which one value for all settings is known not to hold; where a damper yields
    before it slides, and the model does not, nothing of valves, oil or gas is named.
    """
    fit, quantities = linearised.fit, linearised.fit.parameters.quantities
    # Beside a jump of the speed nothing counts.
    counts, residuals, force = linearised.counts, linearised.residuals, linearised.force
    doubted = tuple(name for name in doubted if fit.status[name] == Status.SHARED)
    alone: set[str] = {Status.FITTED, Status.NOT_IDENTIFIABLE}
    absorbed = _absorbed(linearised, {*alone, Status.SHARED})
    # Values that the other settings hold back absorb nothing of what one setting lacks.
    is_tied = any(status == Status.SHARED for status in fit.status.values())
    own = _absorbed(linearised, alone) if doubted or is_tied else absorbed
    columns = _columns(linearised)
    if is_tied or fit.mse_percent < EXCELLENT:  # a wrong law alone looks like a gain
        columns["force_gain"] = [force]
    # Parameters that nothing in the logs has set may be held at a wrong value, but for an offset,
    # which is among the flaws already. Of a law that does not fit none can be said to be the cause.
    fixed = [q for q in quantities if fit.status[q.name] == Status.FIXED and not q.is_offset]
    held = [q.name for q in fixed if fit.mse_percent < EXCELLENT and q.name not in columns]
    for name in (*held, *doubted):
        columns[name] = [linearised.jacobian[:, linearised.names.index(name)]]
    pairs, sizes = [], _sizes(linearised)
    for name, candidates in columns.items():
        basis = own if name in {*doubted, "force_gain"} else absorbed
        gains = [gain(column * counts, basis, residuals) for column in candidates]
        best = max(range(len(gains)), key=gains.__getitem__)
        share, amount = gains[best]
        flaw = FLAWS.get(name)
        if flaw is None:
            is_shared = name in doubted
            how = "is shared by all settings and here" if is_shared else "held at a wrong value,"
            family = "a shared parameter" if is_shared else "a held parameter"
            flaw = _Flaw(family, 100.0, f"{name} {how} too {{way}}", ("low", "high"))
        size = amount * flaw.unit * sizes.get(name, 1.0)
        explained = min(share / (repeats * len(counts)), 1.0)
        hint = Hint(name, flaw.family, explained, size, flaw.words(size))
        if name in _OF_ANY and not _is_reasonable(hint, math.inf):
            continue
        pairs.append((hint, None if name in doubted else amount * candidates[best]))
    pairs.sort(key=lambda pair: -pair[0].share)
    # Nearly all that is wrong looks a little like a gain to what the settings share: it is named
    # where nothing else is near, but for what all settings have in common, which the others then
    # show too (`reconciled`). A setting by itself takes all of a gain but that of its gas.
    is_gain = bool(pairs) and pairs[0][0].name == "force_gain"
    beside = {"force_gain", *_IN_COMMON} if is_gain else {"force_gain"}
    rivals = [pair for pair in pairs if pair[0].name not in beside]
    if is_tied and rivals and rivals[0][0].share > _TIE * pairs[0][0].share:
        pairs = [pair for pair in pairs if pair[0].name != "force_gain"]
    if not pairs or pairs[0][0].share < _NAMED:
        return (), {}
    pairs[0] = (_as_stiffness(pairs[0][0]), pairs[0][1])
    half_range, friction = 0.5 * float(np.ptp(force)), _friction(linearised)
    unlikely = _OF_VALVES if has_yielded else frozenset()
    # What stands far behind a best one that is beyond reason leaves most of the misfit unexplained.
    bar = max(_TIE * pairs[0][0].share, _NAMED)
    likely = {
        hint: column
        for hint, column in pairs
        if hint.share >= bar
        and hint.name not in unlikely
        and _is_reasonable(hint, half_range, friction)
    }
    # Less than none: the friction at speed is larger than the fitted one.
    words = "friction that depends on velocity (less at low speed)"
    hints = tuple(
        replace(hint, words=words)
        if hint.name == "friction_with_speed" and hint.amount < -friction
        else hint
        for hint in likely
    )
    pulls = {hint.name: linearised.pull(x) for hint, x in likely.items() if x is not None}
    return hints, pulls


def _columns(linearised: Linearisation) -> dict[str, list[FloatArray]]:
    """Force that one unit of each flaw adds, behind the filter, over the samples of all logs."""
    quantities, tables = linearised.fit.parameters.quantities, []
    for log, seen in zip(linearised.fit.logs, linearised.logs, strict=True):
        slopes = zip(quantities, seen.jacobian.T, strict=True)
        stiff = [column for quantity, column in slopes if quantity.is_open]
        rows_by_flaw = signatures(log.trace, seen.force, stiff, seen.pressures)
        table = {name: rows for name, rows in rows_by_flaw.items() if name in linearised.flaws}
        conditions = zip(linearised.conditions, seen.gas.T, strict=False)
        tables.append(table | {name: [column] for name, column in conditions})
    return {
        name: [np.concatenate(parts) for parts in zip(*(of[name] for of in tables), strict=True)]
        for name in tables[0]
    }


def _sizes(linearised: Linearisation) -> dict[str, float]:
    """What amounts refer to: the full stroke, the peak speed and the peak force."""
    traces, stroke = [log.trace for log in linearised.fit.logs], full_stroke(linearised.fit)
    speed = max(float(np.abs(trace.velocity[trace.compared]).max()) for trace in traces)
    return {
        "gas_volume": stroke,
        "friction_with_position": stroke,
        "valve_law_rebound": speed**2,
        "valve_law_bump": speed**2,
        "load_cell": float(np.abs(linearised.force).max()),
    }


def full_stroke(fit: Fit) -> float:
    """Return the largest displacement from the middle that is compared in the logs, m."""
    traces = (log.trace for log in fit.logs)
    return max(float(np.abs(trace.displacement[trace.compared]).max()) for trace in traces)


def _friction(linearised: Linearisation) -> float:
    """Friction that was found, N; without an end where the model has none to compare with."""
    values = linearised.fit.parameters
    frictions = [float(getattr(values, q.name)) for q in values.quantities if q.is_friction]
    return sum(frictions) if frictions else math.inf


def _absorbed(linearised: Linearisation, statuses: set[str]) -> FloatArray:
    """Orthonormal basis of what parameters of these statuses could absorb where samples count."""
    status = linearised.fit.status
    places = [j for j, name in enumerate(linearised.names) if status[name] in statuses]
    whole = linearised.jacobian[:, places] * linearised.counts[:, None]
    lengths = np.sqrt(np.sum(whole * whole, axis=0))
    return np.asarray(np.linalg.qr(whole[:, lengths > 0.0] / lengths[lengths > 0.0])[0])


def _as_stiffness(hint: Hint) -> Hint:
    """An exponent that no gas has as what it stands for: another stiffness of the gas."""
    # To first order the gas's force at the ends of the stroke goes with gamma a_r^2 P_0/V_g0.
    times = 1.0 + hint.amount / 100.0
    is_stiffness = not _is_reasonable(hint, math.inf) and _SOFTEST <= times <= STIFFEST
    if hint.name != "gas_exponent" or not is_stiffness:
        return hint
    words = f"a gas spring about {rounded(times)} times as stiff as declared (gas volume, gas "
    return replace(hint, name="gas_stiffness", words=f"{words}pressure, rod diameter)")


def _is_reasonable(hint: Hint, half_range: float, friction: float = math.inf) -> bool:
    """Whether a rig or damper can be wrong by so much; half the force's range and friction in N."""
    if hint.name == "friction_with_position":
        return -friction < hint.amount <= half_range
    if hint.name == "friction_with_pressure" and hint.amount < 0.0:
        return False  # no seal has less
    flaw = FLAWS.get(hint.name)
    largest = _LARGEST_OF_HELD if flaw is None else flaw.largest or half_range
    return hint.name == "gas_stiffness" or abs(hint.amount) <= largest


# Friction that is larger at low speed is one for all settings, and shows in all of them before it
# shows in one. Its sum has the scatter of the scores between the cycles, or between blocks where
# nothing repeats; the settings together make it sure. A scatter of few cycles is itself not known.

_CHANCE = 1e-5  # of such a friction where there is none, at each of three speeds
# Of the friction: less moves no parameter by 1 %, more is no friction.
_LEAST, _MOST = 0.02, 2.0
_BLOCKS = 16  # of a segment in which nothing repeats


class BySpeed(NamedTuple):
    """Friction that depends on velocity at one setting: by each of `_STRIBECK_SPEEDS`."""

    sums: FloatArray  # of the scores, over the mean square of the residuals, 1/N
    powers: FloatArray  # that one newton adds to the sums
    variances: FloatArray  # of the sums
    freedom: int  # degrees of freedom of the variances
    pulls: FloatArray  # (speeds, k), what one newton adds to the summed scores
    fitted: float  # the friction that was found, N


def friction_by_speed(linearised: Linearisation) -> BySpeed | None:
    """Return what a setting says of friction that depends on velocity; None where it has none."""
    fit, counts, residuals = linearised.fit, linearised.counts, linearised.residuals
    sought = {Status.FITTED, Status.SHARED}
    frictions = [quantity.name for quantity in fit.parameters.quantities if quantity.is_friction]
    if not any(fit.status[name] in sought for name in frictions):
        return None
    basis = _absorbed(linearised, {*sought, Status.NOT_IDENTIFIABLE})
    columns = np.concatenate([np.stack(_at_low_speed(log.trace)) for log in fit.logs], axis=1)
    left = columns * counts
    left -= (left @ basis) @ basis.T
    power = np.sum(left * left, axis=1)
    if not np.all(power > 1e-9 * np.sum(columns * columns, axis=1)):
        return None
    edges, first = [], 0
    for segment in (segment for log in fit.logs for segment in log.trace.segments):
        ends = np.linspace(0.0, segment.n_samples, _BLOCKS + 1)[:-1]
        if segment.n_cycles > 2:
            ends = segment.cycle_starts[:-1] - segment.first
        edges.append(first + np.maximum(np.rint(ends), 0.0).astype(np.int64))
        first += segment.n_samples
    scores = np.add.reduceat(left * residuals, np.concatenate(edges), axis=1)
    noise = float(residuals @ residuals) / float(counts.sum())
    n = scores.shape[1]
    return BySpeed(
        sums=scores.sum(axis=1) / noise,
        powers=power / noise,
        variances=n * np.var(scores, axis=1, ddof=1) / noise**2,
        freedom=n - 1,
        pulls=linearised.pull(columns.T).T,
        fitted=_friction(linearised),
    )


def hidden_friction(each: Sequence[BySpeed]) -> tuple[int, float]:
    """Return place of the speed, and newtons, of what all settings show together; or 0 N."""
    if not each:
        return 0, 0.0
    variances = np.array([setting.variances for setting in each])
    whole, total = variances.sum(axis=0), np.sum([setting.sums for setting in each], axis=0)
    sureness = total / np.sqrt(np.maximum(whole, 1e-300))
    best = int(np.argmax(np.abs(sureness)))
    amount = float(total[best] / sum(setting.powers[best] for setting in each))
    # Degrees of freedom of a sum of variances: Satterthwaite, Biometrics Bulletin 2 (1946).
    shares = variances[:, best] / max(whole[best], 1e-300)
    freedom = 1.0 / max(float(np.sum(shares**2 / [setting.freedom for setting in each])), 1e-300)
    least = student_quantile(freedom, 1.0 - 0.5 * _CHANCE)
    fitted = each[0].fitted
    is_sure = abs(sureness[best]) > least and _LEAST * fitted < abs(amount) < _MOST * fitted
    return best, amount if is_sure else 0.0


# The repeating power of pure noise over its scatter is F-distributed; beyond the bar once in as
# many settings.
_CHANCE_RESIDUALS = 1e-6
# Misfit over noise where nothing repeats: noise of the displacement may double it.
_MUCH = 4.0
# Below this share of the force's variance, 0.1 N of 300 N, the integrator's error repeats too.
_NEGLIGIBLE = 1e-7
# Noise of the displacement is looked at first where noise makes this much of the misfit.
_NOISE_COUNTS = 1.0 / 3.0
# Delay and skew of a log that differ by less, ms, or by less than half, are one.
_SKEW_AGREES = 1.0
# What all settings have in common: the rig's timing and the damper's gas. Amounts within so much
# of the middle one stand where they are so many times as frequent as others.
_IN_COMMON = ("delay", "gas_pressure", "gas_exponent", "gas_volume")
_MOST_RESIDUALS, _UNLIKE = 3, 2.0
# Warnings on a log that leave a misfit in every cycle, in the order to look at them: no tare can be
# reported before the signs are right.
_FAULTS_OF_LOGS = (
    "direction",
    "clipping",
    "stuck",
    "skew",
    "steps",
    "displacement_noise",
    "tare",
    "velocity_channel",
    "rig_filter",
    "force_smoothed",
)


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """What the residuals of one setting say."""

    setting: Setting
    mse_percent: float  # eq. (22)
    noise_percent: float  # the part that differs from cycle to cycle; NaN for a single cycle
    is_structured: bool  # whether more of the residual repeats with the cycle than noise explains
    # What may be missing, best first; empty where nothing repeats or nothing explains it.
    hints: tuple[Hint, ...]
    sentence: str
    # Share of the force's range left at a tenth of the speed while slowing down; NaN where no log
    # shows it. A damper that yields before it slides holds `YIELDS` or more.
    held_share: float = math.nan
    modelled_share: float = math.nan  # the same of the model's force

    @property
    def repeating_percent(self) -> float:
        """The part of the MSE that repeats with the cycle; NaN for a single cycle."""
        return max(self.mse_percent - self.noise_percent, 0.0)

    @property
    def has_yielded(self) -> bool:
        """Whether the damper yields before it slides."""
        return self.held_share >= YIELDS

    @property
    def is_met(self) -> bool:
        """Whether the model meets the logs as well as the paper calls excellent."""
        return self.mse_percent < EXCELLENT


def diagnose(
    linearised: Linearisation, *, doubted: tuple[str, ...] = ()
) -> tuple[Diagnosis, dict[str, FloatArray]]:
    """Return what the residuals of a setting say, and the pulls of the hints; no simulation.

    Doubted are shared parameters of which one value for all settings is known not to hold.
    """
    fit, parts = linearised.fit, []
    for log, seen in zip(fit.logs, linearised.logs, strict=True):
        for segment, place in zip(log.trace.segments, log.trace.places, strict=True):
            rest = np.where(seen.weights[place] > 0.0, seen.residuals[place], 0.0)
            folded = _fold(rest, segment) if segment.n_cycles > 1 else np.empty((0, 0))
            about = folded - folded.mean(axis=0) if folded.size else folded
            parts.append(SegmentResiduals(segment, log.trace.interval, rest, folded, about))
    repeats, noise, is_more = split_power(parts)
    forces = [log.trace.force[log.trace.compared] for log in fit.logs]
    variance = variance_of(forces[0] if len(forces) == 1 else np.concatenate(forces))
    is_structured = bool(repeats > _NEGLIGIBLE * variance and is_more())
    shares = [
        held_shares(log.trace, np.stack([measured, seen.force]))
        for log, measured, seen in zip(fit.logs, forces, linearised.logs, strict=True)
    ]
    known = [[share for share in of if math.isfinite(share)] for of in zip(*shares, strict=True)]
    share, modelled = (median(of) if of else math.nan for of in known)
    hints: tuple[Hint, ...] = ()
    pulls: dict[str, FloatArray] = {}
    if is_structured:
        is_missed = share >= YIELDS and _misses_yield(share, modelled)
        hints, pulls = seek_flaws(linearised, repeats, doubted=doubted, has_yielded=is_missed)
    findings = [finding for log in fit.logs for finding in log.trace.findings]
    skews = [
        0.0 if finding.values.get("is_correction") else 1e3 * finding.values["value"]
        for finding in findings
        if finding.code == "skew" and finding.values.get("value") is not None
    ]

    def is_contradicted(hint: Hint) -> bool:
        """Whether it is a delay that the logs' own skew contradicts."""
        allowed = max(_SKEW_AGREES, 0.5 * abs(hint.amount))
        return hint.name == "delay" and any(abs(hint.amount - skew) > allowed for skew in skews)

    hints = tuple(hint for hint in hints if not is_contradicted(hint))
    diagnosis = Diagnosis(
        setting=fit.setting,
        mse_percent=fit.mse_percent,
        noise_percent=float(min(100.0 * noise / variance, fit.mse_percent)),
        is_structured=is_structured,
        hints=hints,
        sentence="",
        held_share=share,
        modelled_share=modelled,
    )
    diagnosis = replace(diagnosis, sentence=_sentence(diagnosis) + _warned(linearised, diagnosis))
    return diagnosis, {hint.name: pulls[hint.name] for hint in hints if hint.name in pulls}


# The residuals of each segment, and their power


class SegmentResiduals(NamedTuple):
    """The residuals of one segment, 0 where none counts; of two cycles or more laid over."""

    segment: Segment
    interval: float  # of the samples, s
    residuals: FloatArray  # (n,), N
    folded: FloatArray = np.empty((0, 0))  # the cycles, (cycles, phases)
    about: FloatArray = np.empty((0, 0))  # what each differs from their mean by


def split_power(parts: Sequence[SegmentResiduals]) -> tuple[float, float, Callable[[], bool]]:
    """Return repeating and scattered mean squares, N^2, and whether noise cannot be all of it."""
    cycles = [part for part in parts if part.folded.size]
    if not cycles and any(part.segment.n_cycles for part in parts):
        return math.nan, math.nan, lambda: False
    n = sum(len(part.residuals) for part in cycles or parts)
    if not cycles:
        # Noise by what was found above the filter's band. That of the displacement is not in it;
        # it makes less than the force's in a usual log.
        noise = sum(len(part.residuals) * part.segment.noise**2 for part in parts) / n
        whole = sum(float(part.residuals @ part.residuals) for part in parts) / n
        return whole - noise, noise, lambda: whole / max(noise, 1e-300) > _MUCH
    repeats = noise = expected = 0.0
    for part in cycles:
        size, (n_cycles, n_phases) = len(part.residuals), part.folded.shape
        scatter = float(np.sum(part.about**2)) / (n_phases * (n_cycles - 1))
        repeats += size * (float(np.mean(part.folded.mean(axis=0) ** 2)) - scatter / n_cycles)
        expected += size * scatter / n_cycles
        noise += size * scatter

    def is_beyond_chance() -> bool:
        worth = [independent_phases(part.about) for part in cycles]
        others = sum(n * (len(part.about) - 1) for n, part in zip(worth, cycles, strict=True))
        ratio = 1.0 + repeats / max(expected, 1e-300)
        return fisher_chance(sum(worth), others, ratio) < _CHANCE_RESIDUALS

    return repeats / n, noise / n, is_beyond_chance


def independent_phases(scatter: FloatArray) -> float:
    """Return how many independent squares the mean square of one cycle's noise is worth.

    From the scatter about the mean cycle, (cycles, phases); uneven it is fewer (Satterthwaite).
    """
    n_cycles, n_phases = scatter.shape
    worth = n_phases * independent_share(np.mean(np.abs(np.fft.fft(scatter)) ** 2, axis=0))
    # A variance from few cycles is itself uneven, by 2/(n - 1).
    uneven = independent_share(np.einsum("ij,ij->j", scatter, scatter))
    return float(max(worth * min(uneven * (1.0 + 2.0 / (n_cycles - 1)), 1.0), 1.0))


def residual_scatter(residuals: FloatArray, segment: Segment) -> float:
    """Return the mean square of what differs from cycle to cycle, N^2; NaN for a single cycle."""
    if segment.n_cycles < 2:
        return math.nan
    return float(np.mean(np.var(_fold(residuals, segment), axis=0, ddof=1)))


def _fold(residuals: FloatArray, segment: Segment) -> FloatArray:
    """Residuals over cycles and phases, shape (cycles, phases)."""
    starts = segment.cycle_starts - segment.first
    lengths = np.diff(starts)
    n_phases = max(8, round(mean_of(lengths)))
    nearest = starts[:-1, None] + lengths[:, None] * (np.arange(n_phases) / n_phases)
    # Beyond an end it is the last sample.
    return residuals.take(np.rint(nearest).astype(np.intp), mode="clip")


# The settings of a run beside each other, and words


def reconciled(diagnoses: Iterable[Diagnosis]) -> tuple[Diagnosis, ...]:
    """Return the diagnoses of a run without causes that contradict each other.

    The rig's delay and the damper's gas are one for all settings: where a few settings want far
    more or less than most, or the opposite, it is not theirs; where settings are divided, it is no
    flaw of any.
    """
    of_run = list(diagnoses)
    for name in (*_IN_COMMON, "force_gain"):
        amounts = [h.amount for d in of_run for h in d.hints if h.name == name]
        low, high = sorted(median(amounts or [0.0]) * times for times in (1.0 / _UNLIKE, _UNLIKE))
        dropped = [amount for amount in amounts if not low <= amount <= high]
        if (_MOST_RESIDUALS + 1) * len(dropped) > len(amounts):
            dropped = amounts
        if name == "force_gain":  # half of the logs have none beside the others
            dropped = amounts if 2 * len(amounts) >= len(of_run) else []
        for place, diagnosis in enumerate(of_run) if dropped else ():
            kept = (h for h in diagnosis.hints if h.name != name or h.amount not in dropped)
            of_run[place] = _with_hints(diagnosis, tuple(kept))
    for place, diagnosis in enumerate(of_run):
        if any(hint.name == "force_gain" for hint in diagnosis.hints):  # of this log, of no other
            hints = tuple(hint for hint in diagnosis.hints if hint.name not in _IN_COMMON)
            of_run[place] = _with_hints(diagnosis, hints)
    return tuple(of_run)


def _with_hints(diagnosis: Diagnosis, hints: tuple[Hint, ...]) -> Diagnosis:
    pointer, left = diagnosis.sentence[len(_sentence(diagnosis)) :], replace(diagnosis, hints=hints)
    return replace(left, sentence=_sentence(left) + pointer)


def _warned(linearised: Linearisation, diagnosis: Diagnosis) -> str:
    """Point to the warnings on these logs that may be the cause."""
    if not diagnosis.is_structured:
        return ""
    # Strokes taken for each other leave the gas force twice: in position.
    is_known = diagnosis.is_met or diagnosis.has_yielded or diagnosis.hints
    may_be = {
        "displacement_noise": diagnosis.noise_percent >= _NOISE_COUNTS * diagnosis.mse_percent,
        "direction": not is_known or any(h.family == "position" for h in diagnosis.hints),
    }
    warnings = [
        (finding.code, log.trace.name)
        for log in linearised.fit.logs
        for finding in log.trace.findings
        if finding.severity == "warning"
    ]
    faults = [
        f"{name} of {log}"
        for fault in _FAULTS_OF_LOGS
        for name, log in warnings
        if name.endswith(fault) and may_be.get(fault, True)
    ]
    more = f" and {len(faults) - 1} more" if len(faults) > 1 else ""
    return f"; see the warning {faults[0]}{more}" if faults else ""


def _misses_yield(held_share: float, modelled_share: float) -> bool:
    return modelled_share < min(YIELDS, 0.9 * held_share)


def _sentence(diagnosis: Diagnosis) -> str:
    text = f"MSE {diagnosis.mse_percent:.2g} %"
    if math.isnan(diagnosis.noise_percent):
        return f"{text}; a single cycle cannot separate noise from lack of fit"
    text += f", of which {diagnosis.noise_percent:.2g} % is noise"
    if not diagnosis.is_structured:
        return f"{text}: no misfit repeats"
    yields = unexplained = "a misfit repeats, and its cause was not found"
    if not diagnosis.is_met or _misses_yield(diagnosis.held_share, diagnosis.modelled_share):
        yields = (
            f"the damper holds {100.0 * diagnosis.held_share:.0f} % of its force down to a tenth "
            "of its speed: it yields before it slides, like a preloaded valve, dry friction or a "
            "magneto-rheological fluid, and the model misses that"
        )
    if not diagnosis.hints:
        return f"{text}: {yields if diagnosis.has_yielded else unexplained}"
    named = " or ".join(hint.words for hint in diagnosis.hints)
    share = f"{100.0 * diagnosis.hints[0].share:.0f} %"
    text = f"{text}: a misfit repeats, {share} of it explained by {named}"
    return f"{text}; {yields}" if diagnosis.has_yielded and not diagnosis.is_met else text


def group_warning(group: Sequence[Diagnosis]) -> Problem:
    """Return what is said of the setting with the largest misfit, for all settings of its kind."""
    worst = max(group, key=lambda diagnosis: diagnosis.mse_percent)
    is_alone = len(group) == 1
    return warning(
        "misfit",
        f"setting{'' if is_alone else 's {settings}, most at'} {{setting}}: {{words}}.",
        settings=listed_settings(diagnosis.setting for diagnosis in group),
        setting=worst.setting,
        words=worst.sentence,
        mse_percent=worst.mse_percent,
        noise_percent=worst.noise_percent,
        flaw=worst.hints[0].name if worst.hints else "",
    )
