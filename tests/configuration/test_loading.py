"""Configuration: complete defaults, layers in order, errors that name file, line and key."""

import pickle
from dataclasses import fields, replace
from pathlib import Path

import pytest

from damperfit.conditioning import ConditionOptions, GasFacts, NominalTest
from damperfit.configuration.loading import (
    configuration_toml,
    default_document,
    load_configuration,
)
from damperfit.configuration.options import offset_facts
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.valve_dampers import ThroughFlow
from damperfit.errors import ConfigurationError
from damperfit.identification import FitOptions, shared_names
from damperfit.io import ReadOptions
from damperfit.simulation import SolverOptions


def _write(folder: Path, text: str) -> Path:
    path = folder / "rig.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_an_offset_that_is_free_anyway_is_not_named_twice() -> None:
    """`--free rebound_bleed,...,f_0,f_0` stood in the note of a log of valves."""
    offset = offset_facts(ThroughFlow(), ())
    assert offset.name == "f_0"
    assert "rebound_bleed" in offset.beside
    assert "f_0" not in offset.beside


def test_the_defaults_are_those_of_the_libraries_below() -> None:
    settings = load_configuration()
    assert settings.damper == PURDY_DAMPER
    assert settings.reading == ReadOptions()
    share = shared_names(FitOptions(), PURDY_DAMPER)
    known = {one.name: one.fallback for one in PURDY_DAMPER.quantities if one.fallback is not None}
    assert settings.identification == replace(FitOptions(), share=share, fallbacks=known)
    assert settings.simulation.solver == SolverOptions()
    lengths = (PURDY_DAMPER.chamber_1_length, PURDY_DAMPER.chamber_2_length)
    nominal = NominalTest(
        frequency=1.5,
        amplitude=0.032,
        temperature=26.0,
        temperature_tolerance=1.0,
        is_of_motion=True,
    )
    gas = GasFacts(
        rod_area=PURDY_DAMPER.rod_area,
        pressure=PURDY_DAMPER.gas_pressure,
        volume=PURDY_DAMPER.gas_volume,
        exponent=PURDY_DAMPER.gas_exponent,
    )
    offset = offset_facts(PURDY_DAMPER, ())
    assert settings.conditioning == ConditionOptions(
        chamber_lengths=lengths, nominal=nominal, gas=gas, offset=offset
    )


def test_a_damper_that_the_configuration_cannot_describe_does_not_exist() -> None:
    document = default_document()
    beside = {"model", "reference_temperature"}  # of any model
    assert set(document["damper"]) - beside == {field.name for field in fields(PURDY_DAMPER)}


def test_fixed_parameters_of_file_and_command_line_add_up(tmp_path: Path) -> None:
    path = _write(tmp_path, '[identification]\nfix = {k_e = "500MPa", f_f = 40}\n')
    fit = load_configuration(
        path, overlay={"identification": {"fix": {"f_f": "45N"}}}
    ).identification
    assert fit.fixed == {"k_e": 5e8, "f_f": 45.0}


FULL = """
[damper]
rod_diameter = "12mm"
gas_exponent = 1
[rig]
settings = [3, 1, 2, 2]
centre = "12.5mm"
columns = {force = "Load \\"cell\\" #1", time = 3}
units = {displacement = "mm"}
filter = "causal"
reverse_force = true
[identification]
procedure = "plain"
free = ["r_m1", "k_e"]
[rig.profiles.logger]
files = "ME*.txt"
scales = {force = 980.665}
[identification.fix]
r_m2 = 3e6
f_f = "50N"
[output]
folder = "ergebnisse µ"
max_mse_percent = 1
"""


@pytest.mark.parametrize("text", ["", FULL])
def test_what_is_printed_loads_back_to_the_same(tmp_path: Path, text: str) -> None:
    settings = load_configuration(_write(tmp_path, text))
    printed = tmp_path / "printed.toml"
    printed.write_text(configuration_toml(settings), encoding="utf-8")
    again = load_configuration(printed)
    assert again == settings
    assert again.document == settings.document
    assert configuration_toml(again) == configuration_toml(settings)


def test_values_arrive_where_they_are_used(tmp_path: Path) -> None:
    settings = load_configuration(_write(tmp_path, FULL))
    assert settings.rig.settings == (1, 2, 3)
    assert settings.conditioning.centre == 0.0125
    assert settings.conditioning.rig_filter == "causal"
    assert settings.reading.columns == {"force": 'Load "cell" #1', "time": 3}
    assert settings.reading.reverse_force is True
    assert settings.reading.reverse_displacement == "detect"
    (profile,) = settings.reading.profiles
    assert (profile.name, profile.files) == ("logger", "ME*.txt")
    assert profile.declared == {"scales": {"force": 980.665}}
    assert settings.identification.free == ("r_m1", "k_e")
    assert settings.identification.fixed == {"r_m2": 3e6, "f_f": 50.0}
    assert settings.output.max_mse_percent == 1.0


# Lines of a file, parted by a bar, and what the sentence says.
MISTAKES = r"""
[damper] | | rod_diametr = 1 -> rig\.toml:3: unknown key 'rod_diametr'.*'rod_diameter'
[damper] | rod-diameter = 1 -> rig\.toml:2: unknown key 'rod-diameter'.*'rod_diameter'
[rig] | 'skew time' = 1 -> rig\.toml:2: unknown key 'skew time'
[damper] | model = 'network' | passages = [{from = 1}] -> rig\.toml:3: .*passage 1: lacks to
[dampr] | x = 1 -> rig\.toml:1: unknown section \[dampr\].*Did you mean 'damper'
damper = 3 -> write \[damper\]
[damper] | rod_diameter = '19 kg' -> rig\.toml:2: damper\.rod_diameter: no unit.*kg
[damper] | rod_diameter = -1.0 -> rig\.toml:2: damper\.rod_diameter: expected .*-1
[damper] | rod_diameter = nan -> damper\.rod_diameter
[damper] | rod_diameter = 1HUGE -> rig\.toml:2: .*expected a number, found 10
[damper] | reference_temperature = 1HUGE -> rig\.toml:2: damper\.reference_temperature: expected 'no
[damper] | model = 'twin_tube' | [damper.mounting] | play = nan -> :3: .*play: found nan
[damper] | rod_diameter = true -> damper\.rod_diameter: .*number.*True
[damper] | rod_diameter = '30mm' -> rig\.toml:2: .*expected less than piston_diameter, 0\.0285 m
[rig] | settings = ['?'] -> rig\.settings: found '\?', expected clicks
[adjusters] | log = '' -> adjusters: 'log' is taken
[adjusters] | Rebound = '' -> adjusters: found 'Rebound', expected small letters
[adjusters] | rebound = 'open' -> rig\.toml:2: adjusters\.rebound: expected ''
[test] | seriall = '1' -> rig\.toml:2: unknown key 'seriall' in \[test\]
[rig] | filter = 'kausal' -> rig\.filter: expected 'none', 'causal' or 'zero_phase'
[rig] | reverse_force = 'yes' -> rig\.toml:2: .*expected true, false or 'detect', found 'yes'
[rig] | reverse_force = 1 -> expected true, false or 'detect', found 1
[rig] | skew = '2mm' -> rig\.toml:2: rig\.skew: no unit of time 'mm'
[rig] | skew = 'atuo' -> rig\.toml:2: rig\.skew
[rig] | skew = '3s' -> skew: found 3\.0, expected 'auto' or at most 0\.1 s
[rig] | setting_pattern = '(' -> setting_pattern.*regular expression
[rig] | profile = 'lab' -> no profile 'lab'
[rig.profiles.lab] | file = 'x' -> unknown key 'file' in \[rig\.profiles\.lab\].*'files'
[rig] | units = {force = 'mm'} -> no unit of force 'mm'
[conditioning] | filter_order = 99 -> filter_order: found 99
[identification] | fix = {ke = 1} -> no parameter 'ke'.*Did you mean 'k_e'
[identification] | fix = {k_e = '5 apples'} -> k_e = 5 apples: expected a number in Pa
[identification] | free = 'r_m1' -> identification\.free: .*list
[simulation] | wave = 'square' -> simulation\.wave
[output] | max_mse_percent = -1 -> output\.max_mse_percent
[output] | units = "stone" -> output\.units: no unit 'stone'
[damper -> rig\.toml: not valid TOML: .*line 1
x = DEEP -> rig\.toml: not valid TOML
[damper] | rod_diameter = 1 | rod_diameter = 2 -> not valid TOML
"""


@pytest.mark.parametrize("row", MISTAKES.strip().splitlines())
def test_a_mistake_is_told_with_its_place(tmp_path: Path, row: str) -> None:
    lines, says = row.split(" -> ")
    text = "\n".join(line.strip() for line in lines.split("|")) + "\n"
    text = text.replace("HUGE", "0" * 400).replace("DEEP", "[" * 5000)
    with pytest.raises(ConfigurationError, match=says) as caught:
        load_configuration(_write(tmp_path, text))
    assert "\n" not in str(caught.value)


def test_files_that_are_no_configuration_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="No such file"):
        load_configuration(tmp_path / "none.toml")
    with pytest.raises(ConfigurationError, match="cannot be read"):
        load_configuration(tmp_path)
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigurationError, match="UTF-8"):
        load_configuration(tmp_path / "binary")
    (tmp_path / "big").write_text("# " + "x" * 1_100_000)
    with pytest.raises(ConfigurationError, match="larger than 1 MB"):
        load_configuration(tmp_path / "big")


def test_a_byte_order_mark_is_no_mistake(tmp_path: Path) -> None:
    (tmp_path / "bom.toml").write_bytes(b"\xef\xbb\xbf[rig]\nfrequency = 2\n")
    assert load_configuration(tmp_path / "bom.toml").rig.frequency == 2.0


SECTIONS = default_document()
# Any temperature and any middle of a log are a number.
ANY_NUMBER = {"temperature", "centre"}


@pytest.mark.parametrize("value", ['"\u00a7"', "-1e99", "[[1]]", "{x=1}"])
@pytest.mark.parametrize("section", SECTIONS)
def test_every_key_is_blamed_where_it_was_typed(tmp_path: Path, section: str, value: str) -> None:
    """The library's own words came without a place for skew, filter_corner and steadiness."""
    path = tmp_path / "mine.toml"
    for key in SECTIONS[section]:
        path.write_text(f"\n[{section}]\n{key} = {value}\n", encoding="utf-8")
        said = ""
        try:
            load_configuration(path)
        except ConfigurationError as error:
            said = str(error)
        is_fine = value.startswith('"') or key in ANY_NUMBER
        assert is_fine if not said else f"mine.toml:3: {section}.{key}" in said, key
        assert len(said.splitlines()) < 2


def test_a_configuration_can_be_handed_to_another_process(tmp_path: Path) -> None:
    first = load_configuration(_write(tmp_path, FULL))
    again = pickle.loads(pickle.dumps(first))  # noqa: S301 - our own
    assert again == first
    assert again.reading.profiles == first.reading.profiles
