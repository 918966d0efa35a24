"""What a law that was chosen says of the damper and its rig, in sentences."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.damper.quantity import STIFFNESS
from damperfit.identification import Status
from damperfit.laws.other_layouts import in_other_layouts

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from damperfit.damper.model import Model, Values
    from damperfit.damper.valve_dampers import ValveDamper
    from damperfit.identification import Campaign
    from damperfit.laws.law_fit import LawFit
    from damperfit.tested.setting import Setting

__all__ = ["SeenAt", "opening_force", "physics_seen", "seen_again"]

_UNTOLD = (frozenset({Status.NOT_IDENTIFIABLE, Status.ABSENT}), frozenset({Status.AT_BOUND}))
_NAMED = 3  # settings; of more only the number is given
_SHOWN_FLOW = 1e-5  # m3/s, at which people are told what a laminar passage costs


@dataclass(frozen=True, slots=True)
class SeenAt:
    """A law at one setting, as far as sentences say it.

    Attributes
    ----------
    setting : Setting
        Which.
    model : Model
        The law.
    values : Values
        What was found.
    undetermined, at_bound : tuple of str
        What the logs do not determine; what ran into an edge of its range.
    """

    setting: Setting
    model: Model
    values: Values
    undetermined: tuple[str, ...]
    at_bound: tuple[str, ...]


def seen_again(choice: Mapping[str, Any], campaign: Campaign, model: Model) -> dict[str, Any]:
    """Return what is kept of a choice, with the physics in the numbers of the fits after it.

    The search knows its law at a few settings and a coarser tolerance; tables are of the fits.

    Parameters
    ----------
    choice : mapping
        As it stands in run.json.
    campaign : Campaign
        The fits of the chosen law.
    model : Model
        That law.
    """
    fits = [
        SeenAt(fit.setting, model, fit.parameters, *(_with(fit.status, one) for one in _UNTOLD))
        for fit in campaign.fits
    ]
    alike = choice.get("layouts_alike") or ()
    is_told = choice.get("sentences") and not choice.get("doubt")
    again = physics_seen(fits, alike) if fits and is_told else ()
    return {**choice, "sentences": list(again)} if again else dict(choice)


def _with(status: Mapping[str, Status], wanted: frozenset[Status]) -> tuple[str, ...]:
    return tuple(name for name, one in status.items() if one in wanted)


def opening_force(damper: ValveDamper, stroke: str, opening: float) -> float:
    """Return the oil's force at which the blow-off of a stroke opens, N.

    Parameters
    ----------
    damper : ValveDamper
        The damper.
    stroke : str
        "rebound" or "compression".
    opening : float
        p_open, Pa.
    """
    rebound, compression = damper.pressed_areas
    return opening * (rebound if stroke == "rebound" else compression)


def physics_seen(fits: Sequence[LawFit | SeenAt], layouts: Sequence[str] = ()) -> tuple[str, ...]:
    """Return one sentence for each part that the law has.

    Parameters
    ----------
    fits : sequence of LawFit or SeenAt
        The chosen law at each setting.
    layouts : sequence of str
        Others that the logs do not tell from its own: what the valves' numbers are in these.
    """
    if not hasattr(fits[0].model, "rebound"):
        return ()
    model: ValveDamper = fits[0].model  # type: ignore[assignment]
    said = []
    for stroke, people in (("rebound", "rebound"), ("compression", "bump")):
        valve = getattr(model, stroke)
        if valve.blow_off != "none":
            name = f"{stroke}_opening"
            openings = _determined(fits, name)
            forces = [opening_force(model, stroke, one) for one in openings]
            said.append(
                f"in {people} a blow-off opens at {_range(forces)} N "
                f"({_range([1e-5 * one for one in openings])} bar"
                f"{_elsewhere(model, layouts, name, lambda one: 1e-5 * one, openings)})"
                f"{_where(fits, name)}"
                if openings
                else f"in {people} these logs do not determine where a blow-off opens"
            )
        kind = "laminar" if valve.bleed == "leak" else "part-laminar"
        parts = (
            ("bleed", _orifice, "a bleed as an orifice of {} mm2 (C_d A)"),
            ("leak", _laminar, f"a {kind} bleed of {{}} bar at 10 cm3/s, in step with the flow"),
            ("port", _orifice, "a port behind the blow-off as an orifice of {} mm2 (C_d A)"),
        )  # fmt: skip
        for part, shown, words in parts:
            name = f"{stroke}_{part}"
            values = _determined(fits, name) if name in model.names else []
            if values:
                numbers = _range([shown(model, one) for one in values])
                others = _elsewhere(model, layouts, name, partial(shown, model), values)
                also = f" ({others.removeprefix('; ')})" if others else ""
                said.append(f"in {people} {words.format(numbers)}{also}{_where(fits, name)}")
    names = fits[0].values.names
    beside = (
        ("k_s", 1e-3, "{} N/mm of elasticity in series with the damper"),
        ("play", 1e3, "{} mm of play at the joints"),
        ("lag", 1e3, "the force is read {} ms late"),
        ("moving_mass", 1.0, "a mass of {} kg moves between load cell and damper"),
        *((one.name, 1.0, "{} N of friction") for one in model.quantities if one.is_friction),
        ("presliding", 1e6, "friction builds up over {} um"),
        ("breakaway", 1.0, "friction at rest is {} N above that of sliding"),
        ("seal_area", 1e6, "friction grows with the pressure, as on {} mm2 of a seal"),
        ("turning_speed", 1e3, "friction turns within {} mm/s"),
        ("free_gas", 1e2, "{} % of the oil's volume is gas at rest"),
        ("drag", 1.0, "the seals drag with {} N s/m"),
    )
    for name, factor, words in beside:
        known = [one for one in (_determined(fits, name) if name in names else []) if one != 0.0]
        if known:
            said.append(words.format(_range([factor * one for one in known])) + _where(fits, name))
    said.extend((*_oil_seen(model, fits), *_gas_seen(model, fits)))
    return tuple(f"{one[0].upper()}{one[1:]}." for one in said)


def _elsewhere(
    model: ValveDamper,
    layouts: Sequence[str],
    name: str,
    shown: Callable[[float], float],
    values: Sequence[float],
) -> str:
    """Return what a number of a valve is in layouts that the logs do not exclude."""
    return "".join(
        f"; {_range([shown(times * one) for one in values])} in a {layout}"
        for layout, times in in_other_layouts(layouts, model, name)
    )


def _oil_seen(model: ValveDamper, fits: Sequence[LawFit | SeenAt]) -> Iterator[str]:
    """Yield the stiffness of the oil where it is not that of the default."""
    for one in model.quantities:
        if one.role == STIFFNESS:
            known = [value for value in _determined(fits, one.name) if value != one.default]
            if known:
                numbers = _range([1e-9 * value for value in known])
                where = _where(fits, one.name)
                yield f"oil and chambers give with a bulk modulus of {numbers} GPa{where}"


def _gas_seen(model: ValveDamper, fits: Sequence[LawFit | SeenAt]) -> list[str]:
    """Return what a gas volume that was found says of what was declared, if one was found."""
    known = [one for one in _determined(fits, "gas_volume") if one != model.gas_volume]
    if not known:
        return []
    times = model.gas_volume / float(np.median(known))
    others = [f"{1e-5 * times * model.gas_pressure:.3g} bar"]
    exponent, (least, most) = times * model.gas_exponent, _of_gases(model)
    if least < exponent < most:
        others.append(f"an exponent of {exponent:.2f}")
    others.append(f"a rod {times**0.25:.3g} times as thick")
    same = f"{', '.join(others[:-1])} or {others[-1]} would do the same"
    found = f"{_range([1e6 * one for one in known])} cm3 at {1e-5 * model.gas_pressure:.4g} bar"
    taken = f"{1e6 * model.gas_volume:.3g} cm3 were taken"
    return [f"the gas is as soft as {found}, where {taken}; {same}: a gauge and callipers decide"]


def _of_gases(model: ValveDamper) -> tuple[float, float]:
    return model.quantity("gas_exponent").believable


def _orifice(damper: ValveDamper, resistance: float) -> float:
    return 1e6 / (resistance * math.sqrt(2.0 * damper.oil_density))


def _laminar(damper: ValveDamper, resistance: float) -> float:
    return 1e-5 * resistance * damper.oil_density * _SHOWN_FLOW


def _determined(fits: Sequence[LawFit | SeenAt], name: str) -> list[float]:
    """Return the values at the settings whose logs determine it."""
    return [float(getattr(one.values, name)) for one in fits if _is_determined(one, name)]


def _is_determined(fit: LawFit | SeenAt, name: str) -> bool:
    return name not in fit.undetermined and name not in fit.at_bound


def _where(fits: Sequence[LawFit | SeenAt], name: str) -> str:
    """Return at which settings that is, where those of the others do not determine it."""
    known = [one.setting for one in fits if _is_determined(one, name)]
    if len(known) == len(fits):
        return ""
    few = f"setting{'s' if len(known) > 1 else ''} {', '.join(map(str, known))}"
    many = f"{len(known)} of {len(fits)} settings"
    return (
        f" at {few if len(known) <= _NAMED else many}; the logs of the others do not determine it"
    )


def _range(values: Sequence[float]) -> str:
    """Return one number, or the least and the largest where they differ by more than 5 %."""
    low, high = float(np.min(values)), float(np.max(values))
    middle = 0.5 * (low + high)
    if high - low <= 0.05 * abs(middle):
        return f"{middle:.3g}"
    return f"{low:.3g} to {high:.3g}"
