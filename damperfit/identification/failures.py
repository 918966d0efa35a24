"""A setting that cannot be fitted costs itself alone, also where the fault is damperfit's own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from damperfit.errors import (
    ConfigurationError,
    FitCancelledError,
    InstallationError,
    Mishap,
    SimulationError,
    mishap_of,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from damperfit.tested.setting import Setting

__all__ = ["SettingError", "SettingFailure", "attempted", "attempted_for_all"]

_INTERNAL = "InternalError"

Found = TypeVar("Found")


@dataclass(frozen=True, slots=True)
class SettingFailure:
    """Why a setting has no fit.

    Attributes
    ----------
    setting : Setting
        Adjuster setting.
    kind : str
        Name of the error class; InternalError where it is none of damperfit's own.
    message : str
        One sentence: what, where, what to do.
    trace : str
        Of an internal error, where it happened, for whoever mends it.
    """

    setting: Setting
    kind: str
    message: str
    trace: str = ""

    @property
    def is_internal(self) -> bool:
        """Whether the fault is damperfit's and not the logs'."""
        return self.kind == _INTERNAL


class SettingError(SimulationError):
    """One of the settings that are fitted together has failed."""

    def __init__(self, failure: SettingFailure) -> None:
        super().__init__(f"setting {failure.setting}: {failure.message}")
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
        mishap = mishap_of(error, "fitting")
        return SettingFailure(setting, mishap.kind, mishap.message, mishap.trace)


def attempted_for_all(fit: Callable[[], Found]) -> Found | Mishap:
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
