"""What a configuration holds: `Configuration`, one options object for each part of the program."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from damperfit.conditioning import GasFacts, OffsetFacts
from damperfit.configuration.damper_section import damper_record
from damperfit.damper.temperature_law import BETA, WithTemperature
from damperfit.errors import ConfigurationError
from damperfit.units.quantities import parse_quantity, says_absolute_or_gauge

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence
    from pathlib import Path

    from damperfit.conditioning import ConditionOptions
    from damperfit.configuration.sections import (
        OutputSection,
        RigSection,
        SimulationSection,
        TestSection,
    )
    from damperfit.damper.model import Model
    from damperfit.damper.quantity import Quantity
    from damperfit.identification import FitOptions
    from damperfit.io import ReadOptions
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty import HoldOutOptions


# Keys of [damper] that say what a damper's gas is.
GAS = ("gas_volume", "gas_pressure", "gas_exponent")
# Those that say what its valves, its rig and its friction are made of, which nobody measures.
_OF_THE_LAW = {"rebound", "compression", "mounting", "friction", "passages", "floating_piston"}
_OUTSIDE = "ambient_pressure"  # nobody declares it, and it is told by itself
_HARMLESS = {"oil_density", "gas_exponent", _OUTSIDE}
_USUALLY_SHARED: tuple[list[str], ...] = ([], ["r_m3", "f_f"], ["detect"])  # by default

# Of units that have a short name; parameters of other units are bare numbers in SI.
_DIMENSIONS = {
    "Pa": "pressure",
    "N": "force",
    "m": "length",
    "s": "time",
    "m/s": "velocity",
    "m2": "area",
    "N/m": "stiffness",
}


def offset_facts(damper: Model, named: Collection[str]) -> OffsetFacts:
    """Return what the fit of a model makes of a force that the rig adds; named: freed or held."""
    own = tuple(
        one.name
        for one in damper.quantities
        if not (one.is_shared or one.is_offset) and one.default is None
    )
    for one in damper.quantities:
        if one.is_offset:
            is_known = one.default is None or one.name in named
            return OffsetFacts(name=one.name, beside=own, is_known=is_known)
    return OffsetFacts()


def facts_of_damper(damper: Model, named: Collection[str]) -> dict[str, Any]:
    """Return what conditioning asks of a damper, by the names of `ConditionOptions`."""
    gas = None if damper.gas is None else GasFacts(*damper.gas)
    offset = offset_facts(damper, named)
    return {"gas": gas, "offset": offset, "chamber_lengths": damper.chamber_lengths}


def with_beta(damper: Model, share: Sequence[str], *, named: Collection[str]) -> tuple[str, ...]:
    """Return what all settings share, and what temperature does, which is one damper's."""
    names = tuple(name.strip() for name in share)
    is_said = BETA.name in {*names, *named} or names == ("detect",)
    return names if is_said or not isinstance(damper, WithTemperature) else (*names, BETA.name)


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
    # Where the logs chose the damper's law: what they tell, as it stands in run.json, and the MSE
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
            conditioning=replace(self.conditioning, **facts),
            identification=fit,
            document={**self.document, "damper": damper_record(damper)},
        )

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of [damper] that the model has."""
        return tuple(
            name
            for name in self.document["damper"]
            if name not in {"model", "reference_temperature"}
        )

    @property
    def undeclared(self) -> tuple[str, ...]:
        """Keys of [damper] that nobody gave."""
        return tuple(name for name in self.keys if f"damper.{name}" not in self.declared)

    @property
    def not_measured(self) -> tuple[str, ...]:
        """Those that somebody could have measured: the air is everywhere much the same."""
        return tuple(name for name in self.undeclared if name not in {*_OF_THE_LAW, _OUTSIDE})

    @property
    def is_assumed(self) -> bool:
        """Whether nobody gave anything that is measured of the damper."""
        measured = {name for name in self.keys if name not in _OF_THE_LAW}
        return bool(measured) and measured <= set(self.undeclared)

    @property
    def whose(self) -> str:
        """Whose dimensions stand where nobody has declared any."""
        return "the paper's damper" if self.damper.name == "purdy" else "a generic damper"

    @property
    def _not_declared(self) -> str:
        if self.chosen_law or len(self.undeclared) == len(self.keys):
            return "[damper] is not declared"
        return "[damper] declares no dimensions"

    @property
    def assumed_dimensions(self) -> str:
        """What nobody declared of the dimensions, and what stands for it; empty for nothing.

        What the oil weighs, how its gas is compressed and what presses on the rod bend nothing that
        the grade hides.
        """
        missing = self._not_declared
        if not self.is_assumed:
            names = [name for name in self.undeclared if name not in {*_OF_THE_LAW, *_HARMLESS}]
            if not names:
                return ""
            listed = " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
            missing = f"{listed} {'are' if len(names) > 1 else 'is'} not declared"
        return f"{missing}, and with the dimensions of {self.whose}"

    @property
    def damper_sentence(self) -> str:
        """The damper's main figures, and whose they are."""
        return self.damper_sentence_from("")

    def damper_sentence_from(self, origin: str) -> str:
        """Return `damper_sentence` with words on where the damper was found, behind its figures."""
        assumed = ""
        if self.is_assumed:
            whose = "the paper's" if self.damper.name == "purdy" else "made up"
            assumed = (
                f" ({whose}: {self._not_declared}, and resistances, K_e and pressures are "
                "right only for these dimensions)"
            )
        return f"Damper: {self.damper.plain.sentence}{assumed}{origin}{self.damper.condition}."

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed of the damper, a sentence each."""
        notes = [] if self.is_assumed else [*self._assumed()]
        fit, only = self.identification, "only procedure joint uses it, found procedure"
        if fit.procedure != "joint":
            if fit.follows:
                notes.append(
                    f"[adjusters] says what follows which adjuster; {only} {fit.procedure}"
                )
            shared = self.document["identification"]["share"]
            if "identification.share" in self.declared and shared not in _USUALLY_SHARED:
                notes.append(
                    f"identification.share = {shared} has no effect: {only} {fit.procedure}"
                )
        pressure = self.document["damper"].get("gas_pressure")
        if isinstance(pressure, str) and not says_absolute_or_gauge(pressure):
            notes.append(
                f"damper.gas_pressure = {pressure} is taken as absolute; a gauge shows 1.013 bar "
                "less: say which, as in 12bara or 12barg"
            )
        return tuple(notes)

    def _assumed(self) -> Iterator[str]:
        if names := self.not_measured:
            taken = {name: getattr(self.damper, name) for name in GAS if name in self.undeclared}
            gas = f" ({gas_in_words(taken)})" if "gas_volume" in taken else ""
            yield (
                f"[damper] leaves {', '.join(names)} to {self.whose}{gas}: "
                "declare what your damper has (damperfit config prints every key)"
            )
        if _OUTSIDE in self.undeclared:
            bar = 1e-5 * getattr(self.damper, _OUTSIDE)
            yield (
                f"the air presses on the rod with {bar:.4g} bar, unless damper.{_OUTSIDE} says "
                "otherwise"
                if bar
                else "the paper's equation leaves out the air that presses on the rod; if the load "
                f'cell was zeroed without the damper, set damper.{_OUTSIDE} = "1.013bara"'
            )


def gas_in_words(values: Mapping[str, float]) -> str:
    """Return what is taken for a damper's gas, of some of `GAS` in SI."""
    words = {
        "gas_volume": ("{:.3g} cm3 of gas", 1e6),
        "gas_pressure": ("{:.3g} bar absolute", 1e-5),
        "gas_exponent": ("exponent {:g}", 1.0),
    }
    known = [(*words[name], values[name]) for name in words if name in values]
    return ", ".join(text.format(factor * value) for text, factor, value in known)


def parameter_value(quantity: Quantity, value: str | float) -> float:
    """Return a parameter's value in SI; text may carry a unit where that is a plain one."""
    name, unit = quantity.name, quantity.unit
    dimension = "absolute pressure" if quantity.is_absolute else _DIMENSIONS.get(unit)
    is_text = isinstance(value, str) and dimension is not None
    try:
        number = parse_quantity(value, str(dimension)) if is_text else float(value)
    except ValueError as error:
        text = f"{name} = {value}: expected a number in {unit}"
        raise ConfigurationError(text, code="not-a-number") from error
    if not math.isfinite(number):
        text = f"{name} = {value}: expected a finite number"
        raise ConfigurationError(text, code="not-a-number")
    return number
