"""Named checks of a run, and which of them must be passed."""

from damperfit.checks.gates import CHECK_LISTS, expand_checks, missed_gates
from damperfit.checks.named_checks import CHECKS, Check, Subject, run_checks, unchecked

__all__ = [
    "CHECKS",
    "CHECK_LISTS",
    "Check",
    "Subject",
    "expand_checks",
    "missed_gates",
    "run_checks",
    "unchecked",
]
