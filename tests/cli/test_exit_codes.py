"""Every exit code, and every kind of error that leads to it."""

import errno
import sys

import pytest
import typer

from damperfit import errors
from damperfit.cli import main
from damperfit.cli.commands import _worst
from damperfit.run.logs import Ending

door = sys.modules["damperfit.cli.main"]  # the package has the function under this name
CODES = {
    "DamperfitError": 1,
    "ConditioningError": 1,
    "ContradictionError": 1,
    "ConfigurationError": 2,
    "FitCancelledError": 130,
    "InstallationError": 2,
    "InternalError": 1,
    "LogError": 1,
    "OutputError": 1,
    "QualityError": 4,
    "SimulationError": 1,
    "TimelessError": 1,
}


RAISED = [
    *(
        pytest.param(getattr(errors, name)("what, where, what to do"), code, "what, where", id=name)
        for name, code in CODES.items()
    ),
    pytest.param(RuntimeError("oops"), 70, "internal error, RuntimeError: oops", id="bug"),
    pytest.param(
        ZeroDivisionError("x"), 70, "this is a bug, --debug shows where", id="another bug"
    ),
    pytest.param(OSError(errno.EACCES, "denied"), 70, "internal error", id="other trouble"),
    pytest.param(
        OSError(errno.ENOSPC, "No space"), 1, "cannot write the output: No space", id="disk"
    ),
    pytest.param(
        OSError(errno.ENAMETOOLONG, "File name too long", "n" * 300),
        2,
        "nnn...: a file's name cannot be that long; give a shorter one",
        id="long name",
    ),
    pytest.param(MemoryError(), 1, "out of memory; give fewer or shorter logs", id="memory"),
    pytest.param(KeyboardInterrupt(), 130, "interrupted", id="interrupt"),
    pytest.param(typer.Abort(), 130, "interrupted", id="abort"),
    pytest.param(typer.BadParameter("no such thing."), 2, "no such thing; see", id="usage"),
    pytest.param(BrokenPipeError(), 0, "", id="reader has left"),
]


@pytest.mark.parametrize(("error", "code", "says"), RAISED)
def test_what_a_command_raises_ends_in_one_line_and_a_code(
    error, code, says, monkeypatch, capsys
) -> None:
    def fail(*_arguments, **_options):
        raise error

    monkeypatch.setattr(door, "app", fail)
    assert main(["config"]) == code
    seen = capsys.readouterr()
    assert seen.out == ""
    assert "Traceback" not in seen.err
    assert says in seen.err
    assert seen.err.count("\n") == bool(says)


def test_without_arguments_the_help_is_shown(capsys) -> None:
    assert main([]) == 0
    assert "Usage: damperfit" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("endings", "code"),
    [
        ((Ending.COMPLETE, Ending.COMPLETE), 0),
        ((Ending.ALL_FAILED, Ending.ALL_FAILED), 3),
        ((Ending.COMPLETE, Ending.ALL_FAILED), 1),
        ((Ending.ALL_FAILED, Ending.INTERRUPTED), 130),
        ((Ending.COMPLETE, Ending.GATE_MISSED), 4),
        ((Ending.SOME_FAILED, Ending.GATE_MISSED), 1),
    ],
)
def test_of_several_dampers_the_gravest_ending_tells(endings, code) -> None:
    assert _worst({one.value for one in endings}) == code
