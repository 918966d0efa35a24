"""What a configuration holds: `Settings`, and the schema that a TOML document must meet.

The schema has no defaults: every key stands in defaults.toml. Quantities are text with a unit
("19mm", "4.6bar") or bare numbers in SI.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from damperfit.conditioning import ConditionOptions
from damperfit.damper.parameters import PARAMETER_NAMES, Damper
from damperfit.errors import did_you_mean
from damperfit.identification import FitOptions
from damperfit.quantities import parse_quantity
from damperfit.readers import ReadOptions
from damperfit.simulation import SolverOptions

__all__ = [
    "OutputOptions",
    "RigOptions",
    "Settings",
    "SimulationOptions",
    "build_settings",
]


@dataclass(frozen=True, slots=True)
class RigOptions:
    """The nominal test, for `simulate` and `samples`, and the settings a campaign should have.

    Attributes
    ----------
    amplitude, frequency : float
        m, Hz.
    settings : tuple of int
        Settings that ought to be among the logs; empty: whatever is there.
    """

    amplitude: float
    frequency: float
    settings: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class SimulationOptions:
    """What `simulate` runs unless the command line says otherwise.

    Attributes
    ----------
    cycles : float
        Length in cycles.
    sample_rate : float
        Hz.
    wave : str
        "sine" or "triangle".
    """

    cycles: float
    sample_rate: float
    wave: str


@dataclass(frozen=True, slots=True)
class OutputOptions:
    """Where results go and what they must reach.

    Attributes
    ----------
    folder : pathlib.Path
        Folder of the results of `identify`.
    max_mse_percent : float
        Gate: a setting above it makes the command end with code 4; 0 is no gate.
    """

    folder: Path
    max_mse_percent: float


@dataclass(frozen=True, slots=True)
class Settings:
    """The complete configuration; one field for each part of the program.

    Attributes
    ----------
    damper : Damper
        Geometry, oil and gas.
    rig : RigOptions
        Nominal test.
    reading : ReadOptions
        How logs are read.
    conditioning : ConditionOptions
        How signals become traces.
    identification : FitOptions
        What is fitted, and how.
    simulation : SimulationOptions
        Defaults of `simulate`.
    output : OutputOptions
        Folder and gates.
    document : dict
        The same as one TOML document, quantities as they were written.
    """

    damper: Damper
    rig: RigOptions
    reading: ReadOptions
    conditioning: ConditionOptions
    identification: FitOptions
    simulation: SimulationOptions
    output: OutputOptions
    document: dict[str, Any] = field(compare=False, repr=False)


def _quantity(dimension: str) -> BeforeValidator:
    def convert(value: object) -> object:
        return parse_quantity(value, dimension) if isinstance(value, str) else value

    return BeforeValidator(convert)


_Positive = Field(gt=0.0, allow_inf_nan=False)
_NotNegative = Field(ge=0.0, allow_inf_nan=False)
_Length = Annotated[float, _quantity("length"), _Positive]
_Pressure = Annotated[float, _quantity("pressure"), _Positive]
_Density = Annotated[float, _quantity("density"), _Positive]
_Frequency = Annotated[float, _quantity("frequency"), _Positive]
_Speed = Annotated[float, _quantity("velocity"), _NotNegative]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class _DamperSection(_Section):
    rod_diameter: _Length
    piston_diameter: _Length
    gas_piston_diameter: _Length
    chamber_1_length: _Length
    chamber_2_length: _Length
    gas_length: _Length
    oil_density: _Density
    gas_pressure: _Pressure
    gas_exponent: Annotated[float, _Positive]

    @model_validator(mode="after")
    def _rod_fits(self) -> _DamperSection:
        if self.rod_diameter >= self.piston_diameter:
            raise ValueError(
                f"rod_diameter {self.rod_diameter:g} m must be smaller than "
                f"piston_diameter {self.piston_diameter:g} m"
            )
        return self

    def build(self) -> Damper:
        return Damper(**self.model_dump())
