"""When a grade is withheld: what a low MSE cannot excuse, and the sentence that says so.

The paper's MSE and its words stay; but a wrong model bends its parameters until it fits, and then
"excellent" is said of a damper that nobody has built. All limits stand here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.conditioning.polarity import CONTRADICTED, force_level
from damperfit.damper.cylinder import AMBIENT
from damperfit.damper.load_cell import behind_lag
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.errors import DamperfitError
from damperfit.identification import GivenStart, identify
from damperfit.identification.fit_problem import edge_of
from damperfit.identification.outcome import Status

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.conditioning import GasFacts
    from damperfit.damper.model import Model
    from damperfit.damper.quantity import Quantity
    from damperfit.identification import Campaign, Fit, FitOptions
    from damperfit.recording import Trace
    from damperfit.simulation import SolverOptions
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty.assessment import Assessment
    from damperfit.uncertainty.residuals import Diagnosis

    FloatArray = NDArray[np.float64]


class GradeLimits(NamedTuple):
    """What a grade must not go beyond; ranges of single quantities stand with them."""

    cavitation: float = 0.05  # share of the cycle with an empty chamber, where the log is missed
    offset: float = 1.0  # distance of f_0 from the log's offset, over what that may be wrong by
    jump: float = 1.25  # jump of the friction at a reversal over the jump that the log has there
    dimensions: float = 0.9  # of what repeats, the share that other dimensions explain
    # What repeats in the residual, over the noise and as a share of the force's variance, both at
    # once: rigs repeat so well that 0.05 % is many times their noise and of no consequence; 0.2 %
    # is 4.5 % of the force's standard deviation, 3 % of its peak.
    times_noise: float = 30.0
    misfit_percent: float = 0.2
    # An MSE that leaves nothing anyone would use, whatever repeats in it: such a fit knows the
    # offset and the friction better than the level and the jumps of the log do. As
    # `laws.ENOUGH_PERCENT`, which takes too long to import here.
    nothing_percent: float = 0.02
    # Samples of a log at the end of a channel's range. With 4 % no number moves by half a per cent;
    # with 19 % a slope is 16 % off, at an MSE of 0.05 %.
    clipped_percent: float = 4.0
    # MSE of a test that was not fitted, in all and over the one expected, both at once.
    predicted_percent: float = 0.5
    predicted_times: float = 4.0


LIMITS = GradeLimits()

# What the level of the force may be wrong by, in its own uncertainty and in gas forces.
_OF_UNCERTAINTY, _OF_GAS = 1.5, 0.25
_AS_CLEAR = 1.5  # times the least doubt of a log: valves that open early look like an offset
_CLIPPINGS = ("force_clipping", "displacement_clipping")
# s; a 30 Hz filter spreads a jump over so much to both sides.
_REVERSAL = 0.02


@dataclass(frozen=True, slots=True)
class Objection:
    """One reason to withhold a grade."""

    # bound, beyond, cavitation, clipping, direction, offset, friction, dimensions, misfit,
    # prediction or delivery
    kind: str
    quantity: str  # name of the quantity it is about; empty where it is about none
    sentence: str  # for people


def objections(
    campaign: Campaign,
    assessment: Assessment,
    gas: GasFacts | None = None,
    *,
    assumed: str = "",
) -> dict[Setting, tuple[Objection, ...]]:
    """Return by setting why its grade is withheld; settings without a reason are left out.

    Without `gas` the offset is not looked at. `assumed` are dimensions that nobody declared, in
    words, as in "[damper] is not declared, and with the dimensions of a generic damper".
    """
    diagnoses = {one.setting: one for one in assessment.diagnoses}
    doubted = _doubted_dimensions(campaign, diagnoses, assumed)
    found = {
        fit.setting: (
            *_of_fit(fit, diagnoses.get(fit.setting), gas),
            *doubted.get(fit.setting, ()),
        )
        for fit in campaign.fits
    }
    return {setting: reasons for setting, reasons in found.items() if reasons}


def doubted_cavitation(said: Mapping[Setting, Sequence[Objection]]) -> frozenset[Setting]:
    """Return the settings whose grade is withheld for a chamber that is empty without need."""
    return frozenset(
        setting for setting, why in said.items() if any(one.kind == "cavitation" for one in why)
    )


def _of_fit(  # noqa: C901, PLR0912 - one reason after the other
    fit: Fit, diagnosis: Diagnosis | None, gas: GasFacts | None
) -> Iterator[Objection]:
    values, findings = (
        fit.parameters,
        [(f, log.trace) for log in fit.logs for f in log.trace.findings],
    )
    found = [
        (one, getattr(values, one.name))
        for one in values.quantities
        if fit.status[one.name] in {Status.FITTED, Status.SHARED}
    ]
    for one in values.quantities:
        if fit.status[one.name] == Status.AT_BOUND:
            side, edge = edge_of(values, one.name)
            text = f"{one.symbol} is at a bound of its range ({side} {edge:.3g} {one.unit})"
            yield Objection("bound", one.name, text)
    for one, value in found:
        low, high = one.believable
        if not low <= value <= high:
            yield Objection("beyond", one.name, _beyond(one, value))
    cut = [
        (one.value, one.name.partition("_")[0], trace.name)
        for one, trace in findings
        if one.name in _CLIPPINGS and (one.value or 0.0) > LIMITS.clipped_percent
    ]
    if cut:
        share, channel, name = max(cut)
        text = f"the {channel} of {name} is clipped at {share:.2g} % of its samples: the numbers "
        yield Objection("clipping", "", f"{text}lack what was cut off")
    contradicted = [trace.name for one, trace in findings if one.name == CONTRADICTED]
    if contradicted:
        text = f"the gas force in {contradicted[0]} contradicts the signs of its channels"
        yield Objection("direction", "", f"{text}: declare which way they are counted")
    if diagnosis is None or math.isnan(diagnosis.noise_percent):
        is_missed = fit.mse_percent > LIMITS.misfit_percent  # much, where noise is not known
    else:
        is_missed = diagnosis.is_structured and fit.mse_percent > LIMITS.nothing_percent
        repeats, noise = diagnosis.repeating_percent, diagnosis.noise_percent
        if repeats > LIMITS.misfit_percent and repeats > LIMITS.times_noise * noise:
            times = "without any noise"
            if noise > 0.0:  # two digits, and no power of ten
                times = f"{float(f'{repeats / noise:.2g}'):.0f} times the noise"
            text = f"a misfit of {repeats:.2g} % repeats from cycle to cycle, {times}"
            yield Objection("misfit", "", text)
    seen = fit.cavitation
    is_doubted = is_missed or (diagnosis is not None and _repeats(diagnosis))
    if is_doubted and seen.fraction > LIMITS.cavitation:
        yield Objection(
            "cavitation",
            "",
            f"chamber {seen.chamber} cavitates for {100.0 * seen.fraction:.0f} % of the cycle in a "
            "model that does not match the log: no evidence supports it",
        )
    if not is_missed:
        return
    for one in values.quantities:
        if one.is_offset and gas is not None:
            apart = offset_mismatch(fit, one.name, gas)
            if apart is not None and apart[0] > LIMITS.offset:
                value = getattr(values, one.name)
                text = f"{one.symbol} is {value:.0f} N where the log shows {apart[1]:.0f} N"
                yield Objection("offset", one.name, text)
    for one, value in found:
        if one.is_friction and (ratio := jump_ratio(fit, value)) > LIMITS.jump:
            text = (
                f"{one.symbol} = {value:.3g} N would need a jump of the force at each reversal "
                f"{ratio:.2g} times that of the log"
            )
            yield Objection("friction", one.name, text)


def _beyond(one: Quantity, value: float) -> str:
    """Say of a value that no damper or rig has it."""
    low, high = (10.0**-one.power * edge for edge in one.believable)
    unit = one.shown_unit
    span = f"{low:g} to {high:g} {unit}" if math.isfinite(high) else f"{low:g} {unit} or more"
    because = f": {one.belief}" if one.belief else ""
    return f"{one.symbol} = {10.0**-one.power * value:.3g} {unit} is beyond {span}{because}"


def _repeats(diagnosis: Diagnosis) -> bool:
    """Whether it is many times the noise; never where that is not known."""
    repeats, noise = diagnosis.repeating_percent, diagnosis.noise_percent
    return diagnosis.is_structured and repeats > LIMITS.times_noise * noise


def _doubted_dimensions(
    campaign: Campaign, diagnoses: Mapping[Setting, Diagnosis], assumed: str
) -> dict[Setting, tuple[Objection]]:
    """Where what repeats is that of other dimensions, or of dimensions that nobody gave.

    Dimensions are the damper's: where one setting has shown them to be wrong, the others in which
    the same repeats are bent by them too, however little it is there.
    """

    def is_of_gas(one: Diagnosis, *names: str) -> bool:
        """Whether nearly all that repeats is as of another gas spring."""
        is_named = bool(one.hints) and one.hints[0].name.startswith(("gas_", *names))
        return is_named and one.hints[0].share > LIMITS.dimensions

    bent = [
        diagnoses[fit.setting]
        for fit in campaign.fits
        if fit.setting in diagnoses
        and _repeats(diagnoses[fit.setting])
        and fit.mse_percent > LIMITS.nothing_percent
    ]
    # What a wrong gas pressure does is an offset at soft settings.
    is_gas_wrong = any(is_of_gas(one, "offset") for one in bent)
    found = {}
    for setting, one in diagnoses.items() if bent else ():
        words = (
            f"the MSE is {one.mse_percent:.2g} %, of which only {one.noise_percent:.2g} % is noise"
        )
        if not one.is_structured or not (assumed or (is_gas_wrong and is_of_gas(one))):
            continue
        words = f"{assumed} {words}" if assumed else f"{words}, and the rest is as from "
        words += "" if assumed else one.hints[0].words
        found[setting] = (Objection("dimensions", "", f"{words}: declare the damper as it is"),)
    return found


def offset_mismatch(fit: Fit, name: str, gas: GasFacts) -> tuple[float, float] | None:
    """Return an offset's distance from the logs', over what that may be wrong by, and that, N."""
    value = getattr(fit.parameters, name)
    found = []
    # Of the log that is farthest, of those that hide it least.
    levels = [force_level(log.trace, gas) for log in fit.logs if log.trace.n_cycles]
    most = _AS_CLEAR * min((one.doubt for one in levels), default=0.0)
    for level in (one for one in levels if one.doubt <= most):
        seen = level.force - level.expected
        allowed = _OF_UNCERTAINTY * level.uncertainty + level.held + _OF_GAS * gas.inside
        if math.isfinite(seen) and allowed > 0.0:
            found.append((abs(value - seen) / allowed, seen))
    return max(found, default=None)


def jump_ratio(fit: Fit, friction: float) -> float:
    """Return the jump of a Coulomb friction at the reversals over that of the logs.

    Both behind the same filter and lag, over 20 ms to both sides. Valves add to the jump: a sound
    damper has less than 1. NaN where something spreads the jump, or nothing repeats.
    """
    if what_spreads(fit):
        return math.nan
    ratios = [_jumps(log.trace, friction, _lag(fit)) for log in fit.logs if log.trace.n_cycles]
    return max((ratio for ratio in ratios if math.isfinite(ratio)), default=math.nan)


def what_spreads(fit: Fit) -> str:
    """Say what spreads the jump of a friction beyond what it is read over; empty where nothing."""
    lag = _lag(fit)
    late = f"the force channel lags by {1e3 * lag:.2g} ms" if lag else ""
    if any(one.unit == "N/m" for one in fit.parameters.quantities):
        also = f" and {late}" if lag else ""
        return f"the mounting is elastic{also}, which spreads the jump at a reversal"
    return f"{late}, which spreads the jump at a reversal" if lag > _REVERSAL else ""


def _lag(fit: Fit) -> float:
    """Lag of the force channel, s; 0 in a model without one."""
    lags = [one.name for one in fit.parameters.quantities if one.unit == "s"]
    return sum(float(getattr(fit.parameters, name)) for name in lags)


def _jumps(trace: Trace, friction: float, lag: float) -> float:
    v = trace.drive.velocity
    (turning,) = behind_lag(friction * np.sign(v)[None], trace.interval, lag)
    jump = apply_filter(trace.model_filter, turning)
    reach = max(1, round(_REVERSAL / trace.interval))
    places = np.flatnonzero(np.signbit(v[:-1]) != np.signbit(v[1:]))
    inside = np.zeros(len(v), dtype=bool)
    inside[trace.compared] = True
    places = places[(places >= reach) & (places + 1 + reach < len(v))]
    places = places[inside[places - reach] & inside[places + 1 + reach]]
    if not len(places):
        return math.nan
    sign = np.sign(v[places + 1 + reach])

    def over(signal: FloatArray) -> float:
        return float(np.mean(sign * (signal[places + 1 + reach] - signal[places - reach])))

    seen = over(trace.force)  # against the motion where the force is late or of the other sign
    return over(jump) / seen if seen > 0.0 else math.nan


# The air on the rod, which the paper's equation leaves out, where the logs show that it is there.
#
# It presses the rod in with a_r P_amb, 11 N on a rod of 12 mm and 39 N on one of 22 mm. A load cell
# that was zeroed without the damper sees it. Where the model leaves it out, R_m3 and friction take
# its place and the MSE hardly rises; but it rises in every cycle, and that can be seen.

# Standard errors by which the squares of the residuals must fall, cycle by cycle: Q. H. Vuong,
# Econometrica 57 (1989), of two models neither of which is a case of the other.
_CERTAIN = 4.0
# Times the noise: a model that misses by more than its noise says nothing of a few newtons.
_OF_NOISE = 2.0


def air_objections(
    campaign: Campaign, assessment: Assessment, damper: Model, options: FitOptions, *, jobs: int
) -> dict[Setting, Objection]:
    """Return why no grade stands where the logs of the paper's model show the air on the rod.

    They are fitted again with 1.013 bar of air; nothing where a free offset takes its place.
    """
    offsets = {one.name for one in damper.quantities if one.is_offset}
    has_offset = any(fit.status[name] != Status.FIXED for fit in campaign.fits for name in offsets)
    if damper.name != PURDY_DAMPER.name or has_offset or not campaign.fits:
        return {}
    inside = replace(damper.plain, ambient_pressure=AMBIENT)  # type: ignore[type-var]
    with_air: Model = inside if damper.plain is damper else replace(damper, damper=inside)  # type: ignore[type-var]
    free = {
        fit.setting: {
            name: getattr(fit.parameters, name)
            for name, status in fit.status.items()
            if status not in {Status.FIXED, Status.ABSENT}
        }
        for fit in campaign.fits
    }
    start = GivenStart(by_setting=free, named=options.start.named)
    traces = [log.trace for fit in campaign.fits for log in fit.logs]
    try:
        again = identify(traces, with_air, replace(options, start=start, starts=1), jobs=jobs)
    except DamperfitError:  # what it would have shown is not known
        return {}
    others = {fit.setting: fit for fit in again.fits}
    pairs = [(fit, others[fit.setting]) for fit in campaign.fits if fit.setting in others]
    noise = {one.setting: one.noise_percent for one in assessment.diagnoses}
    gains = [
        gain
        for fit, other in pairs
        if other.mse_percent <= _OF_NOISE * noise.get(fit.setting, math.nan)
        for gain in _gains((fit, damper), (other, with_air), options.solver)
    ]
    if not is_certain(gains):
        return {}
    return {
        fit.setting: Objection(
            "dimensions",
            "",
            "the logs show the air on the rod, which the paper's equation leaves out: with "
            f"{AMBIENT / 1e5:.4g} bar the MSE is {other.mse_percent:.3g} % instead of "
            f'{fit.mse_percent:.3g} %: set damper.ambient_pressure = "1.013bara", unless '
            "gas_pressure is declared 1 bar too high",
        )
        for fit, other in pairs
    }


def _gains(
    without: tuple[Fit, Model], with_air: tuple[Fit, Model], solver: SolverOptions
) -> Iterator[float]:
    """Yield by how much the squares are less with the air, N^2, cycle by cycle."""
    for first, second in zip(without[0].logs, with_air[0].logs, strict=True):
        squares = [
            (log.trace.force - log.compared(fit.parameters, damper, solver).force) ** 2
            for log, (fit, damper) in ((first, without), (second, with_air))
        ]
        for stretch in first.trace.stretches:
            fall = (squares[0] - squares[1])[stretch.window]
            for cycle in np.array_split(fall, max(stretch.n_cycles, 1)):
                yield float(np.sum(cycle))


def is_certain(gains: Sequence[float]) -> bool:
    """Whether the mean of what is gained is above nothing by far more than chance."""
    n = len(gains)
    return n > 1 and bool(np.mean(gains) > _CERTAIN * np.std(gains, ddof=1) / math.sqrt(n))
