"""A setting that was not fitted, from the clicks of others; logs of an integrator of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.model import Quantity, values_type
from damperfit.identification import DETECT, FitOptions, identify, put_together
from damperfit.recording import Recording
from damperfit.setting import Setting
from damperfit.uncertainty import assess, predict
from tests.identification import adjusted
from tests.identification.adjusted import DAMPER, FOLLOWS, SETTINGS, at, log, numbers
from tests.laws.valve_logs import moved
from tests.oracles.network import solve

TWO = values_type(
    (
        Quantity("s", "s", "bleed", "bleed", "Pa", (1.0, 9.0)),
        Quantity("f_0", "f_0", "force offset", "tare", "N", (-9.0, 9.0), is_logarithmic=False),
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
    found = put_together(known(*rows), at(*wanted))
    if value is None:
        assert found is None
    else:
        assert found.s == value
        assert found.f_0 == pytest.approx(np.mean(range(len(rows))))


def test_other_adjusters_tell_nothing() -> None:
    rows = known((1, 1, 5.0), (1, 2, 5.0), (3, 1, 7.0))
    assert put_together(rows, Setting.of(3)) is None
    assert put_together({}, at(1, 1)) is None


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
        "predicted as well as fitted; put together from the clicks of other settings"
    )
    wrong = log(SETTINGS[3], rebound_bleed=4e4)  # a damper that does not keep to its clicks
    (worse,) = predict(fitted, assess(fitted, DAMPER), (wrong,), damper=DAMPER)
    assert worse.is_failed
    apart = identify(adjusted.logs()[:3], DAMPER, FitOptions("plain"))
    assert predict(apart, assess(apart, DAMPER), (unseen,), damper=DAMPER) == ()


def from_outside(setting: Setting, speeds: tuple[float, ...]) -> object:
    """The log of a setting by SciPy's Radau, with 4 N of noise and 8 um of the displacement."""
    motion = moved(speeds, cycles=2)
    time = np.arange(len(motion.displacement)) * motion.interval
    path = CubicHermiteSpline(time, motion.displacement, motion.velocity)
    values = numbers(setting) | {
        "gas_pressure": DAMPER.gas_pressure,
        "gas_volume": DAMPER.gas_volume,
        "gas_exponent": DAMPER.gas_exponent,
        "return_slope": 2.5e5,
        "series_stiffness": 0.0,
        "play": 0.0,
        "drag": 0.0,
    }
    force, _ = solve(DAMPER.network, values, DAMPER, (path, path.derivative()), time, rtol=1e-6)
    random = np.random.default_rng([7, *(place for _, place in setting.places)])
    recording = Recording(
        name=f"{setting.slug}_{speeds[0]:g}.csv", path="", sha256="", setting=setting, time=time,
        displacement=motion.displacement + 8e-6 * random.standard_normal(len(time)),
        force=force + values["f_0"] + 4.0 * random.standard_normal(len(time)),
    )  # fmt: skip
    return condition(recording, ConditionOptions(is_offset_known=True))


@pytest.mark.slow
def test_one_model_for_all_settings_and_what_it_predicts() -> None:
    """`pytest -m slow tests/identification/test_unseen.py`: the bars of one model for all."""
    fast = [from_outside(one, (0.05, 0.2)) for one in SETTINGS]
    whole = identify(fast, DAMPER, FitOptions("joint", share=(DETECT,)))
    assert whole.sharing.follows == FOLLOWS
    assert np.mean([fit.mse_percent for fit in whole.fits]) <= 0.2
    slow = [replace(from_outside(one, (0.04,)), name=f"slow {one}") for one in SETTINGS]
    for one in predict(whole, assess(whole, DAMPER), slow, damper=DAMPER):
        assert one.mse_percent <= 0.5
    for k, unseen in enumerate(fast):
        rest = [one for place, one in enumerate(fast) if place != k]
        fitted = identify(rest, DAMPER, FitOptions("joint", share=(DETECT,)))
        (found,) = predict(fitted, assess(fitted, DAMPER), (unseen,), damper=DAMPER)
        assert found.is_unseen
        assert found.mse_percent <= 0.15
