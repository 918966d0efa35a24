"""A blow-off that no log opens: its preload is above the pressure on it, and that is said."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.damper.mounting import Mounting
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.warmed import Warmed
from damperfit.identification import FitOptions, Sharing, identify
from damperfit.identification.options import GivenStart
from damperfit.identification.outcome import Status
from damperfit.recording import Recording
from damperfit.simulation import simulate
from damperfit.tested.setting import Setting
from damperfit.uncertainty import Uncertainty, assess, reconsider
from damperfit.uncertainty.covariance import make_interval
from damperfit.uncertainty.verdicts import verdicts, with_least_openings
from tests import fakes
from tests.laws.valve_logs import VALUES, damper, moved

MODEL = replace(damper(has_play_and_lag=False), mounting=Mounting())
NAME = "rebound_opening"


def log_of(setting: int, peak: float, **more: float):
    truth = {name: VALUES[name] for name in MODEL.names if name in VALUES} | more
    motion = moved((peak,), cycles=4)
    response = simulate(MODEL.values(truth), MODEL, motion)
    chance, n = np.random.default_rng(setting), len(response.force)
    x = motion.displacement + chance.normal(0.0, 3e-6, n)
    force = response.force + chance.normal(0.0, 2.0, n)
    log = Recording(f"{setting}.csv", "", "", Setting.of(setting),
                    motion.interval * np.arange(n), x, force)  # fmt: skip
    return condition(log), float((response.pressures[0] - response.pressures[2]).max())


# From an edge, for where on the way to it a descent ends is chance.
@pytest.mark.parametrize(("opening", "speed", "start"), [(4e6, 0.05, {}), (1e7, 0.13, {NAME: 1e8})])
def test_an_opening_that_no_log_reaches_is_above_the_pressure_on_it(opening, speed, start) -> None:
    trace, most = log_of(1, speed, rebound_opening=opening)
    campaign = identify([trace], MODEL, FitOptions("plain", start=GivenStart(start)))
    judged = assess(campaign, MODEL)
    campaign = reconsider(campaign, judged)
    (fit,) = campaign.fits
    assert fit.status[NAME] == Status.NOT_IDENTIFIABLE
    assert judged.uncertainties[0].unopened == {NAME: pytest.approx(most, rel=0.02)}
    said = judged.verdicts(campaign)[fit.setting]
    least = re.search(r"it opens above (\S+) Pa, the highest pressure on it in them", said[NAME])
    assert float(least[1]) == pytest.approx(most, rel=0.02)
    if start:
        assert said[NAME].endswith("1e+08 Pa is used: the law may as well lack this part")
    assert "they do not open the blow-off" in said["rebound_slope"]
    assert said["compression_opening"].startswith("fitted, 95 % from")


@pytest.mark.parametrize(
    ("opening", "used"),
    [(0.99e6, "9.9e+05 Pa is used with a slope that lets next to nothing through; hold it"),
     (1.01e6, "1.01e+06 Pa is used; hold it")],
)  # fmt: skip
def test_an_opening_below_the_highest_pressure_lets_next_to_nothing_through(opening, used) -> None:
    fit = SimpleNamespace(
        setting=Setting.of(1),
        parameters=MODEL.values({n: VALUES.get(n, 1.0) for n in MODEL.names} | {NAME: opening}),
        status=dict.fromkeys(MODEL.names, Status.NOT_IDENTIFIABLE),
    )
    known = Uncertainty(
        fit.setting,
        {NAME: make_interval(opening, 1.0)},
        (NAME,),
        np.eye(1),
        unopened={NAME: 1e6},
    )
    assert used in verdicts(fit, known, Sharing(), {})[NAME]


def linearised(setting: int, opening: float, pressed: float, slope: float = 1e6):
    values = SimpleNamespace(rebound_opening=opening, rebound_slope=slope)
    log = SimpleNamespace(trace=fakes.trace(setting))
    fit = SimpleNamespace(setting=Setting.of(setting), parameters=values, logs=(log,))
    return SimpleNamespace(fit=fit, pressed={NAME: pressed}, names=(NAME, "rebound_slope"))


def unopened(*each, is_shared: bool = True, damper=MODEL):
    settings = tuple(one.fit.setting for one in each)
    sharing = Sharing(jointly=(NAME,) if is_shared else (), settings=settings)
    known = Uncertainty(settings[0], {}, (), np.eye(1))
    return with_least_openings([known], each, sharing, damper)[0].unopened


@pytest.mark.parametrize(
    ("is_shared", "opening", "found"),
    [(True, 1e6, {NAME: 9e5}), (False, 1e6, {NAME: 2e5}), (True, 8e5, {}), (False, 1.9e5, {})],
)
@pytest.mark.parametrize("damper", [PURDY_DAMPER, MODEL, Warmed(MODEL, 20.0)])
def test_a_setting_that_shares_an_opening_may_press_on_it_more(
    damper, is_shared, opening, found
) -> None:
    each = [linearised(1, opening, 2e5), linearised(2, opening, 9e5)]
    assert unopened(*each, is_shared=is_shared, damper=damper) == found


@pytest.mark.parametrize(("share", "is_open"), [(0.0095, False), (0.0105, True)])
def test_a_hundredth_of_a_strokes_oil_is_a_blow_off_that_opens(share, is_open) -> None:
    flow = MODEL.oil_density * MODEL.annulus_area * fakes.trace(1).fastest.peak_speed
    one = linearised(1, 5e5, 9e5, slope=4e5 / (share * flow))
    assert unopened(one) == ({} if is_open else {NAME: 9e5})
