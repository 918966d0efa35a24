"""One pydantic model of a configuration, made of its sections, and what the program makes of it."""

from __future__ import annotations

import math
import os
import re
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    WithJsonSchema,
    create_model,
)

from damperfit.conditioning import ConditionOptions, NominalTest
from damperfit.configuration.damper_section import damper_defaults, damper_of
from damperfit.configuration.drawings import MEASURED
from damperfit.configuration.options import (
    Configuration,
    facts_of_damper,
    parameter_value,
    with_beta,
)
from damperfit.configuration.sections import (
    SECTIONS,
    Entry,
    OutputSection,
    ProfileSection,
    RigSection,
    SimulationSection,
    TestSection,
)
from damperfit.damper.model import MODELS
from damperfit.errors import ConfigurationError, blamed_on, did_you_mean
from damperfit.identification import DETECT, FitOptions, GivenStart, check_options
from damperfit.io import Profile, ReadOptions
from damperfit.io.options import Declarations
from damperfit.io.tests_table import FACTS, fact_of
from damperfit.problem import Key
from damperfit.simulation import SolverOptions
from damperfit.tables.columns import column_names
from damperfit.tested.identity import IDENTITY_KEYS
from damperfit.tested.setting import Setting, parse_setting
from damperfit.uncertainty import HoldOutOptions, check_profile_names
from damperfit.units.quantities import parse_quantity
from damperfit.units.shown_units import parse_units

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from damperfit.damper.model import Model

_MOST = 8  # adjusters of a damper; real ones have four
_CLOSED = "from closed"
_FROM = ("from open", _CLOSED)
# Hz, m, degC and K: a window that belongs to this test asks nothing of another one.
_PAPERS_TEST = (1.5, 0.032, 26.0, 1.0)


def _adjuster(value: object) -> object:
    is_list = isinstance(value, list) and all(isinstance(one, str) for one in value)
    if is_list or value in ("", *_FROM):
        return value
    raise ValueError(
        "expected '', 'from open', 'from closed', or a list of what follows it, as in "
        "['rebound.bleed']"
    )


# How its clicks count, or a list of the quantities that follow it, with that among them.
AdjusterKey: TypeAlias = Annotated[str | list[str], BeforeValidator(_adjuster)]


def _sign(value: object) -> object:
    if value == "detect" or isinstance(value, bool):
        return value
    raise ValueError("expected true, false or 'detect'")


def _whole_or_share(cycles: float) -> float:
    if cycles >= 1.0 and cycles != round(cycles):
        raise ValueError("expected a share below 1 or a whole number of cycles")
    return cycles


def _quantity(entry: Entry) -> BeforeValidator:
    """Return what takes text with a unit, a bare number in SI, or the word."""

    def convert(value: object) -> object:
        is_text = isinstance(value, str) and not (entry.word and value == entry.word)
        return parse_quantity(str(value), entry.dimension) if is_text else value

    return BeforeValidator(convert)


def _type_of(name: str, entry: Entry) -> Any:
    """Return the type of a key, as pydantic checks it."""
    if entry.given == "sign":
        return Annotated[bool | str, BeforeValidator(_sign)]
    if entry.given == "profiles":
        return dict[str, _section_model(ProfileSection)]  # type: ignore[misc]
    if entry.given is not None:
        return entry.given
    if entry.words:
        return Literal[entry.words]
    is_list = isinstance(entry.default, list)
    kind: Any = float if entry.dimension else str if is_list else type(entry.default)
    if kind in {int, float}:
        limits: dict[str, Any] = {"gt": entry.above, "ge": entry.least, "le": entry.most}
        limits["allow_inf_nan"] = False if kind is float and not entry.has_infinity else None
        given = {name: limit for name, limit in limits.items() if limit is not None}
        kind = Annotated[kind, Field(**given)]
    if name == "hold_out_cycles":
        kind = Annotated[kind, AfterValidator(_whole_or_share)]
    if entry.dimension:
        written = WithJsonSchema({"type": ["number", "string"]})
        kind = Annotated[kind | str if entry.word else kind, _quantity(entry), written]
    if not is_list:
        return Annotated[kind, Field(min_length=1)] if name == "folder" else kind
    return Annotated[list[kind], Field(min_length=1)] if name == "speeds" else list[kind]


@cache
def _section_model(section: Any) -> type[BaseModel]:
    """Return the pydantic model of a section; the defaults stand as they would be written."""
    known = {
        name: (_type_of(name, entry), Field(default=entry.default, description=entry.about))
        for name, entry in section.entries().items()
    }
    how = ConfigDict(extra="forbid", strict=True, protected_namespaces=())
    return create_model(section.__name__, __config__=how, __doc__=section.__doc__, **known)  # type: ignore[call-overload, no-any-return]


@cache
def document_model() -> type[BaseModel]:
    """Return the model of the whole document; what [damper] has is its own model's to judge."""
    sections: dict[str, Any] = dict(SECTIONS)
    kinds: dict[str, Any] = {name: (_section_model(one), ...) for name, one in sections.items()}
    kinds["damper"] = (dict[str, Any], ...)
    kinds["adjusters"] = (dict[str, AdjusterKey], ...)
    return create_model("Document", __config__=ConfigDict(extra="forbid", strict=True), **kinds)


def build_configuration(
    document: dict[str, Any], *, declared: frozenset[str] = frozenset()
) -> Configuration:
    """Return the configuration that a complete TOML document describes."""
    model = document["damper"]["model"]
    own: dict[str, Any] = {}  # what a model has of its own where nobody has declared it
    if model != "purdy":
        own = {"procedure": MODELS[model].procedures[0], "share": [DETECT]}
    if document["damper"]["reference_temperature"] != "none":
        own["procedure"] = "joint"
    left = {key: one for key, one in own.items() if f"identification.{key}" not in declared}
    document = {**document, "identification": document["identification"] | left}
    values = document_model().model_validate(document).model_dump(exclude_unset=True)
    fit, output, test = values["identification"], values["output"], values["test"]
    damper = damper_of(values["damper"])
    adjusters = check_adjusters(values["adjusters"])
    labels = declared_settings(values["rig"]["settings"], adjusters, key="rig.settings")
    rig = RigSection(**values["rig"] | {"settings": labels})
    is_open = "damper.model" not in declared
    profiled = tuple(name.strip() for name in fit["profile"])
    check_profile_names(profiled, damper.names, fixed=fit["fix"])
    return Configuration(
        damper=damper,
        rig=rig,
        reading=_reading(values["rig"], adjusters),
        test=TestSection(**test | {"table": _path(test["table"]), "typed": frozenset()}),
        conditioning=_conditioning(
            values["conditioning"], rig, facts_of_damper(damper, {*fit["fix"], *fit["free"]})
        ),
        identification=_fit_options(fit, damper, values["adjusters"], is_open=is_open),
        hold_out=HoldOutOptions(tuple(fit["hold_out"]), fit["hold_out_cycles"]),
        start_table=_path(fit["start"]),
        profile=profiled,
        simulation=SimulationSection(**values["simulation"], dead_band=fit["dead_band"]),
        output=OutputSection(
            folder=_path(output["folder"]),
            max_mse_percent=output["max_mse_percent"],
            checks=_checks(output["checks"], rig),
            speeds=tuple(sorted(set(output["speeds"]))),
            units=parse_units(output["units"], Key(("output", "units"))),
        ),
        declared=declared,
        document=document,
    )


def _path(text: str) -> Path | None:
    return Path(os.path.expanduser(text)) if text else None  # noqa: PTH111 - Path raises on ~nobody


def _declared(values: dict[str, Any]) -> dict[str, Any]:
    """Return the keys that are given, as `Declarations` has them."""
    given = {one.name: values[one.name] for one in fields(Declarations) if one.name in values}
    if "tested_at" in given:
        given["tested_at"] = facts_stated(given["tested_at"])
    return {k: tuple(v) if isinstance(v, list) else v for k, v in given.items()}


def _reading(rig: dict[str, Any], adjusters: tuple[str, ...]) -> ReadOptions:
    general = ReadOptions(**_declared(rig), adjusters=adjusters, max_bytes=rig["max_log_bytes"])
    profiles = tuple(
        Profile(name=name, files=keys.get("files", ""), declared=_declared(keys))
        for name, keys in rig["profiles"].items()
    )
    return replace(general, profile=rig["profile"], profiles=profiles)


def _conditioning(own: dict[str, Any], rig: RigSection, facts: dict[str, Any]) -> ConditionOptions:
    is_auto = isinstance(own["filter_corner"], str)
    motion = (rig.frequency, rig.amplitude, rig.temperature, rig.temperature_tolerance)
    return ConditionOptions(
        **own | ({"filter_corner": 30.0} if is_auto else {}),
        auto_corner=is_auto,
        rig_filter=rig.filter,
        rig_filter_corner=rig.filter_corner,
        rig_filter_order=rig.filter_order,
        centre=None if isinstance(rig.centre, str) else rig.centre,
        skew=rig.skew,
        nominal=NominalTest(
            frequency=rig.frequency,
            amplitude=rig.amplitude,
            temperature=rig.temperature,
            temperature_tolerance=rig.temperature_tolerance,
            is_of_motion=motion == _PAPERS_TEST,
        ),
        **facts,
    )


def _fit_options(
    fit: dict[str, Any], damper: Any, adjusters: dict[str, Any], *, is_open: bool
) -> FitOptions:
    def in_si(name: str) -> dict[str, float]:
        with blamed_on(Key(("identification", name))):
            known = fit[name].items()
            return {name: parameter_value(damper.quantity(name), one) for name, one in known}

    options = FitOptions(
        procedure=fit["procedure"],
        free=tuple(name.strip() for name in fit["free"]) or None,
        fixed=in_si("fix"),
        start=GivenStart(in_si("start_values")),
        share=with_beta(damper, fit["share"], named={*fit["free"], *fit["fix"]}),
        follows=followed(adjusters, damper, is_law_open=is_open),
        from_closed=counted_from_closed(adjusters),
        solver=SolverOptions(tolerance=fit["tolerance"], dead_band=fit["dead_band"]),
        max_evaluations=fit["max_evaluations"],
        untied=tuple(name.strip() for name in fit["untie"]),
        bulk_modulus=fit["bulk_modulus"],
        starts=fit["starts"],
        fallbacks={"r_m3": fit["fallback_r_m3"], "f_f": fit["fallback_f_f"]},
    )
    # The law that --model auto chooses may have what the declared model has not.
    check_options(replace(options, untied=()) if is_open else options, damper)
    return options


def _checks(names: list[str], rig: RigSection) -> tuple[str, ...]:
    if not names:
        return ()
    from damperfit.checks import expand_checks

    is_any = math.isinf(rig.temperature_tolerance)
    pointless = ("temperature_in_window",) if is_any else ()
    return expand_checks((name.strip() for name in names), pointless=pointless)


# The section [adjusters], labels of settings, and what logs are declared to be tested at


def check_adjusters(adjusters: Mapping[str, AdjusterKey]) -> tuple[str, ...]:
    """Return the names of the adjusters; refuse what is no name, or that of a column."""
    wrong = ""
    if not 1 <= len(adjusters) <= _MOST:
        wrong = f"found {len(adjusters)}, expected 1 to {_MOST}"
    for name in adjusters if not wrong else ():
        if not re.fullmatch(r"[a-z][a-z0-9_]{0,30}", name):
            wrong = f"found '{name}', expected small letters, digits and _, as in low_speed_rebound"
        elif name in column_names() or name in IDENTITY_KEYS:
            wrong = f"'{name}' is taken, a column of the tables has this name; choose another"
        if wrong:
            break
    if wrong:
        raise ConfigurationError(wrong, where=Key(("adjusters",)), code="wrong-adjuster")
    return tuple(adjusters)


def followed(
    adjusters: Mapping[str, AdjusterKey], damper: Model, *, is_law_open: bool = False
) -> dict[str, tuple[str, ...]]:
    """Return the quantities of a model that are declared to follow adjusters."""
    own, words = _parts(damper), _words(adjusters)
    known = own
    if is_law_open and any(word not in own for _, word in words):
        known = {word: names for one in _every_model() for word, names in _parts(one).items()}
    by_quantity: dict[str, dict[str, None]] = {}
    for adjuster, word in words:
        if not known.get(word):
            near = did_you_mean(word, known) or f" There are {', '.join(known)}."
            raise ConfigurationError(
                f"no quantity '{word}' of the model {damper.name} could follow it.{near}",
                where=Key(("adjusters", adjuster)),
                code="unknown-quantity",
            )
        for name in own.get(word, ()):
            by_quantity.setdefault(name, {})[adjuster] = None
    return {name: tuple(who) for name, who in by_quantity.items()}


def unmatched(adjusters: Mapping[str, AdjusterKey], damper: Model) -> tuple[str, ...]:
    """Return the words in [adjusters] that name nothing of a model."""
    own = _parts(damper)
    return tuple(word for _, word in _words(adjusters) if word not in own)


def counted_from_closed(adjusters: Mapping[str, AdjusterKey]) -> tuple[str, ...]:
    """Return the adjusters whose clicks count from closed."""
    how = {name: [key] if isinstance(key, str) else key for name, key in adjusters.items()}
    return tuple(
        n for n, key in how.items() if [one for one in key if one in _FROM][:1] == [_CLOSED]
    )


def _words(adjusters: Mapping[str, AdjusterKey]) -> list[tuple[str, str]]:
    return [
        (adjuster, word.strip())
        for adjuster, key in adjusters.items()
        if isinstance(key, list)
        for word in key
        if word not in _FROM
    ]


def _parts(damper: Model) -> dict[str, tuple[str, ...]]:
    return {**damper.parts, **{name: (name,) for name in damper.names}}


def _every_model() -> list[Model]:
    """One damper of every model, with everything that it may have."""
    from damperfit.damper.network import BLOW_OFFS, Valve
    from damperfit.damper.valve_dampers import DeclaredNetwork, ValveDamper

    valves = [Valve("long", kind) for kind in BLOW_OFFS if kind not in {"none", "linear"}]
    return [
        kind(rebound=valve, compression=valve)
        if issubclass(kind, ValveDamper) and kind is not DeclaredNetwork
        else kind()
        for kind in MODELS.values()
        for valve in valves
    ]


def facts_stated(stated: Mapping[str, float | str]) -> dict[str, float]:
    """Return what logs were tested at, SI; a name that is none is left to the reader's options."""
    known = {}
    for name, text in stated.items():
        try:
            known[name] = fact_of(name, str(text)) if name in FACTS else math.nan
        except ValueError as error:
            raise _wrong(text, error, "tested_at", name) from error
    return known


def declared_settings(
    labels: Iterable[int | str], adjusters: tuple[str, ...], *, key: str
) -> tuple[Setting, ...]:
    """Return the settings that labels name, in order."""
    known = set()
    for label in labels:
        try:
            known.add(parse_setting(str(label), adjusters))
        except ValueError as error:
            raise _wrong(label, error, *key.split(".")) from error
    return tuple(sorted(known))


def _wrong(value: object, error: ValueError, *key: str) -> ConfigurationError:
    return ConfigurationError(f"found {value!r}, {error}", where=Key(key), code="wrong-value")


# For editors


def configuration_schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a file: editors complete and check TOML by it."""
    schema = document_model().model_json_schema()
    for section in (schema, *schema["$defs"].values()):
        section.pop("required", None)  # a file needs only what differs
        for key in section["properties"].values():
            key.pop("title", None)
    keys: dict[str, Any] = {}  # [damper] has those of any model; what goes together it says itself
    for model in MODELS:
        for name, value in damper_defaults(model).items():
            _add(keys, name, value)
    for name, entry in SECTIONS["damper"].entries().items():
        keys[name]["description"] = entry.about
    keys["model"]["enum"] = [*MODELS]
    damper = {"type": "object", "properties": keys, "additionalProperties": False}
    schema["properties"]["damper"] = damper
    named = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "damperfit"}
    return {**schema, **named}


def _add(keys: dict[str, Any], name: str, value: Any) -> None:
    """Add a key with the type of its default; a section inside has its own keys."""
    types = {bool: "boolean", dict: "object", list: "array"}
    known = keys.setdefault(name, {"type": types.get(type(value), ["number", "string"])})
    if name in MEASURED:
        known["description"] = MEASURED[name]
    if isinstance(value, dict):
        inner = known.setdefault("properties", {})
        for key, one in value.items():
            _add(inner, key, one)
