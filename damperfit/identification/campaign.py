"""The settings of a campaign fitted side by side; one that cannot be fitted costs itself alone."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING

from damperfit.errors import FitCancelledError
from damperfit.identification.fit_problem import Block
from damperfit.identification.fit_setting import Fit
from damperfit.identification.outcome import attempted
from damperfit.identification.sharing import Sharing
from damperfit.problem import Failure, Problem
from damperfit.tested.setting import Setting
from damperfit.workers import apart

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from damperfit.damper.model import Model
    from damperfit.damper.quantity import Quantity
    from damperfit.identification.mean_cycle import SettledLogs
    from damperfit.identification.options import FitOptions
    from damperfit.identification.starts import Search
    from damperfit.recording import Trace

SettingFailure = Failure  # of a setting that has no fit


@dataclass(frozen=True, slots=True, eq=False)
class Campaign:
    """The fits of a damper over its settings."""

    procedure: str  # how they were made
    fits: tuple[Fit, ...]  # by rising setting
    failures: tuple[SettingFailure, ...] = ()  # settings without a fit, and why
    warnings: tuple[Problem, ...] = ()
    is_complete: bool = True  # False: the caller asked to stop before every setting was done
    sharing: Sharing = Sharing()  # how the shared parameters were estimated
    searches: tuple[Search, ...] = ()  # what fits from many starts found, where asked for
    failure: Failure | None = None  # what damperfit got wrong in a step over all settings
    named: tuple[Quantity, ...] = ()  # quantities of the model, where no fit may tell them

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What the model has; nothing where neither it nor a fit is known."""
        return self.named or (self.fits[0].parameters.quantities if self.fits else ())

    @property
    def gaps(self) -> tuple[tuple[int, int], ...]:
        """Runs of settings without a fit within a run of clicks: first and last of each."""
        cells = [Setting.of(fit.setting).cell for fit in self.fits]
        done = [cell for cell in cells if isinstance(cell, int)]
        steps = sorted(later - earlier for earlier, later in pairwise(done))
        # Where every other click or none but 1, 5, 10 was tested, those between are no gaps.
        if len(done) < len(cells) or not steps or steps[len(steps) // 2] != 1:
            return ()
        return tuple((a + 1, b - 1) for a, b in pairwise(done) if b - a > 1)


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
        """The names in the order of the model."""
        wanted = set(names)
        return tuple(name for name in self.damper.names if name in wanted)

    def block(self, setting: Setting, free: Iterable[str]) -> Block:
        """What is fitted at a setting."""
        return Block(
            self.damper,
            self.settings[setting],
            self.ordered(free),
            self.options.solver,
            self.cycles.get(setting),
            self.cancelled,
            self.options.max_evaluations,
        )


def fit_every_setting(
    given: ProcedureInput,
    fit: Callable[[Setting], tuple[Fit, Search | None]],
    warnings: Iterable[Problem] = (),
    *,
    known: Mapping[Setting, SettingFailure] = MappingProxyType({}),
) -> Campaign:
    """Run the fit at every setting, side by side; those `known` to have failed are left alone."""

    def of(setting: Setting) -> tuple[Fit, Search | None] | SettingFailure | None:
        if setting in known:
            return known[setting]
        try:
            return attempted(setting, lambda: fit(setting))
        except FitCancelledError:
            return None

    settings = sorted(given.settings)
    results = apart(of, settings, jobs=given.jobs, known=given.known, cancelled=given.cancelled)
    fits, searches, failures, is_complete = [], [], [], True
    for result in results:
        if result is None:
            is_complete = False
        elif isinstance(result, tuple):
            given.on_fit(result[0])
            fits.append(result[0])
            searches += [] if result[1] is None else [result[1]]
        else:
            failures.append(result)
    return Campaign(
        procedure=given.options.procedure,
        fits=tuple(fits),
        failures=tuple(failures),
        warnings=tuple(warnings),
        is_complete=is_complete,
        searches=tuple(searches),
    )
