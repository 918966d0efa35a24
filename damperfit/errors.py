"""Every failure that damperfit raises on purpose, each with its exit code.

A message is one line: what is wrong, where, what was found and expected, what to do.
The library raises; only ``damperfit.cli`` catches and exits.
"""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = [
    "ConditioningError",
    "ConfigurationError",
    "DamperfitError",
    "InstallationError",
    "LogError",
    "OutputError",
    "QualityError",
    "SimulationError",
    "did_you_mean",
]


class DamperfitError(Exception):
    """Parent of every error that damperfit raises on purpose."""

    exit_code = 1


class ConfigurationError(DamperfitError):
    """Wrong usage, option or configuration; nothing was touched."""

    exit_code = 2


class InstallationError(DamperfitError):
    """The compiled core or an optional library is missing or does not load."""

    exit_code = 2


class LogError(DamperfitError):
    """One log cannot be read as force and displacement over time."""


class ConditioningError(LogError):
    """One log was read, but its signals cannot be evaluated."""


class QualityError(LogError):
    """One log can be evaluated, but has a warning, and strict quality was asked for."""

    exit_code = 4


class SimulationError(DamperfitError):
    """The model cannot be integrated for these parameters and this displacement."""


class OutputError(DamperfitError):
    """Results cannot be written."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return " Did you mean 'X'?" for the nearest known name, or an empty string.

    Examples
    --------
    >>> did_you_mean("forse_N", ["force_N", "time_s"])
    " Did you mean 'force_N'?"
    >>> did_you_mean("zzz", ["force_N"])
    ''
    """
    near = get_close_matches(name, list(known), n=1, cutoff=0.6)
    return f" Did you mean {near[0]!r}?" if near else ""
