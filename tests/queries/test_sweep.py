"""One parameter varied: the paper's sensitivities at setting 10 (Figs 4 to 9)."""

import json

import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError
from damperfit.queries.simulations import (
    choose_parameters,
    parse_variation,
    run_sweep,
)
from damperfit.reporting.simulated import (
    sweep_pressure_plot,
    sweep_sentence,
)


@pytest.fixture(scope="module")
def settings():
    return load_configuration()


@pytest.fixture(scope="module")
def choice():
    return choose_parameters(10, table=None, replaced={})


@pytest.fixture
def family(choice, settings):
    def make(text):
        variation = parse_variation(text)
        return run_sweep(choice, settings, variation=variation)

    return make


def peaks(kin):
    return kin.figures.peak_force_rebound, -kin.figures.peak_force_bump


def opening(kin):
    return abs(kin.figures.hysteresis_rebound), abs(kin.figures.hysteresis_bump)


def test_valve_1_moves_both_strokes_rebound_more(family):
    low, base, high = family("r_m1=0.8,1,1.2")
    assert all(a < b < c for a, b, c in zip(peaks(low), peaks(base), peaks(high), strict=True))
    rebound, bump = (b / a for a, b in zip(peaks(low), peaks(high), strict=True))
    assert rebound > bump
    assert all(a < b for a, b in zip(opening(base), opening(high), strict=True))


def test_valve_2_moves_bump_only(family):
    low, high = family("r_m2=0.8,1.2")
    assert peaks(low)[0] == pytest.approx(peaks(high)[0], rel=1e-3)
    assert peaks(high)[1] > 1.1 * peaks(low)[1]


def test_valve_3_moves_rebound_only_and_cavitates_chamber_2(family):
    low, base, high = family("r_m3=0.5,1,1.5")
    assert peaks(low)[1] == pytest.approx(peaks(high)[1], rel=1e-3)
    assert peaks(low)[0] < peaks(base)[0] < peaks(high)[0]
    assert [kin.cavitation > 0.0 for kin in (low, base, high)] == [False, False, True]
    assert high.figures.cavitation_shares[1] == high.cavitation
    sentence = sweep_sentence("r_m3", [high, low, base])
    assert sentence.startswith("r_m3 x0.5 to x1.5: peak rebound ")
    assert "cavitation: chamber 2 for " in sentence
    assert sweep_pressure_plot(high, file_name="a", title="a").panels[0].bands
    assert not sweep_pressure_plot(base, file_name="a", title="a").panels[0].bands


def test_soft_oil_opens_the_loop_about_four_times(family):
    soft, base, hard = family("k_e=0.2,1,2")
    ratios = [a / b for a, b in zip(opening(soft), opening(base), strict=True)]
    assert all(2.5 < ratio < 5.0 for ratio in ratios)
    assert all(a < b for a, b in zip(opening(hard), opening(base), strict=True))


def test_friction_moves_both_branches_by_itself(family):
    none, base, double = family("f_f=0,1,2")
    for stroke in (0, 1):
        assert peaks(base)[stroke] - peaks(none)[stroke] == pytest.approx(50.0, abs=0.1)
        assert peaks(double)[stroke] - peaks(none)[stroke] == pytest.approx(100.0, abs=0.1)
    assert none.figures.energy < base.figures.energy


@pytest.mark.parametrize("name", ["p_0", "gamma", "amplitude", "frequency"])
def test_rig_and_gas_are_varied_too(family, name):
    factor = 0.75 if name == "gamma" else 0.5  # 1.4 to 1.05: below 1 is no gas
    low, high = family(f"{name}={factor},1")
    assert high.value == pytest.approx(low.value / factor)
    assert abs(peaks(high)[0] - peaks(low)[0]) > 0.1
    if name == "frequency":
        assert high.frequency == 2.0 * low.frequency
    if name in {"amplitude", "frequency"}:
        assert high.figures.peak_speed_rebound == pytest.approx(
            2.0 * low.figures.peak_speed_rebound, rel=1e-3
        )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("r_m9=1,2", "Did you mean"),
        ("r_m1", "expected NAME=F1,F2"),
        ("r_m1=a", "'a' is not a number"),
        ("r_m1=nan", "0 or more"),
        ("r_m1=-1", "0 or more"),
        ("r_m1=0,1", "not a damper"),
        ("r_m1=1,1", "given twice"),
    ],
)
def test_what_cannot_be_varied_is_refused(text, words):
    with pytest.raises(ConfigurationError, match=words):
        parse_variation(text)


def test_a_factor_that_leaves_no_damper_is_named_as_it_was_typed(family):
    with pytest.raises(
        ConfigurationError, match=r"^--vary gamma=0\.5: gas_exponent: expected 1 to"
    ):
        family("gamma=1,0.5")


@pytest.mark.parametrize(("model", "vary", "peak"), [
    ("twin_tube", "rebound_opening=0.5,1,2", "rebound"),
    ("monotube", "gas_pressure=1,1.5", "bump"),
    ("bilinear", "amplitude=0.5,1", "rebound"),
])  # fmt: skip
def test_every_model_can_be_swept(tmp_path, capsys, model: str, vary: str, peak: str) -> None:
    from damperfit.cli import main
    from tests.test_every_model import TRUTH

    (tmp_path / "damper.toml").write_text(f'[damper]\nmodel = "{model}"\n')
    values = [part for k, v in TRUTH[model].items() for part in ("--set", f"{k}={v}")]
    code = main(["sweep", *values, "--vary", vary, "--config", str(tmp_path / "damper.toml"),
                 "--out", str(tmp_path / "out"), "--quiet", "--json"])  # fmt: skip
    captured = capsys.readouterr()
    assert code == 0, captured.err
    rows = json.loads(captured.out)["rows"]
    forces = [abs(row[f"peak_force_{peak}_N"]) for row in rows]
    assert forces == sorted(forces)
    assert forces[-1] > forces[0]
