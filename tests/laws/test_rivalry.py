"""Models of the literature fitted to logs of their own, and ranked by what they predict."""

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.damper.rivals import RIVALS
from damperfit.laws.law_fit import Candidate, SettingLogs, fit_law, rank_rivals
from damperfit.recording import Trace
from damperfit.simulation import Motion, simulate
from damperfit.tested.setting import Setting
from tests.identification.rig import recorded
from tests.laws.valve_logs import VALUES, damper, moved

SETTING = Setting.of(3)
FITTED, CHECK = moved((0.06, 0.24)), moved((0.17,), amplitude=0.012)


def logged(motion: Motion, force: np.ndarray, seed: int) -> Trace:
    """A log with 1.5 N and 3 um of noise, conditioned."""
    how = {"setting": SETTING, "noises": (3e-6, 1.5), "seed": seed, "name": f"{seed}.csv"}
    return condition(recorded(motion.displacement, force, 1.0 / motion.interval, **how))


@pytest.fixture(scope="module")
def logs() -> SettingLogs:
    """A damper with valves, and another speed and stroke held out."""
    model = damper(has_play_and_lag=False)
    numbers = {name: number for name, number in VALUES.items() if name not in {"play", "lag"}}
    values = model.values(numbers)
    fitted, check = (
        logged(motion, simulate(values, model, motion).force, seed)
        for seed, motion in ((1, FITTED), (2, CHECK))
    )
    return SettingLogs(SETTING, (fitted,), (check,))


@pytest.fixture(scope="module")
def ranked(logs: SettingLogs) -> tuple[Candidate, ...]:
    return rank_rivals([logs])


def test_a_valve_damper_ranks_them_by_what_they_predict(ranked: tuple[Candidate, ...]) -> None:
    assert {one.title for one in ranked} == {kind.title for kind in RIVALS}
    held = [one.held_out_percent for one in ranked]
    assert held == sorted(held)
    by_name = {one.fits[0].model.name: one for one in ranked}
    # Two slopes and a spring are nearest to a bleed, a blow-off and an elastic mounting.
    assert ranked[0] is by_name["besinger_cebon_cole"]
    assert by_name["linear"].mse_percent > by_name["four_slopes"].mse_percent
    surface = by_name["restoring_force_surface"]
    assert surface.mse_percent < by_name["polynomial_xv"].mse_percent
    assert surface.held_out_percent > surface.mse_percent


def test_what_was_held_out_takes_no_part_in_the_fit(
    logs: SettingLogs, ranked: tuple[Candidate, ...]
) -> None:
    best = ranked[0].fits[0]
    again = fit_law(best.model, SettingLogs(SETTING, logs.fitted))
    assert again.values == best.values
    assert (best.held_out, again.held_out) == ("logs", "transients")
