"""What the model may lack: flaws, each with the force that it would leave in the residuals.

The signature of a flaw is the force that one unit of it would add, behind the filter and with
everything the fit could absorb projected out. The share of the repeating misfit that one signature
explains is what a refit with that flaw in the model would gain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.identification.fit_setting import EXCELLENT
from damperfit.identification.outcome import Status
from damperfit.statistics import student_quantile

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.recording import Trace
    from damperfit.uncertainty.linearisation import Linearisation

    FloatArray = NDArray[np.float64]

# Speeds over which seal friction falls from its breakaway level, m/s.
_STRIBECK_SPEEDS = (0.01, 0.03, 0.1)
# A signature that explains less of the repeating misfit than this names nothing.
_NAMED = 0.5
# Signatures within this factor of the best cannot be told from it: an offset of the force explains
# nearly all of a wrong gas pressure, and that all of an offset.
_TIE = 0.85


class _Flaw(NamedTuple):
    """A flaw, its unit, and its words; `largest` is the amount beyond which no rig has it.

    Whatever its signature explains: it stands for a law that the model lacks then. None: half the
    range of the force.
    """

    family: str
    unit: float
    text: str
    ways: tuple[str, str] = ("more", "less")
    largest: float | None = None

    def words(self, amount: float) -> str:
        """Say how large it is, in two digits."""
        return self.text.format(size=_rounded(amount), way=self.ways[not amount > 0.0])


def _rounded(amount: float) -> str:
    """Two digits, without sign or exponent: 750, not 7.5e+02."""
    return f"{float(f'{abs(amount):.2g}'):g}"


_FLAWS: Mapping[str, _Flaw] = {
    "delay": _Flaw(
        "reversals",
        1e3,
        "a channel delay (the force is {size} ms {way} against the displacement)",
        ("late", "early"),
        largest=25.0,  # ms; force channels are 8 to 14 ms late at worst
    ),
    "gas_pressure": _Flaw(
        "position",
        100.0,
        "a wrong gas pressure ({size} % {way} than configured)",
        largest=100.0,  # %; at -100 % there is no gas
    ),
    "gas_exponent": _Flaw(
        "position",
        100.0,
        "a wrong gas exponent (by {size} %)",
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
        "the sign of v",
        1.0,
        "friction that {way} with the pressure ({size} N at the peak force)",
        ("grows", "falls"),
    ),
    "compressibility": _Flaw(
        "reversals",
        100.0,
        "a bulk modulus that changes with pressure (by {size} % at the peak force)",
        largest=300.0,  # %; oil with gas in it stiffens by its pressure
    ),
    "force_gain": _Flaw(
        "the force",
        100.0,
        "a force channel whose gain is {size} % too {way} in this log beside the others",
        ("high", "low"),
        largest=50.0,  # %
    ),
    "valve_law_rebound": _Flaw("v squared", 1.0, "the rebound valve ({size} N at peak)"),
    "valve_law_bump": _Flaw("v squared", 1.0, "the compression valve ({size} N at peak)"),
}
# A gas spring of another stiffness is so many times as stiff as declared; beyond it is none.
_STIFFEST, _SOFTEST = 5.0, 0.2
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
    friction: FloatArray | float = 0.0,
) -> dict[str, list[FloatArray]]:
    """Return the force that one unit of each flaw adds, behind the filter, where it is compared.

    Parameters
    ----------
    trace : Trace
        The log.
    force : numpy.ndarray
        Shape (n,), over the compared samples, modelled or measured, N.
    stiff : sequence of numpy.ndarray
        Shape (n,) each, derivatives of the modelled force by ln of stiffnesses; none leave a
        stiffness that changes with pressure out.
    friction : numpy.ndarray or float
        Shape (n,), the part of the force that is friction, N.
    """
    x, v = trace.displacement, trace.velocity
    peak = float(np.max(np.abs(v[trace.compared])))
    stroke = float(np.max(np.abs(x[trace.compared])))
    turned = np.tanh(v / 1e-3)

    def passed(values: FloatArray) -> FloatArray:
        return apply_filter(trace.model_filter, values)[trace.compared]

    # Stretch by stretch: where one ends and the next begins nothing was logged in between.
    rate = np.concatenate([np.gradient(force[place], trace.interval) for place in trace.places])
    # Friction that grows with the pressure on a seal: both strokes alike (piston), or one (rod).
    pressing = (force - friction) - np.mean(force - friction)
    largest = max(float(np.max(np.abs(pressing))), 1e-300)
    seals = (np.abs(pressing), np.maximum(pressing, 0.0), np.maximum(-pressing, 0.0))
    found = {
        "delay": [-rate],
        "gas_volume": [passed(x / stroke)],
        "offset": [np.ones(len(force))],
        "friction_with_speed": _at_low_speed(trace),
        "friction_with_position": [passed(turned * np.abs(x) / stroke)],
        "friction_with_pressure": [passed(turned) * pressed / largest for pressed in seals],
        "valve_law_rebound": [passed(np.maximum(v, 0.0) ** 2 / peak**2)],
        "valve_law_bump": [passed(np.minimum(v, 0.0) ** 2 / peak**2)],
    }
    if stiff:
        pressure = np.abs(force - force.mean())
        share = pressure / max(float(pressure.max()), 1e-300)
        found["compressibility"] = [column * share for column in stiff]
    return found


def _at_low_speed(trace: Trace) -> list[FloatArray]:
    """Friction of 1 N at rest that falls over each of `_STRIBECK_SPEEDS`."""
    v = trace.velocity
    falling = (np.tanh(v / 1e-3) * np.exp(-np.abs(v) / speed) for speed in _STRIBECK_SPEEDS)
    return [apply_filter(trace.model_filter, one)[trace.compared] for one in falling]


def gain(column: FloatArray, absorbed: FloatArray, residuals: FloatArray) -> tuple[float, float]:
    """Return by how much a signature, (n,), lowers the sum of squares, and its amount.

    `absorbed` is an orthonormal basis of what the fit could absorb, (n, k).
    """
    left = column - absorbed @ (absorbed.T @ column)
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
    """Return the flaws that explain what repeats in the residuals, best first, and their pulls.

    A pull, (k,), is what the flaw adds to the summed scores: by H^-1 of it the fit is off. Flaws
    that cannot be told from the best stand beside it; none where the best explains less than half.

    Parameters
    ----------
    linearised : Linearisation
        Of one setting.
    repeats : float
        Mean square of the repeating misfit, N^2.
    doubted : tuple of str
        Shared parameters of which one value for all settings is known not to hold.
    has_yielded : bool
        The damper yields before it slides: nothing of valves, oil or gas is named.
    """
    fit, logs = linearised.fit, linearised.logs
    quantities = fit.parameters.quantities
    # Beside a jump of the speed nothing counts.
    counts = np.concatenate([(seen.weights > 0.0).astype(np.float64) for seen in logs])
    residuals = counts * np.concatenate([seen.residuals for seen in logs])
    doubted = tuple(name for name in doubted if fit.status[name] == Status.SHARED)
    alone: set[str] = {Status.FITTED, Status.NOT_IDENTIFIABLE}
    absorbed = _absorbed(linearised, {*alone, Status.SHARED}, counts)
    # Values that the other settings hold back absorb nothing of what one setting lacks.
    is_tied = any(status == Status.SHARED for status in fit.status.values())
    own = _absorbed(linearised, alone, counts) if doubted or is_tied else absorbed
    columns = _columns(linearised)
    if is_tied:  # what the settings share knows the gain of each log
        columns["force_gain"] = [np.concatenate([seen.force for seen in logs])]
    # Parameters that nothing in the logs has set may be held at a wrong value, but for an offset,
    # which is among the flaws already. Of a law that does not fit none can be said to be the cause.
    held = [
        one.name
        for one in quantities
        if fit.status[one.name] == Status.FIXED
        and not one.is_offset
        and fit.mse_percent < EXCELLENT
    ]
    for name in (*held, *doubted):
        place = linearised.names.index(name)
        columns[name] = [np.concatenate([seen.jacobian[:, place] for seen in logs])]
    weighed = np.vstack([seen.jacobian * seen.weights[:, None] ** 2 for seen in logs])
    found, pulls = [], {}
    for name, candidates in columns.items():
        basis = own if name in {*doubted, "force_gain"} else absorbed
        gains = [gain(column * counts, basis, residuals) for column in candidates]
        best = max(range(len(gains)), key=gains.__getitem__)
        share, amount = gains[best]
        flaw = _FLAWS.get(name) or _held_flaw(name, is_shared=name in doubted)
        size = amount * flaw.unit
        explained = min(share / (repeats * len(counts)), 1.0)
        hint = Hint(name, flaw.family, explained, size, flaw.words(size))
        found.append((hint, None if name in doubted else amount * (weighed.T @ candidates[best])))
    found.sort(key=lambda pair: -pair[0].share)
    # Nearly all that is wrong looks a little like a gain: it is named where nothing else is near.
    rivals = [pair for pair in found if pair[0].name != "force_gain"]
    if rivals and (found[0] is rivals[0] or rivals[0][0].share > _TIE * found[0][0].share):
        found = rivals
    if not found or found[0][0].share < _NAMED:
        return (), {}
    found[0] = (_as_stiffness(found[0][0]), found[0][1])
    half_range = 0.5 * float(np.ptp(np.concatenate([seen.force for seen in logs])))
    friction = _friction(linearised)
    unlikely = _OF_VALVES if has_yielded else frozenset()
    # What stands far behind a best one that is beyond reason leaves most of the misfit unexplained.
    bar = max(_TIE * found[0][0].share, _NAMED)
    hints = []
    for hint, pull in found:
        if hint.share < bar or hint.name in unlikely:
            continue
        if _is_reasonable(hint, half_range, friction):
            hints.append(_without_amount(hint, friction))
            if pull is not None:
                pulls[hint.name] = pull
    return tuple(hints), pulls


def _held_flaw(name: str, *, is_shared: bool) -> _Flaw:
    how = "is shared by all settings and here too" if is_shared else "held at a wrong value, too"
    family = "a shared parameter" if is_shared else "a held parameter"
    return _Flaw(family, 100.0, f"{name} {how} {{way}}", ("low", "high"))


def _columns(linearised: Linearisation) -> dict[str, list[FloatArray]]:
    """Force that one unit of each flaw adds, behind the filter, over the samples of all logs."""
    quantities, tables = linearised.fit.parameters.quantities, []
    for log, seen in zip(linearised.fit.logs, linearised.logs, strict=True):
        stiff = [seen.jacobian[:, k] for k, one in enumerate(quantities) if one.is_open]
        friction = sum(
            seen.jacobian[:, k] for k, one in enumerate(quantities) if one.is_friction
        )  # in ln y the derivative is the force itself
        found = signatures(log.trace, seen.force, stiff, friction)
        table = {name: rows for name, rows in found.items() if name in linearised.flaws}
        tables.append(
            table | {name: [seen.gas[:, k]] for k, name in enumerate(linearised.conditions)}
        )
    return {
        name: [np.concatenate(parts) for parts in zip(*(of[name] for of in tables), strict=True)]
        for name in tables[0]
    }


def _friction(linearised: Linearisation) -> float:
    """Friction that was found, N; without an end where the model has none to compare with."""
    values = linearised.fit.parameters
    found = [float(getattr(values, one.name)) for one in values.quantities if one.is_friction]
    return sum(found) if found else math.inf


def _absorbed(linearised: Linearisation, statuses: set[str], counts: FloatArray) -> FloatArray:
    """Orthonormal basis of what parameters of these statuses could absorb where samples count."""
    status = linearised.fit.status
    places = [j for j, name in enumerate(linearised.names) if status[name] in statuses]
    whole = np.vstack([seen.jacobian[:, places] for seen in linearised.logs]) * counts[:, None]
    lengths = np.sqrt(np.sum(whole * whole, axis=0))
    basis, _ = np.linalg.qr(whole[:, lengths > 0.0] / lengths[lengths > 0.0])
    return np.asarray(basis)


def _as_stiffness(hint: Hint) -> Hint:
    """Return an exponent that no gas has as what it stands for: another stiffness of the gas.

    To first order the force of the gas at the ends of the stroke goes with gamma a_r^2 P_0/V_g0.
    """
    times = 1.0 + hint.amount / 100.0
    is_stiffness = not _is_reasonable(hint, math.inf) and _SOFTEST <= times <= _STIFFEST
    if hint.name != "gas_exponent" or not is_stiffness:
        return hint
    words = (
        f"a gas spring about {_rounded(times)} times as stiff as declared (gas volume, gas "
        "pressure, rod diameter)"
    )
    return replace(hint, name="gas_stiffness", words=words)


def _without_amount(hint: Hint, friction: float) -> Hint:
    """Return friction that would be less than none at low speed without saying how much less.

    The friction that a refit finds at speed is larger than the fitted one, which nobody sees.
    """
    if hint.name != "friction_with_speed" or hint.amount >= -friction:
        return hint
    return replace(hint, words="friction that depends on velocity (less at low speed)")


def _is_reasonable(hint: Hint, half_range: float, friction: float = math.inf) -> bool:
    """Whether a rig or damper can be wrong by so much; half the force's range and friction in N."""
    if hint.name in {"friction_with_position", "friction_with_pressure"}:
        return -friction < hint.amount <= half_range
    if hint.name == "gas_stiffness":
        return True
    flaw = _FLAWS.get(hint.name)
    largest = _LARGEST_OF_HELD if flaw is None else flaw.largest or half_range
    return abs(hint.amount) <= largest


# Friction that is larger at low speed is one for all settings, and shows in all of them before it
# shows in one. Its sum has the scatter of the scores between the cycles, or between blocks where
# nothing repeats; the settings together make it sure. A scatter of few cycles is itself not known.

_CHANCE = 1e-5  # of such a friction where there is none, at each of three speeds
# Of the friction: less moves no parameter by 1 %, more is no friction.
_LEAST, _MOST = 0.02, 2.0
_BLOCKS = 16  # of a stretch in which nothing repeats


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
    fit, seen = linearised.fit, linearised.logs
    sought = {Status.FITTED, Status.SHARED}
    frictions = [one.name for one in fit.parameters.quantities if one.is_friction]
    if not any(fit.status[name] in sought for name in frictions):
        return None
    counts = np.concatenate([(one.weights > 0.0).astype(np.float64) for one in seen])
    residuals = counts * np.concatenate([one.residuals for one in seen])
    basis = _absorbed(linearised, {*sought, Status.NOT_IDENTIFIABLE}, counts)
    columns = np.concatenate([np.stack(_at_low_speed(log.trace)) for log in fit.logs], axis=1)
    left = columns * counts
    left -= (left @ basis) @ basis.T
    power = np.sum(left * left, axis=1)
    if not np.all(power > 1e-9 * np.sum(columns * columns, axis=1)):
        return None
    edges, first = [], 0
    for log in fit.logs:
        for place, stretch in zip(log.trace.places, log.trace.stretches, strict=True):
            ends = np.linspace(0.0, stretch.n_samples, _BLOCKS + 1)[:-1]
            if stretch.n_cycles > 2:
                ends = stretch.cycle_starts[:-1] - stretch.first
            edges.append(first + place.start + np.maximum(np.rint(ends), 0.0).astype(np.int64))
        first += log.trace.n_samples
    scores = np.add.reduceat(left * residuals, np.concatenate(edges), axis=1)
    weighed = np.vstack([one.jacobian * one.weights[:, None] ** 2 for one in seen])
    noise = max(float(residuals @ residuals) / float(counts.sum()), 1e-300)
    n = scores.shape[1]
    return BySpeed(
        sums=scores.sum(axis=1) / noise,
        powers=power / noise,
        variances=n * np.var(scores, axis=1, ddof=1) / noise**2,
        freedom=n - 1,
        pulls=columns @ weighed,
        fitted=_friction(linearised),
    )


def hidden_friction(each: Sequence[BySpeed]) -> tuple[int, float]:
    """Return place of the speed, and newtons, of what all settings show together; or 0 N."""
    if not each:
        return 0, 0.0
    variances = np.array([one.variances for one in each])
    whole, total = variances.sum(axis=0), np.sum([one.sums for one in each], axis=0)
    sureness = total / np.sqrt(np.maximum(whole, 1e-300))
    best = int(np.argmax(np.abs(sureness)))
    amount = float(total[best] / sum(one.powers[best] for one in each))
    # Degrees of freedom of a sum of variances: Satterthwaite, Biometrics Bulletin 2 (1946).
    shares = variances[:, best] / max(whole[best], 1e-300)
    freedom = 1.0 / max(float(np.sum(shares**2 / [one.freedom for one in each])), 1e-300)
    least = student_quantile(freedom, 1.0 - 0.5 * _CHANCE)
    fitted = each[0].fitted
    is_sure = abs(sureness[best]) > least and _LEAST * fitted < abs(amount) < _MOST * fitted
    return best, amount if is_sure else 0.0


def words_of(name: str, amount: float) -> str:
    """Return a flaw of a size, in its own unit, for people."""
    return _FLAWS[name].words(amount)
