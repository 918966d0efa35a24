"""samples, config, help, and what holds for every command: colours, completion, exit codes."""

import errno
import io
import json
import re
import sys
import tomllib
from pathlib import Path

import pytest
import typer

from damperfit import errors
from damperfit.cli import console, main
from damperfit.configuration.loading import load_configuration
from damperfit.manual import TOPICS

ROOT = Path(__file__).parents[2]


def test_config_prints_toml_that_loads_back(run, tmp_path) -> None:
    (tmp_path / "mine.toml").write_text('[damper]\nrod_diameter = "14mm"\n')
    printed = run("config", "--config", "mine.toml").out
    assert tomllib.loads(printed)["damper"]["rod_diameter"] == "14mm"
    (tmp_path / "all.toml").write_text(printed)
    assert load_configuration(tmp_path / "all.toml") == load_configuration(tmp_path / "mine.toml")
    assert json.loads(run("config", "--json").out)["rig"]["frequency"] == "1.5Hz"


def test_samples_are_the_same_for_the_same_seed(run, tmp_path) -> None:
    arguments = ("--settings", "4,6-7", "--cycles", "4", "--seed", "7")
    ended = run("samples", "a", *arguments)
    assert ended.code == 0
    names = sorted(path.name for path in (tmp_path / "a").iterdir())
    assert names == ["README.md", *(f"setting_0{k}.csv" for k in (4, 6, 7)), "truth.csv"]
    document = json.loads(run("samples", "b", *arguments, "--json").out)
    assert [Path(log).name for log in document["logs"]] == names[1:4]
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_what_goes_into_a_file_is_utf_8_whatever_the_locale(run, tmp_path, monkeypatch) -> None:
    (tmp_path / "µ.toml").write_text('[output]\nfolder = "Größe"\n', encoding="utf-8")
    kept = io.BytesIO()
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(kept, encoding="ascii"))
    assert main(["config", "--config", "µ.toml"]) == 0
    sys.stdout.flush()
    assert tomllib.loads(kept.getvalue().decode("utf-8"))["output"]["folder"] == "Größe"


def test_nothing_behind_the_equals_sign_gives_the_default_back(run, logs, tmp_path) -> None:
    """As a shell hands over --rig decimal="" as well."""
    profile = '[rig.profiles.lab]\nfiles = "*.csv"\ndecimal = ","\nunits = {force = "lbf"}\n'
    (tmp_path / "lab.toml").write_text(profile, encoding="utf-8")
    log, given = logs / "setting_01.csv", ("--config", "lab.toml")
    assert run("inspect", log, *given).code != 0
    ended = run("inspect", log, *given, "--rig", "units.force=", "--rig", "decimal=")
    assert ended.code == 0
    assert ended.out.splitlines()[:5] == run("inspect", log).out.splitlines()[:5]


def test_the_configuration_of_the_folder_or_above_is_used_and_named(
    run, tmp_path, monkeypatch
) -> None:
    (tmp_path / "damperfit.toml").write_text('[rig]\nfrequency = "2Hz"\n')
    (tmp_path / "mine.toml").write_text('[rig]\nfrequency = "3Hz"\n')
    (tmp_path / "below").mkdir()
    found = run("config")
    assert found.err == "note: configuration of damperfit.toml\n"
    assert 'frequency = "2Hz"' in found.out
    assert 'frequency = "3Hz"' in run("config", "--config", "mine.toml").out
    monkeypatch.chdir(tmp_path / "below")
    assert 'frequency = "2Hz"' in run("config", "-q").out
    monkeypatch.setenv("DAMPERFIT_CONFIG", str(tmp_path / "mine.toml"))
    assert 'frequency = "3Hz"' in run("config", "-q").out
    monkeypatch.setenv("DAMPERFIT_CONFIG", "nothing.toml")
    assert run("config").code == 2


def test_checks_that_failed_are_red_and_others_dim(capsys, monkeypatch) -> None:
    lines = ["1 failed, 2 not evaluated", "FAILED friction: FAILED twice"]
    red, dim = "\x1b[31mFAILED\x1b[0m", "\x1b[2mnot evaluated\x1b[0m"
    coloured = f"1 failed, 2 {dim}\n{red} friction: FAILED twice\n"
    plain = "".join(f"{line}\n" for line in lines)
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    cases = (("auto", "", coloured), ("never", "", plain), ("auto", "1", plain))
    for when, no_colour, shown in (*cases, ("always", "1", coloured)):
        if no_colour:
            monkeypatch.setenv("NO_COLOR", no_colour)
        monkeypatch.setattr(console, "_colour", {"is": when})
        console.print_lines(lines)
        assert capsys.readouterr().out == shown


@pytest.mark.parametrize(
    "row",
    """
export --to f -> fmu2 fmu3
identify --model tw -> twin_tube
identify --check purdy2000,every_c -> purdy2000,every_click_counts
identify --free r_m1,k -> r_m1,k_e
simulate --wave  -> sine triangle
simulate --parameters results --setting 1 -> 1 10 11
ride results --setting 1 -> 1 10 11
ride nowhere --setting 1 ->
help tru -> trust
help ident -> identify
""".strip().splitlines(),
)
def test_values_are_completed(capsys, monkeypatch, tmp_path, row) -> None:
    """What the shell completes behind an option."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results").mkdir()
    table = "setting,r_m1\n1,2.0\n10,2.0\n11,2.0\n2,2.0\n"
    (tmp_path / "results" / "parameters.csv").write_text(table, encoding="utf-8")
    typed, _, completed = row.partition(" ->")
    words = ["damperfit", *typed.split(" ")]
    monkeypatch.setenv("_DAMPERFIT_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", " ".join(words))
    monkeypatch.setenv("COMP_CWORD", str(len(words) - 1))
    with pytest.raises(SystemExit):
        main([])
    assert capsys.readouterr().out.split() == completed.split()


# `damperfit help`: pages of the manual, and what commands take.


def test_the_pages_are_listed(run) -> None:
    assert [line.split()[0] for line in run("help").out.splitlines() if line][:-1] == [*TOPICS]
    assert tuple(json.loads(run("help", "--json").out)["topics"]) == TOPICS


@pytest.mark.one_in(5)
@pytest.mark.parametrize("topic", TOPICS)
def test_a_page_is_shown_in_the_columns_asked_for(run, monkeypatch, topic) -> None:
    monkeypatch.setenv("COLUMNS", "72")
    ended = run("help", topic)
    assert (ended.code, ended.err) == (0, "")
    lines = ended.out.splitlines()
    assert max(map(len, lines)) <= 72
    assert len(lines) > 8
    assert not re.search(r"<!--|\]\(\w+\.md|```|^## ", ended.out, flags=re.MULTILINE)


# Every exit code, and every kind of error that leads to it.

door = sys.modules["damperfit.cli.main"]  # the package has the function under this name
CODES = {
    1: "Damperfit Conditioning Contradiction Internal Log Output Simulation Timeless",
    2: "Configuration Installation",
    4: "Quality",
    130: "FitCancelled",
}
RAISED = [
    *(
        (getattr(errors, f"{name}Error")("what, where, what to do"), code, "what, where")
        for code, names in CODES.items()
        for name in names.split()
    ),
    (RuntimeError("oops"), 70, "internal error, RuntimeError: oops; this is a bug, --debug shows"),
    (OSError(errno.EACCES, "denied"), 70, "internal error"),
    (OSError(errno.ENOSPC, "No space"), 1, "cannot write the output: No space"),
    (OSError(errno.ENAMETOOLONG, "too long", "n" * 300), 2, "nnn...: a file's name cannot be"),
    (MemoryError(), 1, "out of memory; give fewer or shorter logs"),
    (KeyboardInterrupt(), 130, "interrupted"),
    (typer.Abort(), 130, "interrupted"),
    (typer.BadParameter("no such thing."), 2, "no such thing; see"),
    (BrokenPipeError(), 0, ""),  # its reader has left
]


@pytest.mark.parametrize(("error", "code", "says"), RAISED)
def test_what_a_command_raises_ends_in_one_line_and_a_code(
    run, error, code, says, monkeypatch
) -> None:
    def fail(*_arguments, **_options):
        raise error

    monkeypatch.setattr(door, "app", fail)
    ended = run("config")
    assert (ended.code, ended.out) == (code, "")
    assert says in ended.err
    assert ended.err.count("\n") == bool(says)
