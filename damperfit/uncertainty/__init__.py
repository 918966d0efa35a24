"""How far each number may be trusted: covariance, intervals, what the residuals say.

A name is looked up when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from damperfit.uncertainty.assessment import *  # noqa: F403
    from damperfit.uncertainty.covariance import *  # noqa: F403
    from damperfit.uncertainty.grades import *  # noqa: F403
    from damperfit.uncertainty.options import *  # noqa: F403
    from damperfit.uncertainty.profiles import *  # noqa: F403
    from damperfit.uncertainty.residuals import *  # noqa: F403
    from damperfit.uncertainty.speed_forces import *  # noqa: F403

_NAMES = {
    "assessment": "METHOD Assessment assess profile_campaign reconsider",
    "covariance": "GasContent Interval Uncertainty linearise_settings uncertainties",
    "grades": "Objection Prediction SegmentRange missed_predictions objections predict "
    "prediction_warnings split_cycles",
    "options": "HoldOutOptions check_profile_names",
    "profiles": "Bench MisfitProfile",
    "residuals": "Diagnosis",
    "speed_forces": "SpeedForces",
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
