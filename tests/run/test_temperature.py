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
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.damper.temperature_law import BETA as QUANTITY
from damperfit.damper.temperature_law import WithTemperature
from damperfit.errors import ConfigurationError
from damperfit.exporting.targets import exported_run
from damperfit.identification import FitOptions, Outcome, Status, identify
from damperfit.identification.fit_setting import NOT_FIT_TO_SHARE, is_loose
from damperfit.io.tests_table import facts_in
from damperfit.queries.simulations import choose_parameters, damper_of, simulated
from damperfit.recording import Recording
from damperfit.results import Run, with_temperature
from damperfit.run.identify import identified, written
from damperfit.run.preparation import check_temperatures, with_reference, without_contradictions
from damperfit.simulation import Motion, SolverOptions, simulate
from damperfit.tested.setting import Setting
from damperfit.uncertainty import assess, reconsider
from tests.fakes import log_text
from tests.run.test_same_setting import batch

BETA, COLD, WARM = 0.012, 26.0, 60.0
TRUTH = WithTemperature(PURDY_DAMPER, COLD)
ROUGH = SolverOptions(tolerance=1e-2)
RATE = 500.0
OWN = ["r_m1", "r_m2", "r_m3", "k_e", "f_f"]
COVARIATE = ("covariate", "damper.reference_temperature", "mean")


def recording(setting: int, temperature: float) -> Recording:
    """Six cycles of the standard test with 4 N of noise."""
    own = asdict(reference_parameters(setting))
    t = np.arange(-400, round(6.2 / 1.5 * RATE)) / RATE
    angle = 2.0 * np.pi * 1.5 * t + 0.4
    x, v = 0.032 * np.sin(angle), 0.032 * 2.0 * np.pi * 1.5 * np.cos(angle)
    motion = Motion(1.0 / RATE, x, v, temperature=temperature)
    force = simulate(TRUTH.values({**own, "beta": BETA}), TRUTH, motion, options=ROUGH).force
    force = force + np.random.default_rng([7, setting, round(temperature)]).normal(0.0, 4.0, len(t))
    name, part = f"setting_{setting:02d}_{temperature:g}C.csv", t >= 0.0
    warmth = np.full(int(part.sum()), temperature)
    channels = {"time": t[part], "displacement": x[part], "force": force[part]}
    return Recording(name, "", "", Setting.of(setting), **channels, temperature=warmth)


@cache
def log(setting: int, temperature: float):
    return condition(recording(setting, temperature), ConditionOptions())


def known_at(setting: int, temperature: float):
    """The true values at a temperature."""
    own = asdict(reference_parameters(setting))
    return TRUTH.at_reference(TRUTH.values({**own, "beta": BETA}), temperature)


def asked_for(text: str, model: str = "purdy", **identification):
    damper = {"damper": {"reference_temperature": text, "model": model}}
    return load_configuration(overlay=damper | {"identification": identification})


def test_the_reference_is_the_mean_of_the_logs_unless_it_is_said() -> None:
    traces = [log(1, COLD), log(1, WARM)]
    mean = with_reference(asked_for("mean"), traces)
    assert mean.damper.reference == mean.document["damper"]["reference_temperature"] == 43.0
    assert with_reference(asked_for("300K"), traces).damper.reference == pytest.approx(26.85)
    plain = load_configuration()
    assert with_reference(plain, traces) is plain
    fitted = mean.identification
    assert (fitted.procedure, fitted.share) == ("joint", ("r_m3", "f_f", "beta"))


FREE = {"procedure": "plain", "free": [*OWN, "beta"]}
SHARED = {"procedure": "joint", "free": OWN, "share": ["beta"]}
HELD = SHARED | {"free": ["r_m1", "r_m2", "k_e", "f_f"], "fix": {"r_m3": 2.6e6}}
GIVEN = {"procedure": "plain", "free": ["r_m1", "r_m2", "k_e"], "fix": {"beta": 0.012}}
BOTH, VALVES = ((1, COLD), (1, WARM)), {"model": "through_flow"}
BY_TWO = [Setting((("compression", 2), ("rebound", place))) for place in (1, 3)]


@pytest.mark.parametrize(
    ("how", "logs", "says"),
    [
        ({}, ((1, COLD), (1, COLD + 2.9)), r"of 26.0 to 28.9 degC; .* over less than 3 K"),
        ({}, ((1, COLD), (1, COLD + 3.1)), ""),
        # Settings fitted alone must each be tested cold and warm.
        (FREE, (*BOTH, (10, COLD), (10, COLD + 2.9)), "setting 10 was tested within 3 K, and proc"),
        (FREE, (*BOTH, (10, COLD), (10, COLD + 3.1)), ""),
        # Settings of one temperature each must share something viscous.
        (SHARED, ((1, COLD), (10, WARM)), "r_m2 and r_m3 are each setting's own"),
        (SHARED, (*BOTH, (10, WARM)), ""),
        (HELD, ((1, COLD), (10, WARM)), ""),
        (GIVEN, ((1, COLD), (10, WARM)), ""),
        # Valves are their own to clicks of one adjuster, not to those of several.
        (VALVES, ((1, COLD), (10, WARM)), "rebound_slope and compression_slope"),
        (VALVES, ((BY_TWO[0], COLD), (BY_TWO[1], WARM)), ""),
    ],
)
def test_logs_that_do_not_tell_what_temperature_does_are_refused(how, logs, says) -> None:
    settings = [(Setting.of(label), warmth) for label, warmth in logs]
    traces = [replace(log(1, COLD), setting=s, temperature=warmth) for s, warmth in settings]
    if not says:
        assert with_reference(asked_for("mean", **how), traces).damper.reference > COLD
        return
    with pytest.raises(ConfigurationError, match=says):
        with_reference(asked_for("mean", **how), traces)
    untold = [traces[0], *(replace(one, temperature=None) for one in traces[1:])]
    says = rf"{traces[1].name}.* (has|have) no temperature; expected a channel, a line '# temp"
    with pytest.raises(ConfigurationError, match=says):
        check_temperatures(asked_for("mean"), untold)


@pytest.mark.parametrize(
    ("damper", "fit", "says"),
    [
        ({"reference_temperature": "warm"}, {}, "expected 'none', 'mean' or a temperature, as in"),
        *(
            ({"reference_temperature": edge}, {}, "expected -60 to 200 degC")
            for edge in (200.5, -60.5)
        ),
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
    assert [asked_for(t).damper.reference for t in (-60, 200)] == [-60.0, 200.0]


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
            facts = f"setting: {setting}", f"temperature: {temperature}"
            text = log_text(one.time, one.displacement, one.force, *facts)
            (folder / one.name).write_text(text, encoding="utf-8")
    out = folder / "results"
    configuration = configured("identify", {"out": out}, COVARIATE)
    (found,) = written(configuration, [str(folder / "*.csv")], jobs=1)
    assert found.run.settings
    return out


def test_results_are_told_and_asked_for_at_a_temperature(results) -> None:
    record = json.loads((results / "run.json").read_text(encoding="utf-8"))
    assert record["configuration"]["damper"]["reference_temperature"] == 43.0
    assert [one["name"] for one in record["quantities"]][-1] == "beta"
    assert "r_m2 and r_m3 are those at 43 degC" in record["procedure"][0]
    assert "those at 43 degC" in (results / "report.md").read_text(encoding="utf-8")
    for asked, there in ((None, 43), ("60degC", 60)):
        found = damperfit.settings(results, temperature=asked)
        assert found.source.endswith(f" and {there} degC")
    run = Run.load(results, temperature="60degC")
    angle = 2.0 * np.pi * 1.5 * np.arange(1000) * 1e-3
    motion = Motion(1e-3, 0.032 * np.sin(angle), 0.032 * 2.0 * np.pi * 1.5 * np.cos(angle))
    force = simulate(run.settings[0].values, run.damper, motion).force
    true = simulate(known_at(1, WARM), PURDY_DAMPER, motion).force
    assert float(np.max(np.abs(force - true))) < 0.01 * float(np.ptp(true))
    with pytest.raises(ConfigurationError, match="hot"):
        damperfit.settings(results, temperature="hot")


@pytest.mark.parametrize(("asked", "there"), [(None, 43.0), ("26degC", 26.0)])
def test_other_programs_get_it_at_one_temperature(results, asked, there: float) -> None:
    handed = exported_run(results, temperature=asked)
    assert handed.damper == PURDY_DAMPER
    for one in handed.settings:
        true = known_at(int(one.setting.cell), there)
        assert one.values.names == true.names
        for name in ("r_m2", "r_m3"):
            assert getattr(one.values, name) == pytest.approx(getattr(true, name), rel=0.01)
    assert f"resistances as they are at {there:g} degC (fitted at 43 degC)" in map(
        str, handed.notes
    )
    assert handed.run.remarks == ()  # nothing is missing: export ends with code 0


def test_logs_without_a_temperature_do_not_contradict_each_other(tmp_path, results) -> None:
    """It said that cold and warm logs contradict each other, and to leave one out."""
    for path in results.parent.glob("setting_01_*.csv"):
        text = path.read_text(encoding="utf-8").splitlines(keepends=True)
        kept = [line for line in text if not line.startswith("# temperature")]
        (tmp_path / path.name).write_text("".join(kept), encoding="utf-8")
    configuration = configured("identify", {"out": tmp_path / "out"}, COVARIATE)
    with pytest.raises(ConfigurationError, match=r"26C.*, setting_01_60C.* have no temper"):
        next(identified(configuration, [str(tmp_path / "setting_01_*.csv")], jobs=1))


def test_a_log_drives_it_at_its_own_temperature_unless_another_is_asked(results) -> None:
    path = results.parent / recording(1, COLD).name
    choice = choose_parameters(1, table=results, replaced={})
    plain, _ = damper_of(choice, load_configuration())
    own, cold, warm = (
        simulated(choice.parameters, with_temperature(plain, asked), log=path)[-1]
        for asked in (None, "26degC", "60degC")
    )
    assert own.peak_force_rebound == cold.peak_force_rebound
    assert warm.peak_force_rebound < 0.95 * own.peak_force_rebound


def test_a_beta_that_no_log_tells_is_called_so_and_so_is_what_hangs_on_it() -> None:
    model, own = WithTemperature(PURDY_DAMPER, 43.0), FitOptions("joint", OWN, share=("beta",))
    campaign = identify([log(1, COLD), log(10, WARM)], model, own)
    judged = assess(campaign, model)
    told = reconsider(campaign, judged)
    lost = Status.NOT_IDENTIFIABLE
    expected = dict.fromkeys(OWN, Status.FITTED) | dict.fromkeys(("beta", "r_m2", "r_m3"), lost)
    for fit in told.fits:
        assert {name: fit.status[name] for name in expected} == expected
        assert judged.plausible_limits(fit, "beta") == (None, None)
        assert fit.outcome is Outcome.NOT_IDENTIFIABLE
    said = judged.verdicts(told)[Setting.of(1)]
    assert said["beta"].startswith("these logs do not determine it (no value of its plausible")


@pytest.mark.parametrize(
    ("value", "error", "is_lost"),
    # In hundredths a kelvin: nothing at all is an answer too.
    [(0.0, 0.32, False), (0.0, 0.34, True), (0.03, 0.99, False), (0.03, 1.01, True)],
)
def test_beta_is_lost_by_its_error_beside_what_oils_have(value, error, *, is_lost: bool) -> None:
    assert is_loose(QUANTITY, value, error, NOT_FIT_TO_SHARE) is is_lost
    offset = PURDY_DAMPER.quantity("f_0")
    assert not is_loose(offset, value, 10.0 * error, NOT_FIT_TO_SHARE)


def test_of_a_preamble_the_first_temperature_is_taken_and_a_cold_one_is_celsius() -> None:
    taken, notes = facts_in({"temp": "28.5", "oil temp (degf)": "104", "shock temp": "80"})
    assert taken == {"temperature": 28.5}
    assert ["degC" in notes[0], "not used" in notes[1], "not used" in notes[2]] == [True] * 3


def test_of_a_preamble_gas_is_by_gauge_unless_it_says_otherwise() -> None:
    for lines, taken, is_said in (
        ({"gas pressure [kpa]": "305"}, 305e3 + 101325, True),
        ({"gas pressure": "5,6 bara"}, 5.6e5, False),
        ({"pression d'azote": "20 bar"}, 2.0e6 + 101325, True),
        ({"gasdruck": "20,7 bar (Überdruck)"}, 2.07e6 + 101325, False),
        ({"gas": "2 MPa abs"}, 2.0e6, False),
        ({"gas": "nitrogen", "n2": "-2 bar"}, None, True),
        ({"gas": "1,200 kPa"}, None, True),
        ({"gas temperature": "5 bara"}, None, False),
    ):
        facts, notes = facts_in(lines)
        assert facts == ({} if taken is None else {"gas_pressure": pytest.approx(taken)}), lines
        assert bool(notes) is is_said, lines
