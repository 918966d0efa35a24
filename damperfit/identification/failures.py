"""A setting that cannot be fitted costs itself alone, also where the fault is damperfit's own."""

from __future__ import annotations

import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from damperfit.errors import (
    ConfigurationError,
    DamperfitError,
    InstallationError,
    SimulationError,
)
from damperfit.identification.descent import FitCancelledError

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["SettingError", "SettingFailure", "attempted"]

_INTERNAL = "InternalError"
_OUT_OF_MEMORY = "out of memory while this setting was fitted; give shorter logs or a lower --jobs."
_PACKAGE = Path(__file__).parents[1]

Found = TypeVar("Found")


@dataclass(frozen=True, slots=True)
class SettingFailure:
    """Why a setting has no fit.

    Attributes
    ----------
    setting : int
        Adjuster setting.
    kind : str
        Name of the error class; InternalError where it is none of damperfit's own.
    message : str
        One sentence: what, where, what to do.
    """

    setting: int
    kind: str
    message: str

    @property
    def is_internal(self) -> bool:
        """Whether the fault is damperfit's and not the logs'."""
        return self.kind == _INTERNAL


class SettingError(SimulationError):
    """One of the settings that are fitted together has failed."""

    def __init__(self, failure: SettingFailure) -> None:
        super().__init__(f"setting {failure.setting}: {failure.message}")
        self.failure = failure


def attempted(setting: int, fit: Callable[[], Found]) -> Found | SettingFailure:
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
    except DamperfitError as error:
        return SettingFailure(setting, type(error).__name__, str(error))
    except MemoryError:
        return SettingFailure(setting, MemoryError.__name__, _OUT_OF_MEMORY)
    except Exception as error:  # noqa: BLE001 - a bug that one setting meets leaves the others
        return SettingFailure(setting, _INTERNAL, _described(error))


def _described(error: Exception) -> str:
    """What to report of a bug: the error and the last line of damperfit that led to it."""
    frames = traceback.extract_tb(error.__traceback__)
    mine = [frame for frame in frames if _PACKAGE in Path(frame.filename).parents]
    where = f" ({Path(mine[-1].filename).name}, line {mine[-1].lineno})" if mine else ""
    said = " ".join(str(error).split()) or "no message"
    return (
        f"internal error, {type(error).__name__}: {said}{where}; this is a bug in damperfit: "
        "please report this line together with the logs of this setting."
    )
