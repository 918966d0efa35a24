"""What of the rig is in forces that are shown, and what is left out, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.adjustment import said_offsets
from damperfit.damper.quantity import RIG

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.adjustment import Stage
    from damperfit.damper.model import Model, Values

__all__ = ["notes_on_settings", "notes_on_simulation"]


def notes_on_settings(damper: Model, stages: Sequence[Stage]) -> Iterator[str]:
    """Yield what of the rig is in forces by setting, and that its offset is not."""
    if any(stage.offset for stage in stages):
        yield _on_offsets(damper, said_offsets(stages))
    if stages:
        yield from _on_rig(_mounting(stages[0].parameters))


def notes_on_simulation(damper: Model, values: Values) -> Iterator[str]:
    """Yield what of the rig is in a simulated force."""
    offsets = []
    if damper.rest_force(0.0) is not None:  # else it holds the gas force
        tares = [float(getattr(values, one.name)) for one in values.quantities if one.is_offset]
        offsets = [f"force offset of {tare:.3g} N" for tare in tares if tare]
    yield from _on_rig([*_mounting(values), *offsets])


def _on_offsets(damper: Model, size: str) -> str:
    if damper.rest_force(0.0) is None:
        return (
            f"the model knows no gas: its force offset ({size}) holds the gas force and the "
            "rig's tare; it is in these forces, not in what a click changes"
        )
    return (
        f"the force offset ({size}) is the rig's tare, not the damper's: it is left out of "
        "these forces, the measured ones too, and of what a click changes"
    )


def _mounting(values: Values) -> list[str]:
    """Series stiffness, play and lag, as far as the model has them."""
    return [one.label for one in values.quantities if one.scope == RIG]


def _on_rig(parts: Sequence[str]) -> Iterator[str]:
    if not parts:
        return
    *before, last = parts
    listed = f"{', '.join(before)} and {last}" if before else last
    yield (
        f"the rig's {listed} {'are' if before else 'is'} in these forces; what damperfit export "
        "writes is of the damper alone"
    )
