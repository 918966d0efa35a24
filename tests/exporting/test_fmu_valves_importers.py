"""FMUs of dampers of valves in other people's programs; `pytest -m proof`, extra `proof`."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from damperfit.exporting import TARGETS, ExportOptions
from tests.exporting.fmi2_client import unzip
from tests.exporting.test_fmu import rms, road, sine
from tests.exporting.test_fmu_importers import HERE, signal
from tests.exporting.test_fmu_valve_equations import NAMED, STATES, known_of
from tests.exporting.test_fmu_valves import SOFT, STIFF, core, of_valves

pytestmark = pytest.mark.proof


@pytest.fixture(scope="session")
def files(handed, tmp_path_factory) -> dict[tuple[str, int], Path]:
    folder, made = tmp_path_factory.mktemp("valves"), {}
    for name, damper in NAMED.items():
        mine = of_valves(handed, damper, [known_of(name, one) for one in (SOFT, STIFF)])
        for version in (2, 3):
            (content,) = TARGETS[f"fmu{version}"].export(mine, ExportOptions()).files.values()
            made[name, version] = folder / f"{name}_{version}.fmu"
            made[name, version].write_bytes(content)
    return made


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", NAMED)
def test_fmpy_finds_no_fault(files, name, version) -> None:
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(files[name, version])) == []


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", NAMED)
@pytest.mark.parametrize("motion", [sine, road])
def test_fmpy_integrates_it_though_it_holds_inputs(files, name, version, motion) -> None:
    from fmpy import simulate_fmu

    scale = 0.5 if motion is road else 1.0

    def scaled(duration, interval):
        return tuple(scale * one for one in motion(duration, interval))

    result = simulate_fmu(
        str(files[name, version]), fmi_type="ModelExchange", start_values={"setting": 2},
        input=signal(scaled, 1.0, 1e-3), output=["force"], output_interval=1e-3, stop_time=1.0,
        relative_tolerance=1e-6,
    )  # fmt: skip
    expected = core(NAMED[name], known_of(name, STIFF), *scaled(1.0, 1e-4))
    seen = np.interp(result["time"], np.arange(len(expected)) * 1e-4, expected)
    assert rms(result["force"] - seen) < 5.0


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", NAMED)
def test_casadi_takes_derivatives_and_integrates_it(files, name, version, tmp_path) -> None:
    import casadi as ca

    dae = ca.DaeBuilder("damper", str(unzip(files[name, version].read_bytes(), tmp_path / "unit")))
    dae.set("setting", 2)
    n = len(STATES[name])
    assert dae.x() == STATES[name]
    blocks = dae.create("slopes", ["t", "x", "u"], ["jac_ode_x", "jac_ode_u", "jac_y_x", "jac_y_u"])
    both = dae.create("both", ["t", "x", "u"], ["ode", "y"])
    held = {"oil_1": 3e-4, "oil_2": 2e-5, "outside": 0.0, "grip": 0.3}
    at, u = np.array([held[one] for one in STATES[name]]), np.array([0.004, 0.02])
    exact = [np.array(one) for one in blocks(0.0, at, u)]
    for k in range(n + 2):
        step = np.eye(n + 2)[k] * (1e-9 if k < n and STATES[name][k].startswith("oil") else 1e-7)
        ends = [both(0.0, at + s * step[:n], u + s * step[n:]) for s in (-1.0, 1.0)]
        for row, pair in enumerate(zip(*ends, strict=True)):
            low, high = (np.array(one).ravel() for one in pair)
            mine = exact[2 * row + (k >= n)][:, k if k < n else k - n]
            assert mine == pytest.approx((high - low) / (2.0 * step[k]), rel=1e-4, abs=1e-3)
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
    expected = core(NAMED[name], known_of(name, STIFF), *sine(0.7, 1e-4))[::10][: len(grid)]
    assert rms(np.array(force) - expected) < 0.1


@pytest.mark.parametrize("name", NAMED)
def test_an_importer_with_a_compiler_builds_it_and_its_speed_is_told(files, name, tmp_path) -> None:
    compiler = shutil.which("gcc") or shutil.which("cc") or pytest.fail("no C compiler")
    folder, program = unzip(files[name, 2].read_bytes(), tmp_path / "unit"), tmp_path / "host"
    sources = sorted((folder / "sources").glob("*.c"))
    command = [compiler, "-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    command += [f"-I{folder / 'sources'}", str(HERE / "fmu_host.c"), *map(str, sources)]
    subprocess.run([*command, "-lm", "-o", str(program)], check=True)
    token = ET.parse(folder / "modelDescription.xml").getroot().get("guid")  # noqa: S314
    for setting in ("1", "2"):
        told = [
            subprocess.run(
                [program, token, "", setting], capture_output=True, text=True, check=True
            )
            for _ in range(3)
        ]
        seconds, forces = zip(*(map(float, one.stdout.split()) for one in told), strict=True)
        assert len(set(forces)) == 1
        assert np.isfinite(forces[0])
        # Of the processor, steps of 1 ms: `pytest -m proof -s` shows it; it fails no machine.
        print(f"{name}, setting {setting}: {1e-3 / min(seconds):.0f} times faster than real time")
