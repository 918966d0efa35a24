"""The fit of every setting, run side by side, and the campaign that they make."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING

from damperfit.errors import FitCancelledError
from damperfit.identification.failures import SettingFailure, attempted
from damperfit.identification.setting import Fit, Judged
from damperfit.identification.sharing import Sharing
from damperfit.tested.setting import Setting
from damperfit.workers import apart

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from damperfit.damper.quantity import Quantity
    from damperfit.identification.multistart import Search
    from damperfit.identification.outcome import Status
    from damperfit.identification.procedure_input import ProcedureInput
    from damperfit.problem import Failure

__all__ = ["Campaign", "fit_every_setting", "with_status"]


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
    warnings : tuple of str
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
    warnings: tuple[str, ...] = ()
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
    def without_responses(self) -> Campaign:
        """The same without what was kept of the last simulations: whoever needs one makes it."""
        fits = (
            replace(fit, logs=tuple(replace(log, seen=None) for log in fit.logs))
            for fit in self.fits
        )
        return replace(self, fits=tuple(fits))

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


def with_status(judged: Judged, status: Mapping[str, Status]) -> Judged:
    """Values that were found once for all settings are not fixed but shared, or not told."""
    return replace(judged, status={**judged.status, **status})


def fit_every_setting(
    given: ProcedureInput,
    fit: Callable[[Setting], tuple[Fit, Search | None]],
    warnings: Iterable[str] = (),
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
