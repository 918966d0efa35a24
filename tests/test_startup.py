"""The command line is there at once: no numerical library is loaded before a command runs."""

import importlib.metadata
import importlib.util
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import damperfit

HEAVY = ("numpy", "scipy", "pandas", "pyarrow", "matplotlib", "pydantic", "plotly", "jinja2")
LOG = str(Path(__file__).parents[1] / "sample_runs" / "setting_01.csv")
DRAWING = {"jinja2", "markupsafe", "matplotlib", "plotly"}
_COUNTED = """
import gc, sys
looked = []
from damperfit.cli import main
usual = gc.get_threshold()
gc.callbacks.append(lambda phase, _: looked.append(gc.get_count()[0]) if phase == "start" else None)
sys.argv = ["damperfit", *sys.argv[1:]]
code = main()
found = len(looked)
gc.callbacks.clear()
print(code, found, gc.get_freeze_count() > 50_000, gc.get_threshold() == usual, file=sys.stderr)
"""


@cache
def run(*arguments: str) -> tuple[str, list[str], set[str]]:
    """One process for all that is asked of it: stdout, other lines of stderr, modules loaded."""
    command = [sys.executable, "-X", "importtime", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    lines = done.stderr.splitlines()
    loaded = {line.split("|")[-1].strip() for line in lines if line.startswith("import time:")}
    return done.stdout, [one for one in lines if not one.startswith("import time:")], loaded


@pytest.mark.parametrize("command", [(), ("identify",)])
def test_help_loads_no_heavy_library(command):
    shown, said, loaded = run("-m", "damperfit", *command, "--help")
    assert "typer" in loaded  # else the report was not understood
    # Of one command typer itself asks for pydantic.
    assert loaded.isdisjoint(HEAVY if not command else {*HEAVY} - {"pydantic"})
    assert said == []
    words = ("--skew", "--hold-out") if command else ("identify", "report", "samples", "config")
    assert all(word in shown for word in words)


# SciPy is 1.1 s of processor for a few small methods, pandas a third of a second.
NEVER = {"scipy", "pandas", "pyarrow.compute", "numpy.ma", "rich.console", *DRAWING}
OTHER = "damper.rivals damper.valve_dampers laws.search"
JUDGING = "identification.fit_setting uncertainty.residuals checks tables.rows"
# A command, as it is run; modules of ours that it needs, and those that it has no use for.
LOADED = {
    "identify": ("-m damperfit", "identification reporting.report", f"{OTHER} laws.law_fit"),
    "inspect": (
        *(f"-c {_COUNTED}", "conditioning.log_to_trace"),
        f"{OTHER} {JUDGING} io.foreign io.groups io.binary",
    ),
}


@pytest.mark.parametrize("command", LOADED)
def test_a_command_loads_what_it_needs_and_no_more(tmp_path, command):
    how, needed, idle = LOADED[command]
    more = ("--out", str(tmp_path), "--quiet") if command == "identify" else ()
    loaded = run(*how.split(" ", 1), command, LOG, *more)[2]
    assert {f"damperfit.{one}" for one in needed.split()} <= loaded
    assert loaded.isdisjoint(NEVER)
    for one in idle.split():
        assert importlib.util.find_spec(f"damperfit.{one}")
        assert f"damperfit.{one}" not in loaded


def test_a_program_that_ends_looks_for_no_garbage():
    """It took a fifteenth of the time of `inspect`, and as much again when Python ended."""
    assert run("-c", _COUNTED, "inspect", LOG)[1] == ["0 0 True True"]


def test_the_script_is_installed():
    (script,) = importlib.metadata.entry_points(group="console_scripts", name="damperfit")
    assert callable(script.load())
    assert importlib.metadata.version("damperfit") == damperfit.__version__


def test_a_checkout_without_the_core_uses_the_installed_one(tmp_path: Path) -> None:
    """Used to fail: ``pip install .``, then Python started in the checkout."""
    import damperfit.damper._core as core

    source = Path(damperfit.__file__).parent
    checkout, site = tmp_path / "checkout", tmp_path / "site"
    ignore = shutil.ignore_patterns("_core*.so", "_core*.pyd", "__pycache__")
    shutil.copytree(source, checkout / "damperfit", ignore=ignore)
    place = site / "damperfit" / "damper"
    place.mkdir(parents=True)
    shutil.copy(core.__file__, place)
    code = (
        "import damperfit; from damperfit.simulation import simulate, sine_motion;"
        "from damperfit.damper.purdy.parameters import PURDY_DAMPER;"
        "from damperfit.damper.purdy.parameters import reference_parameters;"
        "m = sine_motion(0.032, 1.5, cycles=1, sample_rate=500);"
        "simulate(reference_parameters(10), PURDY_DAMPER, m); print(damperfit.__file__)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(checkout), str(site)])},
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert str(checkout) in done.stdout
