"""What a set lacks is called by name; what lacks nothing is left alone; nothing beyond reason."""

from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import ConditionOptions, condition
from damperfit.conditioning.polarity import YIELDS, held_share
from damperfit.identification import FitOptions
from damperfit.uncertainty import Diagnosis
from damperfit.uncertainty.residuals import (
    BySpeed,
    Hint,
    _as_stiffness,
    _is_reasonable,
    hidden_friction,
    reconciled,
)
from tests.identification.rig import recording, short_traces
from tests.uncertainty.flaws import FLAWS, judged, outcomes, speed

SETTINGS = (1, 10, 20)
UNFILTERED = ConditionOptions(filter="none")
KNOWN = {"r_m3": 2.597e6, "f_f": 50.0}
PLAIN = FitOptions("plain", ("r_m1", "r_m2", "k_e", "f_f"), {"r_m3": 2.597e6})
BARE = FitOptions("plain", ("r_m1", "r_m2", "k_e"), KNOWN)


@pytest.mark.parametrize(
    "seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))]
)
def test_a_sound_set_is_left_in_peace(seed) -> None:
    found = judged(short_traces(SETTINGS, noise=4.0, seed=seed, duration=10.0))
    assert found.warnings == ()
    for one in found.diagnoses:
        assert not one.is_structured
        assert one.noise_percent > 0.9 * one.mse_percent
    (sentence,) = found.sentences
    assert sentence.startswith("settings 1, 10, 20: no misfit repeats")
    assert judged(short_traces(SETTINGS, seed=seed)).warnings == ()  # nor without any noise


@pytest.mark.parametrize(
    "settings", [(12,), pytest.param(SETTINGS, marks=pytest.mark.slow)], ids=["one", "three"]
)
@pytest.mark.parametrize("flaw", FLAWS, ids=lambda flaw: flaw.name)
def test_a_flaw_is_named_with_its_size(flaw, settings) -> None:
    # Many seeds by hand: python -m tests.uncertainty.flaws.
    for found, names in outcomes(flaw, settings, seed=7):
        assert flaw.expected in names if flaw.expected else names == ()
        for hint in found.hints:
            if hint.name == flaw.expected and flaw.amount is not None:
                assert hint.amount == pytest.approx(flaw.amount, abs=flaw.within)
                assert hint.words in found.sentence
        if flaw.expected == "delay":
            assert found.mse_percent < 0.1  # excellent, and wrong: K_e is off by up to half


def test_a_weak_misfit_that_repeats_for_long_is_seen_below_white_noise() -> None:
    # The bar took its independent samples from the residual, and rose with the misfit in it.
    log = recording(10)
    noise = 4.0 * np.random.default_rng(5).standard_normal(len(log.force))
    third = 2.0 * np.sin(3.0 * 2.0 * np.pi * 1.5 * log.time)
    for more, is_seen in ((noise, False), (noise + third, True)):
        seen = condition(replace(log, force=log.force + more), UNFILTERED)
        assert judged([seen], BARE).diagnoses[0].is_structured is is_seen


# Faults that a fit absorbs are named, and their shifts are in the intervals.


def test_noise_of_few_cycles_is_no_hidden_friction() -> None:
    """The scatter of three cycles is hardly known: four settings of them are sure of little."""
    random = np.random.default_rng(1)

    def amount(friction: float) -> float:
        each = []
        for _ in range(4):
            scores = friction + 0.3 * random.normal(size=(3, 3))  # (speeds, cycles)
            variances = 3.0 * np.var(scores, axis=1, ddof=1)
            each.append(
                BySpeed(scores.sum(axis=1), np.full(3, 3.0), variances, 2, np.zeros((3, 1)), 2.0)
            )
        return hidden_friction(each)[1]

    assert sum(amount(0.0) != 0.0 for _ in range(300)) <= 1
    assert amount(5.0) == 0.0  # more than twice the friction is none
    assert np.median([amount(3.5) for _ in range(30)]) == pytest.approx(3.5, rel=0.1)


# No flaw beyond reason, none of valves where nothing flows, none that contradicts another


def hint(name, amount, share=0.9):
    return Hint(name, "", share, amount, f"{name} {amount:g}")


@pytest.mark.parametrize(
    ("names", "largest"),
    [
        ("delay", 25.0),
        ("gas_pressure", 100.0),
        ("gas_exponent", 50.0),
        ("compressibility", 300.0),
        ("offset gas_volume friction_with_speed valve_law_rebound valve_law_bump", 700.0),
        ("r_m3", 1000.0),
    ],
)
def test_an_amount_beyond_reason_is_no_cause(names, largest) -> None:
    for name in names.split():
        for size in (largest, -largest):
            assert _is_reasonable(hint(name, size), half_range := 700.0)
            assert not _is_reasonable(hint(name, 1.001 * size), half_range)


@pytest.mark.parametrize(
    ("amount", "said"),
    [
        (49.0, ""),  # an exponent that a gas may have
        (51.0, "about 1.5 times as stiff"),
        (399.0, "about 5 times as stiff"),
        (401.0, ""),
        (-79.0, "about 0.21 times as stiff"),
        (-81.0, ""),
    ],
)
def test_an_exponent_that_no_gas_has_is_another_gas_spring(amount, said) -> None:
    found = _as_stiffness(hint("gas_exponent", amount))
    assert found.name == ("gas_stiffness" if said else "gas_exponent")
    assert said in found.words
    assert _is_reasonable(found, 700.0) is (bool(said) or abs(amount) < 50.0)
    assert _as_stiffness(hint("gas_volume", amount)).name == "gas_volume"


def yielding(hold, noise=2.0):
    """A log of what slides at 600 N once it has given by 1 mm, over a little of the speed."""
    log = recording(5, noise=noise, duration=6.0)
    v = speed(log)
    x = np.cumsum(v) / 1000.0
    held, state = np.empty(len(x)), 0.0
    for k, step in enumerate(np.diff(x, prepend=x[0])):
        state = float(np.clip(state + step / 1e-3, -1.0, 1.0))
        held[k] = state
    force = 600.0 * (hold * held + (1.0 - hold) * v / 0.3) + log.force.mean()
    return condition(replace(log, force=force))


def test_a_damper_that_yields_is_said_to_and_no_valve_is_blamed() -> None:
    seen = yielding(0.8)
    assert held_share(seen) > 0.6
    (one,) = judged([seen], PLAIN).diagnoses
    assert one.is_structured
    assert one.has_yielded
    assert not {"delay", "compressibility", "gas_pressure"} & {h.name for h in one.hints}
    assert "it yields before it slides" in one.sentence
    # Motion that does not repeat shows it too.
    moving = tuple(replace(part, cycle_starts=np.empty(0)) for part in seen.segments)
    assert held_share(replace(seen, segments=moving)) == held_share(seen)


def test_from_which_share_on_it_yields() -> None:
    below, above = (held_share(yielding(hold, noise=0.0)) for hold in (0.30, 0.37))
    assert YIELDS - 0.08 < below < YIELDS <= above < YIELDS + 0.08
    plain = condition(recording(1, duration=6.0))
    assert held_share(plain) < 0.2


def test_causes_of_one_run_do_not_contradict_each_other() -> None:
    def diagnosis(setting, *hints):
        return Diagnosis(setting, 1.0, 0.1, True, hints, "")

    late, early, valve = hint("delay", 3.0), hint("delay", -2.0), hint("valve_law_bump", 50.0)
    divided = reconciled([diagnosis(1, late), diagnosis(2, late), diagnosis(3, early, valve)])
    assert [one.hints for one in divided] == [(), (), (valve,)]
    assert "its cause was not found" in divided[0].sentence
    assert "explained by valve_law_bump 50" in divided[2].sentence
    most = reconciled([*(diagnosis(k, late) for k in (1, 2, 3)), diagnosis(4, early)])
    assert [one.hints for one in most] == [(late,)] * 3 + [()]
    # One gas spring is not six times as wrong at one setting as at another.
    amounts = 30.0, 70.0, 200.0
    unlike = reconciled([diagnosis(k, hint("gas_volume", a)) for k, a in enumerate(amounts, 1)])
    assert [one.hints for one in unlike] == [()] * 3
    # What each setting may have for itself stands in any sign.
    own = (diagnosis(1, valve), diagnosis(2, hint("valve_law_bump", -50.0)))
    assert reconciled(own) == own
