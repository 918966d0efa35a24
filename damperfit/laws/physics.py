"""What a law that was chosen says of the damper and its rig, in sentences."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.damper.valve_dampers import ValveDamper
    from damperfit.laws.law_fit import LawFit

__all__ = ["opening_force", "physics_seen"]

_NAMED = 3  # settings; of more only the number is given


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


def physics_seen(fits: Sequence[LawFit]) -> tuple[str, ...]:
    """Return one sentence for each part that the law has.

    Parameters
    ----------
    fits : sequence of LawFit
        The chosen law at each setting.
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
                f"({_range([1e-5 * one for one in openings])} bar){_where(fits, name)}"
                if openings
                else f"in {people} these logs do not determine where a blow-off opens"
            )
        if valve.bleed == "orifice":
            name = f"{stroke}_bleed"
            areas = [_orifice(model, one) for one in _determined(fits, name)]
            if areas:
                said.append(
                    f"in {people} a bleed as an orifice of {_range(areas)} mm2 (C_d A)"
                    f"{_where(fits, name)}"
                )
    names = fits[0].values.names
    beside = (
        ("k_s", 1e-3, "{} N/mm of elasticity in series with the damper"),
        ("play", 1e3, "{} mm of play at the joints"),
        ("lag", 1e3, "the force is read {} ms late"),
        *((one.name, 1.0, "{} N of friction") for one in model.quantities if one.is_friction),
        ("presliding", 1e6, "friction builds up over {} um"),
        ("breakaway", 1.0, "friction at rest is {} N above that of sliding"),
        ("seal_area", 1e6, "friction grows with the pressure, as on {} mm2 of a seal"),
        ("turning_speed", 1e3, "friction turns within {} mm/s"),
        ("free_gas", 1e2, "{} % of the oil's volume is gas at rest"),
    )
    for name, factor, words in beside:
        known = [one for one in (_determined(fits, name) if name in names else []) if one != 0.0]
        if known:
            said.append(words.format(_range([factor * one for one in known])) + _where(fits, name))
    return tuple(f"{one[0].upper()}{one[1:]}." for one in said)


def _orifice(damper: ValveDamper, resistance: float) -> float:
    return 1e6 / (resistance * math.sqrt(2.0 * damper.oil_density))


def _determined(fits: Sequence[LawFit], name: str) -> list[float]:
    """Return the values at the settings whose logs determine it."""
    return [float(getattr(one.values, name)) for one in fits if _is_determined(one, name)]


def _is_determined(fit: LawFit, name: str) -> bool:
    return name not in fit.undetermined and name not in fit.at_bound


def _where(fits: Sequence[LawFit], name: str) -> str:
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
