"""What is open of a damper where nobody has declared its layout, its dimensions or its gas."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

from damperfit.configuration.options import GAS, gas_in_words
from damperfit.damper.purdy.parameters import Damper
from damperfit.damper.valve_dampers import Monotube, ValveDamper

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.laws import LawFit, LawSearch, Tried

__all__ = [
    "GAS_LENGTHS",
    "assumed_gas",
    "declared_dimensions",
    "is_monotube_open",
    "open_dimensions",
    "open_layout",
]

# What a law has of its own, and the lengths that make the paper's gas volume.
_VALVES = {"rebound", "compression"}
GAS_LENGTHS = {"gas_length", "gas_piston_diameter"}
# Dimensions whose error bends the loop, and what of the rig takes its shape.
_DIMENSIONS = {
    "rod_diameter": "the rod",
    "piston_diameter": "the bore",
    "gas_pressure": "the gas pressure",
}
_OF_RIG = {
    "k_s": "elasticity",
    "play": "play",
    "lag": "the lag of the force",
    "moving_mass": "the moving mass",
}


def declared_dimensions(
    configuration: Configuration, damper: Damper | ValveDamper
) -> dict[str, Any]:
    """What a layout takes from the damper: what was declared, as `--model NAME` does."""
    own = {one.name for one in fields(damper) if one.init}
    shared = {one.name for one in fields(ValveDamper) if one.name in own} - _VALVES
    if isinstance(damper, ValveDamper):
        return {name: getattr(damper, name) for name in shared}
    known = {name: getattr(damper, name) for name in shared}
    known["gas_volume"] = damper.gas_volume
    declared = {one.removeprefix("damper.") for one in configuration.declared}
    if declared & GAS_LENGTHS:
        declared |= {"gas_volume"}
    return {name: value for name, value in known.items() if name in declared}


def is_monotube_open(configuration: Configuration, search: LawSearch, layout: str | None) -> bool:
    """Whether a monotube is excluded only by a gas pressure that nobody has declared.

    Its rod side is empty in bump at the gas pressure times the annulus.

    Parameters
    ----------
    configuration : Configuration
        What is declared.
    search : LawSearch
        The law that was taken, and which layouts fit alike.
    layout : str or None
        That was named for the search.
    """
    damper, taken = configuration.damper, search.chosen.fits[0].model
    known = (
        declared_dimensions(configuration, damper)
        if isinstance(damper, Damper)
        else configuration.declared
    )
    return (
        layout is None
        and "damper.model" not in configuration.declared
        and isinstance(taken, ValveDamper)
        and Monotube.name not in {taken.name, *search.alike}
        and not {"gas_pressure", "damper.gas_pressure"} & {*known}
    )


def open_layout(
    configuration: Configuration, fit: LawFit, layout: str | None, *, is_open: bool
) -> tuple[str, ...]:
    """What is open of the layout, but for layouts that fit alike, in a sentence.

    Parameters
    ----------
    configuration : Configuration
        What is declared.
    fit : LawFit
        Of the law that was taken.
    layout : str or None
        That was named for the search.
    is_open : bool
        Of `is_monotube_open`.
    """
    if is_open and isinstance(fit.model, ValveDamper):
        said = (
            f"The layout, {fit.model.name.replace('_', ' ')} or monotube: the gas pressure is not "
            f"declared, and a monotube with more than the {1e-5 * fit.model.gas_pressure:.3g} bar "
            "that were taken may fit as well. Pressures and orifices of the valves differ with it "
            "(intervals of identify hold both). Declare the layout (damper.model, or models "
            "--layout), or the gas pressure as measured."
        )
        return (said,)
    if not isinstance(fit.model, Damper) or "damper.model" in configuration.declared:
        return ()
    if layout is not None:
        said = (
            f"The valves of the {layout.replace('_', ' ')}: the paper's model is enough for these "
            f'logs, and its resistances are none of theirs. damper.model = "{layout}" keeps them.'
        )
        return (said,)
    said = (
        "The layout: the paper's model is enough for these logs, but a damper that is built "
        "otherwise may fit it as well, with other resistances and pressures for the same forces. "
        "Where the maker's drawing shows another layout, name it (damper.model, or models "
        "--layout)."
    )
    return (said,)


def open_dimensions(configuration: Configuration, fit: LawFit) -> tuple[str, ...]:
    """What of the rig may be the doing of dimensions that nobody has declared, in a sentence."""
    damper = configuration.damper
    if not isinstance(fit.model, ValveDamper) or not isinstance(damper, Damper | ValveDamper):
        return ()
    known = {one.removeprefix("damper.") for one in configuration.declared}
    if isinstance(damper, Damper):
        known = {*declared_dimensions(configuration, damper)}
    missing = [said for name, said in _DIMENSIONS.items() if name not in known]
    parts = [said for name, said in _OF_RIG.items() if name in fit.free]
    if not missing or not parts:
        return ()
    said = (
        f"Whether {_listed(parts)} {'are' if len(parts) > 1 else 'is'} the rig's: "
        f"{_listed(missing)} {'are' if len(missing) > 1 else 'is'} not declared, and a wrong "
        "one may look like that. Declare them as measured."
    )
    return (said,)


def _listed(words: Sequence[str]) -> str:
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last


def assumed_gas(configuration: Configuration, tried: Sequence[Tried]) -> tuple[str, ...]:
    """What the layouts that were tried have of the gas that nobody has declared, in a sentence."""
    damper = configuration.damper
    has_valves = any(isinstance(one.fits[0].model, ValveDamper) for one in tried)
    if not has_valves or not isinstance(damper, Damper):
        return ()
    known = declared_dimensions(configuration, damper)
    missing = {name: getattr(ValveDamper(), name) for name in GAS if name not in known}
    if not missing:
        return ()
    said = (
        f"laws of real valves were tried with {gas_in_words(missing)}, the defaults of --model "
        "twin_tube and its like: declare what your damper has"
    )
    return (said,)
