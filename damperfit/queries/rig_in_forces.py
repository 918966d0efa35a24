"""What of the rig is in forces that are shown, and what is left out, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.adjustment import said_offsets

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.adjustment import Stage
    from damperfit.damper.model import Model

__all__ = ["notes_on_settings"]


def notes_on_settings(damper: Model, stages: Sequence[Stage]) -> Iterator[str]:
    """Yield what became of the rigs' offsets in forces by setting."""
    if not any(stage.offset for stage in stages):
        return
    size = said_offsets(stages)
    if damper.rest_force(0.0) is None:
        yield (
            f"the model knows no gas: its force offset ({size}) holds the gas force and the "
            "rig's tare; it is in these forces, not in what a click changes"
        )
    else:
        yield (
            f"the force offset ({size}) is the rig's tare, not the damper's: it is left out of "
            "these forces, the measured ones too, and of what a click changes"
        )
