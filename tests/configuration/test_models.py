"""The section [damper] of any model: its own keys, their units, mistakes told with their line."""

from pathlib import Path

import pytest

from damperfit.configuration.loading import configuration_toml, load_configuration
from damperfit.configuration.schema import unmatched
from damperfit.damper.model import MODELS
from damperfit.damper.mounting import Mounting
from damperfit.damper.network import Valve
from damperfit.damper.valve_dampers import ThroughFlow
from damperfit.errors import ConfigurationError

TEXT = """\
[damper]
model = "through_flow"
rod_diameter = "8.9mm"
piston_diameter = "25mm"
gas_pressure = "100psig"
gas_volume = "20cm3"

[damper.rebound]
bleed = "long"
blow_off = "rounded"

[damper.mounting]
series_stiffness = "400N/mm"
lag = "fit"
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "rig.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_damper_of_real_valves_is_what_its_sections_say(tmp_path: Path) -> None:
    found = load_configuration(written(tmp_path, TEXT))
    damper = found.damper
    assert isinstance(damper, ThroughFlow)
    assert (damper.rod_diameter, damper.piston_diameter) == pytest.approx((0.0089, 0.025))
    assert (damper.gas_pressure, damper.gas_volume) == pytest.approx((790800.7, 2e-5), rel=1e-6)
    assert (damper.rebound, damper.compression) == (Valve("long", "rounded"), Valve())
    assert damper.mounting == Mounting(4e5, "none", "fit")
    assert found.identification.procedure == "plain"
    assert found.identification.share == ("detect",)
    assert "generic damper" in found.notes[0]
    assert "chamber_1_length" in found.notes[0]


@pytest.mark.parametrize("name", MODELS)
def test_what_is_printed_of_any_model_loads_back_to_the_same(name: str, tmp_path: Path) -> None:
    first = load_configuration(overlay={"damper": {"model": name}})
    assert first.damper == MODELS[name]()
    text = configuration_toml(first)
    again = load_configuration(written(tmp_path, text))
    assert (again.damper, again.identification) == (first.damper, first.identification)
    assert configuration_toml(again) == text


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("bleed =", "bleeed =", r"rig.toml:9: unknown key 'bleeed' in \[damper.rebound\]. Did you"),
        ('"long"', '"lng"', "rig.toml:8: damper.rebound: no bleed 'lng'; .*Did you mean 'long'"),
        ("through_flow", "throughflow", "rig.toml:2: damper.model: no model .*'through_flow'"),
        ('"through_flow"', "3", "rig.toml:2: damper.model: expected the name of a model, found 3"),
        ("25mm", "25m", "rig.toml:4: damper.piston_diameter: expected 0.002 to 1 m, found 25 m"),
        ("25mm", "8mm", "rig.toml:3: damper.rod_diameter: expected less than piston_diameter"),
        ("400N/mm", "400N/m2", "rig.toml:13: damper.mounting.series_stiffness: no unit"),
        ('"fit"', '"fitt"', "rig.toml:12: damper.mounting: lag: found 'fitt'; expected a number"),
        ("gas_volume", "gas_length", r"rig.toml:6: unknown key 'gas_length' in \[damper\]"),
        ("[damper.rebound]", "[damper.rebond]", r"rig.toml:8: unknown key 'rebond' in \[damper\]"),
    ],
)
def test_a_mistake_is_told_with_its_line(tmp_path: Path, old: str, new: str, says: str) -> None:
    with pytest.raises(ConfigurationError, match=says):
        load_configuration(written(tmp_path, TEXT.replace(old, new)))


def test_a_section_that_is_a_number_is_told(tmp_path: Path) -> None:
    text = '[damper]\nmodel = "monotube"\nrebound = 3\n'
    with pytest.raises(ConfigurationError, match=r"rig.toml:3: .* write \[damper.rebound\]"):
        load_configuration(written(tmp_path, text))


def test_the_command_line_takes_another_model_over_the_file(tmp_path: Path) -> None:
    path = written(tmp_path, '[damper]\nrod_diameter = "12mm"\n')
    with pytest.raises(ConfigurationError, match=r"unknown key 'rod_diameter' in \[damper\]"):
        load_configuration(path, overlay={"damper": {"model": "kwok"}})
    other = written(tmp_path, '[damper]\nmodel = "linear"\n')
    found = load_configuration(other, overlay={"damper": {"model": "kwok"}})
    assert found.damper.name == "kwok"


ADJUSTED = TEXT + '\n[adjusters]\nlow_speed = ["from closed", "rebound.bleed"]\nhigh_speed = {}\n'


def test_what_follows_an_adjuster_is_declared_by_parts_or_columns(tmp_path: Path) -> None:
    text = ADJUSTED.format('["rebound.blow_off", "compression_opening"]')
    found = load_configuration(written(tmp_path, text))
    # The rebound valve of TEXT is long and rounded.
    assert found.identification.follows == {
        "rebound_bleed": ("low_speed",),
        "rebound_leak": ("low_speed",),
        "rebound_opening": ("high_speed",),
        "rebound_slope": ("high_speed",),
        "rebound_width": ("high_speed",),
        "compression_opening": ("high_speed",),
    }
    assert found.identification.from_closed == ("low_speed",)
    assert "only procedure joint uses it, found procedure plain" in " ".join(found.notes)
    again = load_configuration(written(tmp_path, configuration_toml(found)))
    assert again == found


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ('["rebound.blowoff"]', "'rebound.blowoff'.* Did you mean 'rebound.blow_off'"),
        ('["rebound.port"]', "no quantity 'rebound.port' of the model through_flow"),
        ('["open"]', "no quantity 'open'"),
        ("[3]", "expected .* or a list of what follows it"),
    ],
)
def test_what_is_no_quantity_is_refused_with_its_line(said, expected, tmp_path: Path) -> None:
    text = ADJUSTED.format(said)
    line = text[: text.index("high_speed =")].count("\n") + 1
    with pytest.raises(
        ConfigurationError, match=rf"rig\.toml:{line}: adjusters\.high_speed.*{expected}"
    ):
        load_configuration(written(tmp_path, text))


def test_a_law_that_is_still_open_may_have_it(tmp_path: Path) -> None:
    text = '[adjusters]\nlow_speed = ["rebound.bleed", "r_m1"]\n'
    found = load_configuration(written(tmp_path, text))
    assert found.identification.follows == {"r_m1": ("low_speed",)}
    assert unmatched(found.document["adjusters"], found.damper) == ("rebound.bleed",)
    with pytest.raises(
        ConfigurationError, match=r"'rebound\.blood'.* Did you mean 'rebound.bleed'"
    ):
        load_configuration(written(tmp_path, text.replace("bleed", "blood")))


OF_VALVES = '[damper]\nrod_diameter = "10mm"\ngas_volume = "21cm3"\n'


def test_keys_of_valves_need_a_model_unless_the_logs_choose(tmp_path):
    path = tmp_path / "damper.toml"
    path.write_text(OF_VALVES)
    said = r"damper\.toml:3: unknown key 'gas_volume' in \[damper\]\. The paper's model has none; "
    with pytest.raises(ConfigurationError, match=said + r"real valves do: add model = \"twin_tube"):
        load_configuration(path)
    found = load_configuration(path, is_law_open=True)
    assert found.damper.name == "twin_tube"
    assert found.damper.gas_volume == pytest.approx(21e-6)
    assert "damper.model" not in found.declared


@pytest.mark.parametrize(("text", "model"), [
    ('[damper]\nrod_diameter = "10mm"\n', "purdy"),
    ('[damper]\ngas_length = "40mm"\n', "purdy"),
    (OF_VALVES + 'model = "monotube"\n', "monotube"),
    ("", "purdy"),
])  # fmt: skip
def test_an_open_law_takes_the_model_that_the_keys_are_of(text, model, tmp_path):
    path = tmp_path / "damper.toml"
    path.write_text(text)
    assert load_configuration(path, is_law_open=True).damper.name == model
