"""What procedure `paper` finds once for all settings, and what it takes where no log tells it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from damperfit.identification.procedure_input import ProcedureInput

__all__ = ["MEAN", "TAKEN", "fallback"]

# R_m3 is taken from one setting, f_f is the mean over the settings.
TAKEN, MEAN = "r_m3", "f_f"


def fallback(given: ProcedureInput, name: str) -> float:
    """Return what is taken for a shared parameter that no log tells; its model knows one."""
    known = given.options.fallback(given.damper.quantity(name))
    assert known is not None
    return known
