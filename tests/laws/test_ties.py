"""Valves follow the letters of labels as the logs bear it out, and are delivered so."""

from types import SimpleNamespace

import pytest

from damperfit.errors import ConfigurationError
from damperfit.laws.criterion import LinearisedTies
from damperfit.tested.setting import Setting
from tests.laws.valve_logs import DAMPER_TOML, VALUES, damper, log_text, moved


def test_letters_of_a_label_are_places() -> None:
    at = Setting.of("L6 H1")
    assert (at.place("L"), at.place("H"), at.label) == (6, 1, "L6 H1")
    assert Setting.of("soft").evident == (("setting", "soft"),)
    assert Setting.of("L6 L1").evident == (("setting", "L6 L1"),)


def test_a_setting_without_the_letters_of_others_stands_elsewhere() -> None:
    labels, is_determined = ("L6 H1", "L6 H3", "soft"), [True, True, False]
    known = SimpleNamespace(
        structure=SimpleNamespace(damper=damper(has_play_and_lag=False)),
        whose=[("rebound_bleed", Setting.of(label)) for label in labels],
        is_determined=is_determined,
    )
    assert LinearisedTies.is_shown(known, "rebound_bleed", ("L",))  # H1 and H3 are both known
    assert not LinearisedTies.is_shown(known, "rebound_bleed", ())  # and of L only 6


@pytest.fixture(scope="module")
def unlike(tmp_path_factory):
    """Two settings of a damper whose friction follows the click."""
    folder = tmp_path_factory.mktemp("unlike")
    (folder / "damper.toml").write_text(DAMPER_TOML + 'model = "through_flow"\n')
    model = damper(has_play_and_lag=False)
    for place, friction in enumerate((12.0, 36.0), start=1):
        known = {name: x for name, x in VALUES.items() if name in model.names}
        text = log_text(model, {**known, "f_f": friction}, moved((0.06, 0.24)), setting=place)
        (folder / f"log_{place}.csv").write_text(text)
    return folder


def test_what_settings_disagree_about_is_said_with_the_numbers(unlike) -> None:
    import damperfit

    logs, config = sorted(unlike.glob("log_*.csv")), unlike / "damper.toml"
    run = damperfit.identify(logs, config=config, procedure="joint", share="f_f,k_s")
    said = [one for one in run.document()["problems"] if one["code"] == "shared-apart"]
    assert [one["values"]["label"] for one in said] == ["friction"]
    low, high = (float(said[0]["values"][name]) for name in ("low", "high"))
    assert (low, high) == pytest.approx((12.0, 36.0), rel=0.3)


@pytest.mark.parametrize("share", ["f_f,k_s", "detect"])
def test_what_is_untied_has_its_own_value_at_each_setting(unlike, share) -> None:
    import damperfit

    logs, config = sorted(unlike.glob("log_*.csv")), unlike / "damper.toml"
    run = damperfit.identify(logs, config=config, procedure="joint", share=share, untie="f_f")
    assert [one.values.f_f for one in run.settings] == pytest.approx([12.0, 36.0], rel=0.03)
    assert {one.status["f_f"] for one in run.settings} == {"fitted"}
    assert {one.status["k_s"] for one in run.settings} == {"shared"}
    with pytest.raises(ConfigurationError, match="nothing_known"):
        damperfit.identify(logs, config=config, procedure="joint", untie="nothing_known")
    with pytest.raises(ConfigurationError, match="only procedure joint"):
        damperfit.identify(logs, config=config, procedure="plain", untie="f_f")
