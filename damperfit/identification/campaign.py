"""The settings of a campaign fitted side by side; one that cannot be fitted costs itself alone."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeVar

from damperfit.errors import (
    ConfigurationError,
    FitCancelledError,
    InstallationError,
    SimulationError,
    mishap_of,
)
from damperfit.identification.fit_problem import FitProblem, kept_within
from damperfit.identification.fit_setting import Fit
from damperfit.identification.sharing import Sharing
from damperfit.identification.starts import Search, best_fitting, best_of_starts
from damperfit.problem import Failure, Problem
from damperfit.tested.setting import Setting
from damperfit.workers import apart

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from damperfit.damper.model import Model, Values
    from damperfit.damper.quantity import Quantity
    from damperfit.identification.mean_cycle import SettledLogs
    from damperfit.identification.options import FitOptions
    from damperfit.recording import Trace

__all__ = [
    "Campaign",
    "ProcedureInput",
    "SettingError",
    "SettingFailure",
    "attempted",
    "fit_every_setting",
]

Found = TypeVar("Found")
SettingFailure = Failure  # of a setting that has no fit


class SettingError(SimulationError):
    """One of the settings that are fitted together has failed."""

    def __init__(self, failure: SettingFailure) -> None:
        super().__init__(failure.message, subject=f"setting {failure.setting}")
        self.failure = failure


def attempted(setting: Setting | None, fit: Callable[[], Found]) -> Found | SettingFailure:
    """Return what a fit of one setting finds (None: of all together), or why it finds nothing.

    Raises
    ------
    FitCancelledError
        When the caller asked to stop.
    ConfigurationError, InstallationError
        What is wrong is wrong at every setting.
    """
    try:
        return fit()
    except (FitCancelledError, ConfigurationError, InstallationError):
        raise
    except Exception as error:  # noqa: BLE001 - a bug that one setting meets leaves the others
        if setting is None:
            return mishap_of(error, "fitting the settings together")
        return replace(mishap_of(error, "fitting"), setting=setting)


@dataclass(frozen=True, slots=True, eq=False)
class Campaign:
    """The fits of a damper over its settings.

    Attributes
    ----------
    procedure : str
        How they were made.
    fits : tuple of Fit
        By rising setting.
    failures : tuple of SettingFailure
        Settings without a fit and why.
    warnings : tuple of Problem
        One plain sentence each.
    is_complete : bool
        False when the caller asked to stop before every setting was done.
    sharing : Sharing
        How the shared parameters were estimated.
    searches : tuple of Search
        What fits from many starts found, where they were asked for.
    mishap : Failure or None
        What damperfit got wrong in a step over all settings, done without.
    named : tuple of Quantity
        Quantities of the model, where there may be no fit to tell them.
    """

    procedure: str
    fits: tuple[Fit, ...]
    failures: tuple[SettingFailure, ...] = ()
    warnings: tuple[Problem, ...] = ()
    is_complete: bool = True
    sharing: Sharing = Sharing()
    searches: tuple[Search, ...] = ()
    mishap: Failure | None = None
    named: tuple[Quantity, ...] = ()

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What the model has; nothing where neither it nor a fit is known."""
        return self.named or (self.fits[0].parameters.quantities if self.fits else ())

    @property
    def gaps(self) -> tuple[tuple[int, int], ...]:
        """Runs of settings without a fit within a run of clicks: first and last of each.

        Where every other click or none but 1, 5, 10 was tested, those between are no gaps.
        """
        cells = [Setting.of(fit.setting).cell for fit in self.fits]
        done = [cell for cell in cells if isinstance(cell, int)]
        if len(done) < len(cells):
            return ()
        steps = sorted(later - earlier for earlier, later in pairwise(done))
        if not steps or steps[len(steps) // 2] != 1:
            return ()
        return tuple((a + 1, b - 1) for a, b in pairwise(done) if b - a > 1)


def fit_every_setting(
    given: ProcedureInput,
    fit: Callable[[Setting], tuple[Fit, Search | None]],
    warnings: Iterable[Problem] = (),
    *,
    known: Mapping[Setting, SettingFailure] = MappingProxyType({}),
) -> Campaign:
    """Run the fit at every setting, side by side; one setting's failure leaves the others.

    Settings that are known to have failed are not tried again.
    """

    def one(setting: Setting) -> tuple[Fit, Search | None] | SettingFailure | None:
        if setting in known:
            return known[setting]
        try:
            return attempted(setting, lambda: fit(setting))
        except FitCancelledError:
            return None

    results: list[Fit | SettingFailure | None] = []
    searches: list[Search] = []
    for found in apart(
        one,
        sorted(given.settings),
        jobs=given.jobs,
        known=given.known,
        cancelled=given.cancelled,
    ):
        result, search = found if isinstance(found, tuple) else (found, None)
        if search is not None:
            searches.append(search)
        if isinstance(result, Fit):
            given.on_fit(result)
        results.append(result)
    return Campaign(
        procedure=given.options.procedure,
        fits=tuple(result for result in results if isinstance(result, Fit)),
        searches=tuple(searches),
        failures=tuple(result for result in results if isinstance(result, SettingFailure)),
        warnings=tuple(warnings),
        is_complete=all(result is not None for result in results),
    )


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

    def problem(self, setting: Setting, free: tuple[str, ...]) -> FitProblem:
        """Return what is fitted at a setting."""
        return FitProblem(
            self.damper,
            self.settings[setting],
            free,
            self.options.solver,
            self.cycles.get(setting),
            self.cancelled,
            self.options.max_evaluations,
        )

    def start(self, setting: Setting, problem: FitProblem, fixed: Mapping[str, float]) -> Values:
        """Return where the fit of a setting starts: as somebody has said, else the model's start.

        Of several starts it is the one that fits the first log best. A law with kinks makes a
        descent long: there it is where the best lead, followed on settled cycles as far as the
        motions repeat. What is fixed stays fixed.
        """
        starts = problem.model.start(problem.traces, fixed)
        return _best(
            problem, tuple({self.with_given_start(setting, one, fixed): None for one in starts})
        )

    def with_given_start(
        self, setting: Setting, start: Values, fixed: Mapping[str, float]
    ) -> Values:
        """Return a start with what somebody has said that the fit of a setting starts at."""
        said = self.options.start.of(setting)
        said = {name: said[name] for name in self.ordered(said) if name not in fixed}
        return kept_within(start.replace(said), said)


def _best(problem: FitProblem, starts: Sequence[Values]) -> Values:
    if len(starts) == 1:
        return starts[0]
    try:
        coarse = replace(problem, cycles=None)
        coarse = coarse.on_cycles() if problem.model.kinks else coarse
        if coarse.cycles is not None:
            return best_of_starts(coarse, starts, is_thorough=True).extra
    except SimulationError:
        return starts[0]
    ranked = best_fitting(replace(coarse, traces=problem.traces[:1]), starts)
    return ranked[0] if ranked else starts[0]
