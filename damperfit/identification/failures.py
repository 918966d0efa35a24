"""A setting that cannot be fitted costs itself alone, also where the fault is damperfit's own."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from damperfit.errors import (
    ConfigurationError,
    FitCancelledError,
    InstallationError,
    SimulationError,
    mishap_of,
)
from damperfit.problem import Failure

if TYPE_CHECKING:
    from collections.abc import Callable

    from damperfit.tested.setting import Setting

__all__ = ["SettingError", "SettingFailure", "attempted", "attempted_for_all"]

Found = TypeVar("Found")
SettingFailure = Failure  # of a setting that has no fit


class SettingError(SimulationError):
    """One of the settings that are fitted together has failed."""

    def __init__(self, failure: SettingFailure) -> None:
        super().__init__(failure.message, subject=f"setting {failure.setting}")
        self.failure = failure


def attempted(setting: Setting, fit: Callable[[], Found]) -> Found | SettingFailure:
    """Return what a fit of one setting finds, or why it finds nothing.

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
        return replace(mishap_of(error, "fitting"), setting=setting)


def attempted_for_all(fit: Callable[[], Found]) -> Found | Failure:
    """Return what a fit of all settings together finds, or what went wrong in it.

    Raises
    ------
    FitCancelledError
        When the caller asked to stop.
    ConfigurationError, InstallationError
        What is wrong is wrong without this fit too.
    """
    try:
        return fit()
    except (FitCancelledError, ConfigurationError, InstallationError):
        raise
    except Exception as error:  # noqa: BLE001 - each setting has a fit of its own already
        return mishap_of(error, "fitting the settings together")
