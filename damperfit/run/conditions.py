"""What the tests of a damper show of gas pressure, temperature and the air on the rod."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.valve_dampers import AMBIENT
from damperfit.damper.warmed import BETA, Warmed
from damperfit.errors import ConfigurationError, DamperfitError
from damperfit.identification import GivenStart, Status, identify
from damperfit.problem import Option
from damperfit.run.duplicate_tests import moves_alike
from damperfit.uncertainty import Objection

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.damper.model import Model
    from damperfit.identification import Campaign, Fit
    from damperfit.recording import Trace
    from damperfit.run.logs import LogBatch
    from damperfit.simulation import SolverOptions
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty import Assessment

__all__ = [
    "LEAST_WARMTH",
    "air_objections",
    "check_temperatures",
    "rod_area_ratio",
    "with_reference",
    "with_rod_remark",
]


# The air on the rod, which the paper's equation leaves out, where the logs show that it is there.
#
# The air presses the rod in with a_r P_amb, 11 N on a rod of 12 mm and 39 N on one of 22 mm. A
# load cell that was zeroed without the damper sees it. Where the model leaves it out, R_m3 and
# friction take its place and the MSE hardly rises; but it rises in every cycle, and that can be
# seen.

# Standard errors by which the squares of the residuals must fall, cycle by cycle: Q. H. Vuong,
# Econometrica 57 (1989), of two models neither of which is a case of the other.
_CERTAIN = 4.0
# Times the noise: a model that misses by more than its noise says nothing of a few newtons.
_OF_NOISE = 2.0


def air_objections(
    configuration: Configuration,
    campaign: Campaign,
    assessment: Assessment,
    *,
    jobs: int,
) -> dict[Setting, Objection]:
    """Return why no grade stands where the logs of the paper's model show the air on the rod.

    They are fitted again with 1.013 bar of air. Nothing where somebody has declared the air or
    has declared no damper, where an offset takes its place, or where it is not needed.

    Parameters
    ----------
    configuration : Configuration
        The complete configuration.
    campaign : Campaign
        The fits without it.
    assessment : Assessment
        What of their MSE is noise.
    jobs : int
        Threads.
    """
    damper = configuration.damper
    if not _is_open(configuration, campaign):
        return {}
    inside = replace(damper.plain, ambient_pressure=AMBIENT)  # type: ignore[type-var]
    with_air: Model = inside if damper.plain is damper else replace(damper, damper=inside)  # type: ignore[type-var]
    options = configuration.identification
    start = GivenStart(
        by_setting={fit.setting: _free_of(fit) for fit in campaign.fits}, named=options.start.named
    )
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
    if not _is_certain(gains):
        return {}
    return {fit.setting: _objection(fit, other) for fit, other in pairs}


def _is_open(configuration: Configuration, campaign: Campaign) -> bool:
    """Whether the paper's equation was taken for another damper, with nothing for the air."""
    is_declared = "damper.ambient_pressure" in configuration.declared or configuration.is_assumed
    if configuration.damper.name != PURDY_DAMPER.name or is_declared or not campaign.fits:
        return False
    return not any(_has_offset(fit) for fit in campaign.fits)


def _has_offset(fit: Fit) -> bool:
    offsets = [one.name for one in fit.parameters.quantities if one.is_offset]
    return any(fit.status[name] != Status.FIXED for name in offsets)


def _free_of(fit: Fit) -> dict[str, float]:
    return {
        name: getattr(fit.parameters, name)
        for name, status in fit.status.items()
        if status not in {Status.FIXED, Status.ABSENT}
    }


def _gains(
    one: tuple[Fit, Model], other: tuple[Fit, Model], solver: SolverOptions
) -> Iterator[float]:
    """Yield by how much the other fit's squares are less, N^2, cycle by cycle."""
    for first, second in zip(one[0].logs, other[0].logs, strict=True):
        squares = [
            (log.trace.force - log.compared(fit.parameters, damper, solver).force) ** 2
            for log, (fit, damper) in ((first, one), (second, other))
        ]
        for stretch in first.trace.stretches:
            fall = (squares[0] - squares[1])[stretch.window]
            for cycle in np.array_split(fall, max(stretch.n_cycles, 1)):
                yield float(np.sum(cycle))


def _is_certain(gains: Sequence[float]) -> bool:
    """Whether the mean of what is gained is above nothing by far more than chance."""
    if len(gains) < 2:
        return False
    error = float(np.std(gains, ddof=1)) / math.sqrt(len(gains))
    return float(np.mean(gains)) > _CERTAIN * error


def _objection(fit: Fit, other: Fit) -> Objection:
    bar = AMBIENT / 1e5
    return Objection(
        "dimensions",
        "",
        f"the logs show the air on the rod, which the paper's equation leaves out: with {bar:.4g} "
        f"bar the MSE is {other.mse_percent:.3g} % instead of {fit.mse_percent:.3g} %: set "
        'damper.ambient_pressure = "1.013bara", unless gas_pressure is declared 1 bar too high',
    )


# The rod's area, as the level of the force over the gas pressures of several tests tells it.

# Pressures nearer than this tell the rod's area badly; an area further off than that is another's.
_APART, _OFF = 0.1, 0.05


def rod_area_ratio(traces: Sequence[Trace], damper: Model) -> float | None:
    """Return the rod's area over the declared one, as the level of the force over pressure tells.

    Of tests of one setting and one motion at gas pressures of their own: there the mean force
    differs by the gas alone. None where there are no such tests.

    Parameters
    ----------
    traces : sequence of Trace
        Of one damper.
    damper : Model
        As declared.
    """
    by_setting: dict[Setting | None, list[int]] = defaultdict(list)
    for place, trace in enumerate(traces):
        if trace.gas_pressure is not None:
            by_setting[trace.setting].append(place)
    pairs = (itertools.combinations(places, 2) for places in by_setting.values())
    seen = expected = 0.0
    for first, second in sorted(itertools.chain.from_iterable(pairs)):
        one, other = traces[first], traces[second]
        if not moves_alike(one, other):
            continue
        levels = [_level(trace, damper) for trace in (one, other)]
        known = [gas for _, gas in levels if gas is not None]
        if len(known) < len(levels) or abs(known[0] - known[1]) < _APART * max(map(abs, known)):
            continue
        # Each pair by its own difference: a small one says little.
        weight = known[0] - known[1]
        seen += weight * (levels[0][0] - levels[1][0])
        expected += weight**2
    return seen / expected if expected else None


def with_rod_remark(batch: LogBatch, damper: Model) -> LogBatch:
    """Return the batch with a word where the pressures tell of another rod than is declared."""
    ratio = rod_area_ratio(batch.traces, damper)
    if ratio is None or abs(ratio - 1.0) <= _OFF:
        return batch
    said = (
        "the level of the force over the gas pressures of the tests corresponds to a rod of "
        f"{ratio:.3g} times the declared area: check rod_diameter, the pressures, and whether the "
        "force was tared between the tests"
    )
    return replace(batch, remarks=(*batch.remarks, said))


def _level(trace: Trace, damper: Model) -> tuple[float, float | None]:
    """Mean force of the compared part, measured and that of the gas alone, N."""
    part = trace.compared
    gas = damper.filled_to(trace.gas_pressure).rest_force(trace.displacement[part])
    return float(np.mean(trace.force[part])), None if gas is None else float(np.mean(gas))


# Logs of several temperatures: whether they tell what it does, and what it is told for.

# K between the coldest and the warmest log. At 1 to 4 % a kelvin the viscosity then changes by 3 to
# 12 %, where settings repeat within a few per cent.
LEAST_WARMTH = 3.0


def check_temperatures(
    configuration: Configuration, traces: Sequence[Trace], held_out: Sequence[Trace] = ()
) -> None:
    """Refuse logs without a temperature where the damper follows it.

    Before logs are asked whether they contradict each other: cold and warm ones do, unless it is
    known that they are.

    Parameters
    ----------
    configuration : Configuration
        Of a damper that follows the temperature, or of any other.
    traces : sequence of Trace
        What is fitted.
    held_out : sequence of Trace
        What is predicted.

    Raises
    ------
    ConfigurationError
        A log has no temperature.
    """
    if not isinstance(configuration.damper, Warmed):
        return
    lacking = [trace.name for trace in (*traces, *held_out) if trace.temperature is None]
    if lacking:
        more = f" and {len(lacking) - 1} more" if len(lacking) > 1 else ""
        raise ConfigurationError(
            f"{lacking[0]}{more} {'have' if more else 'has'} no "
            "temperature; expected a channel, a line '# temperature: 31', a column of tests.csv or "
            "tested_at in a profile",
            where=Option("covariate", "temperature"),
        )


def with_reference(
    configuration: Configuration, traces: Sequence[Trace], held_out: Sequence[Trace] = ()
) -> Configuration:
    """Return the configuration with the temperature that the damper's resistances are told for.

    Parameters
    ----------
    configuration : Configuration
        Of a damper that follows the temperature, or of any other, which stays as it is.
    traces : sequence of Trace
        What is fitted.
    held_out : sequence of Trace
        What is predicted, each at its own temperature.

    Raises
    ------
    ConfigurationError
        A log has no temperature, or all have nearly the same.
    """
    damper = configuration.damper
    if not isinstance(damper, Warmed) or not traces:
        return configuration
    check_temperatures(configuration, traces, held_out)
    known = [trace.temperature for trace in traces if trace.temperature is not None]
    reach = max(known) - min(known)
    if reach < LEAST_WARMTH:
        ends = f"{min(known):.1f} to {max(known):.1f}"
        if f"{min(known):.1f}" == f"{max(known):.1f}":
            ends = f"{min(known):.1f}"
        raise ConfigurationError(
            f"the logs are {'' if ' ' in ends else 'all '}of {ends} degC; "
            f"the effect of temperature cannot be determined over less than "
            f"{LEAST_WARMTH:g} K: test colder or warmer too, or leave the option out",
            where=Option("covariate", "temperature"),
        )
    _check_told(configuration, damper, traces)
    reference = damper.reference
    if math.isnan(reference):
        reference = round(sum(known) / len(known), 1)
    document = dict(configuration.document)
    document["damper"] = {**document["damper"], "reference_temperature": reference}
    return replace(configuration, damper=replace(damper, reference=reference), document=document)


def _check_told(configuration: Configuration, damper: Warmed, traces: Sequence[Trace]) -> None:
    """Refuse logs in which whatever temperature does could as well be the setting's."""
    options = configuration.identification
    if BETA.name in options.fixed:
        return
    warmths: dict[str, list[float]] = {}
    for trace in traces:
        if trace.temperature is not None:
            warmths.setdefault(str(trace.setting), []).append(trace.temperature)
    alone = [one for one, known in warmths.items() if max(known) - min(known) < LEAST_WARMTH]
    if options.procedure == "plain" and alone:
        raise ConfigurationError(
            f"setting {alone[0]} was tested within {LEAST_WARMTH:g} K, "
            "and procedure plain fits each setting by itself, so that beta cannot be determined "
            "there: take procedure joint, with one beta for all settings, or leave the option out",
            where=Option("covariate", "temperature"),
        )
    is_open = options.is_detecting or bool(options.follows)
    held = {*(options.share or ()), *options.fixed}
    if options.procedure == "joint" and len(alone) == len(warmths) and not is_open:
        names = damper.viscous
        if held.isdisjoint(names):
            raise ConfigurationError(
                f"each setting was tested within {LEAST_WARMTH:g} K, and "
                f"{' and '.join(names)} are each setting's own, so that beta cannot be determined: "
                "test one setting cold and warm, or share one of them ({share})",
                share=Option("share"),
                where=Option("covariate", "temperature"),
            )
