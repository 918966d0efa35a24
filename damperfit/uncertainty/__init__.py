"""How far each number may be trusted: covariance, intervals, what the residuals say."""

from damperfit.uncertainty.assessment import METHOD, Assessment, assess
from damperfit.uncertainty.evidence import Evidence, LogEvidence, gather
from damperfit.uncertainty.intervals import (
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
from damperfit.uncertainty.residuals import Diagnosis, Hint, diagnose
from damperfit.uncertainty.verdicts import verdicts

__all__ = [
    "METHOD",
    "Assessment",
    "Diagnosis",
    "Evidence",
    "Hint",
    "HoldOutOptions",
    "Interval",
    "LogEvidence",
    "Prediction",
    "Uncertainty",
    "assess",
    "collect_evidence",
    "diagnose",
    "gather",
    "predict",
    "prediction_warnings",
    "split_cycles",
    "uncertainties",
    "verdicts",
]
