"""A setting that was not fitted, from the clicks of others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.damper.model import values_type
from damperfit.damper.quantity import OFFSET, Quantity
from damperfit.identification import (
    DETECT,
    FitOptions,
    Status,
    identify,
    unlimited_in,
    values_from_others,
)
from damperfit.tested.setting import Setting
from damperfit.uncertainty import Assessment, assess, predict
from tests.identification import adjusted
from tests.identification.adjusted import DAMPER, FOLLOWS, SETTINGS, at, log

TWO = values_type(
    (
        Quantity("s", "s", "bleed", "bleed", "Pa", (1.0, 9.0)),
        Quantity("f_0", "f_0", "tare", "tare", "N", (-9.0, 9.0), is_logarithmic=False, role=OFFSET),
    )
)


def known(*rows: tuple[int, int, float]) -> dict[Setting, object]:
    return {at(low, high): TWO(s, float(k)) for k, (low, high, s) in enumerate(rows)}


@pytest.mark.parametrize(
    ("rows", "wanted", "value"),
    [
        ([(1, 1, 5.0), (1, 2, 5.0), (3, 1, 7.0)], (3, 2), 7.0),  # by the first adjuster
        ([(1, 1, 5.0), (3, 1, 5.0), (1, 2, 7.0)], (3, 2), 7.0),  # by the second
        ([(1, 1, 5.0), (1, 2, 5.0), (3, 1, 5.0)], (3, 2), 5.0),  # by none
        ([(1, 1, 5.0), (1, 2, 6.0), (3, 1, 7.0)], (3, 2), None),  # by both
        ([(1, 1, 5.0), (1, 2, 5.0), (3, 1, 7.0)], (4, 2), None),  # a click that nobody has tested
        ([(1, 1, 5.0), (3, 2, 7.0)], (1, 2), None),  # it may follow either
        ([(1, 1, 5.0), (3, 2, 7.0), (1, 4, 5.0)], (1, 2), None),
        ([(1, 1, 5.0), (3, 1, 7.0)], (1, 2), None),  # a click of the second that nobody has tested
    ],
)
def test_what_the_clicks_of_others_tell(rows, wanted, value) -> None:
    found = values_from_others(known(*rows), at(*wanted))
    if value is None:
        assert found is None
    else:
        assert found.s == value
        assert found.f_0 == pytest.approx(np.mean(range(len(rows))))


def test_other_adjusters_tell_nothing() -> None:
    rows = known((1, 1, 5.0), (1, 2, 5.0), (3, 1, 7.0))
    assert values_from_others(rows, Setting.of(3)) is None
    assert values_from_others({}, at(1, 1)) is None


def test_an_unseen_setting_is_predicted_with_the_offset_of_its_log() -> None:
    fitted = identify(
        adjusted.logs()[:3], DAMPER, FitOptions("joint", share=(DETECT,), follows=FOLLOWS)
    )
    unseen = log(SETTINGS[3], f_0=40.0)
    (found,) = predict(fitted, assess(fitted, DAMPER), (unseen,), damper=DAMPER)
    assert found.setting == at(14, 3)
    assert found.is_unseen
    assert found.mse_percent < 0.01
    assert found.verdict == (
        "predicted as well as fitted; parameters combined from settings that share its clicks"
    )
    wrong = log(SETTINGS[3], rebound_bleed=4e4)  # a damper that does not keep to its clicks
    (worse,) = predict(fitted, assess(fitted, DAMPER), (wrong,), damper=DAMPER)
    assert worse.is_failed
    assert worse.unlimited == ()
    # What no log of its click limits is named: those that have the click of the bleed.
    lost = {"rebound_bleed": Status.NOT_IDENTIFIABLE}
    fits = tuple(replace(one, status={**one.status, **lost}) for one in fitted.fits)
    (open_,) = predict(replace(fitted, fits=fits), Assessment(), (unseen,), damper=DAMPER)
    assert open_.unlimited == ("rebound_bleed",)
    apart = identify(adjusted.logs()[:3], DAMPER, FitOptions("plain"))
    assert predict(apart, assess(apart, DAMPER), (unseen,), damper=DAMPER) == ()


@pytest.mark.parametrize(
    ("open_at", "told"), [({(1, 2)}, ("f_0",)), ({(1, 1)}, ()), (set(), ()), ({(3, 1)}, ())]
)
def test_a_value_is_unlimited_where_all_that_have_it_are(open_at, told) -> None:
    rows = known((1, 1, 5.0), (1, 2, 6.0), (3, 1, 7.0))
    values = TWO(5.0, 1.0)  # s of the first, f_0 of the second
    unlimited = {at(*one): ("f_0",) for one in open_at}
    assert unlimited_in(values, rows, unlimited) == told
    assert unlimited_in(values, {}, unlimited) == ()
