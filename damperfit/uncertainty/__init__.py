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
from damperfit.uncertainty.information import Evidence, LogEvidence, gather
from damperfit.uncertainty.intervals import (
    NORMAL_95,
    Interval,
    Uncertainty,
    collect_evidence,
    uncertainties,
)
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
    "NORMAL_95",
    "Assessment",
    "Bench",
    "Diagnosis",
    "Evidence",
    "GasContent",
    "Hint",
    "HoldOutOptions",
    "Interval",
    "LogEvidence",
    "MisfitProfile",
    "Objection",
    "Prediction",
    "ProfilePoint",
    "SpeedForces",
    "Stride",
    "Uncertainty",
    "assess",
    "check_profile_names",
    "collect_evidence",
    "diagnose",
    "gather",
    "objections",
    "predict",
    "prediction_warnings",
    "profile_campaign",
    "reconsider",
    "split_cycles",
    "uncertainties",
]
