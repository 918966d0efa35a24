"""From traces to parameters: residuals, starting values, one setting's fit, the campaign.

A name is looked up when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from damperfit.identification.campaign import PROCEDURES, Campaign, identify
    from damperfit.identification.failures import SettingFailure
    from damperfit.identification.given_start import GivenStart, check_start
    from damperfit.identification.log_fit import LogFit
    from damperfit.identification.model_versus_log import SimulatedLog, compare, normalised_mse
    from damperfit.identification.multistart import Search, Valley, describe_searches
    from damperfit.identification.options import DETECT, FitOptions, check_options, shared_names
    from damperfit.identification.outcome import Outcome, Status
    from damperfit.identification.setting import Fit
    from damperfit.identification.sharing import Sharing
    from damperfit.identification.unseen import unlimited_in, values_from_others

__all__ = [
    "DETECT",
    "PROCEDURES",
    "Campaign",
    "Fit",
    "FitOptions",
    "GivenStart",
    "LogFit",
    "Outcome",
    "Search",
    "SettingFailure",
    "Sharing",
    "SimulatedLog",
    "Status",
    "Valley",
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

_LATE = {
    "Campaign": "campaign",
    "SimulatedLog": "model_versus_log",
    "DETECT": "options",
    "Fit": "setting",
    "FitOptions": "options",
    "GivenStart": "given_start",
    "LogFit": "log_fit",
    "Outcome": "outcome",
    "PROCEDURES": "campaign",
    "Search": "multistart",
    "SettingFailure": "failures",
    "Sharing": "sharing",
    "Status": "outcome",
    "Valley": "multistart",
    "check_options": "options",
    "check_start": "given_start",
    "compare": "model_versus_log",
    "describe_searches": "multistart",
    "identify": "campaign",
    "normalised_mse": "model_versus_log",
    "unlimited_in": "unseen",
    "values_from_others": "unseen",
    "shared_names": "options",
}


def __getattr__(name: str) -> Any:
    if name not in _LATE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_LATE[name]}"), name)
