"""Declarations: defaults < [rig] < the profile of the log < the command line, for every key."""

import itertools
import json

import pytest

from damperfit.arguments import configured
from damperfit.configuration.loading import configuration_toml, load_configuration
from damperfit.errors import ConfigurationError
from damperfit.io import ReadOptions, read_log
from damperfit.sections import Declarations

# Key of [rig] -> its default, and two other values, as in TOML.
VALUES = {
    "setting_pattern": (ReadOptions().setting_pattern, r"n(\d+)", r"m(\d+)"),
    "part_settings": ([], [1, 2], [3]),
    "columns.force": ("", "Load cell", 4),
    "units.force": ("", "kN", "lbf"),
    "scales.force": (1.0, 250.0, -3.0),
    "offsets.force": (0.0, 1.5, -1.5),
    "reverse_force": ("detect", True, False),
    "reverse_displacement": ("detect", True, False),
    "encoding": ("", "cp1252", "utf-16"),
    "separator": ("", ";", "tab"),
    "decimal": ("", ",", "."),
    "thousands": ("", "'", " "),
    "skip_lines": (0, 2, 5),
    "sample_rate": (0.0, 200.0, "1kHz"),
    "pause": (0.0, 60.0, "500ms"),
    "restarts": ("refuse", "split", "last"),
    "bad_rows": ("refuse", "drop", "refuse"),
    "allow_truncated": (False, True, False),
    "tested_at.gas_pressure": ("1bara", "8bara", "9barg"),
    "tested_at.temperature": (0.0, 31, -5.5),
    "tested_at.tare": (0.0, "12N", -3.5),
    "tested_at.skew": (0.0, "2ms", "-1ms"),
}
SI = {
    "1kHz": 1000.0, "500ms": 0.5, "1bara": 1e5, "8bara": 8e5, "12N": 12.0,
    "2ms": 2e-3, "9barg": 1001325.0, "-1ms": -1e-3,
}  # fmt: skip


def in_force(folder, rig: dict, profile: dict, command_line: dict) -> ReadOptions:
    lines = ["[rig]", *_entries(rig), "[rig.profiles.bench]", 'files = "bench*"']
    path = folder / "rig.toml"
    path.write_text("\n".join([*lines, *_entries(profile)]), encoding="utf-8")
    texts = [f"{key}={json.dumps(value)}" for key, value in command_line.items()]
    configuration = configured("inspect", {"config": path, "rig": texts})
    return configuration.reading.for_file("bench_1.csv")[0]


def _entries(values: dict) -> list[str]:
    return [f"{key} = {json.dumps(value)}" for key, value in values.items()]


def found(options: ReadOptions, key: str) -> object:
    name, _, channel = key.partition(".")
    value = getattr(options, name)
    default = VALUES[key][0]
    return value.get(channel, SI.get(default, default)) if channel else value


@pytest.mark.one_in(2)
@pytest.mark.parametrize("key", VALUES)
def test_the_nearest_word_counts_also_where_it_is_the_default(tmp_path, key) -> None:
    assert {one.partition(".")[0] for one in VALUES} == set(Declarations.entries())
    choices = [{}, *({key: value} for value in dict.fromkeys(map(_frozen, VALUES[key])))]
    choices = [{k: list(v) if isinstance(v, tuple) else v for k, v in c.items()} for c in choices]
    # Each level with and without a word, and every word nearest once: not all 64.
    words = [choices[1:][k:] + choices[1:][:k] for k in range(len(choices) - 1)]
    said = [(word[0], word[1 % len(word)], word[-1]) for word in words]
    each = itertools.product(said[:1], itertools.product([True, False], repeat=3))
    for three, has in (*each, *((three, (True, True, True)) for three in said[1:])):
        levels = [one if there else {} for one, there in zip(three, has, strict=True)]
        told = [level[key] for level in levels if level]
        expected = told[-1] if told else VALUES[key][0]
        expected = tuple(expected) if isinstance(expected, list) else SI.get(expected, expected)
        assert found(in_force(tmp_path, *levels), key) == expected, levels


def _frozen(value: object) -> object:
    return tuple(value) if isinstance(value, list) else value


def test_tables_are_put_over_each_other_channel_by_channel(tmp_path) -> None:
    rig = {"units.force": "N", "units.displacement": "cm", "units.time": "ms"}
    options = in_force(
        tmp_path, rig, {"units.force": "kN", "units.time": "min"}, {"units.time": "s"}
    )
    assert options.units == {"force": "kN", "displacement": "cm", "time": "s"}


def test_what_is_printed_reads_logs_alike(tmp_path) -> None:
    # Printed, what the command line says is no longer told from [rig]: profiles must hold it.
    path = tmp_path / "rig.toml"
    path.write_text('[rig.profiles.b]\nfiles = "b*"\ndecimal = "."\nunits = {force = "N"}\n')
    settings = load_configuration(path, overlay={"rig": {"decimal": "", "units": {"force": "kN"}}})
    path.write_text(configuration_toml(settings), encoding="utf-8")
    assert load_configuration(path) == settings
    options, _ = load_configuration(path).reading.for_file("b1.csv")
    assert (options.decimal, options.units) == ("", {"force": "kN"})


def test_a_profile_gives_the_unit_of_the_log_back_and_the_first_that_fits_is_taken(
    tmp_path,
) -> None:
    # Before, a profile could only add to the units of [rig].
    log = tmp_path / "bench_s3.csv"
    log.write_text("time_s,displacement_mm,force_kN\n0,1,2\n1,2,3\n2,3,4\n")
    config = tmp_path / "rig.toml"
    for unit, factor in (("", 1.0), ('units = {force = ""}\n', 1e3)):
        text = f'[rig]\nunits = {{force = "N"}}\n[rig.profiles.b]\nfiles = "bench*"\n{unit}'
        config.write_text(text)
        found = read_log(log, load_configuration(config).reading).force
        assert list(found) == [2.0 * factor, 3.0 * factor, 4.0 * factor]
    profiles = {
        name: {"files": files, "reverse_force": is_reversed}
        for name, files, is_reversed in (("a", "x*", True), ("b", "b*", True), ("c", "*", False))
    }
    recording = read_log(log, ReadOptions(profiles=profiles))
    assert recording.notes[0] == "profile: b"
    assert list(recording.force) == [-2e3, -3e3, -4e3]


WRONG = r"""
unit = {} -> unknown key 'unit' .* Did you mean 'units'
units = {force = 'apples'} -> no unit of force 'apples'
scales = {force = true} -> \.scales\.force: expected a number, found True
skip_lines = '2' -> \.skip_lines: expected a whole number, found '2'
files = 3 -> \.files: expected a text, found 3
restarts = 'lst' -> expected 'refuse', 'split' or 'last'.*Did you mean 'last'
thousands = ',' | decimal = ',' -> ',' already has another meaning
bad_rows = 'keep' -> expected 'refuse' or 'drop', found 'keep'
scales = {force = 0.0} -> scales: force is 0\.0, expected other than 0
units = {forse = 'N'} -> no channel 'forse'.*Did you mean 'force'
setting_pattern = 's' -> no group
separator = 'colon' -> separator: expected .*, found 'colon'
skip_lines = -1 -> skip_lines: expected 0 or more
"""


@pytest.mark.parametrize("row", WRONG.strip().splitlines())
def test_a_wrong_key_of_a_profile_is_named(tmp_path, row) -> None:
    lines, says = row.split(" -> ")
    text = lines.replace(" | ", "\n")
    path = tmp_path / "rig.toml"
    path.write_text(f"[rig.profiles.lab]\n{text}\n", encoding="utf-8")
    with pytest.raises(ConfigurationError, match=says) as caught:
        load_configuration(path)
    assert "rig.profiles.lab" in str(caught.value)
    if says.startswith((r"\.", "unknown")):  # others are judged when all is known
        assert str(caught.value).startswith(f"--config {path}:2: ")
