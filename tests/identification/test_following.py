"""What follows which adjuster: found by the logs, or declared; settings that were not fitted."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import damperfit
from damperfit.damper.model import OFFSET, Quantity, values_type
from damperfit.identification import (
    DETECT,
    Campaign,
    FitOptions,
    Outcome,
    Status,
    identify,
    unlimited_in,
    values_from_others,
)
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from damperfit.uncertainty import Assessment, assess, predict
from tests.identification import adjusted
from tests.identification.adjusted import DAMPER, FOLLOWS, SETTINGS, at, log, numbers

FINE = SolverOptions(tolerance=1e-3)
FOUND = FitOptions("joint", share=(DETECT,), solver=FINE)
DECLARED = FitOptions("joint", share=(DETECT,), follows=FOLLOWS)


@pytest.fixture(scope="module")
def found() -> Campaign:
    """All four settings, as the logs tell."""
    return identify(adjusted.logs(), DAMPER, FOUND)


def test_the_logs_tell_what_follows_which_adjuster(found: Campaign) -> None:
    sharing = found.sharing
    assert sharing.follows == FOLLOWS
    assert set(sharing.free) - set(sharing.jointly) == {"f_0"}
    assert sharing.sentence == (
        "The logs show that rebound_bleed and compression_bleed follow low_speed; rebound_opening "
        "follows high_speed; f_0 is each setting's own; everything else is shared by all 4 settings"
    )
    for fit in found.fits:
        assert fit.outcome is Outcome.CONVERGED
        for name, true in numbers(fit.setting).items():
            assert getattr(fit.parameters, name) == pytest.approx(true, rel=0.02), name
            assert fit.status[name] == ("fitted" if name == "f_0" else "shared")


def test_clicks_of_one_adjuster_have_valves_of_their_own(tmp_path) -> None:
    # Of 3 % a click the logs alone would not tell that a bleed or a preload moves.
    damperfit.samples(tmp_path, settings=[9, 10, 11], model="through_flow", seed=1)
    run = damperfit.identify(tmp_path / "*.csv", model="through_flow", jobs=1)
    for true in pd.read_csv(tmp_path / "truth.csv", index_col="setting").itertuples():
        fit = run.setting(true.Index)
        assert set(fit.shared) == {"f_f", "k_s"}
        for name in (*fit.own, *fit.shared):
            value, (low, high) = fit.values[name], fit.intervals[name]
            assert abs(value - getattr(true, name)) < high - low, name
            assert name == "f_0" or value == pytest.approx(getattr(true, name), rel=0.02), name


def test_a_setting_that_does_not_tell_it_takes_it_from_others() -> None:
    # At the stiff click of high speed a slow log never opens the blow-off.
    logs = [*adjusted.logs()[:3], log(SETTINGS[3], speeds=(0.02, 0.04))]
    (alone,) = identify(logs[3:], DAMPER, FitOptions("plain")).fits
    assert alone.outcome is not Outcome.CONVERGED
    fit = identify(logs, DAMPER, DECLARED).fits[3]
    assert fit.outcome is Outcome.CONVERGED
    assert fit.parameters.rebound_opening == pytest.approx(8e5, rel=0.02)


# A setting that was not fitted, from the clicks of others.

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
        ([(1, 1, 5.0), (1, 2, 5.0), (3, 1, 7.0)], at(3, 2), 7.0),  # by the first adjuster
        ([(1, 1, 5.0), (3, 1, 5.0), (1, 2, 7.0)], at(3, 2), 7.0),  # by the second
        ([(1, 1, 5.0), (1, 2, 5.0), (3, 1, 5.0)], at(3, 2), 5.0),  # by none
        ([(1, 1, 5.0), (1, 2, 6.0), (3, 1, 7.0)], at(3, 2), None),  # by both
        ([(1, 1, 5.0), (1, 2, 5.0), (3, 1, 7.0)], at(4, 2), None),  # a click nobody has tested
        ([(1, 1, 5.0), (3, 2, 7.0)], at(1, 2), None),  # it may follow either
        ([(1, 1, 5.0), (3, 2, 7.0), (1, 4, 5.0)], at(1, 2), None),
        ([(1, 1, 5.0), (3, 1, 7.0)], at(1, 2), None),  # a click of the second nobody has tested
        ([(1, 1, 5.0), (1, 2, 5.0), (3, 1, 7.0)], Setting.of(3), None),  # other adjusters
        ([], at(1, 1), None),
    ],
)
def test_what_the_clicks_of_others_tell(rows, wanted, value) -> None:
    found = values_from_others(known(*rows), wanted)
    assert (found and found.s) == value
    if found:
        assert found.f_0 == pytest.approx(np.mean(range(len(rows))))


def test_an_unseen_setting_is_predicted_with_the_offset_of_its_log() -> None:
    logs = adjusted.logs()[:3]
    fitted = identify(logs, DAMPER, DECLARED)
    judged, unseen = assess(fitted, DAMPER), log(SETTINGS[3], f_0=40.0)
    (found,) = predict(fitted, judged, (unseen,), damper=DAMPER)
    assert found.setting == at(14, 3)
    assert found.is_unseen
    assert found.mse_percent < 0.01
    assert found.verdict == (
        "predicted as well as fitted; parameters combined from settings that share its clicks"
    )
    wrong = log(SETTINGS[3], rebound_bleed=4e4)  # a damper that does not keep to its clicks
    (worse,) = predict(fitted, judged, (wrong,), damper=DAMPER)
    assert worse.is_failed
    assert worse.unlimited == ()
    # What no log of its click limits is named: those that have the click of the bleed.
    lost = {"rebound_bleed": Status.NOT_IDENTIFIABLE}
    fits = tuple(replace(one, status={**one.status, **lost}) for one in fitted.fits)
    (open_,) = predict(replace(fitted, fits=fits), Assessment(), (unseen,), damper=DAMPER)
    assert open_.unlimited == ("rebound_bleed",)
    apart = identify(logs, DAMPER, FitOptions("plain"))
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
