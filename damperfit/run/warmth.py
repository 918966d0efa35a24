"""Logs of several temperatures: whether they tell what it does, and what it is told for."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.damper.warmed import BETA, Warmed
from damperfit.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.recording import Trace

__all__ = ["LEAST_WARMTH", "are_unlike", "check_temperatures", "with_reference"]

# K between the coldest and the warmest log. At 1 to 4 % a kelvin the viscosity then changes by 3 to
# 12 %, where settings repeat within a few per cent.
LEAST_WARMTH = 3.0
# K between two logs beyond which their forces need not be the same, where temperature is looked at.
_ALIKE = 0.5


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
            f"--covariate temperature: {lacking[0]}{more} {'have' if more else 'has'} no "
            "temperature; expected a channel, a line '# temperature: 31', a column of tests.csv or "
            "tested_at in a profile"
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
            f"--covariate temperature: the logs are {'' if ' ' in ends else 'all '}of {ends} degC; "
            f"the effect of temperature cannot be determined over less than "
            f"{LEAST_WARMTH:g} K: test colder or warmer too, or leave the option out"
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
            f"--covariate temperature: setting {alone[0]} was tested within {LEAST_WARMTH:g} K, "
            "and procedure plain fits each setting by itself, so that beta cannot be determined "
            "there: take procedure joint, with one beta for all settings, or leave the option out"
        )
    is_open = options.is_detecting or bool(options.follows)
    held = {*(options.share or ()), *options.fixed}
    if options.procedure == "joint" and len(alone) == len(warmths) and not is_open:
        names = damper.viscous
        if held.isdisjoint(names):
            raise ConfigurationError(
                f"--covariate temperature: each setting was tested within {LEAST_WARMTH:g} K, and "
                f"{' and '.join(names)} are each setting's own, so that beta cannot be determined: "
                "test one setting cold and warm, or share one of them (--share)"
            )


def are_unlike(first: Trace, second: Trace) -> bool:
    """Whether two logs differ in temperature by so much that their forces may."""
    known = first.temperature, second.temperature
    return None not in known and abs(known[0] - known[1]) > _ALIKE  # type: ignore[operator]
