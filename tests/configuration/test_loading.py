"""Configuration: complete defaults, layers in order, errors that name file, line and key."""

import pickle
from dataclasses import fields, replace
from pathlib import Path

import pytest

from damperfit.conditioning import ConditionOptions, GasFacts, NominalTest
from damperfit.configuration.damper_section import damper_defaults
from damperfit.configuration.loading import (
    configuration_toml,
    default_document,
    load_configuration,
)
from damperfit.configuration.options import offset_facts, unmatched
from damperfit.damper.model import MODELS
from damperfit.damper.mounting import Mounting
from damperfit.damper.network import Valve
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.valve_dampers import ThroughFlow
from damperfit.errors import ConfigurationError
from damperfit.identification import FitOptions, shared_names
from damperfit.io import ReadOptions
from damperfit.simulation import SolverOptions


@pytest.fixture
def write(tmp_path):
    def put(text: str) -> Path:
        path = tmp_path / "rig.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return put


def test_the_defaults_are_those_of_the_libraries_below() -> None:
    settings, damper = load_configuration(), PURDY_DAMPER
    assert (settings.damper, settings.reading) == (damper, ReadOptions())
    share = shared_names(FitOptions(), damper)
    known = {one.name: one.fallback for one in damper.quantities if one.fallback is not None}
    assert settings.identification == replace(FitOptions(), share=share, fallbacks=known)
    assert load_configuration(overlay={"identification": {"share": []}}).identification.share == ()
    assert settings.simulation.solver == SolverOptions()
    assert settings.conditioning == ConditionOptions(
        chamber_lengths=(damper.chamber_1_length, damper.chamber_2_length),
        nominal=NominalTest(
            frequency=1.5, amplitude=0.032, temperature=26.0, temperature_tolerance=1.0,
            is_of_motion=True,
        ),
        gas=GasFacts(
            rod_area=damper.rod_area, pressure=damper.gas_pressure, volume=damper.gas_volume,
            exponent=damper.gas_exponent,
        ),
        offset=offset_facts(damper, ()),
    )  # fmt: skip
    beside = {"model", "reference_temperature"}  # of any model
    document = default_document()["damper"]
    assert set(document) - beside == {field.name for field in fields(damper)}
    # `--free rebound_bleed,...,f_0,f_0` stood in the note of a log of valves.
    offset = offset_facts(ThroughFlow(), ())
    assert offset.name == "f_0"
    assert ("rebound_bleed" in offset.beside, "f_0" in offset.beside) == (True, False)


MEASURED = "gas_pressure gas_volume rod_diameter piston_diameter chamber_1_length"


@pytest.mark.parametrize(
    ("given", "is_missing", "has_free_k_e"),
    [("monotube", False, False), ("twin_tube", True, False), ("twin_tube --free", True, True)],
)
def test_a_model_says_what_of_a_damper_must_be_measured_and_whether_k_e_is_fitted(
    given, is_missing, has_free_k_e
) -> None:
    model, _, frees = given.partition(" ")
    damper = damper_defaults(model)
    damper = {"model": model} | {name: damper[name] for name in MEASURED.split()}
    fit = {"free": ["k_e", "f_0"]} if frees else {}
    configuration = load_configuration(overlay={"damper": damper, "identification": fit})
    assert ("chamber_2_length" in configuration.not_measured) is is_missing
    assert configuration.conditioning.has_free_k_e is has_free_k_e


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
VALVES = """\
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
ADJUSTED = VALVES + '\n[adjusters]\nlow_speed = ["from closed", "rebound.bleed"]\nhigh_speed = {}\n'
FOLLOWED = ADJUSTED.format('["rebound.blow_off", "compression_opening"]')


@pytest.mark.parametrize(
    "text", ["", FULL, FOLLOWED, *(f'[damper]\nmodel = "{name}"\n' for name in MODELS)]
)
def test_what_is_printed_or_handed_to_a_process_loads_back_to_the_same(write, text: str) -> None:
    first = load_configuration(write(text))
    printed = configuration_toml(first)
    again = load_configuration(write(printed))
    assert (again, configuration_toml(again)) == (first, printed)
    assert again.document == first.document
    sent = pickle.loads(pickle.dumps(first))  # noqa: S301 - our own
    assert sent == first
    assert sent.reading.profiles == first.reading.profiles


def test_values_arrive_where_they_are_used(write) -> None:
    settings = load_configuration(write(FULL))
    assert settings.rig.settings == (1, 2, 3)
    assert (settings.conditioning.centre, settings.conditioning.rig_filter) == (0.0125, "causal")
    reading = settings.reading
    assert reading.columns == {"force": 'Load "cell" #1', "time": 3}
    assert (reading.reverse_force, reading.reverse_displacement) == (True, "detect")
    assert reading.profiles == {"logger": {"files": "ME*.txt", "scales": {"force": 980.665}}}
    assert settings.identification.free == ("r_m1", "k_e")
    assert settings.identification.fixed == {"r_m2": 3e6, "f_f": 50.0}
    assert settings.output.max_mse_percent == 1.0
    with pytest.raises(AttributeError):  # who is handed it cannot change it for the others
        reading.encoding = "cp1252"
    # What the command line fixes adds up with it.
    fit = load_configuration(write(FULL), overlay={"identification": {"fix": {"f_f": "45N"}}})
    assert fit.identification.fixed == {"r_m2": 3e6, "f_f": 45.0}
    mark = write("")
    mark.write_bytes(b"\xef\xbb\xbf[rig]\nfrequency = 2\n")
    assert load_configuration(mark).rig.frequency == 2.0


# Lines of a file, parted by a bar, and what the sentence says; those of VALVES by what is replaced.
MISTAKES = r"""
[damper] | | rod_diametr = 1 -> :3: unknown key 'rod_diametr'.*'rod_diameter'
[damper] | rod-diameter = 1 -> :2: unknown key 'rod-diameter'.*'rod_diameter'
[damper] | model = 'network' | passages = [{from = 1}] -> :3: .*passage 1: lacks to
[dampr] | x = 1 -> :1: unknown section \[dampr\].*Did you mean 'damper'
damper = 3 -> write \[damper\]
[damper] | rod_diameter = '19 kg' -> :2: damper\.rod_diameter: no unit.*kg
[damper] | rod_diameter = -1.0 -> :2: damper\.rod_diameter: expected .*-1
[damper] | rod_diameter = 1HUGE -> :2: .*expected a number, found 10
[damper] | reference_temperature = 1HUGE -> :2: damper\.reference_temperature: expected 'no
[damper] | model = 'twin_tube' | [damper.mounting] | play = nan -> :3: .*play: found nan
[damper] | rod_diameter = true -> damper\.rod_diameter: .*number.*True
[damper] | rod_diameter = '30mm' -> :2: .*expected less than piston_diameter, 0\.0285 m
[rig] | settings = ['?'] -> rig\.settings: found '\?', expected clicks
[adjusters] | log = '' -> adjusters: 'log' is taken
[adjusters] | Rebound = '' -> adjusters: found 'Rebound', expected small letters
[adjusters] | rebound = 'open' -> :2: adjusters\.rebound: expected ''
[test] | seriall = '1' -> :2: unknown key 'seriall' in \[test\]
[rig] | filter = 'kausal' -> rig\.filter: expected 'none', 'causal', 'zero_phase' or 'analogue'
[rig] | reverse_force = 'yes' -> :2: .*expected true, false or 'detect', found 'yes'
[rig] | reverse_force = 1 -> expected true, false or 'detect', found 1
[rig] | skew = '2mm' -> :2: rig\.skew: no unit of time 'mm'
[rig] | skew = '3s' -> skew: expected 'auto' or at most 0\.1 s
[rig] | tested_at.tear = '3N' -> tested_at: no 'tear'; there are .*Did you mean 'tare'
[rig] | tested_at.gas_pressure = '8bar' -> tested_at.gas_pressure: found '8bar', expected a unit
[rig.profiles.lab] | tested_at.tare = '8mm' -> tested_at.tare: found '8mm'
[rig] | setting_pattern = '(' -> setting_pattern.*regular expression
[rig] | profile = 'lab' -> no profile 'lab'
[rig.profiles.lab] | file = 'x' -> unknown key 'file' in \[rig\.profiles\.lab\].*'files'
[rig] | units = {force = 'mm'} -> no unit of force 'mm'
[conditioning] | filter_order = 99 -> filter_order: expected at most 12, found 99
[identification] | fix = {ke = 1} -> no parameter 'ke'.*Did you mean 'k_e'
[identification] | fix = {k_e = '5 apples'} -> k_e = 5 apples: expected a number in Pa
[identification] | free = 'r_m1' -> identification\.free: .*list
[output] | units = "stone" -> output\.units: no unit 'stone'
[damper -> not valid TOML: .*line 1
x = DEEP -> not valid TOML
[damper] | rod_diameter = 1 | rod_diameter = 2 -> not valid TOML
[damper] | model = "monotube" | rebound = 3 -> :3: .* write \[damper.rebound\]
[damper] | gas_volume = 1 -> :2: unknown key 'gas_volume' .* real valves do: add model = \"twin_tube
VALVES bleed =, bleeed = -> :9: unknown key 'bleeed' in \[damper.rebound\]. Did you
VALVES "long", "lng" -> :8: damper.rebound: no bleed 'lng'; .*Did you mean 'long'
VALVES through_flow, throughflow -> :2: damper.model: no model .*'through_flow'
VALVES "through_flow", 3 -> :2: damper.model: expected the name of a model, found 3
VALVES 25mm, 25m -> :4: damper.piston_diameter: expected 0.002 to 1 m, found 25 m
VALVES 25mm, 8mm -> :3: damper.rod_diameter: expected less than piston_diameter
VALVES 400N/mm, 400N/m2 -> :13: damper.mounting.series_stiffness: no unit
VALVES "fit", "fitt" -> :12: damper.mounting: lag: found 'fitt'; expected a number
VALVES gas_volume, gas_length -> :6: unknown key 'gas_length' in \[damper\]
VALVES [damper.rebound], [damper.rebond] -> :8: unknown key 'rebond' in \[damper\]
ADJUSTED ["rebound.blowoff"] -> :18: adjusters\.high_speed.*Did you mean 'rebound.blow_off'
ADJUSTED ["rebound.port"] -> :18: .*no quantity 'rebound.port' of the model through_flow
ADJUSTED ["open"] -> :18: .*no quantity 'open'
ADJUSTED [3] -> :18: .*expected .* or a list of what follows it
"""


@pytest.mark.parametrize("row", MISTAKES.strip().splitlines())
def test_a_mistake_is_told_with_its_place(write, row: str) -> None:
    lines, says = row.split(" -> ")
    kind, _, rest = lines.partition(" ")
    text = "\n".join(line.strip() for line in lines.split("|")) + "\n"
    text = text.replace("HUGE", "0" * 400).replace("DEEP", "[" * 5000)
    if kind == "VALVES":
        text = VALVES.replace(*rest.split(", "))
    elif kind == "ADJUSTED":
        text = ADJUSTED.format(rest)
    with pytest.raises(
        ConfigurationError, match=f"{'rig.toml' * says.startswith(':')}{says}"
    ) as caught:
        load_configuration(write(text))
    assert "\n" not in str(caught.value)


SECTIONS = default_document()
# Any temperature and any middle of a log are a number.
ANY_NUMBER = {"temperature", "centre"}


@pytest.mark.one_in(3)
@pytest.mark.parametrize("value", ['"\u00a7"', "-1e99", "[[1]]", "{x=1}"])
@pytest.mark.parametrize("section", SECTIONS)
def test_every_key_is_blamed_where_it_was_typed(write, section: str, value: str) -> None:
    """The library's own words came without a place for skew, filter_corner and steadiness."""
    for key in SECTIONS[section]:
        path, said = write(f"\n[{section}]\n{key} = {value}\n"), ""
        try:
            load_configuration(path)
        except ConfigurationError as error:
            said = str(error)
        is_fine = value.startswith('"') or key in ANY_NUMBER
        assert is_fine if not said else f"rig.toml:3: {section}.{key}" in said, key
        assert len(said.splitlines()) < 2


# The section [damper] of any model.


def test_a_damper_of_real_valves_is_what_its_sections_say(write) -> None:
    found = load_configuration(write(FOLLOWED))
    damper = found.damper
    assert isinstance(damper, ThroughFlow)
    assert (damper.rod_diameter, damper.piston_diameter) == pytest.approx((0.0089, 0.025))
    assert (damper.gas_pressure, damper.gas_volume) == pytest.approx((790800.7, 2e-5), rel=1e-6)
    assert (damper.rebound, damper.compression) == (Valve("long", "rounded"), Valve())
    assert damper.mounting == Mounting(4e5, "none", "fit")
    fit = found.identification
    assert (fit.procedure, fit.share) == ("joint", None)
    assert all(words in str(found.notes[0]) for words in ("generic damper", "chamber_1_length"))
    # The rebound valve is long and rounded.
    assert fit.follows == {
        **dict.fromkeys(("rebound_bleed", "rebound_leak"), ("low_speed",)),
        **dict.fromkeys(("rebound_opening", "rebound_slope", "rebound_width"), ("high_speed",)),
        "compression_opening": ("high_speed",),
    }
    assert fit.from_closed == ("low_speed",)
    plain = load_configuration(write(FOLLOWED), overlay={"identification": {"procedure": "plain"}})
    assert "only procedure joint uses it, found procedure plain" in " ".join(map(str, plain.notes))


def test_the_command_line_takes_another_model_over_the_file(write) -> None:
    kwok = {"damper": {"model": "kwok"}}
    with pytest.raises(ConfigurationError, match=r"unknown key 'rod_diameter' in \[damper\]"):
        load_configuration(write('[damper]\nrod_diameter = "12mm"\n'), overlay=kwok)
    found = load_configuration(write('[damper]\nmodel = "linear"\n'), overlay=kwok)
    assert found.damper.name == "kwok"


def test_a_law_that_is_still_open_may_have_what_another_model_has(write) -> None:
    text = '[adjusters]\nlow_speed = ["rebound.bleed", "r_m1"]\n'
    found = load_configuration(write(text))
    assert found.identification.follows == {"r_m1": ("low_speed",)}
    assert unmatched(found.document["adjusters"], found.damper) == ("rebound.bleed",)
    says = r"'rebound\.blood'.* Did you mean 'rebound.bleed'"
    with pytest.raises(ConfigurationError, match=says):
        load_configuration(write(text.replace("bleed", "blood")))


OF_VALVES = '[damper]\nrod_diameter = "10mm"\ngas_volume = "21cm3"\n'


@pytest.mark.parametrize(
    ("text", "model"),
    [
        *((f'[damper]\n{key} = "10mm"\n', "purdy") for key in ("rod_diameter", "gas_length")),
        (OF_VALVES, "twin_tube"),
        *((OF_VALVES + 'model = "monotube"\n', "monotube"), ("", "purdy")),
    ],
)
def test_an_open_law_takes_the_model_that_the_keys_are_of(text, model, write):
    found = load_configuration(write(text), is_law_open=True)
    assert found.damper.name == model
    assert ("damper.model" in found.declared) == ("model" in text)
