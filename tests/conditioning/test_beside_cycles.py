"""Run-up, coast-down and changes of speed as what is predicted."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from damperfit.cli import main
from damperfit.conditioning import condition, transients
from damperfit.damper.model import MODELS
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions, compare, identify, normalised_mse
from damperfit.recording import Recording, Trace
from damperfit.simulation import Motion, simulate
from damperfit.tested.setting import Setting
from damperfit.uncertainty import assess, predict, prediction
from tests.laws.valve_logs import VALUES, damper, log_text, moved

RATE = 1000.0


def conditioned(x: np.ndarray, *, noise: float = 0.0) -> Trace:
    """A displacement on the paper's damper at setting 10, as a trace; noise 1: 4 N and 8 um."""
    motion = Motion(1.0 / RATE, x, np.gradient(x, 1.0 / RATE))
    force = simulate(reference_parameters(10), PURDY_DAMPER, motion).force
    chance = np.random.default_rng(3)
    x = x + noise * chance.normal(0.0, 8e-6, len(x))
    force = force + noise * chance.normal(0.0, 4.0, len(x))
    time = np.arange(len(x)) / RATE
    return condition(Recording("a.csv", "a.csv", "", Setting.of(10), time, x, force))


def run_up(
    seconds: float, *, rest: float = 0.6, cycles: float = 6.0, start: float = 0.0
) -> np.ndarray:
    """Rest, a motor that runs up to 1.5 Hz and 32 mm, cycles, down again, rest."""
    ramp = np.linspace(0.0, 1.5, round(seconds * RATE))
    still = np.zeros(round(rest * RATE))
    steady = np.full(round(cycles / 1.5 * RATE), 1.5)
    speed = np.concatenate([still, ramp, steady, ramp[::-1], still])
    return 0.032 * np.sin(start + 2.0 * np.pi * np.cumsum(speed) / RATE)


@pytest.fixture(scope="module")
def trace() -> Trace:
    """Two speeds; all that was logged, nothing of it cut."""
    motion = moved((0.06, 0.24))
    force = simulate(damper().values(VALUES), damper(), motion).force
    time = motion.interval * np.arange(len(force))
    log = Recording("a.csv", "a.csv", "", Setting.of(3), time, motion.displacement, force)
    whole = condition(log).whole
    assert whole is not None
    return whole


def test_the_change_of_speed_is_what_lies_between(trace: Trace) -> None:
    found = transients(trace)
    assert found is not None
    first, second = trace.stretches
    up, between, down = found.stretches
    assert up.stop <= first.first
    assert second.stop <= down.first
    assert between.kind == "moving"
    assert first.stop <= between.first < between.stop <= second.first
    # Half a second of sweep, and what of the slow motion no whole cycle holds.
    assert between.n_samples * trace.interval == pytest.approx(0.5, abs=0.4)
    assert between.peak_speed > 0.06
    assert between.amplitude == pytest.approx(0.02, rel=0.05)


def test_run_up_and_coast_down_pass_through_conditioning() -> None:
    cut = conditioned(run_up(1.5))
    found = transients(cut)
    assert found is not None
    assert cut.whole is not None
    up, down = found.stretches
    # Rest is none of it, nor is the first steady cycle or what the filter reaches.
    assert up.first == pytest.approx(600, abs=200)
    assert up.stop == pytest.approx(2100, abs=400)
    assert down.first == pytest.approx(6100, abs=400)
    assert down.stop == pytest.approx(7600, abs=300)
    # What is fitted is what it was: a cycle of run-in, and no more.
    assert len(cut.force) < 0.7 * len(found.force)
    (own,), (same,) = cut.stretches, cut.whole.stretches
    shift = same.first - own.first
    assert np.array_equal(cut.force, cut.whole.force[shift : shift + len(cut.force)])
    assert cut.whole.start_time + shift / RATE == pytest.approx(cut.start_time)


@pytest.mark.parametrize("setting", [10])
@pytest.mark.parametrize("start", [0.0, -1.5])
def test_the_true_model_predicts_them(setting: int, start: float) -> None:
    cut = conditioned(run_up(1.5, start=start))
    found = transients(cut)
    assert found is not None
    force = compare(reference_parameters(setting), found, PURDY_DAMPER).force[found.compared]
    assert normalised_mse(found.force[found.compared], force) < 1e-4


def test_a_log_that_begins_in_motion_has_no_run_up() -> None:
    x = run_up(1.5)[1300:]
    found = transients(conditioned(x))
    assert found is not None
    (down,) = found.stretches
    assert down.first > 4000


@pytest.mark.parametrize("rest", [0.6, 0.05])
def test_steady_cycles_that_begin_and_end_at_once_are_no_test(rest: float) -> None:
    still = np.zeros(round(rest * RATE))
    x = 0.032 * np.sin(2.0 * np.pi * 1.5 * np.arange(round(6.0 / 1.5 * RATE)) / RATE)
    cut = conditioned(np.concatenate([still, x, still]))
    assert transients(cut) is None
    assert cut.whole is None


@pytest.mark.parametrize(("share", "is_there"), [(0.947, True), (0.953, False)])
def test_cycles_of_the_same_stroke_and_speed_are_no_test(share: float, *, is_there: bool) -> None:
    whole = conditioned(run_up(1.5, cycles=9.0)).whole
    assert whole is not None
    (one,) = whole.stretches
    # The last three cycles are not compared, and as fast and long as a share of the others.
    less = replace(one, stop=round(one.cycle_starts[3]), cycle_starts=one.cycle_starts[:4],
                   amplitude=one.amplitude / share, peak_speed=one.peak_speed / share)  # fmt: skip
    found = transients(replace(whole, stretches=(less,)))
    assert found is not None
    has = any(part.first < one.stop - 500 < part.stop for part in found.stretches)
    assert has is is_there


@pytest.mark.parametrize(("pause", "parts"), [(0.44, 2), (0.50, 3)])
def test_a_rest_in_the_coast_down_is_left_out(pause: float, parts: int) -> None:
    x = run_up(1.5, start=-np.pi / 2.0)
    at = 6800 + int(np.argmin(np.abs(np.gradient(x)[6800:7200])))  # at a turn
    x = np.concatenate([x[:at], np.full(round(pause * RATE), x[at]), x[at:]])
    whole = conditioned(x)
    found = transients(whole)
    assert found is not None
    assert len(found.stretches) == parts


@pytest.mark.parametrize(("share", "has_run_up"), [(0.019, True), (0.021, False)])
def test_what_comes_before_counts_where_the_log_begins_at_rest(
    trace: Trace, share: float, *, has_run_up: bool
) -> None:
    fastest = max(one.peak_speed for one in trace.stretches)
    velocity = trace.velocity.copy()
    velocity[:24], velocity[24] = 0.0, share * fastest  # 50 ms
    velocity[25] = fastest
    found = transients(replace(trace, velocity=velocity))
    assert found is not None
    assert (found.stretches[0].stop <= trace.stretches[0].first) is has_run_up


@pytest.mark.parametrize(("length", "is_there"), [(0.26, True), (0.24, False)])
def test_a_moment_tells_nothing(trace: Trace, length: float, *, is_there: bool) -> None:
    found = transients(trace)
    assert found is not None
    between = found.stretches[1]
    first, second = trace.stretches
    n = round(length / trace.interval)
    begin = (between.first + between.stop - n) // 2
    close = (replace(first, stop=begin), replace(second, first=begin + n))
    found = transients(replace(trace, stretches=close))
    assert found is not None
    assert any(first.stop < one.first < second.first for one in found.stretches) is is_there


@pytest.mark.parametrize(("share", "is_there"), [(0.021, True), (0.019, False)])
def test_rest_is_no_motion(trace: Trace, share: float, *, is_there: bool) -> None:
    """What moves between the speeds by less than a fiftieth of the longest stroke."""
    first, second = trace.stretches
    between = slice(first.stop, second.first)
    longest = max(one.amplitude for one in trace.stretches)
    x = trace.displacement.copy()
    # Beyond the other strokes, so that no passage there is like a steady one.
    x[between] = 0.03 + np.linspace(0.0, 2.0 * share * longest, between.stop - between.start)
    found = transients(replace(trace, displacement=x))
    assert found is not None
    within = [one for one in found.stretches if first.stop <= one.first < second.first]
    assert bool(within) is is_there


def test_whole_logs_of_steady_cycles_have_none(trace: Trace) -> None:
    whole = replace(trace.stretches[0], first=0, stop=len(trace.force))
    assert transients(replace(trace, stretches=(whole,))) is None


def test_a_fit_predicts_them_as_well_as_it_fits() -> None:
    cut = conditioned(run_up(1.5, cycles=8.0), noise=1.0)
    found = transients(cut)
    assert found is not None
    campaign = identify((cut,), PURDY_DAMPER, FitOptions(procedure="plain"))
    assessment = assess(campaign, PURDY_DAMPER)
    (told,) = predict(campaign, assessment, (found,), damper=PURDY_DAMPER)
    assert told.verdict == "predicted as well as fitted"
    weaker = np.var(cut.force[cut.compared]) / np.var(found.force[found.compared])
    assert told.mse_percent < 2.0 * weaker * told.fitted_mse_percent
    assert (told.cycles, told.is_part, told.is_same_motion) == ("transients", True, False)


def test_a_law_that_fits_is_found_out_by_them() -> None:
    """One speed bends a straight line to its valves; the run-up has others."""
    cut = conditioned(run_up(1.5, cycles=8.0), noise=1.0)
    found = transients(cut)
    assert found is not None
    model = MODELS["bilinear"]()
    campaign = identify((cut,), model, FitOptions(procedure="plain", free=model.names))
    (told,) = predict(campaign, assess(campaign, model), (found,), damper=model)
    assert told.mse_percent > told.fitted_mse_percent


@pytest.mark.parametrize(("percent", "is_failed"), [(0.099, False), (0.101, True)])
def test_what_is_below_use_is_no_failure(
    percent: float, monkeypatch: pytest.MonkeyPatch, *, is_failed: bool
) -> None:
    cut = conditioned(run_up(1.5, cycles=8.0))
    found = transients(cut)
    assert found is not None
    campaign = identify((cut,), PURDY_DAMPER, FitOptions(procedure="plain"))
    monkeypatch.setattr(prediction, "normalised_mse", lambda *_: percent)
    monkeypatch.setattr(prediction, "_SMALL", 0.0)  # of the fitted forces: another limit
    (told,) = predict(campaign, assess(campaign, PURDY_DAMPER), (found,), damper=PURDY_DAMPER)
    assert told.is_failed is is_failed


@pytest.mark.parametrize("asked", [["--hold-out", "transients"], []])
def test_identify_predicts_them_by_that_word_and_by_itself(tmp_path, capsys, asked) -> None:
    x = run_up(1.5, cycles=5.0)
    motion = Motion(1.0 / RATE, x, np.gradient(x, 1.0 / RATE))
    values = asdict(reference_parameters(10))
    (tmp_path / "one.csv").write_text(log_text(PURDY_DAMPER, values, motion, setting=10))
    out = str(tmp_path / "out")
    command = ["identify", str(tmp_path / "one.csv"), *asked, "--quiet", "--json", "--out", out]
    assert main(command) == 0
    (held,) = json.loads(capsys.readouterr().out)["held_out"]
    assert held["log"] == "one.csv"
    assert held["mse_percent"] < 0.01
    assert held["is_same_motion"] is False
    assert held["cycles"] == "transients"
    assert "| transients |" in (tmp_path / "out" / "report.md").read_text()
    assert main(["report", out, "--quiet"]) == 0


def test_logs_without_any_are_refused(tmp_path, capsys) -> None:
    assert main(["samples", str(tmp_path), "--settings", "10", "--quiet"]) == 0
    log = str(next(tmp_path.glob("*10*.csv")))
    code = main(["identify", log, "--hold-out", "transients", "--out", str(tmp_path / "out")])
    said = capsys.readouterr().err
    assert (code, "no log has a run-up" in said) == (2, True), said
