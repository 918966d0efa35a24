"""What a procedure works on: the logs by setting, the damper, the options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.damper.parameters import PARAMETER_NAMES
from damperfit.identification.descent import Misfit
from damperfit.identification.starting import scan_bulk_modulus, starting_values

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from damperfit.damper.parameters import Damper, Parameters
    from damperfit.identification.options import FitOptions
    from damperfit.identification.setting import Fit
    from damperfit.recording import Trace

__all__ = ["ProcedureInput", "closed_form_start", "ordered"]

# Where the scan over bulk moduli starts from when no other setting has been fitted.
_BULK_MODULUS = 6e8


@dataclass(frozen=True, slots=True, eq=False)
class ProcedureInput:
    """Everything a procedure needs."""

    settings: Mapping[int, tuple[Trace, ...]]
    damper: Damper
    options: FitOptions
    jobs: int
    on_fit: Callable[[Fit], None]
    cancelled: Callable[[], bool]

    def misfit(self, setting: int, free: tuple[str, ...]) -> Misfit:
        """Return what is fitted at a setting."""
        return Misfit(
            self.settings[setting],
            self.damper,
            free,
            self.options.solver,
            self.options.max_evaluations,
            self.cancelled,
        )


def closed_form_start(misfit: Misfit, fixed: Mapping[str, float]) -> Parameters:
    """Return the closed form's values; a bulk modulus that is not fixed comes from a scan."""
    k_e = fixed.get("k_e", _BULK_MODULUS)
    start = starting_values(misfit.traces, misfit.damper, fixed, k_e)
    if "k_e" in fixed:
        return start
    return scan_bulk_modulus(start, misfit.traces, misfit.damper, misfit.solver)


def ordered(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names in the order of `PARAMETER_NAMES`."""
    wanted = set(names)
    return tuple(name for name in PARAMETER_NAMES if name in wanted)
