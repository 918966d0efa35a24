"""Changes of speed as what is predicted."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from damperfit.cli import main
from damperfit.conditioning import condition
from damperfit.recording import Recording, Trace
from damperfit.setting import Setting
from damperfit.simulation import simulate
from damperfit.uncertainty import transients
from tests.laws.valve_logs import DAMPER_TOML, VALUES, damper, log_text, moved


@pytest.fixture(scope="module")
def trace() -> Trace:
    motion = moved((0.06, 0.24))
    force = simulate(damper().values(VALUES), damper(), motion).force
    time = motion.interval * np.arange(len(force))
    log = Recording("a.csv", "a.csv", "", Setting.of(3), time, motion.displacement, force)
    return condition(log)


def test_the_change_of_speed_is_what_lies_between(trace: Trace) -> None:
    found = transients(trace)
    assert found is not None
    first, second = trace.stretches
    (between,) = found.stretches
    assert (between.kind, between.first, between.stop) == ("moving", first.stop, second.first)
    assert between.peak_speed > 0.06
    assert between.amplitude == pytest.approx(0.02, rel=0.05)


@pytest.mark.parametrize(("share", "has_run_up"), [(0.019, True), (0.021, False)])
def test_what_comes_before_counts_where_the_log_begins_at_rest(
    trace: Trace, share: float, *, has_run_up: bool
) -> None:
    fastest = max(one.peak_speed for one in trace.stretches)
    velocity = trace.velocity.copy()
    velocity[:24], velocity[24] = 0.0, share * fastest  # 50 ms
    assert abs(velocity[25]) > 0.1 * fastest
    found = transients(replace(trace, velocity=velocity))
    assert found is not None
    assert (found.stretches[0].first == 0) is has_run_up


@pytest.mark.parametrize(("length", "is_there"), [(0.26, True), (0.24, False)])
def test_a_moment_tells_nothing(trace: Trace, length: float, *, is_there: bool) -> None:
    first, second = trace.stretches
    n = round(length / trace.interval)
    close = replace(trace, stretches=(first, replace(second, first=first.stop + n)))
    assert (transients(close) is not None) is is_there


@pytest.mark.parametrize(("share", "is_there"), [(0.021, True), (0.019, False)])
def test_rest_is_no_motion(trace: Trace, share: float, *, is_there: bool) -> None:
    first, second = trace.stretches
    longest = max(one.amplitude for one in trace.stretches)
    x = trace.displacement.copy()
    n = second.first - first.stop
    x[first.stop : second.first] = np.linspace(0.0, 2.0 * share * longest, n)
    assert (transients(replace(trace, displacement=x)) is not None) is is_there


def test_whole_logs_of_steady_cycles_have_none(trace: Trace) -> None:
    whole = replace(trace.stretches[0], first=0, stop=len(trace.force))
    assert transients(replace(trace, stretches=(whole,))) is None


def test_identify_predicts_them_by_that_word(tmp_path, capsys) -> None:
    (tmp_path / "one.csv").write_text(log_text(damper(), VALUES, moved((0.06, 0.24)), setting=1))
    mounting = '[damper.mounting]\nseries_stiffness = "fit"\nplay = "fit"\nlag = "fit"\n'
    toml = f'{DAMPER_TOML}model = "through_flow"\ngas_volume = "62.83cm3"\ngas_exponent = 1.4\n'
    (tmp_path / "damper.toml").write_text(toml + mounting)
    out = str(tmp_path / "out")
    command = ["identify", str(tmp_path / "one.csv"), "--config", str(tmp_path / "damper.toml"),
               "--hold-out", "transients", "--quiet", "--json", "--out", out]  # fmt: skip
    assert main(command) == 0
    (held,) = json.loads(capsys.readouterr().out)["held_out"]
    assert held["log"] == "one.csv"
    assert held["mse_percent"] < 0.1
    assert held["is_same_motion"] is False


def test_logs_without_any_are_refused(tmp_path, capsys) -> None:
    assert main(["samples", str(tmp_path), "--settings", "10", "--quiet"]) == 0
    log = str(next(tmp_path.glob("*10*.csv")))
    code = main(["identify", log, "--hold-out", "transients", "--out", str(tmp_path / "out")])
    said = capsys.readouterr().err
    assert (code, "no log changes its speed" in said) == (2, True), said
