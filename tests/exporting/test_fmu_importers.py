"""FMUs in other people's programs; `pytest -m proof`, with the extra `proof`."""

import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from damperfit.exporting.targets import TARGETS, ExportOptions
from tests.exporting.clients import unzip
from tests.exporting.units import CASES, STATES, core, exported, rms, road, sine

pytestmark = pytest.mark.proof

HERE = Path(__file__).parent


@pytest.fixture(scope="session")
def files(handed, tmp_path_factory) -> dict[tuple[str, int], Path]:
    folder, made = tmp_path_factory.mktemp("importers"), {}
    for name in CASES:
        for version in (2, 3):
            options = ExportOptions(stem=f"{name}_{version}")
            (entry,) = (
                TARGETS[f"fmu{version}"].export(exported(handed, name), options).files.items()
            )
            made[name, version] = folder / entry[0]
            made[name, version].write_bytes(entry[1])
    return made


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", CASES)
def test_fmpy_finds_no_fault(files, name, version) -> None:
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(files[name, version])) == []


def signal(motion, duration: float, interval: float):
    x, v = motion(duration, interval)
    kinds = [("time", float), ("displacement", float), ("velocity", float)]
    rows = np.zeros(len(x), dtype=kinds)
    rows["time"], rows["displacement"], rows["velocity"] = np.arange(len(x)) * interval, x, v
    return rows


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("motion", [sine, road])
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_fmpy_runs_it_though_it_holds_inputs(files, name, version, motion, kind) -> None:
    from fmpy import simulate_fmu

    result = simulate_fmu(
        str(files[name, version]), fmi_type=kind, start_values={"setting": 2},
        input=signal(motion, 1.0, 1e-3), output=["force"], output_interval=1e-3, stop_time=1.0,
        relative_tolerance=1e-6,
    )  # fmt: skip
    expected = core(name, 2, *motion(1.0, 1e-4))
    seen = np.interp(result["time"], np.arange(len(expected)) * 1e-4, expected)
    assert rms(result["force"] - seen) < 5.0  # held without more they would cost 770 N


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", CASES)
def test_casadi_integrates_it(files, name, version, tmp_path) -> None:
    import casadi as ca

    dae = ca.DaeBuilder("damper", str(unzip(files[name, version].read_bytes(), tmp_path / "unit")))
    dae.set("setting", 2)
    n = len(STATES[name])
    assert dae.x() == STATES[name]
    both = dae.create("both", ["t", "x", "u"], ["ode", "y"])
    t, w, a = ca.MX.sym("t"), 2.0 * np.pi * 1.5, 0.032
    x = ca.MX.sym("x", n)
    ode, _ = both(t, x, ca.vertcat(a * ca.sin(w * t), a * w * ca.cos(w * t)))
    grid = np.arange(0.0, 0.7, 1e-3)
    options = {"reltol": 1e-6, "abstol": 1e-9}
    walk = ca.integrator("walk", "cvodes", {"x": x, "t": t, "ode": ode}, 0.0, grid, options)
    states = np.array(walk(x0=np.zeros(n))["xf"])
    force = [
        float(both(s, states[:, i], [a * np.sin(w * s), a * w * np.cos(w * s)])[1][0])
        for i, s in enumerate(grid)
    ]
    expected = core(name, 2, *sine(0.7, 1e-4))[::10][: len(grid)]
    assert rms(np.array(force) - expected) < 0.1


def test_libcosim_steps_it(files) -> None:
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    execution = CosimExecution.from_step_size(step_size=1_000_000)  # ns
    slave = CosimLocalSlave(fmu_path=str(files["paper", 2]), instance_name="damper")
    index = execution.add_local_slave(local_slave=slave)
    hand, eye = CosimManipulator.create_override(), CosimObserver.create_last_value()
    assert execution.add_manipulator(manipulator=hand)
    assert execution.add_observer(observer=eye)
    x, v = sine(1.0)
    execution.real_initial_value(index, 2, float(v[0]))
    execution.integer_initial_value(index, 8, 2)
    force = []
    for i in range(len(x) - 1):
        hand.slave_real_values(index, [1, 2], [float(x[i]), float(v[i])])
        assert execution.step()
        force.append(eye.last_real_values(index, [3])[0])
    assert rms(np.array(force) - core("paper", 2, *sine(1.0, 1e-4))[10::10]) < 0.1


@pytest.mark.parametrize("name", CASES)
def test_an_importer_with_a_compiler_builds_it_and_its_speed_is_told(files, name, tmp_path) -> None:
    """The sources hold the damper themselves."""
    compiler = shutil.which("gcc") or shutil.which("cc") or pytest.fail("no C compiler")
    folder, program = unzip(files[name, 2].read_bytes(), tmp_path / "unit"), tmp_path / "host"
    sources = sorted((folder / "sources").glob("*.c"))
    command = [compiler, "-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    command += [f"-I{folder / 'sources'}", str(HERE / "fmu_host.c"), *map(str, sources)]
    subprocess.run([*command, "-lm", "-o", str(program)], check=True)
    token = ET.parse(folder / "modelDescription.xml").getroot().get("guid")  # noqa: S314
    for setting in (1, 2):
        command = [program, token, "", str(setting)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        seconds, force = map(float, done.stdout.split())
        # The last step ends at 200 s, three hundred whole cycles: as at 4/3 s.
        steady = core(name, setting, *sine(2.0, 1e-4))[13333]
        assert force == pytest.approx(steady, abs=0.02 * abs(steady) + 1.0)
        # Of the processor, steps of 1 ms: `pytest -m proof -s` shows it; it fails no machine.
        print(f"{name}, setting {setting}: {1e-3 / seconds:.0f} times faster than real time")
