"""Logs of several temperatures: what temperature does is found, or it is said why not."""

import json
from dataclasses import asdict, replace
from functools import cache

import numpy as np
import pytest

import damperfit
from damperfit.arguments import configured
from damperfit.conditioning import ConditionOptions, condition
from damperfit.conditioning.duplicates import are_unlike
from damperfit.configuration.loading import load_configuration
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.damper.temperature_law import BETA as QUANTITY
from damperfit.damper.temperature_law import WithTemperature
from damperfit.errors import ConfigurationError
from damperfit.exporting import exported_run
from damperfit.identification import FitOptions, Outcome, Status, identify
from damperfit.identification.fit_setting import NOT_FIT_TO_SHARE, is_loose
from damperfit.queries.simulations import (
    choose_parameters,
    damper_of,
    simulated,
)
from damperfit.recording import Recording
from damperfit.results import Run, with_temperature
from damperfit.run.identify import identified, written
from damperfit.run.parting import check_temperatures, with_reference, without_contradictions
from damperfit.simulation import Motion, SolverOptions, simulate
from damperfit.tested.setting import Setting
from damperfit.uncertainty import assess, reconsider
from tests.run.test_same_setting import batch

BETA, COLD, WARM = 0.012, 26.0, 60.0
TRUTH = WithTemperature(PURDY_DAMPER, COLD)
ROUGH = SolverOptions(tolerance=1e-2)
JOINT = FitOptions("joint", share=("r_m3", "f_f", "beta"))
RATE = 500.0


def recording(setting: int, temperature: float) -> Recording:
    """Six cycles of the standard test with 4 N of noise."""
    own = asdict(reference_parameters(setting))
    t = np.arange(-400, round(6.2 / 1.5 * RATE)) / RATE
    angle = 2.0 * np.pi * 1.5 * t + 0.4
    x, v = 0.032 * np.sin(angle), 0.032 * 2.0 * np.pi * 1.5 * np.cos(angle)
    motion = Motion(1.0 / RATE, x, v, temperature=temperature)
    force = simulate(TRUTH.values({**own, "beta": BETA}), TRUTH, motion, options=ROUGH).force
    force = force + np.random.default_rng([7, setting, round(temperature)]).normal(0.0, 4.0, len(t))
    part = t >= 0.0
    return Recording(
        name=f"setting_{setting:02d}_{temperature:g}C.csv",
        path="",
        sha256="",
        setting=Setting.of(setting),
        time=t[part],
        displacement=x[part],
        force=force[part],
        temperature=np.full(int(part.sum()), temperature),
    )


@cache
def log(setting: int, temperature: float):
    return condition(recording(setting, temperature), ConditionOptions())


def known_at(setting: int, temperature: float):
    """The true values at a temperature."""
    own = asdict(reference_parameters(setting))
    return TRUTH.at_reference(TRUTH.values({**own, "beta": BETA}), temperature)


def logs(*temperatures: float, settings=(1, 10)):
    return [log(setting, one) for setting in settings for one in temperatures]


@pytest.fixture(scope="module")
def temperature_law():
    model = WithTemperature(PURDY_DAMPER, 43.0)
    campaign = identify(logs(COLD, WARM), model, JOINT)
    return model, campaign, assess(campaign, model)


def test_what_temperature_does_is_found_within_its_interval(temperature_law) -> None:
    _, campaign, judged = temperature_law
    assert campaign.sharing.jointly == ("r_m3", "f_f", "beta")
    for fit, known in zip(campaign.fits, judged.uncertainties, strict=True):
        assert fit.outcome is Outcome.CONVERGED
        assert fit.status["beta"] is Status.SHARED
        interval = known.intervals["beta"]
        assert interval.low < BETA < interval.high
        assert interval.error < 0.02 * BETA
        true = known_at(int(fit.setting.cell), 43.0)
        for name in ("r_m1", "r_m2", "r_m3", "k_e"):
            found = known.intervals[name]
            assert abs(getattr(fit.parameters, name) - getattr(true, name)) < 4.0 * found.error


def asked_for(*texts: str):
    return load_configuration(overlay={"damper": {"reference_temperature": texts[0]}})


def test_the_reference_is_the_mean_of_the_logs_unless_it_is_said() -> None:
    traces = logs(COLD, WARM, settings=(1,))
    mean = with_reference(asked_for("mean"), traces)
    assert mean.damper.reference == 43.0
    assert mean.document["damper"]["reference_temperature"] == 43.0
    said = with_reference(asked_for("300K"), traces)
    assert said.damper.reference == pytest.approx(26.85)
    plain = load_configuration()
    assert with_reference(plain, traces) is plain
    assert mean.identification.procedure == "joint"
    assert mean.identification.share == ("r_m3", "f_f", "beta")


@pytest.mark.parametrize(("reach", "is_refused"), [(2.9, True), (3.1, False)])
def test_less_than_three_kelvin_determine_nothing(reach: float, *, is_refused: bool) -> None:
    one = log(1, COLD)
    traces = [one, replace(one, temperature=COLD + reach)]
    if not is_refused:
        assert with_reference(asked_for("mean"), traces).damper.reference == pytest.approx(27.6)
        return
    with pytest.raises(ConfigurationError, match=r"of 26.0 to 28.9 degC; .* over less than 3 K"):
        with_reference(asked_for("mean"), traces)


def test_a_log_without_a_temperature_is_named() -> None:
    traces = [log(1, COLD), *(replace(log(s, WARM), temperature=None) for s in (1, 10))]
    says = r"setting_01_60C.csv and 1 more have no temperature; expected a channel, a line '# temp"
    with pytest.raises(ConfigurationError, match=says):
        check_temperatures(asked_for("mean"), traces)


@pytest.mark.parametrize(
    ("damper", "fit", "says"),
    [
        ({"reference_temperature": "warm"}, {}, "expected 'none', 'mean' or a temperature, as in"),
        ({"reference_temperature": 200.5}, {}, "expected -60 to 200 degC"),
        ({"reference_temperature": -60.5}, {}, "expected -60 to 200 degC"),
        (
            {"reference_temperature": "mean"},
            {"procedure": "paper"},
            "procedure paper cannot fit the model 'purdy'; expected one of joint, plain",
        ),
        ({"model": "bouc_wen", "reference_temperature": "mean"}, {}, "nothing of the model"),
    ],
)
def test_what_cannot_be_is_refused(damper, fit, says) -> None:
    with pytest.raises(ConfigurationError, match=says):
        load_configuration(overlay={"damper": damper, "identification": fit})
    edges = [
        load_configuration(overlay={"damper": {"reference_temperature": t}}) for t in (-60, 200)
    ]
    assert [one.damper.reference for one in edges] == [-60.0, 200.0]


@pytest.mark.parametrize(("apart", "unlike"), [(0.48, False), (0.52, True)])
def test_logs_half_a_kelvin_apart_need_not_be_alike(apart: float, *, unlike: bool) -> None:
    one, other = log(1, COLD), log(1, WARM)
    near = replace(other, temperature=COLD + apart)
    assert are_unlike(one, near) is unlike
    assert not are_unlike(one, replace(other, temperature=None))
    left = batch(one, near)
    without_contradictions(left, asked_for("mean"), is_law_open=True)
    assert len(left.traces) == (2 if unlike else 0)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("warm")
    for setting in (1, 10):
        for temperature in (COLD, WARM):
            one = recording(setting, temperature)
            rows = zip(one.time, 1e3 * one.displacement, one.force, strict=True)
            lines = [
                "# damperfit rig log",
                f"# setting: {setting}",
                f"# temperature: {temperature}",
            ]
            lines.append("time_s,displacement_mm,force_N")
            lines += [f"{t:.4f},{x:.5f},{f:.3f}" for t, x, f in rows]
            (folder / one.name).write_text("\n".join([*lines, ""]), encoding="utf-8")
    out = folder / "results"
    configuration = configured(
        "identify", {"out": out}, ("covariate", "damper.reference_temperature", "mean")
    )
    (found,) = written(configuration, [str(folder / "*.csv")], jobs=1)
    assert found.run.settings
    return out


def test_a_run_tells_beta_and_the_temperature_of_its_resistances(results) -> None:
    record = json.loads((results / "run.json").read_text(encoding="utf-8"))
    assert record["configuration"]["damper"]["reference_temperature"] == 43.0
    assert [one["name"] for one in record["quantities"]][-1] == "beta"
    assert "r_m2 and r_m3 are those at 43 degC" in record["procedure"][0]
    report = (results / "report.md").read_text(encoding="utf-8")
    assert "beta" in report
    assert "those at 43 degC" in report


def test_results_are_asked_for_at_another_temperature(results) -> None:
    there = damperfit.settings(results, temperature="60degC")
    assert there.source.endswith(" and 60 degC")
    assert damperfit.settings(results).source.endswith(" and 43 degC")
    run = Run.load(results, temperature="60degC")
    motion = Motion(1e-3, *wave())
    found = simulate(run.settings[0].values, run.damper, motion).force
    true = simulate(known_at(1, WARM), PURDY_DAMPER, motion).force
    assert float(np.max(np.abs(found - true))) < 0.01 * float(np.ptp(true))
    done = damperfit.simulate(1, parameters=results, temperature="60degC")
    peak = done.characteristics.peak_speed_rebound
    row = damperfit.settings(results, temperature="60degC", velocity=peak).document()["forces"][0]
    half = 0.5 * (row["force_ci_high_N"] - row["force_ci_low_N"])
    assert done.document()["half_interval_N"]["rebound"] == pytest.approx(half, rel=1e-2)
    with pytest.raises(ConfigurationError, match="hot"):
        damperfit.settings(results, temperature="hot")


def wave():
    angle = 2.0 * np.pi * 1.5 * np.arange(1000) * 1e-3
    return 0.032 * np.sin(angle), 0.032 * 2.0 * np.pi * 1.5 * np.cos(angle)


@pytest.mark.parametrize(("asked", "there"), [(None, 43.0), ("26degC", 26.0)])
def test_other_programs_get_it_at_one_temperature(results, asked, there: float) -> None:
    handed = exported_run(results, temperature=asked)
    assert handed.damper == PURDY_DAMPER
    for one in handed.settings:
        true = known_at(int(one.setting.cell), there)
        assert one.values.names == true.names
        for name in ("r_m2", "r_m3"):
            assert getattr(one.values, name) == pytest.approx(getattr(true, name), rel=0.01)
    assert f"resistances as they are at {there:g} degC (fitted at 43 degC)" in handed.notes
    assert handed.run.remarks == ()  # nothing is missing: export ends with code 0


def test_logs_without_a_temperature_do_not_contradict_each_other(tmp_path, results) -> None:
    """It said that cold and warm logs contradict each other, and to leave one out."""
    for path in results.parent.glob("setting_01_*.csv"):
        text = path.read_text(encoding="utf-8").splitlines(keepends=True)
        kept = [line for line in text if not line.startswith("# temperature")]
        (tmp_path / path.name).write_text("".join(kept), encoding="utf-8")
    configuration = configured(
        "identify", {"out": tmp_path / "out"}, ("covariate", "damper.reference_temperature", "mean")
    )
    with pytest.raises(ConfigurationError, match="and 1 more have no temperature"):
        next(identified(configuration, [str(tmp_path / "setting_01_*.csv")], jobs=1))


def test_a_log_drives_it_at_its_own_temperature_unless_another_is_asked(results) -> None:
    path = results.parent / recording(1, COLD).name
    choice = choose_parameters(1, table=results, replaced={})
    plain, _ = damper_of(choice, load_configuration())
    peak = {
        asked: simulated(choice.parameters, with_temperature(plain, asked), log=path)[
            -1
        ].peak_force_rebound
        for asked in (None, "26degC", "60degC")
    }
    assert peak[None] == peak["26degC"]
    assert peak["60degC"] < 0.95 * peak[None]


def warmed_run(**identification):
    configuration = load_configuration(
        overlay={"damper": {"reference_temperature": "mean"}, "identification": identification}
    )
    return lambda *traces: with_reference(configuration, traces)


@pytest.mark.parametrize(("reach", "is_refused"), [(2.9, True), (3.1, False)])
def test_settings_fitted_alone_must_each_be_tested_cold_and_warm(
    reach: float, *, is_refused: bool
) -> None:
    free = ["r_m1", "r_m2", "r_m3", "k_e", "f_f", "beta"]
    check = warmed_run(procedure="plain", free=free)
    one = log(10, COLD)
    near = replace(one, temperature=COLD + reach)
    if not is_refused:
        assert check(log(1, COLD), log(1, WARM), one, near).damper.reference > COLD
        return
    with pytest.raises(ConfigurationError, match="setting 10 was tested within 3 K, and procedure"):
        check(log(1, COLD), log(1, WARM), one, near)


def test_settings_of_one_temperature_each_must_share_something_viscous() -> None:
    own = warmed_run(procedure="joint", free=["r_m1", "r_m2", "r_m3", "k_e", "f_f"], share=["beta"])
    with pytest.raises(ConfigurationError, match="r_m2 and r_m3 are each setting's own"):
        own(log(1, COLD), log(10, WARM))
    assert own(log(1, COLD), log(1, WARM), log(10, WARM)).damper.reference > COLD
    held = warmed_run(
        procedure="joint", free=["r_m1", "r_m2", "k_e", "f_f"], share=["beta"], fix={"r_m3": 2.6e6}
    )
    assert held(log(1, COLD), log(10, WARM)).damper.reference == 43.0
    given = warmed_run(procedure="plain", free=["r_m1", "r_m2", "k_e"], fix={"beta": 0.012})
    assert given(log(1, COLD), log(10, WARM)).damper.reference == 43.0


def test_a_beta_that_no_log_tells_is_called_so_and_so_is_what_hangs_on_it() -> None:
    model = WithTemperature(PURDY_DAMPER, 43.0)
    own = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
    campaign = identify(
        [log(1, COLD), log(10, WARM)], model, FitOptions("joint", free=own, share=("beta",))
    )
    judged = assess(campaign, model)
    told = reconsider(campaign, judged)
    for fit in told.fits:
        for name in ("beta", "r_m2", "r_m3"):
            assert fit.status[name] is Status.NOT_IDENTIFIABLE, name
        for name in ("r_m1", "k_e", "f_f"):
            assert fit.status[name] is Status.FITTED, name
        assert judged.plausible_limits(fit, "beta") == (None, None)
        assert fit.outcome is Outcome.NOT_IDENTIFIABLE
    said = judged.verdicts(told)[Setting.of(1)]
    assert said["beta"].startswith("these logs do not determine it (no value of its plausible")


@pytest.mark.parametrize(
    ("value", "error", "is_lost"),
    [
        (0.0, 0.32, False),  # in hundredths a kelvin: nothing at all is an answer too
        (0.0, 0.34, True),
        (0.03, 0.99, False),
        (0.03, 1.01, True),
    ],
)
def test_beta_is_lost_by_its_error_beside_what_oils_have(value, error, *, is_lost: bool) -> None:
    assert is_loose(QUANTITY, value, error, NOT_FIT_TO_SHARE) is is_lost
    offset = PURDY_DAMPER.quantity("f_0")
    assert not is_loose(offset, value, 10.0 * error, NOT_FIT_TO_SHARE)
