"""From traces to parameters: the problem of one setting or of several, its fit, the campaign.

A name is looked up when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from damperfit.identification.fit_problem import *  # noqa: F403
    from damperfit.identification.fit_setting import *  # noqa: F403
    from damperfit.identification.logs import *  # noqa: F403
    from damperfit.identification.options import *  # noqa: F403
    from damperfit.identification.outcome import *  # noqa: F403
    from damperfit.identification.procedures import *  # noqa: F403
    from damperfit.identification.sharing import *  # noqa: F403

_NAMES = {
    "fit_problem": "Block FitProblem",
    "fit_setting": "Fit LocalMinimum Search describe_searches",
    "options": "DETECT FitOptions GivenStart check_options check_start shared_names",
    "outcome": "Outcome Status",
    "procedures": "Campaign PROCEDURES SettingFailure identify",
    "sharing": "Sharing unlimited_in values_from_others",
    "logs": "LogFit SimulatedLog compare normalised_mse",
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
