"""The section [damper] of a configuration: its keys are the fields of the model that it names."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, fields, is_dataclass
from typing import Any

from damperfit.damper.model import MODELS, Model, model_named
from damperfit.damper.mounting import NONE
from damperfit.damper.temperature_law import WithTemperature
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.problem import Key
from damperfit.units.quantities import QuantityError, parse_quantity, says_absolute_or_gauge

_ASKED_BELOW = 2e5  # Pa: a gauge reading taken as absolute is here a third too low, or more
# Unit of a key: what it is, and the unit that people measure it in with its size.
_UNITS = {
    "m": ("length", "mm", 1e-3),
    "m3": ("volume", "cm3", 1e-6),
    "kg/m3": ("density", "kg/m3", 1.0),
    "Pa": ("absolute pressure", "bara", 1e5),
}
# Numbers of a section inside [damper], which may be words too.
_INNER_DIMENSIONS = {
    "series_stiffness": "stiffness",
    "play": "length",
    "lag": "time",
    "moving_mass": "mass",
    "rubber": "force",
    "rubber_bend": "displacement",
    "presliding": "length",
    "breakaway": "force",
    "stribeck_speed": "velocity",
    "seal_area": "area",
    "turning_speed": "velocity",
}
_VALVES = "twin_tube"  # whose geometry and gas the other layouts share
_OF_LOGS = "mean"  # a reference temperature: the mean of the logs
_OIL_TEMPERATURES = (-60.0, 200.0)  # degC: what oil of dampers is tested at
_BEGIN_OF_NUMBER = frozenset("0123456789.+-")


def damper_defaults(model: str) -> dict[str, Any]:
    """Return every key of [damper] for a model; lengths and pressures as people measure them."""
    kind = MODELS[model]
    record = damper_record(kind())
    for name, (_, _, unit) in kind.ranges.items():
        dimension, measured, size = _UNITS.get(unit, ("", "", 1.0))
        text = f"{record[name] / size:.6g}{measured}"
        if dimension and parse_quantity(text, dimension) == record[name]:
            record[name] = text
    return record


def damper_record(damper: Model) -> dict[str, Any]:
    """Return [damper] of a damper, in SI, as the record of a run has it."""
    plain: Any = damper.plain
    reference: float | str = damper.reference if isinstance(damper, WithTemperature) else NONE
    if isinstance(reference, float) and math.isnan(reference):
        reference = _OF_LOGS
    keys = {field.name for field in fields(plain) if field.init}
    values = {name: value for name, value in asdict(plain).items() if name in keys}
    if "passages" in values:
        values["passages"] = [passage.table for passage in plain.passages]
    return {"model": plain.name, "reference_temperature": reference, **values}


def damper_of_record(record: Mapping[str, Any]) -> Model:
    """Return the damper that a run has recorded, without the checks of a declaration."""
    name = record.get("model", "purdy")
    defaults = damper_record(model_named(name if isinstance(name, str) else repr(name))())
    values = {**defaults, **record}
    for key, value in defaults.items():
        if isinstance(value, dict) and isinstance(values[key], dict):
            values[key] = {**value, **values[key]}
    return damper_of(values, is_recorded=True)


def damper_of(keys: Mapping[str, Any], *, is_recorded: bool = False) -> Model:
    """Return the damper that a complete [damper] declares."""
    kind: Any = model_named(keys["model"])
    declared = {field.name: field for field in fields(kind) if field.init}
    _refuse_unknown(keys, ("model", "reference_temperature", *declared), "damper")
    values: dict[str, Any] = {}
    for name, field in declared.items():
        try:
            values[name] = _value(kind, field, keys[name], is_recorded=is_recorded)
        except OverflowError as error:  # of a whole number with hundreds of digits
            raise _wrong("a number", keys[name], name) from error
        except ConfigurationError as error:
            detail = f", found {keys[name]!r}" if isinstance(error, QuantityError) else ""
            if isinstance(error.problem.where, Key):
                raise
            raise error.adding(detail).at(Key(("damper", name))) from error
    reference = _reference(keys["reference_temperature"])
    damper: Model = kind(**values)
    if reference == NONE:
        return damper
    return WithTemperature(damper, math.nan if reference == _OF_LOGS else float(reference))


def unknown_key(name: str, allowed: Iterable[str], *section: str) -> ConfigurationError:
    """Return the refusal of a key that a section does not have."""
    allowed = list(allowed)
    hint = did_you_mean(name, allowed) or f" There are {', '.join(allowed)}."
    is_papers = section == ("damper",) and "gas_piston_diameter" in allowed
    if is_papers and name in damper_defaults(_VALVES):
        hint = (
            f' The paper\'s model has none; real valves do: add model = "{_VALVES}", "monotube" or '
            '"through_flow", or let the logs choose, with identify --model auto.'
        )
    text = f"unknown key '{name}' in [{'.'.join(section)}].{hint}"
    return ConfigurationError(text, where=Key((*section, name)), code="unknown-key")


def not_a_section(*path: str) -> ConfigurationError:
    """Return the refusal of a value that stands where a section is expected."""
    name = ".".join(path)
    text = f"{name} is a section: write [{name}]"
    return ConfigurationError(text, where=Key(path), code="not-a-section")


def _refuse_unknown(keys: Mapping[str, Any], allowed: Iterable[str], *section: str) -> None:
    allowed = list(allowed)
    if unknown := [name for name in keys if name not in allowed]:
        raise unknown_key(unknown[0], allowed, *section)


def _wrong(expected: str, value: object, *path: str) -> ConfigurationError:
    text = f"expected {expected}, found {value!r}"
    return ConfigurationError(text, where=Key(("damper", *path)), code="wrong-value")


def _value(kind: Any, field: Any, value: Any, *, is_recorded: bool) -> Any:
    name = field.name
    if is_dataclass(field.default):
        if not isinstance(value, dict):
            raise not_a_section("damper", name)
        owner: Any = type(field.default)
        inner = {item.name: item for item in fields(owner)}
        _refuse_unknown(value, inner, "damper", name)
        entries = {k: _word(inner[k], entry, name) for k, entry in value.items()}
        try:
            return owner(**entries)
        except ConfigurationError as error:  # which of its keys, given or not
            text, code = f"{error}", error.problem.code
            raise ConfigurationError(text, where=Key(("damper", name)), code=code) from error
    if name == "passages":
        from damperfit.damper.valve_dampers import declared_passages

        if not (isinstance(value, list) and all(isinstance(entry, dict) for entry in value)):
            raise _wrong("a list", value, name)
        return declared_passages(value)
    if field.type == "bool":
        if not isinstance(value, bool):
            raise _wrong("true or false", value, name)
        return value
    dimension = _UNITS.get(kind.ranges[name][2] if name in kind.ranges else "", ("",))[0]
    kinds = float | int | str if dimension else float | int
    if isinstance(value, bool) or not isinstance(value, kinds):
        raise _wrong("a number", value, name)
    number = parse_quantity(value, dimension) if isinstance(value, str) else float(value)
    if name == "gas_pressure" and not is_recorded:
        says_which = isinstance(value, str) and says_absolute_or_gauge(value)
        is_low = number == 0.0 or kind.ranges[name][0] <= number < _ASKED_BELOW
        if is_low and not says_which:
            text = (
                "is it absolute, or does it count from the atmosphere? expected a unit that says "
                f"so, as in 'bara' or 'barg', found {value!r}"
            )
            where = Key(("damper", name))
            raise ConfigurationError(text, where=where, code="absolute-or-gauge")
    return number


def _word(field: Any, value: Any, section: str) -> Any:
    """Return text as a quantity where it begins like a number, else as it is."""
    if field.type == "str":
        if not isinstance(value, str):
            raise _wrong("a text", value, section, field.name)
        return value
    if isinstance(value, bool) or not isinstance(value, float | int | str):
        raise _wrong("a number", value, section, field.name)
    if isinstance(value, str) and value[:1] in _BEGIN_OF_NUMBER:
        try:
            return parse_quantity(value, _INNER_DIMENSIONS[field.name])
        except QuantityError as error:
            where = Key(("damper", section, field.name))
            raise error.adding(f", found {value!r}").at(where) from error
    return value


def _reference(value: Any) -> Any:
    """Return a temperature in degrees Celsius, or "mean" (of the logs), or "none"."""
    if value in (NONE, _OF_LOGS):
        return value
    low, high = _OIL_TEMPERATURES
    place, expected = "reference_temperature", f"{low:g} to {high:g} degC"
    try:
        number = math.nan if isinstance(value, bool) else parse_quantity(value, "temperature")
    except QuantityError as error:
        raise _wrong("'none', 'mean' or a temperature, as in '25degC'", value, place) from error
    if not low <= number <= high:
        raise _wrong(expected, value, place)
    return number
