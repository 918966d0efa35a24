"""What of the rig is in forces that are shown, and what is left out, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.adjustment.force_at import offset_sentence
from damperfit.damper.quantity import RIG

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.adjustment.stage import Stage
    from damperfit.damper.model import Model, Values

__all__ = ["notes_on_settings", "notes_on_simulation"]


def notes_on_settings(damper: Model, stages: Sequence[Stage]) -> Iterator[str]:
    """Yield what of the rig is left out of forces by setting."""
    holds_gas = damper.rest_force(0.0) is None
    if said := offset_sentence([stage.offset for stage in stages], holds_gas=holds_gas):
        yield said
    if stages and (parts := _mounting(stages[0].parameters)):
        listed, verb = _listed(parts)
        yield f"the rig's {listed} {verb} in measured forces, not in the model's"


def notes_on_simulation(damper: Model, values: Values) -> Iterator[str]:
    """Yield what of the rig is in a simulated force."""
    offsets = []
    if damper.rest_force(0.0) is not None:  # else it holds the gas force
        tares = [float(getattr(values, one.name)) for one in values.quantities if one.is_offset]
        offsets = [f"force offset of {tare:.3g} N" for tare in tares if tare]
    yield from _on_rig([*_mounting(values), *offsets])


def _mounting(values: Values) -> list[str]:
    """Series stiffness, play, lag and moving mass, as far as the model has them."""
    return [one.label for one in values.quantities if one.scope == RIG]


def _on_rig(parts: Sequence[str]) -> Iterator[str]:
    if not parts:
        return
    listed, verb = _listed(parts)
    yield (
        f"the rig's {listed} {verb} in these forces; what damperfit settings shows and damperfit "
        "export writes is of the damper alone"
    )


def _listed(parts: Sequence[str]) -> tuple[str, str]:
    *before, last = parts
    return (f"{', '.join(before)} and {last}", "are") if before else (last, "is")
