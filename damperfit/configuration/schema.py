"""The schema of a configuration: a pydantic model for each section but [damper].

The schema has no defaults: every key stands in defaults.toml. Quantities are text with a unit
("19mm", "4.6bar") or bare numbers in SI. What the program reads of a section is the section itself,
but for those of which a package below makes options of its own.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, get_type_hints

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    create_model,
    field_validator,
    model_validator,
)

from damperfit.conditioning import ConditionOptions, NominalTest
from damperfit.configuration.damper_section import DamperSection, damper_section
from damperfit.configuration.options import (
    Configuration,
    facts_of_damper,
    parameter_value,
    with_beta,
)
from damperfit.configuration.what_is_tested import (
    AdjusterKey,
    check_adjusters,
    counted_from_closed,
    declared_settings,
    facts_stated,
    followed,
)
from damperfit.damper.model import MODELS
from damperfit.errors import blamed_on, did_you_mean
from damperfit.identification import DETECT, FitOptions, GivenStart, check_options
from damperfit.io import Profile, ReadOptions
from damperfit.io.options import Declarations
from damperfit.problem import Key
from damperfit.simulation import SolverOptions
from damperfit.tested.identity import IDENTITY_KEYS, Identity
from damperfit.uncertainty import HoldOutOptions, check_profile_names
from damperfit.units.quantities import parse_quantity
from damperfit.units.shown_units import ShownUnits, parse_units

if TYPE_CHECKING:
    from damperfit.damper.model import Model

    # What is typed is replaced by settings, names of checks and a tuple of m/s once it is built.
    _Labels: TypeAlias = Any
    _Names: TypeAlias = Any
    _Speeds: TypeAlias = Any

__all__ = ["build_configuration"]

_LONGEST = 2.0  # m, beyond any rig's amplitude: mm were meant
_FASTEST = 500.0  # Hz, beyond any rig's test: rpm or mHz were meant
# Hz, m, degC and K: a window that belongs to this test asks nothing of another one.
_PAPERS_TEST = (1.5, 0.032, 26.0, 1.0)


# Values of keys by themselves: quantities with their unit, words, and what no rig has.


def _quantity(dimension: str, word: str = "") -> BeforeValidator:
    """Return what takes text with a unit, a bare number in SI, or the word."""

    def convert(value: object) -> object:
        is_text = isinstance(value, str) and not (word and value == word)
        return parse_quantity(str(value), dimension) if is_text else value

    return BeforeValidator(convert)


def _at_most(most: float, unit: str, example: str) -> AfterValidator:
    def check(value: float) -> float:
        if value > most:
            raise ValueError(
                f"expected at most {most:g} {unit}; a bare number is in {unit}, as in {example!r}"
            )
        return value

    return AfterValidator(check)


def _known_or_detect(value: object) -> object:
    if value == "detect" or isinstance(value, bool):
        return value
    raise ValueError("expected true, false or 'detect'")


def _path_of(value: object) -> object:
    """Return a path, or None of no text; it stays as it is where a program gives it."""
    if not isinstance(value, str):
        return value
    return Path(os.path.expanduser(value)) if value else None  # noqa: PTH111 - Path raises on ~nobody


def _is_path(value: Any) -> Any:
    if not (value is None or isinstance(value, Path)):
        raise ValueError("expected a text")
    return value


def _units_of(value: Any) -> ShownUnits:
    if isinstance(value, str):
        return parse_units(value, Key(("output", "units")))
    raise ValueError("expected a text")


_Sign = Annotated[bool | str, BeforeValidator(_known_or_detect)]
_Positive = Field(gt=0.0, allow_inf_nan=False)
_NotNegative = Field(ge=0.0, allow_inf_nan=False)
_Length = Annotated[float, _quantity("length"), _Positive]
_Force = Annotated[float, _quantity("force"), _Positive]
_Frequency = Annotated[float, _quantity("frequency"), _Positive]
if not TYPE_CHECKING:
    _Labels = list[int | str]
    _Names = list[str]
    _Speeds = Annotated[
        list[Annotated[float, _quantity("velocity"), _Positive]], Field(min_length=1)
    ]
_Path = Annotated[Any, BeforeValidator(_path_of), AfterValidator(_is_path)]
_Filter = Literal["none", "causal", "zero_phase"]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    def but(self, **values: Any) -> Any:
        """Return the section with other values, which are taken as they are."""
        return self.model_copy(update=values)


class TestSection(_Section):
    """[test]: whose damper it is, where the logs and the table of tests do not say."""

    __test__ = False  # no test of pytest's

    damper: str
    serial: str
    customer: str
    operator: str
    date: str
    rig: str
    text: str
    table: _Path
    # Facts of tests that the command line tells, or sets aside: no table goes before it.
    typed: frozenset[str] = frozenset()

    @property
    def identity(self) -> Identity:
        """What is declared of the damper."""
        stated: dict[str, Any] = {key: getattr(self, key).strip() for key in IDENTITY_KEYS}
        return Identity(**stated)


class _DeclaredKeys(_Section):
    """How logs are to be understood: in [rig], and in a profile, where none is needed."""

    reverse_displacement: _Sign
    reverse_force: _Sign
    setting_pattern: str
    part_settings: list[int | float | str]
    columns: dict[str, str | int]
    units: dict[str, str]
    scales: dict[str, float]
    offsets: dict[str, float]
    encoding: str
    separator: str
    decimal: str
    thousands: str
    skip_lines: int
    sample_rate: Annotated[float, _quantity("frequency"), _NotNegative]
    pause: Annotated[float, _quantity("time"), _NotNegative]
    restarts: str
    bad_rows: str
    allow_truncated: bool
    tested_at: dict[str, float | str]

    def declared(self) -> dict[str, Any]:
        """Return the keys that are given, as `Declarations` has them."""
        given = {f.name for f in fields(Declarations)} & self.model_fields_set
        values = self.model_dump(include=given)
        if "tested_at" in values:
            values["tested_at"] = facts_stated(values["tested_at"])
        return {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}


class _ProfileKeys(_Section):
    files: str = ""

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, values: object) -> object:
        known = cls.model_fields
        unknown = [key for key in values if key not in known] if isinstance(values, dict) else []
        if unknown:
            hint = did_you_mean(unknown[0], known) or f" There are {', '.join(known)}."
            raise ValueError(f"unknown key {unknown[0]!r}.{hint}")
        return values


# Every declared key, none of them needed; only those that are given count.
_ProfileSection: Any = create_model(
    "_ProfileSection",
    __base__=(_ProfileKeys, _DeclaredKeys),
    __module__=__name__,
    **{
        name: (kind, None)
        for name, kind in get_type_hints(_DeclaredKeys, include_extras=True).items()
        if name in _DeclaredKeys.model_fields
    },  # type: ignore[call-overload]
)


class RigSection(_DeclaredKeys):
    """[rig]: the nominal test, and how logs are read."""

    amplitude: Annotated[_Length, _at_most(_LONGEST, "m", "32mm")]
    frequency: Annotated[_Frequency, _at_most(_FASTEST, "Hz", "1.5Hz")]
    settings: _Labels
    contradictions: Literal["refuse", "average"]
    strict: bool
    temperature: Annotated[float, Field(allow_inf_nan=False)]
    temperature_tolerance: Annotated[float, Field(ge=0.0)]  # infinite: none is asked for
    filter: _Filter
    filter_corner: _Frequency
    filter_order: int
    centre: Annotated[float | str, _quantity("length", "mid-stroke")]
    skew: Annotated[float | str, _quantity("time", "auto")]
    max_log_bytes: int
    max_stroke: Annotated[float, _quantity("length"), _NotNegative]
    max_speed: Annotated[float, _quantity("velocity"), _NotNegative]
    max_force: Annotated[float, _quantity("force"), _NotNegative]
    max_frequency: Annotated[float, _quantity("frequency"), _NotNegative]
    profile: str
    profiles: dict[str, _ProfileSection]

    @property
    def is_strict(self) -> bool:
        """Whether a log with a warning is refused."""
        return self.strict

    @property
    def is_averaging(self) -> bool:
        """Whether logs of one setting that contradict each other are fitted together."""
        return self.contradictions == "average"

    def reading(self, adjusters: tuple[str, ...]) -> ReadOptions:
        """Return how logs are read."""
        general = ReadOptions(**self.declared(), adjusters=adjusters, max_bytes=self.max_log_bytes)
        profiles = (
            Profile(name=name, files=keys.files, declared=keys.declared())
            for name, keys in self.profiles.items()
        )
        return replace(general, profile=self.profile, profiles=tuple(profiles))


class _ConditioningSection(_Section):
    filter: _Filter
    filter_corner: Annotated[float | str, _quantity("frequency", "auto")]
    filter_order: int
    steadiness: float
    spikes: str
    min_amplitude: _Length
    max_amplitude: _Length
    max_force: _Force

    def build(
        self, rig: RigSection, damper: Model, fit: _IdentificationSection
    ) -> ConditionOptions:
        is_auto = isinstance(self.filter_corner, str)
        motion = (rig.frequency, rig.amplitude, rig.temperature, rig.temperature_tolerance)
        own = self.model_dump() | ({"filter_corner": 30.0} if is_auto else {})
        return ConditionOptions(
            **own,
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
            **facts_of_damper(damper, {*fit.fix, *fit.free}),
        )


class _IdentificationSection(_Section):
    procedure: str
    free: list[str]
    fix: dict[str, float | str]
    share: list[str]
    bulk_modulus: str
    starts: Annotated[int, Field(ge=1, le=10_000)]
    start: _Path
    start_values: dict[str, float | str]
    profile: list[str]
    hold_out: list[str]
    hold_out_cycles: Annotated[float, _NotNegative]
    max_evaluations: Annotated[int, Field(ge=1)]
    tolerance: _Force
    dead_band: Annotated[float, _quantity("velocity"), _NotNegative]
    fallback_r_m3: Annotated[float, _Positive]
    fallback_f_f: Annotated[float, _quantity("force"), _NotNegative]

    @field_validator("hold_out_cycles")
    @classmethod
    def _share_or_number(cls, cycles: float) -> float:
        if cycles >= 1.0 and cycles != round(cycles):
            raise ValueError("expected a share below 1 or a whole number of cycles")
        return cycles

    def build(self, damper: Model, adjusters: Mapping[str, Any], *, is_open: bool) -> FitOptions:
        options = FitOptions(
            procedure=self.procedure,
            free=tuple(name.strip() for name in self.free) or None,
            fixed=_in_si(damper, self.fix, "fix"),
            start=GivenStart(_in_si(damper, self.start_values, "start_values")),
            share=with_beta(damper, self.share, named={*self.free, *self.fix}),
            follows=followed(adjusters, damper, is_law_open=is_open),
            from_closed=counted_from_closed(adjusters),
            solver=SolverOptions(tolerance=self.tolerance, dead_band=self.dead_band),
            max_evaluations=self.max_evaluations,
            bulk_modulus=self.bulk_modulus,
            starts=self.starts,
            fallbacks={"r_m3": self.fallback_r_m3, "f_f": self.fallback_f_f},
        )
        check_options(options, damper)
        return options

    def profiled(self, damper: Model) -> tuple[str, ...]:
        names = tuple(name.strip() for name in self.profile)
        check_profile_names(names, damper.names, fixed=self.fix)
        return names


def _in_si(damper: Model, values: Mapping[str, float | str], key: str) -> dict[str, float]:
    with blamed_on(Key(("identification", key))):
        return {name: parameter_value(damper.quantity(name), one) for name, one in values.items()}


class SimulationSection(_Section):
    """[simulation]: what `simulate` runs unless the command line says otherwise."""

    wave: Literal["sine", "triangle"]
    cycles: Annotated[float, Field(ge=1.0, le=10_000.0)]
    sample_rate: _Frequency
    tolerance: _Force
    max_steps: Annotated[int, Field(ge=1)]
    dead_band: float = 0.0  # of [identification]

    @property
    def solver(self) -> SolverOptions:
        """How exactly to integrate."""
        return SolverOptions(tolerance=self.tolerance, dead_band=self.dead_band)


class OutputSection(_Section):
    """[output]: where results go, in which units, and what they must reach."""

    folder: _Path
    max_mse_percent: Annotated[float, _NotNegative]
    checks: _Names
    speeds: _Speeds
    units: Annotated[ShownUnits, BeforeValidator(_units_of)]

    @field_validator("folder")
    @classmethod
    def _has_a_name(cls, folder: Path | None) -> Path:
        if folder is None:
            raise ValueError("expected a text that is not empty")
        return folder

    def build(self, rig: RigSection) -> OutputSection:
        """Return the section with its checks expanded and its speeds in order."""
        checks: tuple[str, ...] = ()
        if self.checks:
            from damperfit.checks import expand_checks

            is_any = math.isinf(rig.temperature_tolerance)
            checks = expand_checks(
                (name.strip() for name in self.checks),
                pointless=("temperature_in_window",) if is_any else (),
            )
        built: OutputSection = self.but(checks=checks, speeds=tuple(sorted(set(self.speeds))))
        return built


class _Document(_Section):
    damper: DamperSection
    adjusters: dict[str, AdjusterKey]
    test: TestSection
    rig: RigSection
    conditioning: _ConditioningSection
    identification: _IdentificationSection
    simulation: SimulationSection
    output: OutputSection


@cache
def _document(model: str) -> type[_Document]:
    return create_model("_Document", __base__=_Document, damper=(damper_section(model), ...))


def build_configuration(
    document: dict[str, Any], *, declared: frozenset[str] = frozenset()
) -> Configuration:
    """Return the configuration that a complete TOML document describes.

    Parameters
    ----------
    document : dict
        Every key of defaults.toml.
    declared : frozenset of str
        Keys that somebody gave, as in "damper.rod_diameter".

    Raises
    ------
    pydantic.ValidationError
        A key is missing or unknown, or a value is of the wrong kind or out of range.
    ConfigurationError
        Values that do not go together, such as a parameter both free and fixed.
    """
    model = document["damper"]["model"]
    own: dict[str, Any] = {}  # what a model has of its own where nobody has declared it
    if model != "purdy":
        own = {"procedure": MODELS[model].procedures[0], "share": [DETECT]}
    if document["damper"]["reference_temperature"] != "none":
        own["procedure"] = "joint"
    left = {key: one for key, one in own.items() if f"identification.{key}" not in declared}
    document = {**document, "identification": document["identification"] | left}
    checked: Any = _document(model).model_validate(document)
    damper, fit = checked.damper.build(), checked.identification
    adjusters = check_adjusters(checked.adjusters)
    settings = declared_settings(checked.rig.settings, adjusters, key="rig.settings")
    return Configuration(
        damper=damper,
        rig=checked.rig.but(settings=settings),
        reading=checked.rig.reading(adjusters),
        test=checked.test,
        conditioning=checked.conditioning.build(checked.rig, damper, fit),
        identification=fit.build(damper, checked.adjusters, is_open="damper.model" not in declared),
        hold_out=HoldOutOptions(tuple(fit.hold_out), fit.hold_out_cycles),
        start_table=fit.start,
        profile=fit.profiled(damper),
        simulation=checked.simulation.but(dead_band=fit.dead_band),
        output=checked.output.build(checked.rig),
        declared=declared,
        document=document,
    )
