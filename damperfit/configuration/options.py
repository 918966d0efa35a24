"""`Configuration`, and how it is made of a document, by pydantic."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    WithJsonSchema,
    create_model,
)

from damperfit.conditioning.options import ConditionOptions, GasFacts, NominalTest, OffsetFacts
from damperfit.configuration.damper_section import damper_defaults, damper_of, damper_record
from damperfit.configuration.drawings import MEASURED
from damperfit.damper.cylinder import K_E
from damperfit.damper.model import MODELS, Model, Quantity
from damperfit.damper.temperature_law import BETA, WithTemperature
from damperfit.errors import ConfigurationError, blamed_on, did_you_mean
from damperfit.identification.options import (
    DETECT,
    FitOptions,
    GivenStart,
    HoldOutOptions,
    check_options,
    check_profile_names,
)
from damperfit.io import ReadOptions
from damperfit.io.tests_table import FACTS, fact_of
from damperfit.problem import Key, Problem, as_subject, note
from damperfit.sections import (
    SECTIONS,
    Entry,
    OutputSection,
    ProfileSection,
    RigSection,
    SimulationSection,
    TestSection,
)
from damperfit.simulation import SolverOptions
from damperfit.tables.columns import column_names
from damperfit.tested.identity import IDENTITY_KEYS
from damperfit.tested.setting import Setting, parse_setting
from damperfit.units.quantities import dimension_of, parse_quantity, says_absolute_or_gauge
from damperfit.units.shown_units import parse_units

# Keys of [damper] on the gas.
GAS = ("gas_volume", "gas_pressure", "gas_exponent")
# Keys on the structure of valves, rig and friction, which is not measured.
_OF_THE_LAW = {"rebound", "compression", "mounting", "friction", "passages", "floating_piston"}
_OUTSIDE = "ambient_pressure"  # rarely declared, and reported by itself
_HARMLESS = {"oil_density", "gas_exponent"}
_OF_ANY = {"model", "reference_temperature"}  # keys of [damper] whatever the model
_USUALLY_SHARED: tuple[list[str], ...] = ([], ["r_m3", "f_f"], ["detect"])  # by default

_MOST = 8  # adjusters of a damper; real ones have four
_CLOSED = "from closed"
_FROM = ("from open", _CLOSED)
# Hz, m, degC and K: a window of this test does not apply to another one.
_PAPERS_TEST = (1.5, 0.032, 26.0, 1.0)


@dataclass(frozen=True, slots=True)
class Configuration:
    """The complete configuration; one field for each part of the program."""

    damper: Model  # with geometry, oil and gas as far as it has them
    rig: RigSection
    reading: ReadOptions  # how logs are read
    conditioning: ConditionOptions  # how signals become traces
    identification: FitOptions  # what is fitted
    hold_out: HoldOutOptions  # what is predicted
    start_table: Path | None  # of an earlier run that the fits start from; read when the run begins
    profile: tuple[str, ...]  # parameters whose misfit is followed away from the best value
    simulation: SimulationSection
    output: OutputSection
    test: TestSection
    declared: frozenset[str] = field(compare=False)  # keys that were given: "damper.rod_diameter"
    # The same as one TOML document, quantities as they were written.
    document: dict[str, Any] = field(compare=False, repr=False)
    # Where the logs chose the damper's law: the choice, as it stands in run.json, and the MSE
    # of that law at each setting when it was chosen, per cent: what is delivered must reach it.
    chosen_law: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)
    chosen_mse: Mapping[Setting, float] = field(default_factory=dict, compare=False, repr=False)
    # By log, N: taken off its force, as its cell was zeroed otherwise than that of the other logs.
    log_offsets: Mapping[str, float] = field(default_factory=dict, compare=False, repr=False)

    def with_damper(
        self, damper: Model, *, identification: FitOptions | None = None
    ) -> Configuration:
        """Return the configuration with another damper, as a run has found or recorded it."""
        fit = identification or self.identification
        facts = facts_of_damper(damper, {*fit.fixed, *(fit.free or ())})
        return replace(
            self,
            damper=damper,
            conditioning=self.conditioning.but(**facts),
            identification=fit,
            document={**self.document, "damper": damper_record(damper)},
        )

    @property
    def undeclared(self) -> tuple[str, ...]:
        """Keys of [damper] of this model that are not declared."""
        keys = (name for name in self.document["damper"] if name not in _OF_ANY)
        return tuple(name for name in keys if f"damper.{name}" not in self.declared)

    @property
    def not_measured(self) -> tuple[str, ...]:
        """Undeclared keys to be measured: without the air, and keys that change no force."""
        others = {*_OF_THE_LAW, _OUTSIDE, *self.damper.plain.unfelt}
        return tuple(name for name in self.undeclared if name not in others)

    @property
    def is_assumed(self) -> bool:
        """Whether no measured key of the damper is declared."""
        measured = {*self.document["damper"]} - _OF_THE_LAW - _OF_ANY
        return bool(measured) and measured <= set(self.undeclared)

    @property
    def whose(self) -> str:
        """The damper whose dimensions are the default."""
        return "the paper's damper" if self.damper.name == "purdy" else "a generic damper"

    @property
    def _not_declared(self) -> str:
        if self.chosen_law or len(self.undeclared) == len({*self.document["damper"]} - _OF_ANY):
            return "[damper] is not declared"
        return "[damper] declares no dimensions"

    @property
    def assumed_dimensions(self) -> str:
        """Which dimensions are not declared, and their defaults; empty for none.

        Oil density, gas exponent and ambient pressure do not affect what the grade assesses.
        """
        missing = self._not_declared
        if not self.is_assumed:
            names = [name for name in self.not_measured if name not in _HARMLESS]
            if not names:
                return ""
            missing = f"{as_subject(names)} not declared"
        return f"{missing}, and with the dimensions of {self.whose}"

    def damper_sentence(self, origin: str = "") -> str:
        """Return the damper's main figures and their origin, as a sentence."""
        assumed = ""
        if self.is_assumed:
            whose = "the paper's" if self.damper.name == "purdy" else "a generic damper's"
            assumed = (
                f" ({whose}: {self._not_declared}, and resistances, K_e and pressures are "
                "right only for these dimensions)"
            )
        return f"Damper: {self.damper.plain.sentence}{assumed}{origin}{self.damper.condition}."

    @property
    def notes(self) -> tuple[Problem, ...]:
        """Assumptions on the damper."""
        notes = [] if self.is_assumed else [*self._assumed()]
        fit = self.identification
        if (procedure := fit.procedure) != "joint":
            only = f"only procedure joint uses it, found procedure {procedure}"
            if fit.follows:
                text = f"[adjusters] says what follows which adjuster; {only}"
                notes.append(note("no-effect", text))
            shared = self.document["identification"]["share"]
            if "identification.share" in self.declared and shared not in _USUALLY_SHARED:
                text = f"identification.share = {shared} has no effect: {only}"
                notes.append(note("no-effect", text))
        pressure = self.document["damper"].get("gas_pressure")
        if isinstance(pressure, str) and not says_absolute_or_gauge(pressure):
            text = (
                f"damper.gas_pressure = {pressure} is taken as absolute; a gauge shows 1.013 bar "
                "less: say which, as in 12bara or 12barg"
            )
            notes.append(note("assumed", text))
        return tuple(notes)

    def _assumed(self) -> Iterator[Problem]:
        if names := self.not_measured:
            values = {name: getattr(self.damper, name) for name in GAS if name in self.undeclared}
            gas = f" ({gas_in_words(values)})" if "gas_volume" in values else ""
            text = (
                f"[damper] leaves {', '.join(names)} to {self.whose}{gas}: "
                "declare what your damper has (damperfit config prints every key)"
            )
            yield note("assumed", text)
        if _OUTSIDE in self.undeclared:
            bar = 1e-5 * getattr(self.damper, _OUTSIDE)
            text = (
                f"the air presses on the rod with {bar:.4g} bar, unless damper.{_OUTSIDE} says "
                "otherwise"
                if bar
                else "the paper's equation leaves out the air that presses on the rod; if the load "
                f'cell was zeroed without the damper, set damper.{_OUTSIDE} = "1.013bara"'
            )
            yield note("assumed", text)


def gas_in_words(values: Mapping[str, float]) -> str:
    """Return a damper's gas in words, by some of `GAS` in SI."""
    formats = {
        "gas_volume": ("{:.3g} cm3 of gas", 1e6),
        "gas_pressure": ("{:.3g} bar absolute", 1e-5),
        "gas_exponent": ("exponent {:g}", 1.0),
    }
    items = ((*formats[name], values[name]) for name in formats if name in values)
    return ", ".join(text.format(factor * value) for text, factor, value in items)


def parameter_value(quantity: Quantity, value: str | float) -> float:
    """Return a parameter's value in SI; text may carry a unit where that is a plain one."""
    name, unit = quantity.name, quantity.unit
    dimension = "absolute pressure" if quantity.is_absolute else dimension_of(unit)
    is_text = isinstance(value, str) and dimension != ""
    expected, number = f"a number in {unit}" if unit != "1" else "a number", math.nan
    with suppress(ValueError):
        number = parse_quantity(value, dimension) if is_text else float(value)
        expected = "a finite number"
    if not math.isfinite(number):
        text = f"{name} = {value}: expected {expected}"
        raise ConfigurationError(text, code="not-a-number")
    return number


# The one pydantic model of a document


def _adjuster(value: object) -> object:
    is_list = isinstance(value, list) and all(isinstance(name, str) for name in value)
    if is_list or value in ("", *_FROM):
        return value
    raise ValueError(
        "expected '', 'from open', 'from closed', or a list of what follows it, as in "
        "['rebound.bleed']"
    )


# How its clicks count, or a list of the quantities that follow it, with that among them.
AdjusterKey: TypeAlias = Annotated[str | list[str], BeforeValidator(_adjuster)]


def _whole_or_share(cycles: float) -> float:
    if cycles >= 1.0 and cycles != round(cycles):
        raise ValueError("expected a share below 1 or a whole number of cycles")
    return cycles


def _type_of(name: str, entry: Entry) -> Any:
    """Return the type of a key, as pydantic checks it."""
    if entry.form == "sign":

        def sign(value: object) -> object:
            if expected := entry.in_place_of(value):
                raise ValueError(f"expected {expected}")
            return value

        return Annotated[bool | str, BeforeValidator(sign)]
    if entry.form == "profiles":
        return dict[str, _section_model(ProfileSection)]  # type: ignore[misc]
    if entry.form is not None:
        return entry.form
    if entry.words:
        return Literal[entry.words]
    is_list = isinstance(entry.default, list)
    kind: Any = float if entry.dimension else str if is_list else type(entry.default)
    if kind in {int, float}:
        limits: dict[str, Any] = {"gt": entry.above, "ge": entry.least}
        limits |= {"lt": entry.below, "le": entry.most}
        limits["allow_inf_nan"] = False if kind is float and not entry.has_infinity else None
        kind = Annotated[kind, Field(**{n: limits[n] for n in limits if limits[n] is not None})]
    if name == "hold_out_cycles":
        kind = Annotated[kind, AfterValidator(_whole_or_share)]
    if entry.dimension:

        def in_si(value: object) -> object:
            """Text with a unit, a bare number in SI, or the word."""
            is_text = isinstance(value, str) and not (entry.word and value == entry.word)
            return parse_quantity(str(value), entry.dimension) if is_text else value

        written = WithJsonSchema({"type": ["number", "string"]})
        kind = Annotated[kind | str if entry.word else kind, BeforeValidator(in_si), written]
    if not is_list:
        return Annotated[kind, Field(min_length=1)] if name == "folder" else kind
    return Annotated[list[kind], Field(min_length=1)] if name == "speeds" else list[kind]


@cache
def _section_model(section: Any) -> type[BaseModel]:
    """Return the pydantic model of a section; the defaults are as in a file."""
    keys = {
        name: (_type_of(name, entry), Field(default=entry.default, description=entry.about))
        for name, entry in section.entries().items()
    }
    config = ConfigDict(extra="forbid", strict=True, protected_namespaces=())
    return create_model(section.__name__, __config__=config, __doc__=section.__doc__, **keys)  # type: ignore[call-overload, no-any-return]


@cache
def document_model() -> type[BaseModel]:
    """Return the model of the whole document; the damper's own model checks [damper]."""
    sections: dict[str, Any] = dict(SECTIONS)
    kinds: dict[str, Any] = {name: (_section_model(sections[name]), ...) for name in sections}
    kinds["damper"] = (dict[str, Any], ...)
    kinds["adjusters"] = (dict[str, AdjusterKey], ...)
    return create_model("Document", __config__=ConfigDict(extra="forbid", strict=True), **kinds)


def build_configuration(
    document: dict[str, Any], *, declared: frozenset[str] = frozenset()
) -> Configuration:
    """Return the configuration that a complete TOML document describes."""
    model = document["damper"]["model"]
    defaults: dict[str, Any] = {}  # defaults of the model, for what is not declared
    if model != "purdy":
        defaults = {"procedure": MODELS[model].procedures[0], "share": []}
    if document["damper"]["reference_temperature"] != "none":
        defaults["procedure"] = "joint"
    defaults = {k: v for k, v in defaults.items() if f"identification.{k}" not in declared}
    document = {**document, "identification": document["identification"] | defaults}
    values = document_model().model_validate(document).model_dump(exclude_unset=True)
    damper, adjusters = damper_of(values["damper"]), check_adjusters(values["adjusters"])
    rig_values, fit, output, test = (
        {key: _as_read(value) for key, value in values[name].items()}
        for name in ("rig", "identification", "output", "test")
    )
    labels = (
        _read(label, partial(parse_setting, str(label), adjusters), "settings")
        for label in rig_values["settings"]
    )
    rig = RigSection(**rig_values | {"settings": tuple(sorted({*labels}))})
    reading = ReadOptions(
        **_declared(rig_values),
        adjusters=adjusters,
        max_bytes=rig.max_log_bytes,
        profile=rig.profile,
        profiles={name: _declared(keys, "profiles", name) for name, keys in rig.profiles.items()},
    )
    if output["checks"]:
        from damperfit.checks import expand_checks

        is_any = math.isinf(rig.temperature_tolerance)
        pointless = ("temperature_in_window",) if is_any else ()
        output["checks"] = expand_checks(output["checks"], pointless=pointless)
    output["speeds"] = tuple(sorted(set(output["speeds"])))
    output["units"] = parse_units(output["units"], Key(("output", "units")))
    check_profile_names(fit["profile"], damper.names, fixed=fit["fix"])
    is_open = "damper.model" not in declared
    chosen = {*fit["fix"], *fit["free"]}
    solver = SolverOptions(values["simulation"]["tolerance"], dead_band=fit["dead_band"])
    return Configuration(
        damper=damper,
        rig=rig,
        reading=reading,
        test=TestSection(**test | {"table": _path(test["table"]), "typed": frozenset()}),
        conditioning=_conditioning(values["conditioning"], rig, facts_of_damper(damper, chosen)),
        identification=_fit_options(fit, damper, values["adjusters"], is_open=is_open),
        hold_out=HoldOutOptions(fit["hold_out"], fit["hold_out_cycles"]),
        start_table=_path(fit["start"]),
        profile=fit["profile"],
        simulation=SimulationSection(**values["simulation"], solver=solver),
        output=OutputSection(**output | {"folder": _path(output["folder"])}),
        declared=declared,
        document=document,
    )


def _as_read(value: Any) -> Any:
    """Return a list as a tuple, names in it without the blanks of a comma."""
    if not isinstance(value, list):
        return value
    return tuple(item.strip() if isinstance(item, str) else item for item in value)


def _path(text: str) -> Path | None:
    return Path(os.path.expanduser(text)) if text else None  # noqa: PTH111 - Path raises on ~nobody


def _declared(values: dict[str, Any], *place: str) -> dict[str, Any]:
    """Return the keys of a profile that are given, `tested_at` in SI."""
    profile = {key: _as_read(values[key]) for key in ProfileSection.entries() if key in values}
    if "tested_at" in profile:  # a name that is none is left to the reader's options
        profile["tested_at"] = {
            name: _read(text, partial(fact_of, name, str(text)), *place, "tested_at", name)
            if name in FACTS
            else math.nan
            for name, text in profile["tested_at"].items()
        }
    return profile


def _conditioning(keys: dict[str, Any], rig: RigSection, facts: dict[str, Any]) -> ConditionOptions:
    is_auto = isinstance(keys["filter_corner"], str)
    names = ("frequency", "amplitude", "temperature", "temperature_tolerance")
    motion = {name: getattr(rig, name) for name in names}
    return ConditionOptions(
        **keys | ({"filter_corner": 30.0} if is_auto else {}),
        auto_corner=is_auto,
        rig_filter=rig.filter,
        rig_filter_corner=rig.filter_corner,
        rig_filter_order=rig.filter_order,
        centre=None if isinstance(rig.centre, str) else rig.centre,
        skew=rig.skew,
        nominal=NominalTest(**motion, is_of_motion=tuple(motion.values()) == _PAPERS_TEST),
        **facts,
    )


def _fit_options(
    fit: dict[str, Any], damper: Any, adjusters: dict[str, Any], *, is_open: bool
) -> FitOptions:
    def in_si(name: str) -> dict[str, float]:
        with blamed_on(Key(("identification", name))):
            items = fit[name].items()
            return {name: parameter_value(damper.quantity(name), value) for name, value in items}

    # The first such word of an adjuster says how its clicks count.
    lists = ((name, [key] if isinstance(key, str) else key) for name, key in adjusters.items())
    counted = [(name, next((word for word in words if word in _FROM), "")) for name, words in lists]
    options = FitOptions(
        procedure=fit["procedure"],
        free=fit["free"] or None,
        fixed=in_si("fix"),
        start=GivenStart(in_si("start_values")),
        share=_shared(damper, fit["share"], {*fit["free"], *fit["fix"]}),
        follows=followed(adjusters, damper, is_law_open=is_open),
        from_closed=tuple(name for name, word in counted if word == _CLOSED),
        solver=SolverOptions(tolerance=fit["tolerance"], dead_band=fit["dead_band"]),
        max_evaluations=fit["max_evaluations"],
        untied=fit["untie"],
        bulk_modulus=fit["bulk_modulus"],
        starts=fit["starts"],
        fallbacks={"r_m3": fit["fallback_r_m3"], "f_f": fit["fallback_f_f"]},
    )
    # The law that --model auto chooses may have what the declared model has not.
    check_options(replace(options, untied=()) if is_open else options, damper)
    return options


def offset_facts(damper: Model, chosen: Collection[str]) -> OffsetFacts:
    """Return how a model fits a force that the rig adds; chosen: names freed or fixed."""
    others = tuple(
        q.name for q in damper.quantities if not (q.is_shared or q.is_offset) and q.default is None
    )
    for quantity in damper.quantities:
        if quantity.is_offset:
            is_known = quantity.default is None or quantity.name in chosen
            return OffsetFacts(name=quantity.name, beside=others, is_known=is_known)
    return OffsetFacts()


def facts_of_damper(damper: Model, chosen: Collection[str]) -> dict[str, Any]:
    """Return the facts of a damper for conditioning, by the names of `ConditionOptions`."""
    gas = None if damper.gas is None else GasFacts(*damper.gas)
    offset, lengths = offset_facts(damper, chosen), damper.chamber_lengths
    moduli = [q for q in damper.quantities if q.name == K_E.name]
    is_free = any(q.default is None or q.name in chosen for q in moduli)
    return {"gas": gas, "offset": offset, "chamber_lengths": lengths, "has_free_k_e": is_free}


def _shared(
    damper: Model, names: tuple[str, ...], chosen: Collection[str]
) -> tuple[str, ...] | None:
    """Return the shared quantities, with that of temperature; none of a network: by scope."""
    if not names and "paper" not in damper.procedures:
        return None
    is_declared = BETA.name in {*names, *chosen} or names == (DETECT,)
    return names if is_declared or not isinstance(damper, WithTemperature) else (*names, BETA.name)


# The section [adjusters], labels of settings, and what logs are declared to be tested at


def check_adjusters(adjusters: Mapping[str, AdjusterKey]) -> tuple[str, ...]:
    """Return the names of the adjusters; refuse other texts, and names of columns."""
    count = len(adjusters)
    wrong = [] if 1 <= count <= _MOST else [f"found {count}, expected 1 to {_MOST}"]
    for name in adjusters:
        if not re.fullmatch(r"[a-z][a-z0-9_]{0,30}", name):
            text = f"found '{name}', expected small letters, digits and _"
            wrong.append(f"{text}, as in low_speed_rebound")
        elif name in column_names() or name in IDENTITY_KEYS:
            text = f"'{name}' is taken, a column of the tables has this name"
            wrong.append(f"{text}; choose another")
    if wrong:
        raise ConfigurationError(wrong[0], where=Key(("adjusters",)), code="wrong-adjuster")
    return tuple(adjusters)


def followed(
    adjusters: Mapping[str, AdjusterKey], damper: Model, *, is_law_open: bool = False
) -> dict[str, tuple[str, ...]]:
    """Return the quantities of a model that are declared to follow adjusters."""
    parts, pairs = _parts(damper), _words(adjusters)
    targets = parts
    if is_law_open and any(word not in parts for _, word in pairs):  # those of every model
        from damperfit.damper.network import BLOW_OFFS, Valve
        from damperfit.damper.valve_dampers import DeclaredNetwork, ValveDamper

        laws = [law for law in BLOW_OFFS if law not in {"none", "linear"}]
        targets = {}
        kinds: list[Any] = [*MODELS.values()]
        for kind in kinds:
            has_valves = issubclass(kind, ValveDamper) and kind is not DeclaredNetwork
            for law in laws if has_valves else laws[:1]:
                valve = {"rebound": Valve("long", law), "compression": Valve("long", law)}
                targets |= _parts(kind(**valve if has_valves else {}))
    by_quantity: dict[str, dict[str, None]] = {}
    for adjuster, word in pairs:
        if not targets.get(word):
            near = did_you_mean(word, targets) or f" There are {', '.join(targets)}."
            text = f"no quantity '{word}' of the model {damper.name} could follow it.{near}"
            where = Key(("adjusters", adjuster))
            raise ConfigurationError(text, where=where, code="unknown-quantity")
        for name in parts.get(word, ()):
            by_quantity.setdefault(name, {})[adjuster] = None
    return {name: tuple(names) for name, names in by_quantity.items()}


def unmatched(adjusters: Mapping[str, AdjusterKey], damper: Model) -> tuple[str, ...]:
    """Return the words in [adjusters] that name nothing of a model."""
    parts = _parts(damper)
    return tuple(word for _, word in _words(adjusters) if word not in parts)


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


def _read(value: Any, parse: Callable[[], Any], *key: str) -> Any:
    """Return a value of [rig] as parsed; an error names its key."""
    try:
        return parse()
    except ValueError as error:
        text, where = f"found {value!r}, {error}", Key(("rig", *key))
        raise ConfigurationError(text, where=where, code="wrong-value") from error


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
    header = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "damperfit"}
    return {**schema, **header}


def _add(keys: dict[str, Any], name: str, value: Any) -> None:
    """Add a key with the type of its default; a section inside has its own keys."""
    types = {bool: "boolean", dict: "object", list: "array"}
    schema = keys.setdefault(name, {"type": types.get(type(value), ["number", "string"])})
    if name in MEASURED:
        schema["description"] = MEASURED[name]
    if isinstance(value, dict):
        inner = schema.setdefault("properties", {})
        for key, entry in value.items():
            _add(inner, key, entry)
