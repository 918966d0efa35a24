"""A value that no option takes is refused by the option that was typed, with what was found."""

from __future__ import annotations

import pytest
import typer

from damperfit.cli.main import app, main

BAD = "§"
COMMANDS = typer.main.get_command(app).commands  # built anew at each call
# What each command needs besides; no log is read and nothing is fitted before its options are.
BESIDE = {
    "identify": ["LOG"],
    "inspect": ["LOG"],
    "models": ["LOG"],
    "fleet": ["LOG", "--out", "fleet"],
    "simulate": ["--setting", "10"],
    "sweep": ["--setting", "10", "--vary", "r_m1=1,2"],
    "samples": ["runs"],
    "export": ["RESULTS", "--to", "csv"],
    "compare": ["RESULTS", "RESULTS"],
    "settings": ["RESULTS", "--velocity", "0.1m/s"],
    "report": ["RESULTS"],
}
# Two of them make a motion together.
TOGETHER = {
    ("compare", "--amplitude"): ["--frequency", "1Hz"],
    ("compare", "--frequency"): ["--amplitude", "9mm"],
}
# Any text is a file's name there, or a word that names something.
WRITES = {"--out", "--log-file", "--plot", "--save", "--junit"}
FILES = {"--config", "--tests", "--parameters", "--displacement", "--repeats", "--hold-out"}


def cases():
    for name, command in COMMANDS.items():
        for one in command.params:
            option = next((text for text in one.opts if text.startswith("--")), "")
            takes = one.param_type_name == "option" and not one.is_flag and option != "--help"
            if takes and option not in WRITES | FILES:
                marks = [pytest.mark.extras] if option == "--scheduler" else []  # needs Dask
                yield pytest.param(name, option, id=f"{name} {option}", marks=marks)


@pytest.fixture(scope="module")
def results(logs, tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    assert main(["identify", str(logs / "setting_01.csv"), "--out", str(folder), "--quiet"]) == 0
    return folder


@pytest.mark.parametrize(("command", "option"), list(cases()))
def test_a_value_that_cannot_be_is_refused_by_its_option(
    run, logs, results, command, option
) -> None:
    given = {"LOG": logs / "setting_01.csv", "RESULTS": results}
    words = (*BESIDE.get(command, []), *TOGETHER.get((command, option), []))
    ended = run(command, *(given.get(word, word) for word in words), f"{option}={BAD}")
    assert ended.code == 2, ended.err
    (line,) = ended.err.splitlines()
    assert option in line
    assert BAD in line
    assert ended.out == ""


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["identify", "LOG", "--jobs", "0"], "--jobs 0: expected 1 or more"),
        (["identify", "LOG", "--jobs", "two"], "--jobs two: expected a whole number"),
        (["identify", "LOG", "--jobs=1.5"], "--jobs 1.5: expected a whole number"),
        (["simulate", "--cycles", "x"], "--cycles x: expected a number"),
        (["samples", "runs", "--seed", "-1"], "--seed -1: expected 0 or more"),
        (["samples", "runs", "--sample-rate", "-1"], "--sample-rate -1.0: expected more than 0"),
    ],
)
def test_a_number_that_cannot_be_is_told_as_typed(run, logs, arguments, says) -> None:
    ended = run(*(str(logs / "setting_01.csv") if a == "LOG" else a for a in arguments))
    assert ended.code == 2
    assert ended.err.startswith(f"damperfit: {says}")
    assert len(ended.err.splitlines()) == 1


# What is wrong with a file that is given: its name, its text if it is there, and what is said.
WRONG_FILES = [
    ("nix.toml", None, "--config", "cannot be read"),
    ("a.toml", "zzz", "--config", "not valid TOML"),
    ("a.toml", "[damper]\n\nrod = 3\n", "--config", "unknown key 'rod'"),
    ("nix.csv", None, "--tests", "cannot be read"),
    ("t.csv", "zzz\n", "--tests", "no column 'file'"),
    ("t.csv", "file,setting\na.csv,1e9\n", "--tests", "setting: found '1e9'"),
    ("nix.csv", None, "--parameters", "cannot be read"),
    ("p.csv", "zzz\n", "--parameters", "not a parameters table"),
    ("nix.csv", None, "--start", "cannot be read"),
    ("p.csv", "zzz\n", "--start", "not a parameters table"),
    ("nix.csv", None, "--tolerance", "cannot be read"),
    ("b.csv", "zzz\n", "--tolerance", "expected the columns"),
    ("nix.csv", None, "--displacement", "no such file"),
    ("d.csv", "zzz\n", "--displacement", "no rows of numbers"),
    ("nix", None, "--repeats", "no such file or folder"),
]


def told_of(option):
    """Yield each command that takes a file by this option."""
    for name, command in COMMANDS.items():
        if any(option in one.opts for one in command.params):
            yield name


@pytest.mark.parametrize(
    ("command", "option", "name", "text", "says"),
    [
        (command, option, *rest)
        for name, text, option, says in WRONG_FILES
        for command in told_of(option)
        for rest in ((name, text, says),)
    ],
)
def test_a_file_that_cannot_be_used_is_told_with_its_option(
    run, logs, results, tmp_path, command, option, name, text, says
) -> None:
    given = {"LOG": logs / "setting_01.csv", "RESULTS": results}
    if text is not None:
        (tmp_path / name).write_text(text)
    words = BESIDE.get(command, [])
    ended = run(command, *(given.get(word, word) for word in words), option, name)
    assert ended.code in ({1, 2} if option == "--displacement" else {2}), ended.err
    (line,) = (one for one in ended.err.splitlines() if one.startswith("damperfit: --"))
    assert line.startswith(f"damperfit: {option} {name}:"), line
    assert says in line
    assert line.count(option) == 1
    assert ended.out == ""


@pytest.mark.parametrize(
    ("command", "option", "place"),
    [
        ("identify", "--out", "a_file"),
        ("fleet", "--out", "a_file/x"),
        ("compare", "--out", "a_file"),
        ("compare", "--save", "a_file/x.json"),
        ("report", "--out", "a_file"),
        ("sweep", "--out", "a_file"),
        ("export", "--out", "a_file/x"),
        ("simulate", "--out", "a_file/x.csv"),
        ("simulate", "--plot", "a_file/x.svg"),
        ("init", "--out", "a_file/x.toml"),
    ],
)
def test_what_can_never_be_written_is_told_with_its_option_and_first(
    run, logs, results, tmp_path, command, option, place
) -> None:
    given = {"LOG": logs / "setting_01.csv", "RESULTS": results}
    (tmp_path / "a_file").write_text("kept")
    words = (given.get(word, word) for word in BESIDE.get(command, []) if word != "--out")
    ended = run(command, *(word for word in words if word != "fleet"), option, place)
    assert ended.code == 2
    (line,) = ended.err.splitlines()
    assert line == f"damperfit: {option} {place}: cannot be written: a_file is not a folder"
    assert ended.out == ""
    assert (tmp_path / "a_file").read_text() == "kept"


def test_a_place_that_was_not_typed_is_told_without_an_option(run, logs, tmp_path) -> None:
    (tmp_path / "results").write_text("kept")
    ended = run("identify", logs / "setting_01.csv")
    assert ended.err == "damperfit: results: cannot be written: results is not a folder\n"
    ended = run("samples", "results")
    assert (ended.code, ended.out) == (2, "")
    assert ended.err == "damperfit: results: cannot be written: results is not a folder\n"
