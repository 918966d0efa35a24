"""A value that no option takes is refused by the option that was typed, with what was found."""

import pytest
import typer

from damperfit.cli.main import app

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
    "advise": ["RESULTS", "--for", "k_e"],
    "valves": ["RESULTS"],
    "passport": ["RESULTS"],
    "watch": ["runs"],
    "ride": ["RESULTS"],
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
