"""What follows which adjuster: found by the logs, or declared; settings that were not fitted."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from damperfit.damper.model import values_type
from damperfit.damper.quantity import OFFSET, Quantity
from damperfit.identification import (
    DETECT,
    Campaign,
    FitOptions,
    Outcome,
    Status,
    compare,
    identify,
    unlimited_in,
    values_from_others,
)
from damperfit.identification.sharing import Unknown
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


def test_what_one_adjuster_moves_is_told_without_a_second() -> None:
    logs = [replace(log(at(low, 1)), setting=low) for low in (6, 14)]
    sharing = identify(logs, DAMPER, FOUND).sharing
    assert not sharing.follows
    assert set(sharing.jointly) == {"rebound_opening", "rebound_slope", "k_e", "f_f"}


def test_it_is_the_minimum_of_one_big_least_squares(found: Campaign) -> None:
    logs = adjusted.logs()
    unknowns = [*found.sharing.unknowns, *(Unknown("f_0", one.places) for one in SETTINGS)]
    fits = {fit.setting: fit for fit in found.fits}

    def values(vector, setting):
        y = {}
        for one, number in zip(unknowns, vector, strict=True):
            if one.holds_at(setting):
                y[one.name] = number if one.name == "f_0" else float(np.exp(number))
        return fits[setting].parameters.replace(y)

    def number_of(one):
        fit = next(fit for fit in found.fits if one.holds_at(fit.setting))
        number = getattr(fit.parameters, one.name)
        return number if one.name == "f_0" else np.log(number)

    def residuals(vector):
        parts = []
        for fit, one in zip(found.fits, logs, strict=True):
            force = compare(values(vector, one.setting), one, DAMPER, solver=FINE).force
            rms = np.sqrt(fit.mse_percent / 100) * np.std(one.force[one.compared])
            parts.append((force - one.force)[one.compared] / rms)
        return np.concatenate(parts)

    start = np.array([number_of(one) for one in unknowns])
    big = least_squares(residuals, start, diff_step=1e-5, x_scale=1e-2, xtol=1e-10, ftol=1e-10)
    errors = np.sqrt(np.diag(np.linalg.inv(big.jac.T @ big.jac)))
    assert np.all(np.abs(big.x - start) < 0.2 * errors)
    known = {one.setting: one for one in assess(found, DAMPER).uncertainties}
    for one, error in zip(unknowns, errors, strict=True):
        setting = next(s for s in SETTINGS if one.holds_at(s))
        printed = known[setting].intervals[one.name].error
        value = 1.0 if one.name == "f_0" else getattr(fits[setting].parameters, one.name)
        # Behind the filter of 30 Hz samples of 500 Hz are not independent: some 7 count as one.
        assert 1.5 < printed / value / error < 6.0, one.label


def test_what_settings_share_has_one_interval(found: Campaign) -> None:
    judged = assess(found, DAMPER)
    known = {one.setting: one for one in judged.uncertainties}

    def ends(name):
        intervals = [known[one].intervals[name] for one in SETTINGS]
        return [(one.low, one.high) for one in intervals]

    low = ends("rebound_bleed")
    assert low[0] == pytest.approx(low[1])
    assert low[2] == pytest.approx(low[3])
    assert low[0][0] > 1.5 * low[2][1]
    assert np.ptp(ends("k_e"), axis=0) == pytest.approx(0.0, abs=1.0)
    # Between settings only what all of them share cancels.
    assert known[SETTINGS[0]].shared == ("rebound_slope", "k_e", "f_f")
    said = judged.verdicts(found)[at(14, 3)]
    assert said["rebound_opening"].startswith("shared by all settings at high_speed 3")
    assert said["k_e"].startswith("shared by all settings, 95 %")


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
