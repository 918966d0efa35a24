"""What was held out and is missed: a grade of the fit is then a grade of the tests, not the damper.

A low MSE on the motion that was fitted is what every law with enough numbers reaches. A speed that
was not fitted, or the run-up and coast-down, shows whether the numbers are the damper's.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.conditioning import TRANSIENTS
from damperfit.uncertainty.withheld import LIMITS, Objection

if TYPE_CHECKING:
    from collections.abc import Iterable

    from damperfit.tested.setting import Setting
    from damperfit.uncertainty.prediction import Prediction

__all__ = ["missed_predictions"]


def missed_predictions(predictions: Iterable[Prediction]) -> dict[Setting, Objection]:
    """Return by setting the held-out test that is missed most, as a reason to withhold its grade.

    Of fitted settings alone, and of other motions than those that were fitted: a repeat that is
    missed tells of drift, not of the law. What settings without a fit would be has no grade.

    Parameters
    ----------
    predictions : iterable of Prediction
        Of all that was held out.
    """
    worst: dict[Setting, Prediction] = {}
    for one in filter(_is_missed, predictions):
        known = worst.get(one.setting)
        if known is None or one.mse_percent > known.mse_percent:
            worst[one.setting] = one
    return {setting: _objection(one) for setting, one in worst.items()}


def _is_missed(one: Prediction) -> bool:
    is_test = not one.is_same_motion and not one.is_unseen
    much = one.mse_percent > LIMITS.predicted_percent
    return is_test and much and one.ratio > LIMITS.predicted_times


def _objection(one: Prediction) -> Objection:
    is_beside = one.cycles == TRANSIENTS
    what = (
        f"the run-up, coast-down or changes of speed of {one.trace.name}"
        if is_beside
        else one.trace.name
    )
    return Objection(
        "prediction",
        "",
        f"{what}, which {'were' if is_beside else 'was'} not fitted, "
        f"{'are' if is_beside else 'is'} missed by an MSE of {_percent(one.mse_percent)} % where "
        f"{_percent(one.expected_mse_percent)} % is expected: the numbers hold for the motion that "
        "was fitted",
    )


def _percent(value: float) -> str:
    """Two digits, and no power of ten."""
    return f"{value:.2g}" if value < 100.0 else f"{float(f'{value:.2g}'):.0f}"
