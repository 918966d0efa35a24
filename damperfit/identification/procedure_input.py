"""What a procedure works on: the logs by setting, the damper, the options."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

from damperfit.damper.parameters import PARAMETER_NAMES
from damperfit.errors import SimulationError
from damperfit.identification.descent import Misfit
from damperfit.identification.model_versus_log import compare, normalised_mse

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from damperfit.damper.parameters import Damper, Parameters
    from damperfit.identification.options import FitOptions
    from damperfit.identification.setting import Fit
    from damperfit.recording import Trace

__all__ = ["ProcedureInput", "first_start", "ordered"]


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


def first_start(misfit: Misfit, fixed: Mapping[str, float]) -> Parameters:
    """Return the model's start; of several the one that fits the first log best."""
    starts = cast("tuple[Parameters, ...]", misfit.damper.start(misfit.traces, fixed))
    if len(starts) == 1:
        return starts[0]
    trace = misfit.traces[0]
    best, least = starts[0], math.inf
    for one in starts:
        try:
            force = compare(one, trace, misfit.damper, solver=misfit.solver).force
        except SimulationError:
            continue
        mse = normalised_mse(trace.force[trace.compared], force[trace.compared])
        if mse < least:
            best, least = one, mse
    return best


def ordered(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names in the order of `PARAMETER_NAMES`."""
    wanted = set(names)
    return tuple(name for name in PARAMETER_NAMES if name in wanted)
