"""What was exported, run against the logs that it was fitted to."""

import json
import re
import zipfile
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from damperfit.damper.mounting import Mounting
from damperfit.damper.valve_dampers import TwinTube
from damperfit.errors import ConfigurationError, SimulationError
from damperfit.exporting.check import check_export, read_back
from damperfit.exporting.targets import TARGETS, ExportOptions, exported_run
from damperfit.settings_and_logs import SettingResult
from damperfit.simulation import Motion, SolverOptions, simulate
from damperfit.tested.setting import Setting
from damperfit.units.shown_units import parse_units
from tests.cli.conftest import run  # noqa: F401
from tests.exporting.clients import ERROR, OK, Unit, unzip
from tests.exporting.reading_back import READERS
from tests.exporting.units import SOFT, STIFF, rms, runs_here, sine

SAMPLES = Path(__file__).parents[2] / "sample_runs"
RIGS = {
    "tare": (Mounting("none"), {}),
    "elastic": (Mounting(), {"k_s": 4e5}),
    "play": (Mounting(play="fit"), {"k_s": 4e5, "play": 2e-4}),
    "late": (Mounting(lag="fit"), {"k_s": 1e6, "lag": 9e-3}),
    "heavy": (Mounting("none", moving_mass="fit"), {"moving_mass": 4.0}),
}


def on_rig(handed, rig):
    mounting, known = RIGS[rig]
    damper = TwinTube(mounting=mounting)
    settings = tuple(
        SettingResult(Setting.of(n), damper.values(one | known))
        for n, one in ((1, SOFT), (2, STIFF))
    )
    return replace(handed, damper=damper, settings=settings)


@runs_here
@pytest.mark.parametrize("rig", RIGS)
def test_with_rig_an_fmu_gives_the_force_as_it_is_logged(handed, tmp_path, rig) -> None:
    """Mounting, play, lag, moving mass and tare are the simulation's, to the last newton."""
    rigged = on_rig(handed, rig)
    folder = unzip(TARGETS["fmu2"].export(rigged).files["damper.fmu"], tmp_path)
    x, v = sine(1.0)
    options = SolverOptions(tolerance=0.03, dead_band=5e-3)
    for k, one in enumerate(rigged.settings, 1):
        unit = Unit(folder)
        unit.initialise(x[0], v[0], setting=k, input_extrapolation=0, with_rig=1)
        force = unit.run(x, v, is_of_end=True)
        logged = simulate(one.values, rigged.damper, Motion(1e-3, x, v), options=options).force[1:]
        assert rms(force - logged) < 1e-3 * np.std(logged)
        alone = Unit(folder)
        alone.initialise(x[0], v[0], setting=k, input_extrapolation=0)
        assert rms(alone.run(x, v, is_of_end=True) - logged) > 0.5
        unit.close()
        alone.close()


@runs_here
def test_with_rig_is_chosen_before_the_beginning_and_for_co_simulation(handed, tmp_path) -> None:
    folder = unzip(TARGETS["fmu2"].export(on_rig(handed, "late")).files["damper.fmu"], tmp_path)
    one = Unit(folder)
    one.initialise()
    assert one.set("with_rig", 1) == ERROR
    assert one.set("with_rig", 0) == OK
    exchange = Unit(folder, is_exchange=True)
    assert exchange.set("with_rig", 1) == ERROR
    assert "co-simulation" in exchange.said[-1]
    rigged = Unit(folder)
    rigged.initialise(0.0, 0.1, setting=1, with_rig=1)
    kept = rigged.state()
    x, v = sine(0.2)
    first = rigged.run(x, v)
    rigged.restore(kept)
    assert np.array_equal(rigged.run(x, v), first)
    for unit in (one, exchange, rigged):
        unit.close()


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """Two settings of the sample runs, fitted."""
    import damperfit

    folder = tmp_path_factory.mktemp("fitted") / "results"
    damperfit.identify([SAMPLES / "setting_01.csv", SAMPLES / "setting_20.csv"], out=folder)
    return folder


@runs_here
@pytest.mark.parametrize("target", ["fmu2", "fmu3", "modelica"])
def test_equations_are_as_near_to_the_logs_as_the_fit(run, fitted, tmp_path, target) -> None:  # noqa: F811
    ended = run("export", fitted, "--to", target, "--out", tmp_path / "out", "--check", "--json")
    rows = json.loads(ended.out)["check"]
    assert [row["setting"] for row in rows] == [1, 20]
    for row in rows:
        assert row["mse_percent"] == pytest.approx(row["fit_mse_percent"], rel=0.01)
        assert row["n_samples"] > 1000


@pytest.mark.parametrize("target", sorted({*READERS, "xlsx"}))
def test_a_table_is_read_back_from_its_file(fitted, target) -> None:
    source = exported_run(fitted)
    options = ExportOptions()
    if "units" in TARGETS[target].takes:
        options = replace(options, units=parse_units("lbf,in/s"))
    if "decimal" in TARGETS[target].takes:
        options = replace(options, decimal=",")
    made = TARGETS[target].export(source, options)
    for (v, force), table in zip(read_back(made), made.tables, strict=True):
        assert v == pytest.approx(table.speeds, abs=2e-6)
        assert force == pytest.approx(table.forces, abs=5e-3)
    first, second = check_export(source, made)
    assert first.mse_percent == pytest.approx(0.029, abs=0.001)
    assert second.mse_percent == pytest.approx(1.55, abs=0.01)  # the oil's compressibility


@pytest.mark.parametrize(
    ("target", "old", "new"),
    [("carsim", r"(?m)^(\S+), .*$", r"\1, 0"), ("modelica", r"P_2\*A_2", "P_2*A_1")],
)
def test_what_stands_in_the_file_counts_not_what_was_meant(fitted, target, old, new) -> None:
    source = exported_run(fitted)
    source = replace(source, settings=source.settings[:1])
    made = TARGETS[target].export(source)
    spoilt = {n: re.sub(old, new, one.decode()).encode() for n, one in made.files.items()}
    (first,) = check_export(source, made._replace(files=spoilt))
    assert first.mse_percent > 10.0


def test_a_file_without_its_table_and_a_run_without_signals_say_so(fitted, results) -> None:
    source = exported_run(fitted)
    for target in ("adams", "modelica"):
        made = TARGETS[target].export(source)
        empty = made._replace(files=dict.fromkeys(made.files, b"end Damper;"))
        with pytest.raises(SimulationError):
            check_export(source, empty)
    bare = exported_run(results)
    with pytest.raises(ConfigurationError, match=r"has no responses\.parquet"):
        check_export(bare, TARGETS["csv"].export(bare))


@runs_here
def test_a_library_for_another_machine_alone_is_refused(fitted) -> None:
    source = exported_run(fitted)
    made, bare = TARGETS["fmu2"].export(source), BytesIO()
    with (
        zipfile.ZipFile(BytesIO(made.files["damper.fmu"])) as old,
        zipfile.ZipFile(bare, "w") as new,
    ):
        for name in old.namelist():
            if not name.startswith("binaries"):
                new.writestr(name, old.read(name))
    with pytest.raises(ConfigurationError, match=r"no library for .*fmu_build"):
        check_export(source, made._replace(files={"damper.fmu": bare.getvalue()}))
