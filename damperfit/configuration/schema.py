"""The schema that a TOML document must meet, and the `Configuration` that it describes.

The schema has no defaults: every key stands in defaults.toml. Quantities are text with a unit
("19mm", "4.6bar") or bare numbers in SI.
"""

from __future__ import annotations

import math
import os
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_type_hints

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

from damperfit.conditioning import ConditionOptions, GasFacts, NominalTest
from damperfit.configuration.damper_section import DamperSection, damper_section
from damperfit.configuration.options import (
    Configuration,
    OutputOptions,
    RigOptions,
    SimulationOptions,
    offset_facts,
    parameter_value,
    with_beta,
)
from damperfit.configuration.plain_values import (
    known_or_detect,
    not_in_mhz,
    not_in_mm,
    quantity,
    quantity_or_word,
)
from damperfit.configuration.what_is_tested import (
    AdjusterKey,
    TestSection,
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
from damperfit.uncertainty import HoldOutOptions, check_profile_names
from damperfit.units.shown_units import parse_units

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.damper.model import Model

__all__ = ["build_configuration"]


_Sign = Annotated[bool | str, BeforeValidator(known_or_detect)]
_Positive = Field(gt=0.0, allow_inf_nan=False)
_NotNegative = Field(ge=0.0, allow_inf_nan=False)
_Length = Annotated[float, quantity("length"), _Positive]
_Force = Annotated[float, quantity("force"), _Positive]
_Amplitude = Annotated[_Length, AfterValidator(not_in_mm)]
_Frequency = Annotated[float, quantity("frequency"), _Positive]
_Speed = Annotated[float, quantity("velocity"), _NotNegative]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


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
    sample_rate: Annotated[float, quantity("frequency"), _NotNegative]
    pause: Annotated[float, quantity("time"), _NotNegative]
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


_OPTIONAL: dict[str, Any] = {
    name: (kind, None)
    for name, kind in get_type_hints(_DeclaredKeys, include_extras=True).items()
    if name in _DeclaredKeys.model_fields
}
# Every declared key, none of them needed; only those that are given count.
_ProfileSection: Any = create_model(
    "_ProfileSection", __base__=(_ProfileKeys, _DeclaredKeys), **_OPTIONAL
)


class _RigSection(_DeclaredKeys):
    amplitude: _Amplitude
    frequency: Annotated[_Frequency, AfterValidator(not_in_mhz)]
    settings: list[int | str]
    contradictions: Literal["refuse", "average"]
    strict: bool
    temperature: Annotated[float, Field(allow_inf_nan=False)]
    temperature_tolerance: Annotated[float, Field(ge=0.0)]  # infinite: none is asked for
    filter: Literal["none", "causal", "zero_phase"]
    filter_corner: _Frequency
    filter_order: int
    centre: Annotated[float | str, quantity_or_word("length", "mid-stroke")]
    skew: Annotated[float | str, quantity_or_word("time", "auto")]
    max_log_bytes: int
    profile: str
    profiles: dict[str, _ProfileSection]

    def build(self, adjusters: tuple[str, ...]) -> RigOptions:
        return RigOptions(
            amplitude=self.amplitude,
            frequency=self.frequency,
            settings=declared_settings(self.settings, adjusters, key="rig.settings"),
            is_averaging=self.contradictions == "average",
            temperature=self.temperature,
            temperature_tolerance=self.temperature_tolerance,
            is_strict=self.strict,
        )

    def build_reading(self, adjusters: tuple[str, ...]) -> ReadOptions:
        general = ReadOptions(**self.declared(), adjusters=adjusters, max_bytes=self.max_log_bytes)
        profiles = (
            Profile(name=name, files=keys.files, declared=keys.declared())
            for name, keys in self.profiles.items()
        )
        return replace(general, profile=self.profile, profiles=tuple(profiles))


class _ConditioningSection(_Section):
    filter: Literal["none", "causal", "zero_phase"]
    filter_corner: Annotated[float | str, quantity_or_word("frequency", "auto")]
    filter_order: int
    steadiness: float
    spikes: str
    min_amplitude: _Length
    max_amplitude: _Length
    max_force: _Force

    def build(
        self, rig: _RigSection, damper: Model, fit: _IdentificationSection
    ) -> ConditionOptions:
        return ConditionOptions(
            filter=self.filter,
            filter_corner=30.0 if isinstance(self.filter_corner, str) else self.filter_corner,
            auto_corner=isinstance(self.filter_corner, str),
            filter_order=self.filter_order,
            rig_filter=rig.filter,
            rig_filter_corner=rig.filter_corner,
            rig_filter_order=rig.filter_order,
            centre=None if isinstance(rig.centre, str) else rig.centre,
            steadiness=self.steadiness,
            spikes=self.spikes,
            skew=rig.skew,
            gas=None if damper.gas is None else GasFacts(*damper.gas),
            offset=offset_facts(damper, {*fit.fix, *fit.free}),
            chamber_lengths=damper.chamber_lengths,
            min_amplitude=self.min_amplitude,
            max_amplitude=self.max_amplitude,
            max_force=self.max_force,
            nominal=NominalTest(
                frequency=rig.frequency,
                amplitude=rig.amplitude,
                temperature=rig.temperature,
                temperature_tolerance=rig.temperature_tolerance,
                is_of_motion=(
                    rig.frequency,
                    rig.amplitude,
                    rig.temperature,
                    rig.temperature_tolerance,
                )
                == _PAPERS_TEST,
            ),
        )


# Hz, m, degC and K: a window that belongs to this test asks nothing of another one.
_PAPERS_TEST = (1.5, 0.032, 26.0, 1.0)


class _IdentificationSection(_Section):
    procedure: str
    free: list[str]
    fix: dict[str, float | str]
    share: list[str]
    bulk_modulus: str
    starts: Annotated[int, Field(ge=1, le=10_000)]
    start: str
    start_values: dict[str, float | str]
    profile: list[str]
    hold_out: list[str]
    hold_out_cycles: Annotated[float, _NotNegative]
    max_evaluations: Annotated[int, Field(ge=1)]
    tolerance: _Force
    dead_band: _Speed
    fallback_r_m3: Annotated[float, _Positive]
    fallback_f_f: Annotated[float, quantity("force"), _NotNegative]

    @field_validator("hold_out_cycles")
    @classmethod
    def _share_or_number(cls, cycles: float) -> float:
        if cycles >= 1.0 and cycles != round(cycles):
            raise ValueError("expected a share below 1 or a whole number of cycles")
        return cycles

    def build_hold_out(self) -> HoldOutOptions:
        return HoldOutOptions(tuple(self.hold_out), self.hold_out_cycles)

    def build(
        self, damper: Model, *, follows: dict[str, tuple[str, ...]], from_closed: tuple[str, ...]
    ) -> FitOptions:
        options = FitOptions(
            procedure=self.procedure,
            free=tuple(name.strip() for name in self.free) or None,
            fixed=_in_si(damper, self.fix, "fix"),
            start=GivenStart(_in_si(damper, self.start_values, "start_values")),
            share=with_beta(damper, self.share, named={*self.free, *self.fix}),
            follows=follows,
            from_closed=from_closed,
            solver=SolverOptions(tolerance=self.tolerance, dead_band=self.dead_band),
            max_evaluations=self.max_evaluations,
            bulk_modulus=self.bulk_modulus,
            starts=self.starts,
            fallbacks={"r_m3": self.fallback_r_m3, "f_f": self.fallback_f_f},
        )
        check_options(options, damper)
        return options

    def build_profile(self, damper: Model) -> tuple[str, ...]:
        names = tuple(name.strip() for name in self.profile)
        check_profile_names(names, damper.names, fixed=self.fix)
        return names


def _in_si(damper: Model, values: Mapping[str, float | str], key: str) -> dict[str, float]:
    with blamed_on(Key(("identification", key))):
        return {name: parameter_value(damper.quantity(name), one) for name, one in values.items()}


class _SimulationSection(_Section):
    wave: Literal["sine", "triangle"]
    cycles: Annotated[float, Field(ge=1.0, le=10_000.0)]
    sample_rate: _Frequency
    tolerance: _Force
    max_steps: Annotated[int, Field(ge=1)]

    def build(self, dead_band: float) -> SimulationOptions:
        solver = SolverOptions(tolerance=self.tolerance, dead_band=dead_band)
        return SimulationOptions(self.cycles, self.sample_rate, self.wave, solver, self.max_steps)


class _OutputSection(_Section):
    folder: Annotated[str, Field(min_length=1)]
    max_mse_percent: Annotated[float, _NotNegative]
    checks: list[str]
    speeds: Annotated[list[Annotated[float, quantity("velocity"), _Positive]], Field(min_length=1)]
    units: str

    def build(self, rig: _RigSection) -> OutputOptions:
        pointless = () if math.isfinite(rig.temperature_tolerance) else ("temperature_in_window",)
        checks: tuple[str, ...] = ()
        if self.checks:
            from damperfit.checks import expand_checks

            checks = expand_checks((name.strip() for name in self.checks), pointless=pointless)
        units = parse_units(self.units, Key(("output", "units")))
        folder = Path(os.path.expanduser(self.folder))  # noqa: PTH111 - a Path raises on ~nobody
        speeds = tuple(sorted(set(self.speeds)))
        return OutputOptions(folder, self.max_mse_percent, checks, units, speeds)


class _Document(_Section):
    damper: DamperSection
    adjusters: dict[str, AdjusterKey]
    test: TestSection
    rig: _RigSection
    conditioning: _ConditioningSection
    identification: _IdentificationSection
    simulation: _SimulationSection
    output: _OutputSection


def _with_own(document: dict[str, Any], declared: frozenset[str], **own: object) -> dict[str, Any]:
    """Put what a model has of its own where nobody has declared it."""
    left = {key: one for key, one in own.items() if f"identification.{key}" not in declared}
    return {**document, "identification": document["identification"] | left}


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
    if model != "purdy":
        own = MODELS[model].procedures[0]
        document = _with_own(document, declared, procedure=own, share=[DETECT])
    if document["damper"]["reference_temperature"] != "none":
        document = _with_own(document, declared, procedure="joint")
    checked: Any = _document(model).model_validate(document)
    damper = checked.damper.build()
    adjusters = check_adjusters(checked.adjusters)
    return Configuration(
        damper=damper,
        rig=checked.rig.build(adjusters),
        reading=checked.rig.build_reading(adjusters),
        test=checked.test.build(),
        conditioning=checked.conditioning.build(checked.rig, damper, checked.identification),
        identification=checked.identification.build(
            damper,
            follows=followed(checked.adjusters, damper, is_law_open="damper.model" not in declared),
            from_closed=counted_from_closed(checked.adjusters),
        ),
        hold_out=checked.identification.build_hold_out(),
        start_table=Path(checked.identification.start) if checked.identification.start else None,
        profile=checked.identification.build_profile(damper),
        simulation=checked.simulation.build(checked.identification.dead_band),
        output=checked.output.build(checked.rig),
        declared=declared,
        document=document,
    )
