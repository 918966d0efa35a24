"""Logs of several temperatures: whether they tell what it does, and what it is told for."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.damper.warmed import BETA, Warmed
from damperfit.errors import ConfigurationError
from damperfit.problem import Option

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.recording import Trace


# K between the coldest and the warmest log. At 1 to 4 % a kelvin the viscosity then changes by 3 to
# 12 %, where settings repeat within a few per cent.
_LEAST = 3.0
_WHERE = Option("covariate", "temperature")


def check_temperatures(configuration: Configuration, traces: Iterable[Trace]) -> None:
    """Refuse logs without a temperature where the damper follows it.

    Before logs are asked whether they contradict each other: cold and warm ones do, unless it is
    known that they are.

    Raises
    ------
    ConfigurationError
        A log has no temperature.
    """
    lacking = [trace.name for trace in traces if trace.temperature is None]
    if lacking and isinstance(configuration.damper, Warmed):
        more = f" and {len(lacking) - 1} more" if len(lacking) > 1 else ""
        raise ConfigurationError(
            f"{lacking[0]}{more} {'have' if more else 'has'} no "
            "temperature; expected a channel, a line '# temperature: 31', a column of tests.csv or "
            "tested_at in a profile",
            where=_WHERE,
        )


def with_reference(configuration: Configuration, traces: Sequence[Trace]) -> Configuration:
    """Return the configuration with the temperature that the damper's resistances are told for.

    Parameters
    ----------
    configuration : Configuration
        Of a damper that follows the temperature, or of any other, which stays as it is.
    traces : sequence of Trace
        What is fitted; each has a temperature.

    Raises
    ------
    ConfigurationError
        All logs have nearly the same temperature, or whatever it does could be the setting's.
    """
    damper = configuration.damper
    if not isinstance(damper, Warmed) or not traces:
        return configuration
    known = [trace.temperature for trace in traces if trace.temperature is not None]
    if max(known) - min(known) < _LEAST:
        ends = dict.fromkeys(f"{one:.1f}" for one in (min(known), max(known)))
        raise ConfigurationError(
            f"the logs are {'all ' * (len(ends) == 1)}of {' to '.join(ends)} degC; "
            f"the effect of temperature cannot be determined over less than "
            f"{_LEAST:g} K: test colder or warmer too, or leave the option out",
            where=_WHERE,
        )
    _check_determined(configuration, damper, traces)
    reference = damper.reference
    if math.isnan(reference):
        reference = round(sum(known) / len(known), 1)
    document = dict(configuration.document)
    document["damper"] = {**document["damper"], "reference_temperature": reference}
    return replace(configuration, damper=replace(damper, reference=reference), document=document)


def _check_determined(
    configuration: Configuration, damper: Warmed, traces: Sequence[Trace]
) -> None:
    """Refuse logs in which whatever temperature does could as well be the setting's."""
    options = configuration.identification
    if BETA.name in options.fixed:
        return
    by_setting: dict[str, list[float]] = defaultdict(list)
    for trace in traces:
        if trace.temperature is not None:
            by_setting[str(trace.setting)].append(trace.temperature)
    alone = [one for one, known in by_setting.items() if max(known) - min(known) < _LEAST]
    if options.procedure == "plain" and alone:
        raise ConfigurationError(
            f"setting {alone[0]} was tested within {_LEAST:g} K, "
            "and procedure plain fits each setting by itself, so that beta cannot be determined "
            "there: take procedure joint, with one beta for all settings, or leave the option out",
            where=_WHERE,
        )
    is_open = options.is_detecting or bool(options.follows)
    held = {*(options.share or ()), *options.fixed}
    if options.procedure == "joint" and len(alone) == len(by_setting) and not is_open:
        names = damper.viscous
        if held.isdisjoint(names):
            raise ConfigurationError(
                f"each setting was tested within {_LEAST:g} K, and "
                f"{' and '.join(names)} are each setting's own, so that beta cannot be determined: "
                "test one setting cold and warm, or share one of them ({share})",
                share=Option("share"),
                where=_WHERE,
            )
