"""FMUs in other people's programs; `pytest -m proof`, with the extra `proof`."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from damperfit.exporting import TARGETS, ExportOptions
from tests.exporting.fmi2_client import OK, Unit, unzip
from tests.exporting.test_fmu import core, rms, road, sine

pytestmark = pytest.mark.proof

HERE = Path(__file__).parent


@pytest.fixture(scope="session")
def files(handed, tmp_path_factory) -> dict[int, Path]:
    folder = tmp_path_factory.mktemp("importers")
    for version in (2, 3):
        name = f"fmu{version}"
        (content,) = TARGETS[name].export(handed, ExportOptions(stem=name)).files.values()
        (folder / f"{name}.fmu").write_bytes(content)
    return {version: folder / f"fmu{version}.fmu" for version in (2, 3)}


@pytest.mark.parametrize("version", [2, 3])
def test_fmpy_finds_no_fault(files, version) -> None:
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(files[version])) == []


def signal(motion, duration: float, interval: float):
    x, v = motion(duration, interval)
    kinds = [("time", float), ("displacement", float), ("velocity", float)]
    rows = np.zeros(len(x), dtype=kinds)
    rows["time"], rows["displacement"], rows["velocity"] = np.arange(len(x)) * interval, x, v
    return rows


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("setting", [1, 10, 20])
@pytest.mark.parametrize(("motion", "limit"), [(sine, 0.1), (road, 5.0)])
def test_fmpy_steps_it(files, handed, version, setting, motion, limit) -> None:
    from fmpy import simulate_fmu

    result = simulate_fmu(
        str(files[version]), fmi_type="CoSimulation", start_values={"setting": setting},
        input=signal(motion, 2.0, 1e-3), output=["force"], output_interval=1e-3, stop_time=2.0,
    )  # fmt: skip
    expected = core(handed, setting, *motion(2.0, 1e-4))[::10]
    assert rms(result["force"] - expected[: len(result)]) < limit


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("setting", [1, 10, 20])
def test_fmpy_integrates_it_though_it_holds_inputs(files, handed, version, setting) -> None:
    from fmpy import simulate_fmu

    result = simulate_fmu(
        str(files[version]), fmi_type="ModelExchange", start_values={"setting": setting},
        input=signal(sine, 1.0, 1e-4), output=["force"], output_interval=1e-3, stop_time=1.0,
        relative_tolerance=1e-6,
    )  # fmt: skip
    expected = core(handed, setting, *sine(1.0, 1e-4))
    seen = np.interp(result["time"], np.arange(len(expected)) * 1e-4, expected)
    assert rms(result["force"] - seen) < 5.0  # held without more they would cost 770 N


@pytest.mark.parametrize("version", [2, 3])
def test_casadi_takes_derivatives_and_integrates_it(files, handed, version, tmp_path) -> None:
    import casadi as ca

    folder = unzip(files[version].read_bytes(), tmp_path / "unit")
    dae = ca.DaeBuilder("damper", str(folder))
    assert dae.x() == ["oil_1", "oil_2", "outside"]
    slopes = dae.create("slopes", ["t", "x", "u"], ["jac_ode_x", "jac_ode_u", "jac_y_x", "jac_y_u"])
    both = dae.create("both", ["t", "x", "u"], ["ode", "y"])
    at, u = np.array([8e-4, -2e-4, 0.0]), np.array([0.01, 0.2])
    blocks = [np.array(one) for one in slopes(0.0, at, u)]
    for k, size in enumerate((1e-9, 1e-9, 1e-3, 1e-8, 1e-7)):
        step = np.eye(5)[k] * size
        ends = [both(0.0, at + s * step[:3], u + s * step[3:]) for s in (-1.0, 1.0)]
        for row, pair in enumerate(zip(*ends, strict=True)):
            low, high = (np.array(one).ravel() for one in pair)
            exact = blocks[2 * row + (k > 2)][:, k if k < 3 else k - 3]
            assert exact == pytest.approx((high - low) / (2.0 * size), rel=1e-4, abs=1e-3)
    described = ET.parse(folder / "modelDescription.xml").getroot()  # noqa: S314
    (told,) = [one for one in described.iter() if one.get("name") == "setting"]
    start = int(told.get("start") or told.find("Integer").get("start"))
    t, w, a = ca.MX.sym("t"), 2.0 * np.pi * 1.5, 0.032
    x = ca.MX.sym("x", 3)
    ode, _ = both(t, x, ca.vertcat(a * ca.sin(w * t), a * w * ca.cos(w * t)))
    grid = np.arange(0.0, 1.0, 1e-3)
    options = {"reltol": 1e-6, "abstol": 1e-9}
    walk = ca.integrator("walk", "cvodes", {"x": x, "t": t, "ode": ode}, 0.0, grid, options)
    states = np.array(walk(x0=[0.0, 0.0, 0.0])["xf"])
    force = [
        float(both(s, states[:, i], [a * np.sin(w * s), a * w * np.cos(w * s)])[1][0])
        for i, s in enumerate(grid)
    ]
    expected = core(handed, start, *sine(1.0, 1e-4))[::10][: len(grid)]
    assert rms(np.array(force) - expected) < 0.1


def test_libcosim_steps_it(files, handed) -> None:
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    execution = CosimExecution.from_step_size(step_size=1_000_000)  # ns
    slave = CosimLocalSlave(fmu_path=str(files[2]), instance_name="damper")
    index = execution.add_local_slave(local_slave=slave)
    hand, eye = CosimManipulator.create_override(), CosimObserver.create_last_value()
    assert execution.add_manipulator(manipulator=hand)
    assert execution.add_observer(observer=eye)
    x, v = sine(1.0)
    execution.real_initial_value(index, 2, float(v[0]))
    execution.integer_initial_value(index, 8, 20)
    force = []
    for i in range(len(x) - 1):
        hand.slave_real_values(index, [1, 2], [float(x[i]), float(v[i])])
        assert execution.step()
        force.append(eye.last_real_values(index, [3])[0])
    expected = core(handed, 20, *sine(1.0, 1e-4))[10::10]
    assert rms(np.array(force) - expected) < 0.1


def test_fmutool_finds_no_fault(files) -> None:
    tool = Path(sys.executable).parent / "fmutool"
    done = subprocess.run(
        [tool, "-input", files[2], "-check", "-summary"],
        capture_output=True,
        text=True,
        check=False,
    )
    said = done.stdout + done.stderr
    assert done.returncode == 0, said
    assert not [line for line in said.splitlines() if line.startswith(("ERROR", "WARNING"))], said
    assert "continuous states : 3" in said


def test_a_quarter_car_of_exudyn(folder_of_unit) -> None:
    """Its damper steps in parallel: at 1 ms the stroke is that at 0.1 ms."""
    import exudyn
    from exudyn.itemInterface import (
        CoordinateSpringDamper,
        LoadCoordinate,
        MarkerNodeCoordinate,
        Mass1D,
        Node1D,
        NodePointGround,
    )

    def drive(h: float):
        one = Unit(folder_of_unit)
        one.initialise(setting=10)
        container = exudyn.SystemContainer()
        system = container.AddSystem()
        nodes = [system.AddNode(Node1D(referenceCoordinates=[0.0])) for _ in range(2)]
        for mass, node in zip((350.0, 40.0), nodes, strict=True):
            system.AddObject(Mass1D(mass=mass, nodeNumber=node))
        ground = system.AddNode(NodePointGround())
        earth = system.AddMarker(MarkerNodeCoordinate(nodeNumber=ground, coordinate=0))
        body, wheel = (
            system.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=0)) for node in nodes
        )
        system.AddObject(CoordinateSpringDamper(markerNumbers=[wheel, body], stiffness=25e3))
        system.AddObject(CoordinateSpringDamper(markerNumbers=[earth, wheel], stiffness=200e3))
        rest, strokes = one.get("force"), []
        pulls = {"damper": 0.0}

        def bump(_system, t, _load):
            return 200e3 * 0.01 * (1.0 - np.cos(2.0 * np.pi * 5.0 * t)) * (t < 0.2)

        system.AddLoad(
            LoadCoordinate(markerNumber=body, loadUserFunction=lambda *_: -pulls["damper"])
        )
        system.AddLoad(
            LoadCoordinate(
                markerNumber=wheel, loadUserFunction=lambda s, t, l: pulls["damper"] + bump(s, t, l)
            )
        )

        def before(s, t):
            at = [s.GetNodeOutput(n, exudyn.OutputVariableType.Coordinates) for n in nodes]
            speed = [s.GetNodeOutput(n, exudyn.OutputVariableType.Coordinates_t) for n in nodes]
            one.set("displacement", float(np.ravel(at[0])[0] - np.ravel(at[1])[0]))
            one.set("velocity", float(np.ravel(speed[0])[0] - np.ravel(speed[1])[0]))
            strokes.append((t, one.get("displacement")))
            old = one.get("force")
            assert one.step(t, h) == OK, one.said
            pulls["damper"] = 0.5 * (old + one.get("force")) - rest  # on the average of the step
            return True

        system.SetPreStepUserFunction(before)
        system.Assemble()
        how = exudyn.SimulationSettings()
        how.timeIntegration.numberOfSteps, how.timeIntegration.endTime = round(1.0 / h), 1.0
        how.timeIntegration.verboseMode = 0
        how.solution.file.write = False
        system.SolveDynamic(how, solverType=exudyn.DynamicSolverType.TrapezoidalIndex2)
        one.close()
        return np.array(strokes)

    fine, coarse = drive(1e-4), drive(1e-3)
    seen = np.interp(coarse[:, 0], fine[:, 0], fine[:, 1])
    assert np.abs(fine[:, 1]).max() > 0.005
    assert np.abs(coarse[:, 1] - seen).max() < 0.02 * np.abs(fine[:, 1]).max()


def test_an_importer_with_a_compiler_builds_it_and_it_runs_fast(
    folder_of_unit, handed, tmp_path
) -> None:
    """The sources hold the damper themselves; a second of it takes less than a millisecond."""
    compiler = shutil.which("gcc") or shutil.which("cc") or pytest.fail("no C compiler")
    sources = sorted((folder_of_unit / "sources").glob("*.c"))
    program = tmp_path / "host"
    folder = folder_of_unit / "sources"
    command = [
        compiler,
        "-std=c99",
        "-O2",
        "-Wall",
        "-Wextra",
        "-Wpedantic",
        "-Werror",
        f"-I{folder}",
    ]
    command += [str(HERE / "fmu_host.c"), *map(str, sources), "-lm", "-o", str(program)]
    subprocess.run(command, check=True)
    token = ET.parse(folder_of_unit / "modelDescription.xml").getroot().get("guid")  # noqa: S314
    seconds = []
    for setting in (1, 10, 20):
        done = subprocess.run(
            [program, token, "", str(setting)], capture_output=True, text=True, check=True
        )
        per_step, force = map(float, done.stdout.split())
        seconds.append(per_step)
        x, v = sine(2.0, 1e-4)
        steady = core(handed, setting, x, v)[: 10 * round(2.0 / 1e-3)]
        # The last step ends at 200 s, three hundred whole cycles: as at 4/3 s.
        assert force == pytest.approx(steady[13333], abs=1.0)
    assert max(seconds) < 1e-6  # of the processor: a thousand times faster than real time
