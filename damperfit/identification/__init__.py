"""From traces to parameters: the problem of one setting or of several, its fit, the campaign.

A name is looked up when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from damperfit.identification.campaign import Campaign, SettingFailure
    from damperfit.identification.fit_problem import FitProblem
    from damperfit.identification.fit_setting import Fit
    from damperfit.identification.options import (
        DETECT,
        FitOptions,
        GivenStart,
        check_options,
        check_start,
        shared_names,
    )
    from damperfit.identification.outcome import Outcome, Status
    from damperfit.identification.procedures import PROCEDURES, identify
    from damperfit.identification.sharing import Sharing, unlimited_in, values_from_others
    from damperfit.identification.simulated_log import LogFit, SimulatedLog, compare, normalised_mse
    from damperfit.identification.starts import LocalMinimum, Search, describe_searches

_LATE = {
    "campaign": ("Campaign", "SettingFailure"),
    "fit_problem": ("FitProblem",),
    "fit_setting": ("Fit",),
    "options": (
        "DETECT", "FitOptions", "GivenStart", "check_options", "check_start", "shared_names",
    ),
    "outcome": ("Outcome", "Status"),
    "procedures": ("PROCEDURES", "identify"),
    "sharing": ("Sharing", "unlimited_in", "values_from_others"),
    "simulated_log": ("LogFit", "SimulatedLog", "compare", "normalised_mse"),
    "starts": ("LocalMinimum", "Search", "describe_searches"),
}  # fmt: skip
_MODULES = {name: module for module, names in _LATE.items() for name in names}

__all__ = [
    "DETECT",
    "PROCEDURES",
    "Campaign",
    "Fit",
    "FitOptions",
    "FitProblem",
    "GivenStart",
    "LocalMinimum",
    "LogFit",
    "Outcome",
    "Search",
    "SettingFailure",
    "Sharing",
    "SimulatedLog",
    "Status",
    "check_options",
    "check_start",
    "compare",
    "describe_searches",
    "identify",
    "normalised_mse",
    "shared_names",
    "unlimited_in",
    "values_from_others",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
