"""The schema that a TOML document must meet, and the `Configuration` that it describes.

The schema has no defaults: every key stands in defaults.toml. Quantities are text with a unit
("19mm", "4.6bar") or bare numbers in SI.
"""

from __future__ import annotations

import math
from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any, Literal, get_type_hints

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)

from damperfit.checks import expand_checks
from damperfit.conditioning import ConditionOptions, GasFacts, NominalTest
from damperfit.configuration.options import (
    Configuration,
    OutputOptions,
    RigOptions,
    SimulationOptions,
    parameter_value,
)
from damperfit.damper.parameters import DAMPER_RANGES, PARAMETER_NAMES, Damper
from damperfit.errors import did_you_mean
from damperfit.identification import FitOptions, check_options
from damperfit.quantities import parse_quantity, says_absolute_or_gauge
from damperfit.readers import Profile, ReadOptions
from damperfit.readers.options import Declarations
from damperfit.setting import Setting
from damperfit.simulation import SolverOptions
from damperfit.uncertainty import HoldOutOptions, check_profile_names

__all__ = ["build_configuration"]


def _quantity(dimension: str) -> BeforeValidator:
    def convert(value: object) -> object:
        return parse_quantity(value, dimension) if isinstance(value, str) else value

    return BeforeValidator(convert)


def _quantity_or_word(dimension: str, word: str) -> BeforeValidator:
    def convert(value: object) -> object:
        is_text = isinstance(value, str) and value != word
        return parse_quantity(str(value), dimension) if is_text else value

    return BeforeValidator(convert)


def _known_or_detect(value: object) -> object:
    if value == "detect" or isinstance(value, bool):
        return value
    raise ValueError("expected true, false or 'detect'")


_ASKED_BELOW = 2e5  # Pa: a gauge reading taken as absolute is here a third too low, or more
_LONGEST = 2.0  # m, beyond any rig's amplitude: mm were meant


def _gas_pressure(value: object) -> object:
    """Return an absolute pressure; ask what a low one counts from."""
    if not isinstance(value, str | float | int) or isinstance(value, bool):
        return value
    pressure = parse_quantity(value, "absolute pressure")
    is_told = isinstance(value, str) and says_absolute_or_gauge(value)
    is_low = pressure == 0.0 or DAMPER_RANGES["gas_pressure"][0] <= pressure < _ASKED_BELOW
    if is_low and not is_told:
        raise ValueError(
            "is it absolute, or does it count from the atmosphere? expected a unit that says so, "
            "as in 'bara' or 'barg'"
        )
    return pressure


def _not_in_mm(length: float) -> float:
    if length > _LONGEST:
        raise ValueError(f"expected at most {_LONGEST:g} m; a bare number is in m, as in '32mm'")
    return length


_Sign = Annotated[bool | str, BeforeValidator(_known_or_detect)]
_Positive = Field(gt=0.0, allow_inf_nan=False)
_NotNegative = Field(ge=0.0, allow_inf_nan=False)
_Length = Annotated[float, _quantity("length"), _Positive]
_Dimension = Annotated[float, _quantity("length")]
_Force = Annotated[float, _quantity("force"), _Positive]
_Amplitude = Annotated[_Length, AfterValidator(_not_in_mm)]
_Frequency = Annotated[float, _quantity("frequency"), _Positive]
_Speed = Annotated[float, _quantity("velocity"), _NotNegative]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class _DamperSection(_Section):
    rod_diameter: _Dimension
    piston_diameter: _Dimension
    gas_piston_diameter: _Dimension
    chamber_1_length: _Dimension
    chamber_2_length: _Dimension
    gas_length: _Dimension
    oil_density: Annotated[float, _quantity("density")]
    gas_pressure: Annotated[float, BeforeValidator(_gas_pressure)]
    gas_exponent: float

    @field_validator("*")
    @classmethod
    def _is_plausible(cls, value: float, info: ValidationInfo) -> float:
        low, high, unit = DAMPER_RANGES[str(info.field_name)]
        if not low <= value <= high:
            raise ValueError(f"expected {low:g} to {high:g}{' ' + unit if unit else ''}")
        return value

    @model_validator(mode="after")
    def _rod_fits(self) -> _DamperSection:
        if self.rod_diameter >= self.piston_diameter:
            raise ValueError(
                f"rod_diameter: expected less than piston_diameter, {self.piston_diameter:g} m, "
                f"found {self.rod_diameter:g} m"
            )
        return self

    def build(self) -> Damper:
        return Damper(**self.model_dump())


class _DeclaredKeys(_Section):
    """How logs are to be understood: in [rig], and in a profile, where none is needed."""

    reverse_displacement: _Sign
    reverse_force: _Sign
    setting_pattern: str
    part_settings: list[int]
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

    def declared(self) -> dict[str, Any]:
        """Return the keys that are given, as `Declarations` has them."""
        given = {f.name for f in fields(Declarations)} & self.model_fields_set
        values = self.model_dump(include=given)
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
    frequency: _Frequency
    settings: list[int]
    strict: bool
    temperature: Annotated[float, Field(allow_inf_nan=False)]
    temperature_tolerance: Annotated[float, Field(ge=0.0)]  # infinite: none is asked for
    filter: Literal["none", "causal", "zero_phase"]
    filter_corner: _Frequency
    filter_order: int
    centre: Annotated[float | str, _quantity_or_word("length", "mid-stroke")]
    skew: Annotated[float | str, _quantity_or_word("time", "auto")]
    max_log_bytes: int
    profile: str
    profiles: dict[str, _ProfileSection]

    def build(self) -> RigOptions:
        return RigOptions(
            amplitude=self.amplitude,
            frequency=self.frequency,
            settings=tuple(sorted(set(map(Setting.of, self.settings)))),
            temperature=self.temperature,
            temperature_tolerance=self.temperature_tolerance,
            is_strict=self.strict,
        )

    def build_reading(self) -> ReadOptions:
        general = ReadOptions(**self.declared(), max_bytes=self.max_log_bytes)
        profiles = (
            Profile(name=name, files=keys.files, declared=keys.declared())
            for name, keys in self.profiles.items()
        )
        return replace(general, profile=self.profile, profiles=tuple(profiles))


class _ConditioningSection(_Section):
    filter: Literal["none", "causal", "zero_phase"]
    filter_corner: _Frequency
    filter_order: int
    steadiness: float
    spikes: str
    min_amplitude: _Length
    max_amplitude: _Length
    max_force: _Force

    def build(
        self, rig: _RigSection, damper: Damper, fit: _IdentificationSection
    ) -> ConditionOptions:
        return ConditionOptions(
            filter=self.filter,
            filter_corner=self.filter_corner,
            filter_order=self.filter_order,
            rig_filter=rig.filter,
            rig_filter_corner=rig.filter_corner,
            rig_filter_order=rig.filter_order,
            centre=None if isinstance(rig.centre, str) else rig.centre,
            steadiness=self.steadiness,
            spikes=self.spikes,
            skew=rig.skew,
            gas=GasFacts(
                rod_area=damper.rod_area,
                pressure=damper.gas_pressure,
                volume=damper.gas_volume,
                exponent=damper.gas_exponent,
            ),
            is_offset_known="f_0" in fit.fix or "f_0" in fit.free,
            chamber_lengths=(damper.chamber_1_length, damper.chamber_2_length),
            min_amplitude=self.min_amplitude,
            max_amplitude=self.max_amplitude,
            max_force=self.max_force,
            nominal=NominalTest(
                frequency=rig.frequency,
                amplitude=rig.amplitude,
                temperature=rig.temperature,
                temperature_tolerance=rig.temperature_tolerance,
            ),
        )


class _IdentificationSection(_Section):
    procedure: str
    free: list[str]
    fix: dict[str, float | str]
    share: list[str]
    bulk_modulus: str
    starts: Annotated[int, Field(ge=1, le=10_000)]
    profile: list[str]
    hold_out: list[str]
    hold_out_cycles: Annotated[float, _NotNegative]
    max_evaluations: Annotated[int, Field(ge=1)]
    tolerance: _Force
    dead_band: _Speed
    fallback_r_m3: Annotated[float, _Positive]
    fallback_f_f: Annotated[float, _quantity("force"), _NotNegative]

    @field_validator("hold_out_cycles")
    @classmethod
    def _share_or_number(cls, cycles: float) -> float:
        if cycles >= 1.0 and cycles != round(cycles):
            raise ValueError("expected a share below 1 or a whole number of cycles")
        return cycles

    def build_hold_out(self) -> HoldOutOptions:
        return HoldOutOptions(tuple(self.hold_out), self.hold_out_cycles)

    def build(self) -> FitOptions:
        options = FitOptions(
            procedure=self.procedure,
            free=tuple(name.strip() for name in self.free) or None,
            fixed={name: parameter_value(name, value) for name, value in self.fix.items()},
            share=tuple(name.strip() for name in self.share),
            solver=SolverOptions(tolerance=self.tolerance, dead_band=self.dead_band),
            max_evaluations=self.max_evaluations,
            bulk_modulus=self.bulk_modulus,
            starts=self.starts,
            fallback_r_m3=self.fallback_r_m3,
            fallback_f_f=self.fallback_f_f,
        )
        check_options(options)
        return options

    def build_profile(self) -> tuple[str, ...]:
        names = tuple(name.strip() for name in self.profile)
        check_profile_names(names, PARAMETER_NAMES, fixed=self.fix)
        return names


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

    def build(self, rig: _RigSection) -> OutputOptions:
        pointless = () if math.isfinite(rig.temperature_tolerance) else ("temperature_in_window",)
        checks = expand_checks((name.strip() for name in self.checks), pointless=pointless)
        return OutputOptions(Path(self.folder), self.max_mse_percent, checks)


class _Document(_Section):
    damper: _DamperSection
    rig: _RigSection
    conditioning: _ConditioningSection
    identification: _IdentificationSection
    simulation: _SimulationSection
    output: _OutputSection


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
    checked = _Document.model_validate(document)
    damper = checked.damper.build()
    return Configuration(
        damper=damper,
        rig=checked.rig.build(),
        reading=checked.rig.build_reading(),
        conditioning=checked.conditioning.build(checked.rig, damper, checked.identification),
        identification=checked.identification.build(),
        hold_out=checked.identification.build_hold_out(),
        profile=checked.identification.build_profile(),
        simulation=checked.simulation.build(checked.identification.dead_band),
        output=checked.output.build(checked.rig),
        declared=declared,
        document=document,
    )
