"""Blow-offs that no log opens: of their preload the logs tell a lower limit, and nothing more."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from damperfit.damper.valve_dampers import ValveDamper
from damperfit.damper.warmed import Warmed
from damperfit.identification.sharing import unknown_at

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from damperfit.damper.model import Model
    from damperfit.identification import Sharing
    from damperfit.uncertainty.intervals import Uncertainty
    from damperfit.uncertainty.linearisation import Linearisation

__all__ = ["pressed_on", "with_least_openings"]

# Of a stroke's oil: a share below it is that of a passage which the logs do not show.
_UNNOTICED = 0.01


def pressed_on(damper: Model, pressures: NDArray[np.floating[Any]]) -> dict[str, float]:
    """Return the highest pressure across each preloaded passage, Pa, by the name of its opening.

    One that lifts gradually lets oil through below its opening, and has none.

    Parameters
    ----------
    damper : Model
        The damper; a model without passages has none.
    pressures : numpy.ndarray
        Shape (3, n): of the chambers, Pa.
    """
    network = getattr(damper.damper if isinstance(damper, Warmed) else damper, "network", None)
    found: dict[str, float] = {}
    for one in () if network is None else network.passages:
        if one.opening and not one.width:
            most = float((pressures[one.start - 1] - pressures[one.end - 1]).max())
            found[one.opening] = max(most, found.get(one.opening, 0.0))
    return found


def with_least_openings(
    known: Uncertainty,
    mine: Linearisation,
    linearised: Sequence[Linearisation],
    sharing: Sharing,
    damper: Model,
) -> Uncertainty:
    """Return a setting's errors with the openings that no log reaches, and what each is above.

    Parameters
    ----------
    known : Uncertainty
        Of the setting.
    mine : Linearisation
        Of the same setting.
    linearised : sequence of Linearisation
        Of all settings: another that shares the opening may press on it more.
    sharing : Sharing
        Which do.
    damper : Model
        The damper.
    """
    if not mine.pressed:
        return known
    found = {}
    for name in mine.pressed:
        alike = list(_alike(name, mine, linearised, sharing))
        if all(one.pressed[name] < _passes_from(name, one, damper) for one in alike):
            found[name] = max(one.pressed[name] for one in alike)
    return replace(known, unopened=found)


def _passes_from(name: str, one: Linearisation, damper: Model) -> float:
    """The pressure above which a blow-off passes oil that a fit could notice, Pa.

    A slope that lets nothing through is one way in which a fit tells that it does not open.
    """
    opening: float = getattr(one.fit.parameters, name)
    own = damper.damper if isinstance(damper, Warmed) else damper
    stroke = name.removesuffix("_opening")
    if not isinstance(own, ValveDamper) or f"{stroke}_slope" not in one.names:
        return opening
    area = own.pressed_areas[0 if stroke == "rebound" else 1]
    speed = max(part.peak_speed for log in one.fit.logs for part in log.trace.stretches)
    slope: float = getattr(one.fit.parameters, f"{stroke}_slope")
    return opening + _UNNOTICED * own.oil_density * area * speed * slope


def _alike(
    name: str, one: Linearisation, all_of: Sequence[Linearisation], sharing: Sharing
) -> Iterator[Linearisation]:
    """The setting, and others with the same number."""
    yield one
    setting = one.fit.setting
    if name in sharing.found_at(setting):
        own = unknown_at(name, sharing.follows, setting)
        yield from (other for other in all_of if own.holds_at(other.fit.setting))
