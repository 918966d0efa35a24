"""How far each number may be trusted: covariance, intervals, what the residuals say."""

from damperfit.uncertainty.evidence import Evidence, LogEvidence, gather
from damperfit.uncertainty.intervals import (
    Interval,
    Uncertainty,
    collect_evidence,
    uncertainties,
)

__all__ = [
    "Evidence",
    "Interval",
    "LogEvidence",
    "Uncertainty",
    "collect_evidence",
    "gather",
    "uncertainties",
]
