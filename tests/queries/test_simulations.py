"""Which parameters a simulation takes: also of a setting that no log was of."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import damperfit
from damperfit.cli import main
from damperfit.configuration.loading import load_configuration
from damperfit.damper.purdy.parameters import reference_parameters
from damperfit.damper.quasi_static import quasi_static
from damperfit.errors import ConfigurationError
from damperfit.identification import Status
from damperfit.queries.simulations import (
    ChosenParameters,
    choose_parameters,
    parse_variation,
    run_sweep,
)
from damperfit.results import Run
from damperfit.settings_and_logs import Tested
from damperfit.tables.files import write_table
from tests import fakes
from tests.fakes import make_tables
from tests.identification.adjusted import HIGH, LOW, SETTINGS, at
from tests.test_every_model import TRUTH

BLEED, OPENING = {6: 2e4, 14: 1e4}, {1: 3e6, 3: 4e6}


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_setting_that_was_not_tested_is_put_together(suffix: str, tmp_path: Path) -> None:
    """Three of four settings; in the second a blow-off that no log limits."""
    fits = []
    for one in SETTINGS[:3]:
        known = {"r_m1": BLEED[one.place(LOW)], "r_m2": OPENING[one.place(HIGH)]}
        fit = fakes.fit(1, status={"r_m2": Status.NOT_IDENTIFIABLE} if len(fits) == 1 else {})
        fits.append(replace(fit, setting=one, parameters=fit.parameters.replace(known)))
    path = tmp_path / f"parameters{suffix}"
    write_table(path, make_tables(fakes.campaign(*fits))["parameters"], suffix=suffix)

    def chosen(label: str, **replaced: str) -> ChosenParameters:
        return choose_parameters(setting=label, table=path, replaced=replaced)

    for label in ("low_speed=14, high_speed=3", "LS14 HS3"):
        found = chosen(label)
        assert (found.parameters.r_m1, found.parameters.r_m2) == (1e4, 4e6)
        assert "put together from the clicks of the settings of" in found.source
    assert found.setting == at(14, 3)
    with pytest.raises(ConfigurationError, match="no parameters of setting LS20 HS3; there are"):
        chosen("LS20 HS3")
    # A value that no log limits is named where it acts.
    (said,) = map(str, found.warnings(0.1))
    assert said == (
        "r_m2 at setting LS14 HS3: the logs of the settings that it is put together from set no "
        "upper limit, so these forces may be far off; fit a log of this setting, or replace the "
        "value"
    )
    own = chosen("LS6 HS3")
    faster = chosen("LS6 HS3")
    faster.run.tested = Tested(1, 0.03, 0.1, (0.5, 0.5))
    assert "r_m2: the logs of setting LS6 HS3 set no upper limit" in str(faster.warnings(0.2)[1])
    for quiet in (
        *(chosen("LS14 HS3", r_m2="3e6").warnings(0.1), chosen("LS6 HS1").warnings(0.1)),
        *(own.warnings(9.0), faster.warnings(0.1)),  # nobody knows what was tested
    ):
        assert quiet == ()


def test_a_setting_between_three_tested_ones_has_values_between_theirs(tmp_path: Path) -> None:
    path = tmp_path / "parameters.csv"
    rows = [f"{n},{1e4 * 1.1**n},2e6,3e6,9e8,20" for n in (1, 5, 9)]
    path.write_text("\n".join(["setting,r_m1,r_m2,r_m3,k_e,f_f", *rows]) + "\n")
    between = choose_parameters(setting="3", table=path, replaced={})
    assert between.parameters.r_m1 == pytest.approx(1e4 * 1.1**3, rel=1e-9)
    assert (between.parameters.r_m2, between.setting.cell) == (2e6, 3)
    for beyond in (0, 10):
        with pytest.raises(ConfigurationError, match="there are 1, 5, 9"):
            choose_parameters(setting=beyond, table=path, replaced={})
    path.write_text("\n".join(["setting,r_m1,r_m2,r_m3,k_e,f_f", *rows[:2]]) + "\n")
    with pytest.raises(ConfigurationError, match="three"):
        choose_parameters(setting=3, table=path, replaced={})


EXTRAPOLATED = "the tests were at 20 to 55 degC; beyond that the viscosity is extrapolated"


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ((0.209,), ""),
        ((0.211,), "never tested: 0.211 m/s (tested: up to 0.2 m/s); there the force is extrapola"),
        *(((0.1, warmth), "") for warmth in (19.05, 55.95, None)),
        *(((0.1, warmth), f"{warmth:.3g} degC: {EXTRAPOLATED}") for warmth in (18.95, 56.05)),
        ((0.1, None, 0.031, 1.55), ""),
        ((0.1, None, 0.11, 15.0), "110 mm (tested: up to 30 mm), 15 Hz (tested: 1 to 1.5 Hz)"),
    ],
)
def test_what_lies_beyond_the_tests_is_extrapolated(asked, says) -> None:
    run = Run({})
    run.tested = Tested(1, 0.03, 0.2, (1.0, 1.5), temperatures=(20.0, 55.0))
    one = ChosenParameters(fakes.fit(1).parameters, None, "", run)
    speed, warmth, *motion = (*asked, None)[: max(len(asked), 2)]
    how = dict(zip(("amplitude", "frequency"), motion, strict=False))
    assert [says in str(line) for line in one.warnings(speed, warmth, **how)] == [True] * bool(says)
    assert replace(one, run=None).warnings(speed, warmth) == ()


def test_the_run_tells_at_which_temperatures_it_was(tmp_path: Path) -> None:
    path = tmp_path / "parameters.csv"
    path.write_text("setting,r_m1,r_m2,r_m3,k_e,f_f\n1,1e4,2e6,3e6,9e8,20\n")
    logs = [{"temperature_degC": warmth} for warmth in (21.5, None, 48.0)]
    record = {"configuration": {"damper": {}}, "inputs": logs}
    (tmp_path / "run.json").write_text(json.dumps(record))
    assert choose_parameters(setting=1, table=path, replaced={}).tested.temperatures == (21.5, 48.0)


# One parameter varied: the paper's sensitivities at setting 10 (Figs 4 to 9).


def family(text):
    choice = choose_parameters(10, table=None, replaced={})
    return run_sweep(choice.parameters, load_configuration(), variation=parse_variation(text))


def peaks(kin):
    return kin.figures.peak_force_rebound, -kin.figures.peak_force_bump


@pytest.mark.parametrize("name", ["p_0", "gamma", "amplitude", "frequency"])
def test_rig_and_gas_are_varied_too(name):
    factor = 0.75 if name == "gamma" else 0.5  # 1.4 to 1.05: below 1 is no gas
    low, high = family(f"{name}={factor},1")
    assert high.value == pytest.approx(low.value / factor)
    assert abs(peaks(high)[0] - peaks(low)[0]) > 0.1
    assert high.frequency == low.frequency / (factor if name == "frequency" else 1.0)
    speeds = [one.figures.peak_speed_rebound for one in (low, high)]
    ratio = 2.0 if name in {"amplitude", "frequency"} else 1.0
    assert speeds[1] == pytest.approx(ratio * speeds[0], rel=1e-3)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        *(("r_m9=1,2", "Did you mean"), ("r_m1", "expected NAME=F1,F2")),
        *(("r_m1=a", "'a' is not a number"), ("r_m1=nan", "0 or more"), ("r_m1=-1", "0 or more")),
        *(("r_m1=0,1", "not a damper"), ("r_m1=1,1", "given twice")),
        ("gamma=1,0.5", r"^--vary gamma=0\.5: gas_exponent: expected 1 to"),  # as it was typed
    ],
)
def test_what_cannot_be_varied_is_refused(text, words):
    with pytest.raises(ConfigurationError, match=words):
        family(text)


@pytest.mark.parametrize(
    ("model", "vary", "peak"),
    [
        ("twin_tube", "rebound_opening=0.5,1,2", "rebound"),
        ("monotube", "gas_pressure=1,1.5", "bump"),
        ("bilinear", "amplitude=0.5,1", "rebound"),
    ],
)
def test_every_model_can_be_swept(tmp_path, capsys, model: str, vary: str, peak: str) -> None:
    (tmp_path / "damper.toml").write_text(f'[damper]\nmodel = "{model}"\n')
    values = [part for k, v in TRUTH[model].items() for part in ("--set", f"{k}={v}")]
    how = ("--config", str(tmp_path / "damper.toml"), "--out", str(tmp_path / "out"))
    code = main(["sweep", *values, "--vary", vary, *how, "--quiet", "--json"])
    captured = capsys.readouterr()
    assert code == 0, captured.err
    rows = json.loads(captured.out)["rows"]
    forces = [abs(row[f"peak_force_{peak}_N"]) for row in rows]
    assert forces[0] < forces[-1] == max(forces)


def test_the_interval_of_a_simulated_force_is_that_of_settings(sample_results) -> None:
    """Lack of fit is in it, and beyond the tests what the logs leave open."""
    run = damperfit.load(sample_results / "results")
    for amplitude in ("20mm", "60mm"):
        done = damperfit.simulate(10, parameters=run, amplitude=amplitude, frequency="1.5Hz")
        peak = done.characteristics.peak_speed_rebound
        rows = damperfit.settings(run, velocity=peak).document()["forces"]
        (own,) = (r for r in rows if r["setting"] == 10 and r["stroke"] == "rebound")
        low, force, high = (own[f"force{end}_N"] for end in ("_ci_low", "", "_ci_high"))
        half = max(high - force, force - low)
        assert done.document()["half_interval_N"]["rebound"] == pytest.approx(half, rel=1e-3)
    assert "warning: never tested" in repr(done)  # as the command says
    assert "sample_rate=" in repr(damperfit.simulate(10, parameters=run, sample_rate=100))


def test_a_setting_between_tested_ones_has_an_interval_that_holds_the_truth() -> None:
    run = damperfit.identify([f"sample_runs/setting_{n:02d}.csv" for n in (1, 5, 10)])
    done = damperfit.simulate(7, parameters=run)
    speeds = [done.characteristics.peak_speed_rebound, -done.characteristics.peak_speed_bump]
    truth, force = (
        quasi_static(run.damper, values, speeds).forces
        for values in (reference_parameters(7), done.choice.parameters)
    )
    assert np.all(np.abs(truth - force) < done.half_intervals)
    for tested in (5, 10):
        at_tested = damperfit.simulate(tested, parameters=run).half_intervals
        assert np.all(np.array(at_tested) < 1.01 * np.array(done.half_intervals))


def test_a_lone_table_is_of_the_damper_that_is_declared(tmp_path) -> None:
    (path := tmp_path / "mine.csv").write_text("setting,c_r,c_b,f_0\n3,2000,1500,0\n")
    done = damperfit.simulate(3, parameters=path, damper={"model": "bilinear"})
    assert done.choice.parameters["c_r"] == 2000.0
    with pytest.raises(ConfigurationError, match="give config="):
        damperfit.simulate(3, parameters=path)


def test_a_log_of_time_and_displacement_alone_drives_as_the_whole_log_does(tmp_path) -> None:
    log, motion = Path(__file__).parents[2] / "sample_runs" / "setting_10.csv", tmp_path / "x.csv"
    rows = (line.split(",")[:2] for line in log.read_text().splitlines() if line[0] != "#")
    motion.write_text("\n".join(map(",".join, rows)))
    whole, lone = (damperfit.simulate(10, displacement=path) for path in (log, motion))
    assert lone.force == pytest.approx(whole.force, abs=1e-3)
