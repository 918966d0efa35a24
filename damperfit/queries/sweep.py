"""One quantity scaled by factors, everything else held: the families of the paper's Figs 4-9."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from damperfit.damper.purdy.figures import FAMILIES
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Damper
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.problem import Option
from damperfit.queries.one_simulation import simulate_test

if TYPE_CHECKING:
    from damperfit.configuration.options import Configuration
    from damperfit.damper.model import Model
    from damperfit.queries.chosen_parameters import ChosenParameters
    from damperfit.queries.one_simulation import SimulatedTest

__all__ = ["PAPER_SWEEPS", "Member", "Variation", "parse_variation", "run_sweep", "swept_units"]


@dataclass(frozen=True, slots=True)
class Variation:
    """What is varied.

    Attributes
    ----------
    name : str
        One of `swept_units`.
    factors : tuple of float
        In the order given.
    """

    name: str
    factors: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Member:
    """One of a family.

    Attributes
    ----------
    factor : float
        What the quantity was multiplied with.
    value : float
        The quantity then, SI.
    simulated : SimulatedTest
        The simulated test.
    """

    factor: float
    value: float
    simulated: SimulatedTest


_GAS = {"p_0": "gas_pressure", "gamma": "gas_exponent"}

PAPER_SWEEPS = tuple(Variation(one.name, one.factors) for one in FAMILIES)


def swept_units(damper: Model) -> dict[str, str]:
    """Return what of a damper and its test can be varied, with units.

    Parameters
    ----------
    damper : Model
        Of any model: its quantities, stroke and frequency; of the paper's the gas too, which is a
        quantity of other dampers with gas.
    """
    gas = {"p_0": "Pa", "gamma": ""} if isinstance(damper, Damper) else {}
    own = {one.name: one.unit for one in damper.quantities}
    return own | gas | {"amplitude": "m", "frequency": "Hz"}


def parse_variation(text: str, damper: Model = PURDY_DAMPER) -> Variation:
    """Return what NAME=F1,F2,... asks for.

    Parameters
    ----------
    text : str
        As typed.
    damper : Model
        Whose quantities there are.

    Raises
    ------
    ConfigurationError
        The name is unknown, or a factor is no number, negative, or zero where that is no damper.

    Examples
    --------
    >>> parse_variation("P_0=0.5,1,2")
    Variation(name='p_0', factors=(0.5, 1.0, 2.0))
    """
    name, equals, factors = (part.strip() for part in text.partition("="))
    name = name.lower()
    if not (name and equals and factors):
        raise ConfigurationError(
            f"expected NAME=F1,F2,..., as in {damper.names[0]}=0.8,1,1.2",
            where=Option("vary", text),
        )
    units = swept_units(damper)
    if name not in units:
        known = ", ".join(units)
        hint = did_you_mean(name, units)
        raise ConfigurationError(
            f"no {name!r}; there are {known}.{hint}", where=Option("vary", text)
        )
    values = tuple(_factor(part, text) for part in factors.split(","))
    may_be_zero = [one.name for one in damper.quantities if one.may_vanish or one.is_offset]
    if min(values) == 0.0 and name not in may_be_zero:
        raise ConfigurationError(
            f"{name} times 0 is not a damper; give factors above 0", where=Option("vary", text)
        )
    if len(set(values)) < len(values):
        raise ConfigurationError("a factor is given twice", where=Option("vary", text))
    return Variation(name, values)


def _factor(text: str, whole: str) -> float:
    try:
        value = float(text)
    except ValueError as error:
        raise ConfigurationError(
            f"{text!r} is not a number", where=Option("vary", whole)
        ) from error
    if not (math.isfinite(value) and value >= 0.0):
        raise ConfigurationError(
            f"{text}: expected a factor of 0 or more", where=Option("vary", whole)
        )
    return value


def run_sweep(
    choice: ChosenParameters, configuration: Configuration, *, variation: Variation
) -> tuple[Member, ...]:
    """Simulate the nominal test once for each factor.

    Parameters
    ----------
    choice : ChosenParameters
        Whose parameters.
    configuration : Configuration
        Damper, nominal test, solver.
    variation : Variation
        What is scaled, by what.

    Returns
    -------
    tuple of Member
        In the order of the factors.

    Raises
    ------
    ConfigurationError
        The quantity is zero, so that no factor changes it, or the stroke becomes too long.
    SimulationError
        The model cannot be integrated.
    """
    base = _value(choice, configuration, variation.name)
    if base == 0.0:
        raise ConfigurationError(f"{variation.name} is 0 here: no factor changes it")
    members = []
    for factor in variation.factors:
        try:
            changed = _changed(choice, configuration, variation.name, value=base * factor)
        except ConfigurationError as error:
            raise ConfigurationError(
                "{error}", error=error, where=Option("vary", f"{factor:g}", variation.name)
            ) from error
        members.append(Member(factor, base * factor, simulate_test(*changed)))
    return tuple(members)


def _value(choice: ChosenParameters, configuration: Configuration, name: str) -> float:
    if name in choice.parameters.names:
        return float(getattr(choice.parameters, name))
    if name in _GAS:
        return float(getattr(configuration.damper, _GAS[name]))
    return float(getattr(configuration.rig, name))


def _changed(
    choice: ChosenParameters, configuration: Configuration, name: str, *, value: float
) -> tuple[ChosenParameters, Configuration]:
    if name in choice.parameters.names:
        return replace(choice, parameters=choice.parameters.replace({name: value})), configuration
    rig, damper = configuration.rig, configuration.damper
    if isinstance(damper, Damper) and name in _GAS:
        damper = replace(damper, **{_GAS[name]: value})
    elif name == "amplitude":
        rig = replace(rig, amplitude=value)
    else:
        rig = replace(rig, frequency=value)
    return choice, replace(configuration, rig=rig, damper=damper)
