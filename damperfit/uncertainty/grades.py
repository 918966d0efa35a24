"""Held-out logs predicted, and when a grade is withheld: what a low MSE cannot excuse.

The paper's MSE and its words stay; but at one amplitude and frequency a wrong model bends its
parameters until it fits, and then "excellent" is said of a damper that does not exist. It shows
where nothing was bent: at another amplitude or frequency. What is held out and missed withholds a
grade, which is then one of the tests, not of the damper. All limits stand here.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from damperfit.arrays import FloatArray
from damperfit.conditioning.filters import apply_filter
from damperfit.conditioning.noise import noise_floor
from damperfit.conditioning.options import GasFacts
from damperfit.conditioning.polarity import CONTRADICTED, LEAST_GAS, force_level
from damperfit.conditioning.segments import TRANSIENTS
from damperfit.damper.cylinder import AMBIENT
from damperfit.damper.model import Model
from damperfit.damper.mounting import behind_lag
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.errors import ConfigurationError, DamperfitError, LogError, SimulationError
from damperfit.identification.fit_problem import edge_of
from damperfit.identification.fit_setting import Fit
from damperfit.identification.joint import ENOUGH_PERCENT
from damperfit.identification.logs import LogFit, SimulatedLog, compare, normalised_mse
from damperfit.identification.options import FitOptions, GivenStart
from damperfit.identification.outcome import Status
from damperfit.identification.procedures import Campaign, identify
from damperfit.identification.sharing import unlimited_in, values_from_others
from damperfit.problem import Problem, warning
from damperfit.recording import Segment, Trace
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from damperfit.uncertainty.residuals import (
    STIFFEST,
    Diagnosis,
    full_stroke,
    residual_scatter,
    rounded,
)
from damperfit.units.quantities import parse_quantity

if TYPE_CHECKING:
    from damperfit.uncertainty.assessment import Assessment
    from damperfit.uncertainty.covariance import Interval


class GradeLimits(NamedTuple):
    """Limits beyond which a grade is withheld; ranges of single quantities stand with them."""

    cavitation: float = 0.05  # share of the cycle with an empty chamber, where the log is missed
    offset: float = 1.0  # distance of f_0 from the log's offset, over what that may be wrong by
    jump: float = 1.25  # jump of the friction at a reversal over the jump that the log has there
    dimensions: float = 0.9  # of what repeats, the share that other dimensions explain
    # What repeats in the residual, over the noise and as a share of the force's variance, both at
    # once: rigs repeat so well that 0.05 % is many times their noise and of no consequence; 0.2 %
    # is 4.5 % of the force's standard deviation, 3 % of its peak. Of what nothing explains
    # `nothing_percent` is the bar.
    times_noise: float = 30.0
    misfit_percent: float = 0.2
    # An MSE that leaves nothing anyone would use, whatever repeats in it: such a fit knows the
    # offset and the friction better than the level and the jumps of the log do.
    nothing_percent: float = ENOUGH_PERCENT
    # Samples of a log at the end of a channel's range. With 4 % no number moves by half a per cent;
    # with 19 % a slope is 16 % off, at an MSE of 0.05 %.
    clipped_percent: float = 4.0
    trend_percent: float = 5.0  # of the peak force: a mean over 8 % has an R_m1 2 % off
    cell_percent: float = 3.0  # of the peak force: a load cell bent by 5 % has an R_m1 3 % off
    # Of all others' frequency or stroke: a log further off may be another test, and is warned of.
    apart_percent: float = 3.5
    # MSE of a test that was not fitted, in all and over the one expected, both at once.
    predicted_percent: float = 0.5
    predicted_times: float = 4.0


LIMITS = GradeLimits()
_FOUND = frozenset({Status.FITTED, Status.SHARED})

# What the level of the force may be wrong by, in its own uncertainty and in gas forces.
_OF_UNCERTAINTY, _OF_GAS = 1.5, 0.25
# An offset of twice the gas force, within this share of it, is no tare but a gas force that is
# counted reversed.
_TURNED = 0.4
_AS_CLEAR = 1.5  # times the least doubt of a log: valves that open early look like an offset
# What warnings of a log mean for its numbers: whatever the MSE; where an offset is held, whose
# place others take; where what repeats is many times the noise.
_CLIPPED = "is clipped at {size:.2g} % of its samples: the numbers lack what was cut off"
_SPOILING = {
    "force_clipping": f"the force of {{log}} {_CLIPPED}",
    "displacement_clipping": f"the displacement of {{log}} {_CLIPPED}",
    "another_force": "{log} holds two forces of one motion: split it, or repair what changed",
    "force_trend": "the peak force of {log} changes by {size:.2g} %, and its numbers are a mean: "
    "let the damper settle, or fit shorter parts of the log",
    CONTRADICTED: "the gas force in {log} contradicts the signs of its channels: check and declare "
    "which way they are counted",
}
_SPOILING_ZERO = {
    "force_drift": "the mean force of {log} drifts by {size:.2g} % of the peak, and the numbers "
    "take it up: check amplifier and temperature"
}
_SPOILING_MISSED = {
    "rig_filter": "{log} looks filtered in the rig, and a misfit repeats: declare rig.filter",
    "force_smoothed": "the force of {log} is smoothed, and a misfit repeats: log it unfiltered",
    "values_repeated": "a converter of {log} is slow, and a misfit repeats: log at its own rate",
}
_LEAST = dict.fromkeys(("force_clipping", "displacement_clipping"), LIMITS.clipped_percent)
_LEAST["force_trend"] = LIMITS.trend_percent
# s; a 30 Hz filter spreads a jump over so much to both sides.
_REVERSAL = 0.02


@dataclass(frozen=True, slots=True)
class Objection:
    """One reason to withhold a grade."""

    # bound, beyond, log, cavitation, direction, offset, friction, dimensions, misfit, prediction
    # or delivery
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

    Without `gas` the offset is not looked at. `assumed` are undeclared dimensions, in
    words, as in "[damper] is not declared, and with the dimensions of a generic damper".
    """
    diagnoses = {diagnosis.setting: diagnosis for diagnosis in assessment.diagnoses}
    doubted = _doubted_dimensions(campaign, diagnoses, assumed)
    of_rig = _of_rig(campaign, diagnoses, assessment.apart)
    errors = {errors.setting: errors.intervals for errors in assessment.uncertainties}
    reasons = {
        fit.setting: (
            *_of_fit(fit, diagnoses.get(fit.setting), gas, of_rig[fit.setting]),
            *doubted.get(fit.setting, ()),
            *_turned_gas(fit, errors.get(fit.setting, {}), gas),
            *_stiff_gas(fit, diagnoses.get(fit.setting), gas),
        )
        for fit in campaign.fits
    }
    return {setting: why for setting, why in reasons.items() if why}


def doubted_cavitation(objections: Mapping[Setting, Sequence[Objection]]) -> frozenset[Setting]:
    """Return the settings whose grade is withheld for a chamber that is empty without need."""
    return frozenset(
        setting for setting, why in objections.items() if any(x.kind == "cavitation" for x in why)
    )


def _of_fit(  # noqa: PLR0912 - one reason after the other
    fit: Fit, diagnosis: Diagnosis | None, gas: GasFacts | None, of_rig: Sequence[str]
) -> Iterator[Objection]:
    values = fit.parameters
    for quantity in values.quantities:
        if fit.status[quantity.name] == Status.AT_BOUND:
            side, edge = edge_of(values, quantity.name)
            text = f"is at a bound of its range ({side} {edge:.3g}{quantity.unit_after})"
            yield Objection("bound", quantity.name, f"{quantity.symbol} {text}")
    fitted = [quantity for quantity in values.quantities if fit.status[quantity.name] in _FOUND]
    for quantity in fitted:
        value, scale, unit = values[quantity.name], 10.0**-quantity.power, quantity.shown_unit
        if not quantity.believable[0] <= value <= quantity.believable[1]:
            low, high = (scale * edge for edge in quantity.believable)
            most = f" to {high:g} {unit}" if math.isfinite(high) else f" {unit} or more"
            because = f": {quantity.belief}" if quantity.belief else ""
            text = f"{scale * value:.3g} {unit} is beyond {low:g}{most}{because}"
            yield Objection("beyond", quantity.name, f"{quantity.symbol} = {text}")
    spoilt = [*_spoiling(fit.logs, _SPOILING), *of_rig]
    if spoilt:
        yield Objection("log", "", spoilt[0])
    if diagnosis is None or math.isnan(diagnosis.noise_percent):
        is_missed = fit.mse_percent > LIMITS.misfit_percent  # much, where noise is not known
    else:
        is_missed = diagnosis.is_structured and fit.mse_percent > LIMITS.nothing_percent
        repeats, noise = diagnosis.repeating_percent, diagnosis.noise_percent
        least = LIMITS.misfit_percent if diagnosis.hints else LIMITS.nothing_percent
        if repeats > least and repeats > LIMITS.times_noise * noise:
            times = f"{rounded(repeats / noise)} times the noise" if noise else "without any noise"
            text = f"a misfit of {repeats:.2g} % repeats from cycle to cycle, {times}"
            yield Objection("misfit", "", text)
    seen = fit.cavitation
    is_doubted = is_missed or (diagnosis is not None and _repeats(diagnosis))
    if is_doubted and seen.fraction > LIMITS.cavitation:
        text = (
            f"chamber {seen.chamber} cavitates for {100.0 * seen.fraction:.0f} % of the cycle in "
        )
        text += "a model that does not match the log: no evidence supports it"
        yield Objection("cavitation", "", text)
    if not is_missed:
        return
    for q in values.quantities:
        off = offset_mismatch(fit, q.name, gas) if q.is_offset and gas is not None else None
        if off is not None and off[0] > LIMITS.offset:
            text = f"{q.symbol} is {values[q.name]:.0f} N where the log shows {off[1]:.0f} N"
            yield Objection("offset", q.name, text)
    for q in fitted:
        value = values[q.name]
        if q.is_friction and (ratio := jump_ratio(fit, value)) > LIMITS.jump:
            text = f"{q.symbol} = {value:.3g} N would need a jump of the force at each reversal "
            yield Objection("friction", q.name, f"{text}{ratio:.2g} times that of the log")


def _of_rig(
    campaign: Campaign, diagnoses: Mapping[Setting, Diagnosis], apart: Iterable[Problem]
) -> dict[Setting, list[str]]:
    """Return by setting what faults of the rig do to its numbers, its own or given by others."""
    otherwise = {
        problem.values["log"]: problem
        for problem in apart
        if "log" in problem.values and float(problem.values["percent"]) <= LIMITS.apart_percent
    }
    own: dict[Setting, list[str]] = {}
    missed: dict[Setting, list[str]] = {}
    for fit in campaign.fits:
        offsets = (q.name for q in fit.parameters.quantities if q.is_offset)
        is_held = any(fit.status[name] == Status.FIXED for name in offsets)
        is_missed = fit.setting in diagnoses and _repeats(diagnoses[fit.setting])
        own[fit.setting] = [*_spoiling(fit.logs, _SPOILING_ZERO if is_held else {})]
        for name in (log.trace.name for log in fit.logs if log.trace.name in otherwise):
            text = "the {what} of {log} is {percent} % off that of all others, and its numbers by "
            text += "about as much: check it, or identify another test by itself"
            own[fit.setting].append(text.format_map(otherwise[name].values))
        missed[fit.setting] = [*_spoiling(fit.logs, _SPOILING_MISSED if is_missed else {})]
    # These are one log's and spoil what its setting gives to all; a filter is that of all logs.
    given = [text for setting in campaign.sharing.taken.values() for text in own.get(setting, ())]
    if campaign.sharing.estimated:
        given += [text for texts in missed.values() for text in texts]
    # A load cell is the rig's: where one setting shows it, it bends the others too.
    hints = (hint for diagnosis in diagnoses.values() for hint in diagnosis.hints[:1])
    cells = (h for h in hints if h.name == "load_cell" and abs(h.amount) > LIMITS.cell_percent)
    common = [f"a misfit looks like {cell.words}: check it" for cell in cells]
    if campaign.sharing.friction_varies:
        text = "friction differs over the settings, and one value for all bends the others: free it"
        common.append(text)
    for setting in (s for s in own if s in diagnoses and diagnoses[s].is_structured):
        own[setting] += common
    return {setting: [*own[setting], *missed[setting], *given] for setting in own}


def _spoiling(logs: Iterable[LogFit], texts: Mapping[str, str]) -> Iterator[str]:
    """Yield what warnings of logs mean for the numbers, of those that have a text."""
    for trace in (log.trace for log in logs):
        for finding in trace.findings:
            size = abs(finding.values.get("value") or 0.0)
            is_warning = finding.code in texts and finding.severity == "warning"
            if is_warning and size >= _LEAST.get(finding.code, 0.0):
                yield texts[finding.code].format(log=trace.name, size=size)


def _turned_gas(
    fit: Fit, intervals: Mapping[str, Interval], gas: GasFacts | None
) -> Iterator[Objection]:
    """An offset that reverses the gas force, as two wrongly declared signs do."""
    for quantity in fit.parameters.quantities:
        error = intervals.get(quantity.name)
        if not quantity.is_offset or error is None or gas is None or gas.force < LEAST_GAS:
            continue
        symbol, value = quantity.symbol, fit.parameters[quantity.name]
        level, doubt = value - gas.force, math.hypot(error.error, error.misfit)
        if abs(level / gas.force - 1.0) < _TURNED and level > _CERTAIN * doubt:
            text = (
                f"{symbol} = {value:.0f} N reverses the gas force of {-gas.force:.0f} N, as if "
                "both channels were positive in compression: check the signs; hold "
                f"{symbol} if the load cell has such a zero"
            )
            yield Objection("direction", quantity.name, text)


def _stiff_gas(fit: Fit, diagnosis: Diagnosis | None, gas: GasFacts | None) -> Iterator[Objection]:
    """A gas spring that no damper of the declared size has, as of a force in another unit."""
    if gas is None or diagnosis is None or not _repeats(diagnosis):
        return
    spring = gas.exponent * gas.rod_area**2 * gas.pressure / gas.volume  # N/m
    for hint in diagnosis.hints:
        times = 1.0 + hint.amount / max(spring * full_stroke(fit), 1e-300)
        if hint.name == "gas_volume" and times > STIFFEST:
            text = f"the gas spring looks {times:.2g} times as stiff as that of the declared damper"
            yield Objection("dimensions", "", f"{text}: check the unit of the force, and [damper]")


def _repeats(diagnosis: Diagnosis) -> bool:
    """Whether it is many times the noise; never where that is not known."""
    repeats, noise = diagnosis.repeating_percent, diagnosis.noise_percent
    return diagnosis.is_structured and repeats > LIMITS.times_noise * noise


def _doubted_dimensions(
    campaign: Campaign, diagnoses: Mapping[Setting, Diagnosis], assumed: str
) -> dict[Setting, tuple[Objection]]:
    """Settings whose misfit looks like other dimensions, or has undeclared ones."""

    def is_of_gas(diagnosis: Diagnosis, *names: str) -> bool:
        """Whether nearly all that repeats is as of another gas spring."""
        is_named = bool(diagnosis.hints) and diagnosis.hints[0].name.startswith(("gas_", *names))
        return is_named and diagnosis.hints[0].share > LIMITS.dimensions

    # Dimensions are the damper's: where one setting has shown them to be wrong, the others in which
    # the same repeats are bent by them too, however little it is there.
    missed = (f.setting for f in campaign.fits if f.mse_percent > LIMITS.nothing_percent)
    bent = [diagnoses[s] for s in missed if s in diagnoses and _repeats(diagnoses[s])]
    # What a wrong gas pressure does is an offset at soft settings.
    is_gas_wrong = any(is_of_gas(diagnosis, "offset") for diagnosis in bent)
    doubted = {}
    for setting, diagnosis in diagnoses.items() if bent else ():
        if not diagnosis.is_structured or not (assumed or (is_gas_wrong and is_of_gas(diagnosis))):
            continue
        whole, noise = diagnosis.mse_percent, diagnosis.noise_percent
        text = f"the MSE is {whole:.2g} %, of which only {noise:.2g} % is noise"
        because = "" if assumed else f", and the rest looks like {diagnosis.hints[0].words}"
        text = f"{assumed} {text}{because}: declare the damper as it is".lstrip()
        doubted[setting] = (Objection("dimensions", "", text),)
    return doubted


def offset_mismatch(fit: Fit, name: str, gas: GasFacts) -> tuple[float, float] | None:
    """Return an offset's distance from the logs', over what that may be wrong by, and that, N."""
    value = getattr(fit.parameters, name)
    distances = []
    # Of the log that is farthest, of those that hide it least.
    levels = [force_level(log.trace, gas) for log in fit.logs if log.trace.n_cycles]
    most = _AS_CLEAR * min((level.doubt for level in levels), default=0.0)
    for level in (level for level in levels if level.doubt <= most):
        seen = level.force - level.expected
        allowed = _OF_UNCERTAINTY * level.uncertainty + level.held + _OF_GAS * gas.inside
        if math.isfinite(seen) and allowed > 0.0:
            distances.append((abs(value - seen) / allowed, seen))
    return max(distances, default=None)


def jump_ratio(fit: Fit, friction: float) -> float:
    """Return the jump of a Coulomb friction at the reversals over that of the logs.

    Both behind the same filter and lag, over 20 ms to both sides. Valves add to the jump: a sound
    damper has less than 1. NaN where something spreads the jump, or nothing repeats.
    """
    if what_spreads(fit):
        return math.nan
    ratios = []
    for trace in (log.trace for log in fit.logs if log.trace.n_cycles):
        v = trace.drive.velocity
        (turning,) = behind_lag(friction * np.sign(v)[None], trace.interval, _lag(fit))
        jump = apply_filter(trace.model_filter, turning)
        reach = max(1, round(_REVERSAL / trace.interval))
        places = np.flatnonzero(np.signbit(v[:-1]) != np.signbit(v[1:]))
        inside = np.zeros(len(v), dtype=bool)
        inside[trace.compared] = True
        places = places[(places >= reach) & (places + 1 + reach < len(v))]
        before = places[inside[places - reach] & inside[places + 1 + reach]] - reach
        after = before + 2 * reach + 1
        sign = np.sign(v[after])
        # Against the motion where the force is late or of the other sign.
        seen = sign @ (trace.force[after] - trace.force[before])
        if seen > 0.0:
            ratios.append(float(sign @ (jump[after] - jump[before]) / seen))
    return max(ratios, default=math.nan)


def what_spreads(fit: Fit) -> str:
    """Say what spreads the jump of a friction beyond what it is read over; empty where nothing."""
    lag = _lag(fit)
    late = f"the force channel lags by {1e3 * lag:.2g} ms" if lag else ""
    if any(quantity.unit == "N/m" for quantity in fit.parameters.quantities):
        also = f" and {late}" if lag else ""
        return f"the mounting is elastic{also}, which spreads the jump at a reversal"
    return f"{late}, which spreads the jump at a reversal" if lag > _REVERSAL else ""


def _lag(fit: Fit) -> float:
    """Lag of the force channel, s; 0 in a model without one."""
    lags = [quantity.name for quantity in fit.parameters.quantities if quantity.unit == "s"]
    return sum(float(getattr(fit.parameters, name)) for name in lags)


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
    offsets = {quantity.name for quantity in damper.quantities if quantity.is_offset}
    has_offset = any(fit.status[name] != Status.FIXED for fit in campaign.fits for name in offsets)
    if damper.name != PURDY_DAMPER.name or has_offset or not campaign.fits:
        return {}
    inside = replace(damper.plain, ambient_pressure=AMBIENT)  # type: ignore[type-var]
    with_air: Model = inside if damper.plain is damper else replace(damper, damper=inside)  # type: ignore[type-var]
    held = {Status.FIXED, Status.ABSENT}
    free = {
        fit.setting: {
            n: fit.parameters[n] for n, status in fit.status.items() if status not in held
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
    noise = {diagnosis.setting: diagnosis.noise_percent for diagnosis in assessment.diagnoses}

    def squares(fit: Fit, log: LogFit, law: Model) -> FloatArray:
        modelled = compare(fit.parameters, log.trace, law, solver=options.solver).force
        return np.asarray((log.trace.force - modelled) ** 2)

    gains: list[float] = []  # by how much the squares are less with the air, N^2, cycle by cycle
    for fit, other in pairs:
        if not other.mse_percent <= _OF_NOISE * noise.get(fit.setting, math.nan):
            continue
        for first, second in zip(fit.logs, other.logs, strict=True):
            fall = squares(fit, first, damper) - squares(other, second, with_air)
            for segment in first.trace.segments:
                cycles = np.array_split(fall[segment.window], max(segment.n_cycles, 1))
                gains += [float(np.sum(cycle)) for cycle in cycles]
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


def is_certain(gains: Sequence[float]) -> bool:
    """Whether the mean of what is gained is above nothing by far more than chance."""
    n = len(gains)
    return n > 1 and bool(np.mean(gains) > _CERTAIN * np.std(gains, ddof=1) / math.sqrt(n))


# What is held out


@dataclass(frozen=True, slots=True)
class SegmentRange:
    """The segments of a log that have a frequency, or a peak speed, within limits."""

    dimension: str  # "frequency" or "velocity"
    low: float  # both limits are included, Hz or m/s
    high: float

    @classmethod
    def parse(cls, text: str) -> SegmentRange | None:
        """Return the range that a text says, as in "4Hz-10Hz" or "0.2m/s-"; None: it says none.

        A ConfigurationError: the upper limit lies below the lower one.

        Examples
        --------
        >>> SegmentRange.parse("0.2m/s-")
        SegmentRange(dimension='velocity', low=0.2, high=inf)
        >>> SegmentRange.parse("run-2.csv") is None
        True
        """
        number = r"(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?"
        for dimension, units in (("frequency", "k?Hz"), ("velocity", "m?m/s|in/s")):
            limit = f"({number} ?(?:{units}))?"
            match = re.fullmatch(f"{limit} ?- ?{limit}", text.strip(), re.IGNORECASE)
            if match is None or not any(match.groups()):
                continue
            low, high = (
                parse_quantity(end, dimension) if end else default
                for end, default in zip(match.groups(), (0.0, math.inf), strict=True)
            )
            if low > high:
                raise ConfigurationError(
                    f"{text}: the upper limit lies below the lower one; expected as in 4Hz-10Hz",
                    code="out-of-range",
                )
            return cls(dimension, low, high)
        return None

    def holds(self, segment: Segment) -> bool:
        """Whether a segment lies within the limits."""
        is_speed = self.dimension == "velocity"
        return self.low <= (segment.peak_speed if is_speed else segment.frequency) <= self.high

    def split(self, trace: Trace) -> tuple[Trace | None, Trace | None]:
        """Return a log without the segments within the limits, and these alone; None for none."""
        held = tuple(part for part in trace.segments if self.holds(part))
        rest = tuple(part for part in trace.segments if not self.holds(part))
        without, alone = (replace(trace, segments=kept) if kept else None for kept in (rest, held))
        return without, alone


def split_cycles(trace: Trace, cycles: float) -> tuple[Trace, Trace]:
    """Return a log without its last steady cycles, and with these alone.

    A whole number, or below 1 a share of them (one at least). A segment with too few is fitted
    whole; a LogError: no cycle would be left to fit.
    """
    fitted, held_out = [], []
    for segment in trace.segments:
        # The last ones of each, in one piece: where a log drifts, it shows there, and the filter's
        # memory joins the two parts at one place only.
        n, starts = segment.n_cycles, segment.cycle_starts
        left = n - (max(1, round(cycles * n)) if cycles < 1.0 else round(cycles))
        if left <= 0:
            fitted.append(segment)
            continue
        edge, (ahead, behind) = round(float(starts[left])), segment.smeared
        inner, outer = starts[: left + 1], starts[left:]
        fitted.append(replace(segment, stop=edge, cycle_starts=inner, smeared=(ahead, 0)))
        held_out.append(replace(segment, first=edge, cycle_starts=outer, smeared=(0, behind)))
    if not held_out:
        n = max(segment.n_cycles for segment in trace.segments)
        raise LogError(
            f"{n} steady cycle{'s' if n > 1 else ''}, of which {max(1, round(cycles))} are to be "
            "held out: none is left to fit; hold out fewer, or give a longer log",
            subject=trace.name,
            code="nothing-to-fit",
        )
    return replace(trace, segments=tuple(fitted)), replace(trace, segments=tuple(held_out))


# How it is predicted

# Twice the expected square is beyond the scatter of an MSE over a cycle or more; ten times is a
# misfit three times as large as where the model was fitted.
_WORSE = 2.0
_NOT_PREDICTED = 10.0
# Of the deviation of the fitted forces. The first quarter of a cycle at the slowest of several
# speeds has a thirtieth of it, and friction that turns in the noise of a sensor a hundredth.
_SMALL = 0.01
# Times the noise of the velocity that drives the model; slower than that chance decides which way
# friction acts. A run-down at 0.2 Hz spends a quarter of its time there: of the exact truth 36 of
# 44 % were missed in it, and beyond three deviations no more than everywhere. With less than the
# second share of the variance left nothing is tested.
_OF_CHANCE = 3.0
_LEAST_TESTED = 0.3
# N; a load cell drifts by less between tests.
_TOLD_OFFSET = 1.0
# A tenth of what is asked of a prediction: a model that carries over to another motion may have it.
PREDICTED_PERCENT = 0.05
# Stroke and peak speed that differ by less are one motion: rigs repeat both to a per cent or two.
_SAME_MOTION = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """How the parameters of a setting meet what was not fitted."""

    setting: Setting
    trace: Trace  # what was predicted; its segments hold the held-out cycles only
    is_part: bool  # whether the other cycles of the same log were fitted
    mse_percent: float  # eq. (22) over them,
    noise_floor_percent: float  # and the part that is scatter between its cycles; NaN for one
    fitted_mse_percent: float  # eq. (22) over the logs that were fitted
    # What the MSE would be with the lack of fit of the fitted logs and the noise, of both channels,
    # of this one; at another motion at least what matters, 0.05 %, for noise of the displacement
    # costs far more at low speed, and a single cycle does not show how much.
    expected_mse_percent: float
    # Whether its strokes and speeds were all fitted too: then it shows drift and scatter, and
    # every law that was bent to the one meets the other.
    is_same_motion: bool = False
    is_same_speed: bool = False  # whether its peak speeds were all fitted, at other strokes
    # No log of its setting was fitted: its values are put together from those of other settings
    # with the same clicks; a force offset, which is each test's own, is taken from the log.
    is_unseen: bool = False
    # Of those the values to which the logs of these settings set no upper limit.
    unlimited: tuple[str, ...] = ()
    # N, of the log beyond the fitted one, where that is a number of each test and not counted: of
    # another log and another motion, whose rig may have been tared anew. 0: it is counted.
    own_offset: float = 0.0
    # Of the force's variance, in the samples that are compared: beside cycles those in which the
    # velocity is within its own noise are left out, for chance turns the friction there.
    tested_share: float = 1.0

    @property
    def ratio(self) -> float:
        """MSE over the one expected; about 1 for a model that carries over."""
        return self.mse_percent / max(self.expected_mse_percent, 1e-300)

    @property
    def is_test(self) -> bool:
        """Whether enough of the force lies where the model can be tested."""
        return self.tested_share >= _LEAST_TESTED

    @property
    def is_failed(self) -> bool:
        """Whether it is met clearly worse than what was fitted."""
        return self.is_test and self.ratio >= _WORSE

    @property
    def cycles(self) -> str:
        """Which of the log's steady cycles, in words; "transients": what moves beside them."""
        n = self.trace.n_cycles
        words = f"last {n}" if self.is_same_motion else f"{n} of other segments"
        return "all" if not self.is_part else words if n else TRANSIENTS

    @property
    def verdict(self) -> str:
        """The ratio in words, and whether it tests the model at all."""
        if not self.is_test:
            share = 100.0 * (1.0 - self.tested_share)
            words = f"no test: {share:.0f} % of the force's variance is within the speed's noise"
        elif self.is_failed and self.ratio >= _NOT_PREDICTED:
            words = f"not predicted: {float(f'{self.ratio:.2g}'):.0f} times the expected MSE"
        elif self.is_failed:
            # 9.96 rounded up would say that the log is not predicted.
            words = f"worse than fitted: {min(self.ratio, 9.9):.2g} times the expected MSE"
        elif self.mse_percent < _NOT_PREDICTED * self.fitted_mse_percent:
            words = "predicted as well as fitted"
        else:
            words = f"predicted within the expected {self.expected_mse_percent:.2g} %"
        if self.is_unseen:
            words += "; parameters combined from settings that share its clicks"
            names = ", ".join(self.unlimited)
            return f"{words}, whose logs do not determine {names}" if names else words
        if self.is_same_motion:
            return f"{words}; same stroke and speed as the fitted logs, so no test of the model"
        own = float(f"{self.own_offset:.2g}")
        if abs(own) >= _TOLD_OFFSET:
            words += f"; with its own force offset, {own:+g} N from the fitted"
        if self.is_same_speed:
            words += "; peak speeds are those of the fitted logs, so it proves little"
        return words

    def describe(self) -> dict[str, Any]:
        """Return the prediction for run.json."""
        return {
            "setting": self.setting,
            "log": self.trace.name,
            "cycles": self.cycles,
            "amplitude_m": self.trace.amplitude,
            "frequency_Hz": self.trace.frequency,
            "mse_percent": self.mse_percent,
            "noise_floor_percent": self.noise_floor_percent,
            "fitted_mse_percent": self.fitted_mse_percent,
            "expected_mse_percent": self.expected_mse_percent,
            "is_same_motion": self.is_same_motion,
            "is_same_speed": self.is_same_speed,
            "is_unseen": self.is_unseen,
            "unlimited": list(self.unlimited),
            "own_offset_N": self.own_offset,
            "tested_share": self.tested_share,
            "verdict": self.verdict,
        }


def predict(
    campaign: Campaign,
    assessment: Assessment,
    traces: Sequence[Trace],
    *,
    damper: Model,
    solver: SolverOptions = SolverOptions(tolerance=1e-2),
) -> tuple[Prediction, ...]:
    """Predict held-out logs with the parameters of their settings, by setting; a simulation each.

    Those of a setting without a fit are predicted where others of a joint fit have its clicks;
    else, or where they cannot be simulated, they are left out. An empty assessment: all misfit of
    the fitted logs counts as lack of fit.
    """
    fits = {fit.setting: fit for fit in campaign.fits}
    parameters = {setting: fit.parameters for setting, fit in fits.items()}
    # Nothing is known of the scatter of a single cycle: then all of the misfit is lack of fit.
    known = (d for d in assessment.diagnoses if not math.isnan(d.noise_percent))
    noise = {diagnosis.setting: diagnosis.noise_percent for diagnosis in known}
    unlimited = {fit.setting: assessment.unlimited(fit) for fit in campaign.fits}
    lacks = [max(fit.mse_percent - noise.get(fit.setting, 0.0), 0.0) for fit in campaign.fits]
    predictions = []
    for trace in traces:
        if trace.setting is None:
            continue
        setting, fit = Setting.of(trace.setting), fits.get(trace.setting)
        values = values_from_others(parameters, setting) if fit is None else fit.parameters
        if values is None:
            continue
        try:
            seen = compare(values, trace, damper, solver=solver)
        except SimulationError:
            continue
        if fit is not None:
            predictions.append(_prediction(fit, trace, seen, noise.get(fit.setting, 0.0)))
            continue
        measured, simulated = trace.force[trace.compared], seen.force[trace.compared]
        if any(quantity.is_offset for quantity in values.quantities):
            simulated = simulated + float(np.mean(measured - simulated))
        expected = float(np.mean(lacks)) + _noise(trace, measured - simulated, 0.0)
        predictions.append(
            Prediction(
                setting=setting,
                trace=trace,
                is_part=False,
                mse_percent=normalised_mse(measured, simulated),
                noise_floor_percent=noise_floor(trace),
                fitted_mse_percent=float(np.mean([fit.mse_percent for fit in campaign.fits])),
                expected_mse_percent=max(expected, PREDICTED_PERCENT),
                is_unseen=True,
                unlimited=unlimited_in(values, parameters, unlimited),
            )
        )
    return tuple(sorted(predictions, key=lambda prediction: prediction.setting))


def _prediction(fit: Fit, trace: Trace, seen: SimulatedLog, fitted_noise: float) -> Prediction:
    measured, simulated = trace.force[trace.compared], seen.force[trace.compared]
    fitted = np.concatenate([log.trace.force[log.trace.compared] for log in fit.logs])
    elsewhere = 0.01 * fitted_noise * float(np.var(fitted))
    noise = _noise(trace, measured - simulated, elsewhere)
    is_part = any(log.trace.name == trace.name for log in fit.logs)
    is_same_motion = _is_same_motion(fit, trace)
    # An offset that the fit has found is that of its own logs, and no number of the damper.
    is_tared = any(
        quantity.is_offset and fit.status[quantity.name] in {Status.FITTED, Status.SHARED}
        for quantity in fit.parameters.quantities
    )
    offset, share = 0.0, 1.0
    if is_tared and not is_part and not is_same_motion:
        offset = float(np.mean(measured - simulated))
        simulated = simulated + offset
    if is_part and not trace.n_cycles:
        # The MSE below which no law is asked to explain more of what moves beside cycles.
        least = _SMALL * float(np.std(fitted)) / float(np.std(measured))
        noise = max(noise, 100.0 * least**2)
        tested = _tested(trace)
        spread = (measured - np.mean(measured)) ** 2
        share = float(np.sum(spread[tested]) / np.sum(spread))
        if share >= _LEAST_TESTED:
            measured, simulated = measured[tested], simulated[tested]
    expected = max(fit.mse_percent - fitted_noise, 0.0) + noise
    return Prediction(
        setting=fit.setting,
        trace=trace,
        is_part=is_part,
        mse_percent=normalised_mse(measured, simulated),
        noise_floor_percent=noise_floor(trace),
        fitted_mse_percent=fit.mse_percent,
        expected_mse_percent=expected if is_same_motion else max(expected, PREDICTED_PERCENT),
        is_same_motion=is_same_motion,
        is_same_speed=_is_same_motion(fit, trace, has_same_stroke=False),
        own_offset=offset,
        tested_share=share,
    )


def _noise(trace: Trace, rest: FloatArray, elsewhere: float) -> float:
    """MSE from scatter between a residual's cycles, %; of a single cycle as `elsewhere`."""
    scatter = sum(
        segment.n_samples
        * (residual_scatter(rest[place], segment) if segment.n_cycles > 1 else elsewhere)
        for segment, place in zip(trace.segments, trace.places, strict=True)
    )
    variance = float(np.var(trace.force[trace.compared]))
    percent = 100.0 * scatter / trace.n_samples / variance if variance else math.nan
    return 0.0 if math.isnan(percent) else percent  # of a single cycle, or of a constant force


def _tested(trace: Trace) -> NDArray[np.bool_]:
    """Return the compared samples whose speed is beyond its noise, which turns friction there."""
    noises = (
        finding.values["value"]
        for finding in trace.findings
        if finding.code == "displacement_noise"
    )
    displacement = 1e-6 * (next(noises, None) or 0.0)
    corner = min(trace.drive.corner, 0.5 / trace.interval)
    passed = math.sqrt(2.0 * corner * trace.interval) * 2.0 * math.pi * corner / math.sqrt(3.0)
    speed = np.abs(trace.drive.velocity[trace.compared])
    return np.asarray(speed > _OF_CHANCE * passed * displacement)


def _is_same_motion(fit: Fit, trace: Trace, *, has_same_stroke: bool = True) -> bool:
    """Whether every segment of a log has the speed of a fitted one, and its stroke; no road has."""
    fitted = [segment for log in fit.logs for segment in log.trace.segments if segment.n_cycles]
    return all(
        segment.n_cycles
        and any(
            (not has_same_stroke or abs(segment.amplitude / other.amplitude - 1.0) < _SAME_MOTION)
            and abs(segment.peak_speed / other.peak_speed - 1.0) < _SAME_MOTION
            for other in fitted
        )
        for segment in trace.segments
    )


# What follows from it


def prediction_warnings(predictions: Sequence[Prediction]) -> tuple[Problem, ...]:
    """Return one problem for all predictions that fail, led by the worst; none where none does."""
    failed = [prediction for prediction in predictions if prediction.is_failed]
    if not failed:
        return ()
    worst = max(failed, key=lambda prediction: prediction.ratio)
    code, what = "not-predicted", "the parameters hold for the fitted tests, not for the damper"
    if worst.is_same_motion:
        code = "drifted"
        what = "repeats of fitted tests differ from them: the rig or the damper has drifted"
    which = "{n_failed} of {n} held-out logs are predicted worse than the fitted ones, most {log}: "
    if all(prediction.cycles == TRANSIENTS for prediction in failed):
        which = (
            "transients, which are not fitted, are predicted worse than the steady cycles in "
            "{n_failed} of {n} logs, most in {log}: "
        )
    counts = {"n_failed": len(failed), "n": len(predictions)}
    text = which + "{verdict}; " + what
    return (warning(code, text, **counts, log=worst.trace.name, verdict=worst.verdict),)


def missed_predictions(predictions: Iterable[Prediction]) -> dict[Setting, Objection]:
    """Return by setting the held-out test that is missed most, as a reason to withhold its grade.

    Of fitted settings and of other motions: a repeat that is missed shows drift, not a wrong law.
    """
    missed = {}
    for prediction in sorted(predictions, key=lambda missed: missed.mse_percent):
        bars = LIMITS.predicted_percent, LIMITS.predicted_times
        is_much = prediction.mse_percent > bars[0] and prediction.ratio > bars[1]
        if not is_much or prediction.is_same_motion or prediction.is_unseen:
            continue
        what, was, is_missed = prediction.trace.name, "was", "is"
        if prediction.cycles == TRANSIENTS:
            what = f"the run-up, coast-down or changes of speed of {what}"
            was, is_missed = "were", "are"
        there, expected = map(rounded, (prediction.mse_percent, prediction.expected_mse_percent))
        text = (
            f"{what}, which {was} not fitted, {is_missed} predicted with an MSE of {there} % where "
            f"{expected} % is expected: the numbers hold for the motion that was fitted"
        )
        missed[prediction.setting] = Objection("prediction", "", text)  # the worst, last, stands
    return missed
