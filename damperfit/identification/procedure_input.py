"""What a procedure works on: the logs by setting, the damper, the options."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from damperfit.errors import SimulationError
from damperfit.identification.descent import Misfit
from damperfit.identification.law_misfit import LawMisfit, best_fitting, best_of_starts
from damperfit.identification.plausible import kept_within

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from damperfit.damper.model import Model, Values
    from damperfit.identification.options import FitOptions
    from damperfit.identification.setting import Fit
    from damperfit.identification.settled import SettledLogs
    from damperfit.recording import Trace
    from damperfit.tested.setting import Setting

__all__ = ["ProcedureInput"]


@dataclass(frozen=True, slots=True, eq=False)
class ProcedureInput:
    """Everything a procedure needs; `cycles` are those of the settings whose logs repeat."""

    settings: Mapping[Setting, tuple[Trace, ...]]
    damper: Model
    options: FitOptions
    jobs: int
    on_fit: Callable[[Fit], None]
    cancelled: Callable[[], bool]
    cycles: Mapping[Setting, SettledLogs | None] = field(default_factory=dict)

    @property
    def softest_first(self) -> list[Setting]:
        """Settings by rising stiffness, as far as it is declared how clicks count."""
        return sorted(self.settings, key=lambda one: one.softness(self.options.from_closed))

    @property
    def known(self) -> tuple[object, ...]:
        """What fits may hold that is not their own: logs, cycles, damper, solver."""
        traces = (one for few in self.settings.values() for one in few)
        cycles = (one for few in self.cycles.values() if few is not None for one in few.cycles)
        return (*traces, *cycles, self.damper, self.options.solver)

    def ordered(self, names: Iterable[str]) -> tuple[str, ...]:
        """Return the names in the order of the model."""
        wanted = set(names)
        return tuple(name for name in self.damper.names if name in wanted)

    def misfit(
        self, setting: Setting, free: tuple[str, ...], *, is_followed: bool = False
    ) -> Misfit:
        """Return what is fitted at a setting, and whether a descent with less free follows."""
        return Misfit(
            self.settings[setting],
            self.damper,
            free,
            self.options.solver,
            self.options.max_evaluations,
            self.cancelled,
            self.cycles.get(setting),
            is_followed=is_followed,
        )

    def start(self, setting: Setting, misfit: Misfit, fixed: Mapping[str, float]) -> Values:
        """Return where the fit of a setting starts: as somebody has said, else the model's start.

        Of several starts it is the one that fits the first log best. A law with kinks makes a
        descent long: there it is where the best lead, followed on settled cycles as far as the
        motions repeat. What is fixed stays fixed.
        """
        starts = misfit.damper.start(misfit.traces, fixed)
        return _best(
            misfit, tuple({self.with_given_start(setting, one, fixed): None for one in starts})
        )

    def with_given_start(
        self, setting: Setting, start: Values, fixed: Mapping[str, float]
    ) -> Values:
        """Return a start with what somebody has said that the fit of a setting starts at."""
        said = self.options.start.of(setting)
        said = {name: said[name] for name in self.ordered(said) if name not in fixed}
        return kept_within(start.replace(said), said)


def _best(misfit: Misfit, starts: Sequence[Values]) -> Values:
    if len(starts) == 1:
        return starts[0]
    law = LawMisfit(
        misfit.damper, misfit.traces, misfit.free, misfit.solver, cancelled=misfit.cancelled
    )
    try:
        law = law.on_cycles() if misfit.damper.kinks else law
        if law.cycles is not None:
            return best_of_starts(law, starts, is_thorough=True).point.extra
    except SimulationError:
        return starts[0]
    ranked = best_fitting(replace(law, traces=misfit.traces[:1]), starts)
    return ranked[0] if ranked else starts[0]
