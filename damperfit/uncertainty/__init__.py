"""How far each number may be trusted: covariance, intervals, what the residuals say."""

from damperfit.uncertainty.assessment import (
    METHOD,
    Assessment,
    assess,
    profile_campaign,
    reconsider,
)
from damperfit.uncertainty.flaws import Hint
from damperfit.uncertainty.gas import GasContent
from damperfit.uncertainty.intervals import (
    Interval,
    Uncertainty,
    linearise_settings,
    uncertainties,
)
from damperfit.uncertainty.linearisation import Linearisation, LogLinearisation, linearise_at_fit
from damperfit.uncertainty.prediction import (
    HoldOutOptions,
    Prediction,
    predict,
    prediction_warnings,
    split_cycles,
)
from damperfit.uncertainty.profiles import (
    Bench,
    MisfitProfile,
    ProfilePoint,
    Stride,
    check_profile_names,
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
    "SpeedForces",
    "Stride",
    "Uncertainty",
    "assess",
    "check_profile_names",
    "diagnose",
    "linearise_at_fit",
    "linearise_settings",
    "objections",
    "predict",
    "prediction_warnings",
    "profile_campaign",
    "reconsider",
    "split_cycles",
    "uncertainties",
]
