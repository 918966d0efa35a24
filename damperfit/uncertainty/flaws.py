"""What the model may lack: flaws, each with the force that it would leave in the residuals.

The signature of a flaw is the force that one unit of it would add, behind the filter and with
everything the fit could absorb projected out. The share of the repeating misfit that one signature
explains is what a refit with that flaw in the model would gain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.identification.fit_setting import EXCELLENT
from damperfit.identification.outcome import Status

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]
    from collections.abc import Callable, Mapping

    from damperfit.uncertainty.linearisation import Linearisation, LogLinearisation

__all__ = [
    "Hint",
    "friction_by_speed",
    "gain",
    "hidden_friction",
    "seek_flaws",
    "signatures",
    "words_of",
]

# Speeds over which seal friction falls from its breakaway level, m/s.
_STRIBECK_SPEEDS = (0.01, 0.03, 0.1)


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
    found = {
        "delay": [-rate],
        "gas_volume": [passed(x / stroke)],
        "offset": [np.ones(len(force))],
        "friction_with_speed": [
            passed(turned * np.exp(-np.abs(v) / speed)) for speed in _STRIBECK_SPEEDS
        ],
        "friction_with_position": [passed(turned * np.abs(x) / stroke)],
        "friction_with_pressure": _by_pressure(passed(turned), force - friction),
    }
    if stiff:
        pressure = np.abs(force - force.mean())
        share = pressure / max(float(pressure.max()), 1e-300)
        found["compressibility"] = [column * share for column in stiff]
    found["valve_law_rebound"] = [passed(np.maximum(v, 0.0) ** 2 / peak**2)]
    found["valve_law_bump"] = [passed(np.minimum(v, 0.0) ** 2 / peak**2)]
    return found


def _by_pressure(turned: FloatArray, force: FloatArray) -> list[FloatArray]:
    """Friction that grows with the pressure on a seal: both strokes alike (piston), one (rod)."""
    varying = force - force.mean()
    largest = max(float(np.max(np.abs(varying))), 1e-300)
    one_way = (np.abs(varying), np.maximum(varying, 0.0), np.maximum(-varying, 0.0))
    return [turned * pressed / largest for pressed in one_way]


def gain(column: FloatArray, absorbed: FloatArray, residuals: FloatArray) -> tuple[float, float]:
    """Return by how much a signature lowers the sum of squares, and its amount.

    Parameters
    ----------
    column : numpy.ndarray
        Shape (n,), the signature.
    absorbed : numpy.ndarray
        Shape (n, k), orthonormal basis of what the fit could absorb.
    residuals : numpy.ndarray
        Shape (n,).
    """
    left = column - absorbed @ (absorbed.T @ column)
    power = float(left @ left)
    if power <= 1e-12 * float(column @ column):
        return 0.0, 0.0  # the fit absorbs it whole
    amount = float(left @ residuals) / power
    return amount * amount * power, amount


# A signature that explains less of the repeating misfit than this names nothing.
_NAMED = 0.5
# Signatures within this factor of the best cannot be told from it: an offset of the force explains
# nearly all of a wrong gas pressure, and that all of an offset.
_TIE = 0.85
# Amounts beyond these are no cause that a rig has, whatever their signature explains: it stands for
# a law that the model lacks. Of forces: shares of half the force's range.
_LARGEST: Mapping[str, float] = MappingProxyType(
    {
        "delay": 25.0,  # ms; force channels are 8 to 14 ms late at worst
        "gas_pressure": 100.0,  # %; at -100 % there is no gas
        "gas_exponent": 50.0,  # %; from 1.0 to 1.67 is all there is
        "compressibility": 300.0,  # %; oil with gas in it stiffens by its pressure
        "force_gain": 50.0,  # %
    }
)
# Times as stiff as declared; beyond this it is no gas spring.
_STIFFEST, _SOFTEST = 5.0, 0.2
_LARGEST_FORCE = 1.0
_LARGEST_OF_HELD = 1000.0  # %; ten times what it is held at
# None of these is the cause where a damper yields before it slides: all of them shape the reversal.
_OF_VALVES = frozenset(
    {
        "delay",
        "gas_pressure",
        "gas_exponent",
        "gas_volume",
        "gas_stiffness",
        "compressibility",
        "valve_law_rebound",
        "valve_law_bump",
    }
)


@dataclass(frozen=True, slots=True)
class Hint:
    """One flaw that would leave such residuals.

    Attributes
    ----------
    name : str
        Short name: delay, gas_pressure, ...
    family : str
        What the misfit is locked to: position, sign of v, reversals or v squared.
    share : float
        Part of the repeating misfit that it explains, 0 to 1.
    amount : float
        Its size in its own unit (ms, per cent or N), as a refit would find it to first order.
    words : str
        For people.
    """

    name: str
    family: str
    share: float
    amount: float
    words: str


class _Flaw(NamedTuple):
    name: str
    family: str
    unit: float
    words: Callable[[float], str]


def _size(text: str, unit: str) -> Callable[[float], str]:
    return lambda amount: text.format(f"{_rounded(amount)} {unit}")


def _rounded(amount: float) -> str:
    """Two digits, without sign or exponent: 750, not 7.5e+02."""
    return f"{float(f'{abs(amount):.2g}'):g}"


_FLAWS: Mapping[str, _Flaw] = {
    flaw.name: flaw
    for flaw in (
        _Flaw(
            "delay",
            "reversals",
            1e3,
            lambda a: (
                f"a channel delay (the force is {_rounded(a)} ms "
                f"{'late' if a > 0.0 else 'early'} against the displacement)"
            ),
        ),
        _Flaw(
            "gas_pressure",
            "position",
            100.0,
            lambda a: (
                f"a wrong gas pressure ({_rounded(a)} % {'more' if a > 0.0 else 'less'} "
                "than configured)"
            ),
        ),
        _Flaw(
            "force_gain",
            "the force",
            100.0,
            lambda a: (
                f"a force channel whose gain is {_rounded(a)} % too {'high' if a > 0.0 else 'low'} "
                "in this log beside the others"
            ),
        ),
        _Flaw("gas_exponent", "position", 100.0, _size("a wrong gas exponent (by {})", "%")),
        _Flaw(
            "gas_volume",
            "position",
            1.0,
            _size("a wrong gas or rod volume ({} at full stroke)", "N"),
        ),
        _Flaw(
            "offset", "position", 1.0, _size("a force offset that is not in the model ({})", "N")
        ),
        _Flaw(
            "friction_with_speed",
            "the sign of v",
            1.0,
            lambda a: (
                f"friction that depends on velocity ({_rounded(a)} N "
                f"{'more' if a > 0.0 else 'less'} at low speed)"
            ),
        ),
        _Flaw(
            "friction_with_position",
            "the sign of v",
            1.0,
            lambda a: (
                f"friction that changes along the stroke ({_rounded(a)} N "
                f"{'more' if a > 0.0 else 'less'} at its ends)"
            ),
        ),
        _Flaw(
            "friction_with_pressure",
            "the sign of v",
            1.0,
            lambda a: (
                f"friction that {'grows' if a > 0.0 else 'falls'} with the pressure "
                f"({_rounded(a)} N at the peak force)"
            ),
        ),
        _Flaw(
            "compressibility",
            "reversals",
            100.0,
            _size("a bulk modulus that changes with pressure (by {} at the peak force)", "%"),
        ),
        _Flaw(
            "valve_law_rebound",
            "v squared",
            1.0,
            _size("the rebound valve ({} at peak)", "N"),
        ),
        _Flaw("valve_law_bump", "v squared", 1.0, _size("the compression valve ({} at peak)", "N")),
    )
}


def _signatures(
    trace: Trace, seen: LogLinearisation, linearised: Linearisation
) -> dict[str, list[FloatArray]]:
    """Force that one unit of each flaw adds, behind the filter, over the compared samples."""
    quantities = linearised.fit.parameters.quantities
    stiff = [seen.jacobian[:, k] for k, one in enumerate(quantities) if one.is_open]
    friction = sum(
        seen.jacobian[:, k] for k, one in enumerate(quantities) if one.is_friction
    )  # in ln y the derivative is the force itself
    found = {
        name: columns
        for name, columns in signatures(trace, seen.force, stiff, friction).items()
        if name in linearised.flaws
    }
    return found | {name: [seen.gas[:, k]] for k, name in enumerate(linearised.conditions)}


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
    # Beside a jump of the speed nothing counts.
    logs = list(zip(linearised.fit.logs, linearised.logs, strict=True))
    counts = np.concatenate([(seen.weights > 0.0).astype(np.float64) for _, seen in logs])
    residuals = counts * np.concatenate([seen.residuals for _, seen in logs])
    doubted = tuple(name for name in doubted if linearised.fit.status[name] == Status.SHARED)
    alone: set[str] = {Status.FITTED, Status.NOT_IDENTIFIABLE}
    absorbed = _absorbed(linearised, {*alone, Status.SHARED}, counts)
    tables = [_signatures(log.trace, seen, linearised) for log, seen in logs]
    columns: dict[str, list[FloatArray]] = {
        name: [
            np.concatenate([table[name][k] for table in tables])
            for k in range(len(tables[0][name]))
        ]
        for name in tables[0]
    }
    # Of a law that does not fit, no held value can be said to be the cause.
    held = _held(linearised) if linearised.fit.mse_percent < EXCELLENT else ()
    for name in (*held, *doubted):
        place = linearised.names.index(name)
        columns[name] = [np.concatenate([seen.jacobian[:, place] for seen in linearised.logs])]
    is_tied = any(status == Status.SHARED for status in linearised.fit.status.values())
    if is_tied:  # what the settings share knows the gain of each log
        columns["force_gain"] = [np.concatenate([seen.force for seen in linearised.logs])]
    power = repeats * len(counts)
    # Values that the other settings hold back absorb nothing of what one setting lacks.
    own = _absorbed(linearised, alone, counts) if doubted or is_tied else absorbed
    found, pulls = [], {}
    weighed = np.vstack([seen.jacobian * seen.weights[:, None] ** 2 for seen in linearised.logs])
    half_range = 0.5 * float(np.ptp(np.concatenate([seen.force for seen in linearised.logs])))
    friction = _friction(linearised)
    unlikely = _OF_VALVES if has_yielded else frozenset()
    for name, candidates in columns.items():
        basis = own if name in {*doubted, "force_gain"} else absorbed
        gains = [gain(column * counts, basis, residuals) for column in candidates]
        best = max(range(len(gains)), key=gains.__getitem__)
        share, amount = gains[best]
        if name not in doubted:
            pulls[name] = amount * (weighed.T @ candidates[best])
        flaw = _FLAWS.get(name) or _held_flaw(name, is_shared=name in doubted)
        size = amount * flaw.unit
        explained = min(share / power, 1.0)
        found.append(Hint(name, flaw.family, explained, size, flaw.words(size)))
    found.sort(key=lambda hint: -hint.share)
    # Nearly all that is wrong looks a little like a gain: it is named where nothing else is near.
    rivals = [hint for hint in found if hint.name != "force_gain"]
    if rivals and (found[0] in rivals or rivals[0].share > _TIE * found[0].share):
        found = rivals
    if not found or found[0].share < _NAMED:
        return (), {}
    pull_of_best = pulls.get(found[0].name)
    found[0] = _as_stiffness(found[0])
    if pull_of_best is not None:
        pulls[found[0].name] = pull_of_best
    # What stands far behind a best one that is beyond reason leaves most of the misfit unexplained.
    bar = max(_TIE * found[0].share, _NAMED)
    hints = tuple(
        _without_amount(hint, friction)
        for hint in found
        if hint.share >= bar
        and hint.name not in unlikely
        and _is_reasonable(hint, half_range, friction)
    )
    return hints, pulls


def _as_stiffness(hint: Hint) -> Hint:
    """Return an exponent that no gas has as what it stands for: another stiffness of the gas.

    To first order the force of the gas at the ends of the stroke goes with gamma a_r^2 P_0/V_g0.
    """
    times = 1.0 + hint.amount / 100.0
    is_reasonable = abs(hint.amount) <= _LARGEST["gas_exponent"]
    if hint.name != "gas_exponent" or is_reasonable or not _SOFTEST <= times <= _STIFFEST:
        return hint
    words = (
        f"a gas spring about {_rounded(times)} times as stiff as declared (gas volume, gas "
        "pressure, rod diameter)"
    )
    return replace(hint, name="gas_stiffness", words=words)


def _friction(linearised: Linearisation) -> float:
    """Friction that was found, N; without an end where the model has none to compare with."""
    values = linearised.fit.parameters
    found = [float(getattr(values, one.name)) for one in values.quantities if one.is_friction]
    return sum(found) if found else math.inf


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
        return -friction < hint.amount <= _LARGEST_FORCE * half_range
    if hint.name == "gas_stiffness":
        return True
    if hint.name in _LARGEST:
        largest = _LARGEST[hint.name]
    else:
        largest = _LARGEST_FORCE * half_range if hint.name in _FLAWS else _LARGEST_OF_HELD
    return abs(hint.amount) <= largest


def _held(linearised: Linearisation) -> tuple[str, ...]:
    """Parameters that nothing in the logs has set; an offset stands among the flaws already."""
    fit = linearised.fit
    return tuple(
        one.name
        for one in fit.parameters.quantities
        if fit.status[one.name] == Status.FIXED and not one.is_offset
    )


def _held_flaw(name: str, *, is_shared: bool) -> _Flaw:
    held = "is shared by all settings and here" if is_shared else "held at a wrong value,"
    return _Flaw(
        name,
        "a shared parameter" if is_shared else "a held parameter",
        100.0,
        lambda a: f"{name} {held} too {'low' if a > 0.0 else 'high'}",
    )


def _absorbed(linearised: Linearisation, statuses: set[str], counts: FloatArray) -> FloatArray:
    """Orthonormal basis of what parameters of these statuses could absorb where samples count."""
    status = linearised.fit.status
    places = [j for j, name in enumerate(linearised.names) if status[name] in statuses]
    whole = np.vstack([seen.jacobian[:, places] for seen in linearised.logs]) * counts[:, None]
    lengths = np.sqrt(np.sum(whole * whole, axis=0))
    basis, _ = np.linalg.qr(whole[:, lengths > 0.0] / lengths[lengths > 0.0])
    return np.asarray(basis)


# Friction that is larger at low speed is one for all settings, and shows in all of them before it
# shows in one. Its amount at each setting has the scatter of its scores between the cycles, or
# between blocks where nothing repeats; the settings together make it sure.

_SURE = 4.5  # standard errors; the best of three speeds has it by chance once in 50 000
# Of the friction: less moves no parameter by 1 %, more is no friction.
_LEAST, _MOST = 0.02, 2.0
_BLOCKS = 16  # of a stretch in which nothing repeats


class BySpeed(NamedTuple):
    """Friction that depends on velocity at one setting: by each of `_STRIBECK_SPEEDS`."""

    amounts: FloatArray  # N
    errors: FloatArray  # standard errors, N
    pulls: FloatArray  # (speeds, k), what one newton adds to the summed scores
    fitted: float  # the friction that was found, N


def friction_by_speed(linearised: Linearisation) -> BySpeed | None:
    """Return what a setting says of friction that depends on velocity; None where it has none."""
    status, quantities = linearised.fit.status, linearised.fit.parameters.quantities
    sought = {Status.FITTED, Status.SHARED}
    if not any(one.is_friction and status[one.name] in sought for one in quantities):
        return None
    logs = list(zip(linearised.fit.logs, linearised.logs, strict=True))
    counts = np.concatenate([(seen.weights > 0.0).astype(np.float64) for _, seen in logs])
    residuals = counts * np.concatenate([seen.residuals for _, seen in logs])
    basis = _absorbed(linearised, {*sought, Status.NOT_IDENTIFIABLE}, counts)
    tables = [_friction_at_low_speed(log.trace) for log, _ in logs]
    columns = np.concatenate(tables, axis=1)
    left = columns * counts
    left -= (left @ basis) @ basis.T
    power = np.sum(left * left, axis=1)
    if not np.all(power > 1e-9 * np.sum(columns * columns, axis=1)):
        return None
    edges, first = [], 0
    for log, _ in logs:
        for place, stretch in zip(log.trace.places, log.trace.stretches, strict=True):
            ends = np.linspace(0.0, stretch.n_samples, _BLOCKS + 1)[:-1]
            if stretch.n_cycles > 2:
                ends = stretch.cycle_starts[:-1] - stretch.first
            edges.append(first + place.start + np.maximum(np.rint(ends), 0.0).astype(np.int64))
        first += log.trace.n_samples
    scores = np.add.reduceat(left * residuals, np.concatenate(edges), axis=1)
    n = scores.shape[1]
    weighed = np.vstack([seen.jacobian * seen.weights[:, None] ** 2 for seen in linearised.logs])
    return BySpeed(
        amounts=scores.sum(axis=1) / power,
        errors=np.sqrt(n * np.var(scores, axis=1, ddof=1)) / power,
        pulls=columns @ weighed,
        fitted=_friction(linearised),
    )


def _friction_at_low_speed(trace: Trace) -> FloatArray:
    v = trace.velocity
    turned = np.tanh(v / 1e-3)
    return np.stack(
        [
            apply_filter(trace.model_filter, turned * np.exp(-np.abs(v) / speed))[trace.compared]
            for speed in _STRIBECK_SPEEDS
        ]
    )


def hidden_friction(each: Sequence[BySpeed]) -> tuple[int, float]:
    """Return place of the speed, and newtons, of what all settings show together; 0 N of nothing.

    Parameters
    ----------
    each : sequence of BySpeed
        Of all settings.
    """
    if not each:
        return 0, 0.0
    weights = np.array([1.0 / np.maximum(one.errors, 1e-300) ** 2 for one in each])
    total = weights.sum(axis=0)
    amounts = (weights * np.array([one.amounts for one in each])).sum(axis=0) / total
    sureness = amounts * np.sqrt(total)
    best = int(np.argmax(np.abs(sureness)))
    amount = float(amounts[best])
    fitted = each[0].fitted
    is_sure = abs(sureness[best]) > _SURE and _LEAST * fitted < abs(amount) < _MOST * fitted
    return best, amount if is_sure else 0.0


def words_of(name: str, amount: float) -> str:
    """Return a flaw of a size, in its own unit, for people."""
    return _FLAWS[name].words(amount)
