"""How far each number may be trusted: covariance, intervals, what the residuals say.

A name is looked up when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from damperfit.uncertainty.assessment import (
        METHOD,
        Assessment,
        assess,
        profile_campaign,
    )
    from damperfit.uncertainty.flaws import Hint
    from damperfit.uncertainty.gas import GasContent
    from damperfit.uncertainty.held_cycles import SegmentRange, split_cycles
    from damperfit.uncertainty.intervals import (
        Interval,
        Uncertainty,
        linearise_settings,
        uncertainties,
    )
    from damperfit.uncertainty.last_word import reconsider
    from damperfit.uncertainty.linearisation import (
        Linearisation,
        LogLinearisation,
        linearise_at_fit,
    )
    from damperfit.uncertainty.mispredicted import missed_predictions
    from damperfit.uncertainty.options import HoldOutOptions, check_profile_names
    from damperfit.uncertainty.prediction import (
        Prediction,
        predict,
        prediction_warnings,
    )
    from damperfit.uncertainty.profiles import (
        Bench,
        MisfitProfile,
        ProfilePoint,
        Stride,
    )
    from damperfit.uncertainty.residuals import Diagnosis, diagnose
    from damperfit.uncertainty.speed_forces import SpeedForces
    from damperfit.uncertainty.withheld import Objection, objections

__all__ = [
    "METHOD",
    "Assessment",
    "Bench",
    "Diagnosis",
    "GasContent",
    "Hint",
    "HoldOutOptions",
    "Interval",
    "Linearisation",
    "LogLinearisation",
    "MisfitProfile",
    "Objection",
    "Prediction",
    "ProfilePoint",
    "SegmentRange",
    "SpeedForces",
    "Stride",
    "Uncertainty",
    "assess",
    "check_profile_names",
    "diagnose",
    "linearise_at_fit",
    "linearise_settings",
    "missed_predictions",
    "objections",
    "predict",
    "prediction_warnings",
    "profile_campaign",
    "reconsider",
    "split_cycles",
    "uncertainties",
]

_LATE = {
    "Assessment": "assessment",
    "Bench": "profiles",
    "Diagnosis": "residuals",
    "GasContent": "gas",
    "Hint": "flaws",
    "HoldOutOptions": "options",
    "Interval": "intervals",
    "Linearisation": "linearisation",
    "LogLinearisation": "linearisation",
    "METHOD": "assessment",
    "MisfitProfile": "profiles",
    "Objection": "withheld",
    "Prediction": "prediction",
    "ProfilePoint": "profiles",
    "SpeedForces": "speed_forces",
    "Stride": "profiles",
    "Uncertainty": "intervals",
    "assess": "assessment",
    "check_profile_names": "options",
    "diagnose": "residuals",
    "linearise_at_fit": "linearisation",
    "linearise_settings": "intervals",
    "missed_predictions": "mispredicted",
    "objections": "withheld",
    "predict": "prediction",
    "prediction_warnings": "prediction",
    "profile_campaign": "assessment",
    "reconsider": "last_word",
    "SegmentRange": "held_cycles",
    "split_cycles": "held_cycles",
    "uncertainties": "intervals",
}


def __getattr__(name: str) -> Any:
    if name not in _LATE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_LATE[name]}"), name)
