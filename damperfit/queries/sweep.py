"""One quantity scaled by factors, everything else held: the families of the paper's Figs 4-9."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from damperfit.damper.purdy.parameters import PURDY_DAMPER, Damper
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.queries.one_simulation import simulate_test

if TYPE_CHECKING:
    from damperfit.configuration.options import Configuration
    from damperfit.queries.one_simulation import Choice, SimulatedTest

__all__ = ["PAPER_SWEEPS", "SWEPT_UNITS", "Member", "Variation", "parse_variation", "run_sweep"]

SWEPT_UNITS = {one.name: one.unit for one in PURDY_DAMPER.quantities} | {
    "p_0": "Pa",
    "gamma": "",
    "amplitude": "m",
    "frequency": "Hz",
}
_MAY_BE_ZERO = [q.name for q in PURDY_DAMPER.quantities if q.may_vanish or q.is_offset]


@dataclass(frozen=True, slots=True)
class Variation:
    """What is varied.

    Attributes
    ----------
    name : str
        One of `SWEPT_UNITS`.
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
    trial : SimulatedTest
        The simulated test.
    """

    factor: float
    value: float
    trial: SimulatedTest


# Figures 4, 5, 6 (and 7: its pressures), 8 and 9 of the paper.
PAPER_SWEEPS = (
    Variation("r_m1", (0.8, 1.0, 1.2)),
    Variation("r_m2", (0.8, 1.0, 1.2)),
    Variation("r_m3", (0.5, 1.0, 1.5)),
    Variation("k_e", (0.2, 1.0, 2.0)),
    Variation("f_f", (0.0, 1.0, 2.0)),
)


def parse_variation(text: str) -> Variation:
    """Return what NAME=F1,F2,... asks for.

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
        raise ConfigurationError(f"--vary {text}: expected NAME=F1,F2,..., as in r_m1=0.8,1,1.2")
    if name not in SWEPT_UNITS:
        known = ", ".join(SWEPT_UNITS)
        hint = did_you_mean(name, SWEPT_UNITS)
        raise ConfigurationError(f"--vary {text}: no {name!r}; there are {known}.{hint}")
    values = tuple(_factor(part, text) for part in factors.split(","))
    if min(values) == 0.0 and name not in _MAY_BE_ZERO:
        raise ConfigurationError(
            f"--vary {text}: {name} times 0 is not a damper; give factors above 0"
        )
    if len(set(values)) < len(values):
        raise ConfigurationError(f"--vary {text}: a factor is given twice")
    return Variation(name, values)


def _factor(text: str, whole: str) -> float:
    try:
        value = float(text)
    except ValueError as error:
        raise ConfigurationError(f"--vary {whole}: {text!r} is not a number") from error
    if not (math.isfinite(value) and value >= 0.0):
        raise ConfigurationError(f"--vary {whole}: {text}: expected a factor of 0 or more")
    return value


def run_sweep(
    choice: Choice, configuration: Configuration, *, variation: Variation
) -> tuple[Member, ...]:
    """Simulate the nominal test once for each factor.

    Parameters
    ----------
    choice : Choice
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
        changed = _changed(choice, configuration, variation.name, value=base * factor)
        members.append(Member(factor, base * factor, simulate_test(*changed)))
    return tuple(members)


def _value(choice: Choice, configuration: Configuration, name: str) -> float:
    others = {
        "p_0": _damper(configuration).gas_pressure,
        "gamma": _damper(configuration).gas_exponent,
        "amplitude": configuration.rig.amplitude,
        "frequency": configuration.rig.frequency,
    }
    return others[name] if name in others else float(getattr(choice.parameters, name))


def _damper(configuration: Configuration) -> Damper:
    if not isinstance(configuration.damper, Damper):
        raise ConfigurationError(
            f"sweep varies the paper's model; these parameters are of {configuration.damper.name!r}"
        )
    return configuration.damper


def _changed(
    choice: Choice, configuration: Configuration, name: str, *, value: float
) -> tuple[Choice, Configuration]:
    if name in choice.parameters.names:
        return replace(choice, parameters=choice.parameters.replace({name: value})), configuration
    rig, damper = configuration.rig, _damper(configuration)
    if name == "amplitude":
        rig = replace(rig, amplitude=value)
    elif name == "frequency":
        rig = replace(rig, frequency=value)
    elif name == "p_0":
        damper = replace(damper, gas_pressure=value)
    else:
        damper = replace(damper, gas_exponent=value)
    return choice, replace(configuration, rig=rig, damper=damper)
