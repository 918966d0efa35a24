"""The command line is there at once: no numerical library is loaded before a command runs."""

from __future__ import annotations

import gc
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import damperfit
from damperfit.cli import main

HEAVY = ("numpy", "scipy", "pandas", "pyarrow", "matplotlib", "pydantic", "plotly", "jinja2")
CLI = [sys.executable, "-m", "damperfit"]


def run(command):
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize("module", ["damperfit", "damperfit.errors", "damperfit.cli"])
def test_importing_loads_no_heavy_library(module):
    script = f"import sys, {module}; print(*(n for n in {HEAVY!r} if n in sys.modules))"
    done = run([sys.executable, "-c", script])
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []


def test_reports_but_for_the_page_load_nothing_that_draws():
    names = "report, tables, forces, sheet, records, inspection, compared"
    script = f"from damperfit.reporting import {names}; import sys; print(*sys.modules)"
    done = run([sys.executable, "-c", script])
    assert done.returncode == 0, done.stderr
    assert "damperfit.reporting.report" in done.stdout.split()
    assert {"jinja2", "markupsafe", "matplotlib", "plotly"}.isdisjoint(done.stdout.split())


def test_identify_loads_no_scipy(tmp_path):
    """1.1 s of processor, for a few small methods and quantiles; pandas was a third of a second."""
    log = Path(__file__).parents[1] / "sample_runs" / "setting_01.csv"
    command = [*CLI, "identify", str(log), "--out", str(tmp_path), "--quiet"]
    done = run([command[0], "-X", "importtime", *command[1:]])
    assert done.returncode == 0, done.stderr
    loaded = {line.split("|")[-1].strip() for line in done.stderr.splitlines()}
    assert "damperfit.identification" in loaded  # else the report was not understood
    assert loaded.isdisjoint({"scipy", "numpy.f2py", "pandas", "matplotlib", "plotly"})
    assert loaded.isdisjoint({"numpy.ma", "pyarrow.compute", "rich.console"})


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
def _inspected():
    """One run for all that is asked of it: what each import took, and what was counted last."""
    log = Path(__file__).parents[1] / "sample_runs" / "setting_01.csv"
    return run([sys.executable, "-X", "importtime", "-c", _COUNTED, "inspect", str(log)])


def test_inspect_loads_nothing_that_fits_judges_or_writes_tables():
    """It took 1.2 s of processor, two thirds of it for what reads no log."""
    done = _inspected()
    assert done.returncode == 0, done.stderr
    loaded = {line.split("|")[-1].strip() for line in done.stderr.splitlines()}
    assert {"damperfit.conditioning.log_to_trace", "pydantic"} <= loaded
    assert loaded.isdisjoint({"rich.table", "rich.console"})  # a pipe has no colours
    assert loaded.isdisjoint({"scipy", "pandas", "matplotlib", "plotly", "jinja2"})
    assert "pyarrow.compute" not in loaded  # 0.1 s, for wall clocks alone
    assert "numpy.ma" not in loaded  # NumPy's medians and percentiles ask for masked arrays
    judging = ("identification.fit_setting", "uncertainty.residuals", "laws.search", "checks")
    judging += (
        "damper.rivals",
        "damper.valve_dampers",
        "io.foreign",
        "io.groups",
        "io.binary",
        "identification.sharing",
    )
    assert loaded.isdisjoint(f"damperfit.{one}" for one in (*judging, "tables.rows"))


def test_a_program_that_ends_looks_for_no_garbage():
    """It took a fifteenth of the time of `inspect`, and as much again when Python ended."""
    said = [
        line for line in _inspected().stderr.splitlines() if not line.startswith("import time:")
    ]
    assert said == ["0 0 True True"]


def test_a_call_of_the_command_line_leaves_garbage_to_its_caller(capsys):
    kept, usual = gc.get_freeze_count(), gc.get_threshold()
    assert main(["--version"]) == 0
    assert gc.get_freeze_count() <= kept
    assert gc.get_threshold() == usual


def test_help_names_every_command_and_loads_no_heavy_library():
    done = run([sys.executable, "-X", "importtime", "-m", "damperfit", "--help"])
    assert done.returncode == 0, done.stderr
    loaded = {line.split("|")[-1].strip().split(".")[0] for line in done.stderr.splitlines()}
    assert "typer" in loaded  # else the report was not understood
    assert loaded.isdisjoint(HEAVY)
    said = [line for line in done.stderr.splitlines() if not line.startswith("import time:")]
    assert said == []
    for command in ("identify", "report", "simulate", "sweep", "samples", "config"):
        assert command in done.stdout


@pytest.mark.parametrize("command", ["identify", "simulate", "samples", "config"])
def test_every_command_explains_itself(command, capsys):
    assert main([command, "--help"]) == 0
    assert f"damperfit {command}" in capsys.readouterr().out


def test_version_is_that_of_the_package():
    done = run([*CLI, "--version"])
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"damperfit {damperfit.__version__}\n"


def test_the_script_is_installed():
    import importlib.metadata

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
        "import damperfit, sys; from damperfit.simulation import simulate, sine_motion;"
        "from damperfit.damper.purdy.parameters import PURDY_DAMPER;"
        "from damperfit.damper.purdy.reference import reference_parameters;"
        "m = sine_motion(0.032, 1.5, cycles=1, sample_rate=500);"
        "r = simulate(reference_parameters(10), PURDY_DAMPER, m);"
        "print(damperfit.__file__, len(r.force))"
    )
    path = os.pathsep.join([str(checkout), str(site)])
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": path},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert str(checkout) in done.stdout
