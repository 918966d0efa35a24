"""The section [damper] of a configuration: its keys are the fields of the model that it names."""

from __future__ import annotations

import math
from dataclasses import asdict, fields, is_dataclass
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    ValidationError,
    create_model,
    model_validator,
)
from pydantic import ValidationInfo as Info
from pydantic import field_validator as checks

from damperfit.damper.model import MODELS, model_named
from damperfit.damper.mounting import NONE
from damperfit.damper.warmed import Warmed
from damperfit.errors import ConfigurationError
from damperfit.units.quantities import parse_quantity, says_absolute_or_gauge

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Self

    from damperfit.damper.model import Model

__all__ = [
    "DamperSection",
    "damper_defaults",
    "damper_of_record",
    "damper_record",
    "damper_section",
]

_ASKED_BELOW = 2e5  # Pa: a gauge reading taken as absolute is here a third too low, or more
_DIMENSIONS = {"m": "length", "m3": "volume", "kg/m3": "density", "Pa": "absolute pressure"}
# Numbers of a section inside [damper], which may be words too.
_INNER_DIMENSIONS = {
    "series_stiffness": "stiffness",
    "play": "length",
    "lag": "time",
    "moving_mass": "mass",
    "presliding": "length",
    "breakaway": "force",
    "stribeck_speed": "velocity",
    "seal_area": "area",
    "turning_speed": "velocity",
}
_OF_LOGS = "mean"  # a reference temperature: the mean of the logs
_WARMTH = (-60.0, 200.0)  # degC: what oil of dampers is tested at
_RECORDED = {"is_recorded": True}  # what a run has written is a value, and no user's words
_BEGIN_OF_NUMBER = frozenset("0123456789.+-")


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class DamperSection(_Section):
    """[damper] of any model."""

    model: str
    reference_temperature: float | str

    @checks("*")
    @classmethod
    def _is_plausible(cls, value: Any, info: Info) -> Any:
        name = str(info.field_name)
        if name == "reference_temperature":
            return _reference(value)
        if name in MODELS[cls.__name__].ranges:
            low, high, unit = MODELS[cls.__name__].ranges[name]
            if not low <= value <= high:
                raise ValueError(f"expected {low:g} to {high:g}{' ' + unit if unit else ''}")
        return value

    @model_validator(mode="after")
    def _can_be_built(self) -> Self:
        try:
            self.build()
        except ConfigurationError as error:
            raise ValueError(str(error)) from error
        return self

    def build(self) -> Model:
        """Return the damper that is declared."""
        kind = MODELS[type(self).__name__]
        values = self.model_dump(exclude={"model", "reference_temperature"})
        inner = _inner(kind)
        if "passages" in values:
            from damperfit.damper.valve_dampers import declared_passages

            values["passages"] = declared_passages(values["passages"])
        damper = kind(**{k: inner[k](**v) if k in inner else v for k, v in values.items()})
        if self.reference_temperature == NONE:
            return damper
        told = self.reference_temperature
        return Warmed(damper, math.nan if told == _OF_LOGS else float(told))


def damper_defaults(model: str) -> dict[str, Any]:
    """Return every key of [damper] for a model, as in defaults.toml, in SI."""
    return damper_record(MODELS[model]())


def damper_record(damper: Model) -> dict[str, Any]:
    """Return [damper] of a damper, in SI, as the record of a run has it."""
    plain: Any = damper.plain
    reference: float | str = damper.reference if isinstance(damper, Warmed) else NONE
    if isinstance(reference, float) and math.isnan(reference):
        reference = _OF_LOGS
    keys = {one.name for one in fields(plain) if one.init}
    own = {name: value for name, value in asdict(plain).items() if name in keys}
    if "passages" in own:
        own["passages"] = [one.table for one in plain.passages]
    return {"model": plain.name, "reference_temperature": reference, **own}


def damper_of_record(record: Mapping[str, Any]) -> Model:
    """Return the damper that a run has recorded; what it took as declared is not questioned.

    Parameters
    ----------
    record : mapping
        Section [damper] of its configuration; a key that it lacks is at its default.

    Raises
    ------
    ConfigurationError
        It is of no model, or has keys or values that no damper has.
    """
    name = record.get("model", MODELS["purdy"].name)
    known = damper_defaults(model_named(name if isinstance(name, str) else repr(name)).name)
    values = {
        key: {**known[key], **one} if isinstance(known.get(key), dict) and isinstance(one, dict)
        else one
        for key, one in record.items()
    }  # fmt: skip
    section = damper_section(known["model"])
    try:
        return section.model_validate({**known, **values}, context=_RECORDED).build()
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(("damper", *map(str, first["loc"])))
        raise ConfigurationError(
            f"{first['msg'].removeprefix('Value error, ')}, found {first['input']!r}", subject=place
        ) from error


def _reference(value: float | str) -> float | str:
    """Return a temperature in degrees Celsius, or the word for that of the logs, or for none."""
    if value in {NONE, _OF_LOGS}:
        return value
    try:
        found = parse_quantity(value, "temperature")
    except ValueError as error:
        raise ValueError(
            f"expected 'none', 'mean' or a temperature, as in '25degC'; {error}"
        ) from error
    low, high = _WARMTH
    if not low <= found <= high:
        raise ValueError(f"expected {low:g} to {high:g} degC")
    return found


def _inner(kind: Any) -> dict[str, type]:
    """The fields of a model that are sections of their own, and what they are."""
    known = [one for one in fields(kind) if one.init]
    return {one.name: type(one.default) for one in known if is_dataclass(one.default)}


def _section(kind: type[Model]) -> type[DamperSection]:
    inner = _inner(kind)
    keys: dict[str, Any] = {}
    for one in fields(kind):  # type: ignore[arg-type]
        if not one.init:
            continue
        if one.name == "passages":
            keys[one.name] = (list[dict[str, Any]], ...)
        elif one.type == "bool":
            keys[one.name] = (bool, ...)
        elif one.name in inner:
            found: dict[str, Any] = {
                part.name: (_word(part.name, str(part.type)), ...)
                for part in fields(inner[one.name])
            }
            whole = {"_whole": _can_be_built(inner[one.name])}
            section = create_model(one.name, __base__=_Section, __validators__=whole, **found)
            keys[one.name] = (section, ...)
        else:
            keys[one.name] = (_number(one.name, _unit(kind, one.name)), ...)
    return create_model(kind.name, __base__=DamperSection, **keys)


def _can_be_built(kind: Any) -> Any:
    def build(section: BaseModel) -> BaseModel:
        try:
            kind(**section.model_dump())
        except ConfigurationError as error:
            raise ValueError(str(error)) from error
        return section

    return model_validator(mode="after")(build)


def _unit(kind: type[Model], name: str) -> str:
    return kind.ranges[name][2] if name in kind.ranges else ""


def _number(name: str, unit: str) -> Any:
    if unit not in _DIMENSIONS:
        return float
    dimension = _DIMENSIONS[unit]

    def convert(value: object) -> object:
        return parse_quantity(value, dimension) if isinstance(value, str) else value

    is_gas = name == "gas_pressure"
    return Annotated[float, BeforeValidator(_gas_pressure if is_gas else convert)]


def _word(name: str, kind: str) -> Any:
    """Text is a quantity where it begins like a number, else a word that its owner judges."""
    if kind == "str":
        return str

    def convert(value: object) -> object:
        is_number = isinstance(value, str) and value[:1] in _BEGIN_OF_NUMBER
        return parse_quantity(str(value), _INNER_DIMENSIONS[name]) if is_number else value

    return Annotated[float | str, BeforeValidator(convert)]


def _gas_pressure(value: object, info: Info) -> object:
    """Return an absolute pressure; ask what a low one counts from."""
    if not isinstance(value, str | float | int) or isinstance(value, bool):
        return value
    pressure = parse_quantity(value, "absolute pressure")
    says_which = isinstance(value, str) and says_absolute_or_gauge(value)
    least: Mapping[str, Any] = MODELS["purdy"].ranges
    is_low = pressure == 0.0 or least["gas_pressure"][0] <= pressure < _ASKED_BELOW
    if is_low and not says_which and info.context != _RECORDED:
        raise ValueError(
            "is it absolute, or does it count from the atmosphere? expected a unit that says so, "
            "as in 'bara' or 'barg'"
        )
    return pressure


@cache
def damper_section(name: str) -> type[DamperSection]:
    """Return the schema of [damper] for a model; each takes time to make, and a run needs one."""
    return _section(MODELS[name])
