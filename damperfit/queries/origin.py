"""Whose parameters a table holds: the damper and the motion of the run that wrote it."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from damperfit.adjustment import Sine, fastest_sine
from damperfit.configuration.loading import load_configuration, redeclared
from damperfit.damper.warmed import at_temperature
from damperfit.errors import ConfigurationError
from damperfit.queries.fleet_part import is_part, record_of
from damperfit.tables import read_facts, unknown_schema
from damperfit.units.quantities import parse_quantity

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from damperfit.configuration.options import Configuration

__all__ = [
    "Origin",
    "configuration_of_run",
    "configured_as",
    "damper_of_table",
    "motion_of_tests",
    "origin_of",
    "warmed_to",
]

_MOTION = ("amplitude", "frequency")
_SAME = 1e-9  # 4.6bara and 460000 are one pressure, but for the last digit


@dataclass(frozen=True, slots=True)
class Origin:
    """What the run that wrote a table tells of itself.

    Attributes
    ----------
    place : str
        Where that stands, for people.
    damper : mapping or None
        Its [damper], as it was written; None: it does not tell.
    motion : Sine or None
        The motion that was tested.
    tested_speed : float or None
        Highest peak speed of its logs, m/s.
    temperatures : tuple of float or None
        Coldest and warmest of its logs, degrees Celsius.
    unknown_schema : str or None
        A sentence where the table is of a schema that is not known here.
    """

    place: str
    damper: Mapping[str, Any] | None = None
    motion: Sine | None = None
    tested_speed: float | None = None
    temperatures: tuple[float, float] | None = None
    unknown_schema: str | None = None


def origin_of(table: Path) -> Origin:
    """Return what a parameters table, or run.json beside it, tells of damper and motion."""
    facts = read_facts(table)
    beside = _record(table.parent / "run.json")
    if is_part(table):
        facts = beside = record_of(table)
    schema = unknown_schema(facts or beside)
    for place, known in ((table, facts), (table.parent / "run.json", beside)):
        document = known.get("configuration")
        damper = document.get("damper") if isinstance(document, dict) else None
        if isinstance(document, dict) and isinstance(damper, dict):
            motion = motion_of_tests(beside) or _nominal(document.get("rig"))
            speed = max((speed for _, _, speed in _tested(beside, None)), default=None)
            return Origin(str(place), damper, motion, speed, _warmth(beside), schema)
    return Origin(str(table), unknown_schema=schema)


def configuration_of_run(
    folder: Path, config: Path | None, record: Mapping[str, Any], remarks: list[str]
) -> Configuration:
    """Return the configuration that has the run's damper, whatever else is in its document.

    Parameters
    ----------
    folder : pathlib.Path
        Of the results.
    config : pathlib.Path or None
        What the user gave.
    record : mapping
        Their run.json.
    remarks : list of str
        Takes a sentence where the damper of the run is not known.

    Raises
    ------
    ConfigurationError
        The user declares another damper, or that of the run cannot be used.
    """
    given = load_configuration(config)
    document = record.get("configuration")
    damper = document.get("damper") if isinstance(document, dict) else None
    origin = Origin(str(folder / "run.json"), damper if isinstance(damper, dict) else None)
    if origin.damper is None and (folder / "parameters.parquet").exists():
        origin = origin_of(folder / "parameters.parquet")
    if origin.damper is not None:
        return configured_as(given, replace(origin, motion=None), config=config)
    if config is None:
        remarks.append("the damper of the run is not known: the paper's is assumed; give --config")
    return given


def warmed_to(configuration: Configuration, temperature: str | None) -> Configuration:
    """Return the configuration with its damper at a temperature, as typed; None: as it is.

    Raises
    ------
    ConfigurationError
        It is no temperature, or the damper does not follow one.
    """
    if temperature is None:
        return configuration
    try:
        told = parse_quantity(temperature, "temperature")
    except ValueError as error:
        raise ConfigurationError(f"--temperature {temperature}: {error}") from error
    return replace(configuration, damper=at_temperature(configuration.damper, told))


def configured_as(
    configuration: Configuration, origin: Origin, *, config: Path | None = None
) -> Configuration:
    """Return the configuration with the damper of a run, and its motion unless one was declared.

    Parameters
    ----------
    configuration : Configuration
        As the user gave it.
    origin : Origin
        Whose parameters are used.
    config : pathlib.Path, optional
        The file it came from, for the message.

    Raises
    ------
    ConfigurationError
        The user declares another damper, or that of the run cannot be used.
    """
    if origin.damper is None:
        return configuration
    try:
        own = load_configuration(overlay={"damper": origin.damper}).damper
    except ConfigurationError as error:
        if config is not None:
            return configuration
        raise ConfigurationError(
            f"the damper in {origin.place} cannot be used ({error}); give --config"
        ) from error
    if "damper.model" in configuration.declared and configuration.damper.name != own.name:
        option = "--model" if config is None else "--config"
        who = option if config is None else f"{option} {config}"
        raise ConfigurationError(
            f"{who}: damper.model is {configuration.damper.name}, but the parameters "
            f"of {origin.place} are of {own.name}; leave {option} out, or run identify again with "
            "it"
        )
    if configuration.damper.name != own.name:
        return _redeclared(configuration, origin)
    for name, (_, _, unit) in own.ranges.items():
        found, fitted = getattr(configuration.damper, name), getattr(own, name)
        is_declared = f"damper.{name}" in configuration.declared
        if is_declared and not math.isclose(found, fitted, rel_tol=_SAME):
            raise ConfigurationError(
                f"--config {config}: damper.{name} is {_said(found, unit)}, but the parameters of "
                f"{origin.place} were fitted with {_said(fitted, unit)} and hold for that damper "
                "alone; leave --config out, or run identify again with it"
            )
    return _redeclared(configuration, origin)


def damper_of_table(
    table: Path, configuration: Configuration, *, config: Path | None = None
) -> tuple[Configuration, str]:
    """Return the configuration with the damper that a table belongs to, and a line on it.

    Parameters
    ----------
    table : pathlib.Path
        Of parameters.
    configuration : Configuration
        As the user gave it.
    config : pathlib.Path, optional
        The file it came from, for the message.

    Raises
    ------
    ConfigurationError
        The user declares another damper than the one that was fitted.
    """
    origin = origin_of(table)
    meant = configured_as(configuration, origin, config=config)
    if origin.damper is None:
        said = f"; {origin.place} does not say whose parameters these are"
    else:
        said = f", that of {origin.place}"
    if origin.unknown_schema:
        said = f"{said}; {origin.unknown_schema}"
    return meant, meant.damper_sentence_from(said)


def _redeclared(configuration: Configuration, origin: Origin) -> Configuration:
    """The damper of a run, and its motion unless one was declared."""
    sections: dict[str, Mapping[str, Any]] = {"damper": origin.damper or {}}
    if origin.motion is not None:
        sections["rig"] = {
            name: getattr(origin.motion, name)
            for name in _MOTION
            if f"rig.{name}" not in configuration.declared
        }
    return redeclared(configuration, sections)


def _said(value: float, unit: str) -> str:
    return f"{value:g} {unit}".rstrip()


def motion_of_tests(
    record: Mapping[str, Any], settings: set[int | str] | None = None
) -> Sine | None:
    """Return the fastest motion of the logs that were fitted, as far as run.json tells.

    Parameters
    ----------
    record : mapping
        run.json.
    settings : set of int, optional
        Settings that have parameters; None takes all logs that were not refused.
    """
    tested = list(_tested(record, settings))
    return fastest_sine(tested) if tested else None


def _tested(
    record: Mapping[str, Any], settings: set[int | str] | None
) -> Iterator[tuple[float, float, float]]:
    """Yield amplitude, frequency and peak speed of all that was tested at some settings."""
    inputs = record.get("inputs")
    for log in inputs if isinstance(inputs, list) else ():
        if isinstance(log, dict) and (settings is None or log.get("setting") in settings):
            yield from _motions(log)


def _warmth(record: Mapping[str, Any]) -> tuple[float, float] | None:
    inputs = record.get("inputs")
    logs = inputs if isinstance(inputs, list) else []
    told = [log.get("temperature_degC") for log in logs if isinstance(log, dict)]
    known = [float(t) for t in told if isinstance(t, int | float) and math.isfinite(t)]
    return (min(known), max(known)) if known else None


def _motions(log: Mapping[str, Any]) -> Iterator[tuple[float, float, float]]:
    """Yield amplitude, frequency and peak speed of each stretch of a log; older runs tell one."""
    stretches = log.get("stretches")
    for one in stretches if isinstance(stretches, list) else [log]:
        if not isinstance(one, dict):
            continue
        numbers: tuple[Any, ...] = (one.get("amplitude_m"), one.get("frequency_Hz"))
        if not all(map(_is_size, numbers)):
            continue
        size, rate = map(float, numbers)
        speed: Any = one.get("peak_speed_m_per_s")
        yield size, rate, float(speed) if _is_size(speed) else 2.0 * math.pi * size * rate


def _is_size(value: Any) -> bool:
    return isinstance(value, int | float) and math.isfinite(value) and value > 0.0


def _nominal(rig: object) -> Sine | None:
    """Return the nominal test of a run whose logs are not known."""
    if not isinstance(rig, dict) or not set(_MOTION) <= rig.keys():
        return None
    values = load_configuration(overlay={"rig": {name: rig[name] for name in _MOTION}}).rig
    return Sine(values.amplitude, values.frequency)


def _record(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return document if isinstance(document, dict) else {}
