"""How a fit ended, with a sentence of advice; what it says of each parameter; why there is none."""

from collections.abc import Callable
from dataclasses import replace
from enum import Enum, StrEnum
from typing import TypeVar

from damperfit.errors import (
    ConfigurationError,
    FitCancelledError,
    InstallationError,
    SimulationError,
    failure_of,
)
from damperfit.problem import Failure
from damperfit.tested.setting import Setting

Result = TypeVar("Result")


class Status(StrEnum):
    """What a fit says of a parameter; the value is the word in tables and run.json."""

    FITTED = "fitted"
    FIXED = "fixed"
    SHARED = "shared"
    AT_BOUND = "at_bound"
    NOT_IDENTIFIABLE = "not_identifiable"
    ABSENT = "absent"

    @property
    def has_failed(self) -> bool:
        """Whether the parameter was to be found and was not."""
        return self in {Status.AT_BOUND, Status.NOT_IDENTIFIABLE}


class Outcome(Enum):
    """How a fit ended; ``value`` is the name in tables, ``advice`` says what to do about it."""

    CONVERGED = "converged"
    CAVITATING = "cavitating"
    AT_BOUND = "at_bound"
    NOT_IDENTIFIABLE = "not_identifiable"
    EVALUATION_LIMIT = "evaluation_limit"
    NO_DESCENT = "no_descent"
    NOT_FINITE = "not_finite"

    @property
    def is_minimum(self) -> bool:
        """Whether the fit ended where it should: elsewhere no error can be given."""
        return self not in {Outcome.EVALUATION_LIMIT, Outcome.NO_DESCENT, Outcome.NOT_FINITE}

    @property
    def advice(self) -> str:
        """One plain sentence for people."""
        return _ADVICE[self]


_ADVICE = {
    Outcome.CONVERGED: "The fit converged.",
    Outcome.CAVITATING: (
        "A chamber of the fitted model cavitates in part of the cycle: hold R_m3, or check the gas "
        "pressure and the force offset."
    ),
    Outcome.AT_BOUND: (
        "A parameter is at a bound of its plausible range: hold it, or check units and signs."
    ),
    Outcome.NOT_IDENTIFIABLE: (
        "These logs do not determine a free parameter: hold it, or fit more logs of this setting."
    ),
    Outcome.EVALUATION_LIMIT: (
        "The fit stopped at its limit of evaluations: raise identification.max_evaluations."
    ),
    Outcome.NO_DESCENT: (
        "No step made the misfit smaller although the gradient is not zero: the result is the best "
        "point found, not a minimum."
    ),
    Outcome.NOT_FINITE: (
        "The simulation failed at the points the fit wanted to try: the result is the best point "
        "found, not a minimum."
    ),
}


class SettingError(SimulationError):
    """One of the settings that are fitted together has failed."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(failure.message, subject=f"setting {failure.setting}")
        self.failure = failure


def attempted(setting: Setting | None, fit: Callable[[], Result]) -> Result | Failure:
    """What a fit of one setting finds (None: of all together), or why it finds nothing."""
    try:
        return fit()
    except (FitCancelledError, ConfigurationError, InstallationError):  # wrong at every setting
        raise
    except Exception as error:  # noqa: BLE001 - a bug that one setting meets leaves the others
        if setting is None:
            return failure_of(error, "fitting the settings together")
        return replace(failure_of(error, "fitting"), setting=setting)
