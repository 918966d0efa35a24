"""FMUs of dampers of valves in model exchange, and their derivatives in both kinds."""

from __future__ import annotations

import ctypes as ct
import io
import zipfile
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from damperfit.damper.friction import Friction
from damperfit.damper.network_model import simulate_network
from damperfit.damper.valve_dampers import Monotube, TwinTube
from damperfit.exporting import TARGETS, ExportOptions
from damperfit.exporting.fmu import exported_damper
from damperfit.simulation import Motion, SolverOptions
from tests.exporting.fmi2_client import ERROR, OK, Unit, unzip
from tests.exporting.test_fmu import BAND, rms, road, runs_here, sine
from tests.exporting.test_fmu_valves import LAYOUTS, RIG, RIGID, SOFT, STIFF, core, of_valves

SEALS = {
    "presliding": 1e-4, "breakaway": 25.0, "stribeck_speed": 0.02, "seal_area": 8e-6,
    "free_gas": 2e-3,
}  # fmt: skip
# Friction that remembers, is larger at rest and is pressed: what a seal may do beyond Coulomb's.
SEALED = TwinTube(mounting=RIGID, friction=Friction("fit", "fit", "fit", "fit"))
WITH_GRIP = Monotube(gas_pressure=2e6, mounting=RIGID, friction=Friction("fit"))
NAMED = {one.name: one for one in LAYOUTS} | {"seals": SEALED, "grip": WITH_GRIP}
STATES = {
    "twin_tube": ["oil_1", "oil_2", "outside"],
    "monotube": ["oil_1", "outside"],
    "through_flow": ["oil_1", "oil_2", "outside"],
    "seals": ["oil_1", "oil_2", "outside", "grip"],
    "grip": ["oil_1", "outside", "grip"],
}
RATES = {"oil_1": "flow_1", "oil_2": "flow_2", "outside": "is_outside", "grip": "grip_rate"}
OUTPUTS = ("force", "pressure_1", "pressure_2", "pressure_3")


def known_of(name, known):
    return known | (SEALS if name == "seals" else {"presliding": 1e-4} if name == "grip" else {})


@pytest.fixture(scope="session")
def folders(handed, tmp_path_factory):
    made = {}
    for name, damper in NAMED.items():
        mine = of_valves(handed, damper, [known_of(name, known) for known in (SOFT, STIFF)])
        (content,) = TARGETS["fmu2"].export(mine, ExportOptions()).files.values()
        made[name] = unzip(content, tmp_path_factory.mktemp(name))
        made[name, "damper"] = exported_damper(mine)
    return made


def opened(folders, name, *, x=0.0, v=0.0, setting=1, **parameters) -> Unit:
    one = Unit(folders[name], is_exchange=True)
    assert one.component, one.said
    one.initialise(x, v, setting=setting, **parameters)
    return one


@runs_here
@pytest.mark.parametrize("name", NAMED)
def test_model_exchange_with_exact_inputs(folders, name) -> None:
    from scipy.integrate import solve_ivp

    w, a, duration = 2.0 * np.pi * 1.5, 0.032, 0.7
    one, states = opened(folders, name, v=a * w, setting=2), STATES[name]
    one.call("EnterContinuousTimeMode")

    def place(t, y) -> None:
        one.at(t, a * np.sin(w * t), a * w * np.cos(w * t), y)

    def rates(t, y):
        place(t, y)
        return one.numbers("GetDerivatives", len(states))

    def jacobian(t, y):
        place(t, y)
        return np.array([[one.slope(RATES[r], s) for s in states] for r in states])

    done = solve_ivp(
        rates, (0.0, duration), one.numbers("GetContinuousStates", len(states)), method="Radau",
        rtol=1e-6, atol=1e-9, jac=jacobian,
    )  # fmt: skip
    assert done.success
    force = []
    for t, y in zip(done.t, done.y.T, strict=True):
        place(t, y)
        force.append(one.get("force"))
    fine = 2e-5  # so that it may be read between its samples
    expected = core(NAMED[name], known_of(name, STIFF), *sine(duration, interval=fine), fine)
    seen = np.interp(done.t, np.arange(len(expected)) * fine, expected)
    settled = done.t > 0.1
    assert np.sqrt(np.mean((np.array(force) - seen)[settled] ** 2)) < 0.1
    one.close()


def points(name):
    """Rebound, bump, and near rest, where friction turns: x, v and the states."""
    damper = NAMED[name]
    for x, v, p_1, p_2 in (
        (0.01, 0.3, 21e5, 3e5), (-0.012, -0.25, 4e5, 9e5), (0.004, 0.003, 8e5, 4e5),
    ):  # fmt: skip
        v_1 = damper.chamber_1_volume - damper.annulus_area * x
        v_2 = damper.chamber_2_volume + damper.piston_area * x
        oil = [
            damper.oil_density * full * (p - damper.gas_pressure) / 9e8
            for full, p in ((v_1, p_1), (v_2, p_2))
        ]
        held = dict(zip(("oil_1", "oil_2"), oil, strict=True)) | {"outside": 0.0, "grip": 0.37}
        yield x, v, [held[state] for state in STATES[name]]


@runs_here
@pytest.mark.parametrize("name", NAMED)
def test_slopes_are_those_of_the_equations_and_each_is_declared(folders, name) -> None:
    one = opened(folders, name)
    states = STATES[name]
    numbers = [each.name for each in folders[name, "damper"].numbers if each.name != "f_0"]
    if name != "seals":
        numbers.remove("free_gas")  # none: at its end, where an empty chamber has no slope by it
    unknowns = (*OUTPUTS, *(RATES[state] for state in states if state != "outside"))
    followed = declared(folders[name])
    for x, v, y in points(name):
        one.at(0.0, x, v, y)
        at = {known: one.get(known) for known in [*numbers, "friction_band"]}
        at |= {"displacement": x, "velocity": v} | dict(zip(states, y, strict=True))
        del at["outside"]
        for known, here in at.items():
            d = 1e-6 * (abs(here) or 1e-3)
            found = {}
            sides = (-1.0 if here or known in states else 0.0, 1.0)  # no number is negative
            for side in sides:
                if known in {"displacement", "velocity", *states}:
                    moved = dict(zip(states, y, strict=True)) | {"displacement": x, "velocity": v}
                    moved[known] += side * d
                    one.at(0.0, moved["displacement"], moved["velocity"],
                           [moved[state] for state in states])  # fmt: skip
                else:
                    assert one.set(known, here + side * d) == OK
                    one.get("force")  # takes the number up, at the pressures as they are
                    one.at(0.0, x, v, y)  # but it is the states that are held
                found[side] = np.array([one.get(unknown) for unknown in unknowns])
            if known in numbers or known == "friction_band":
                one.set(known, here)
                one.get("force")
            one.at(0.0, x, v, y)
            numeric = (found[1.0] - found[sides[0]]) / (d * (1.0 - sides[0]))
            for unknown, expected in zip(unknowns, numeric, strict=True):
                exact = one.slope(unknown, known)
                size = abs(one.get(unknown)) / (abs(here) or 1e-3)
                error = abs(expected - exact)
                assert error <= 1e-4 * abs(exact) + 1e-8 * size, (unknown, known, exact, expected)
                is_state_or_input = known not in numbers and known != "friction_band"
                if exact and is_state_or_input:
                    assert known in followed[unknown], (unknown, known)
    one.close()


def declared(folder) -> dict[str, set[str]]:
    """What the outputs and rates follow, by name."""
    root = ET.parse(folder / "modelDescription.xml").getroot()  # noqa: S314
    names = [one.get("name") for one in root.iter("ScalarVariable")]
    structure = root.find("ModelStructure")
    return {
        names[int(one.get("index")) - 1]: {
            names[int(i) - 1] for i in one.get("dependencies").split()
        }
        for part in ("Outputs", "Derivatives")
        for one in structure.find(part)
    }


@runs_here
@pytest.mark.parametrize("name", ["twin_tube", "monotube", "seals"])
def test_slopes_in_co_simulation_are_those_of_the_run(folders, name) -> None:
    x, v = sine(0.401)
    damper, known = NAMED[name], known_of(name, SOFT)
    numbers = {one: getattr(damper.values(known), one) for one in damper.names if one not in RIG}
    asked = [one for one in numbers if one != "f_0"] + ["gas_pressure"]
    response = simulate_network(
        damper.network, numbers | {"f_0": 0.0}, damper, Motion(1e-3, x, v),
        sensitivities=asked, options=SolverOptions(tolerance=0.03, dead_band=BAND),
    )  # fmt: skip
    one = Unit(folders[name])
    one.initialise(x[0], v[0], setting=1, input_extrapolation=0, carry_derivatives=1)
    force = one.run(x, v, is_of_end=True)
    assert rms(force - response.force[1:]) < 1e-9
    for each in asked:
        row = response.sensitivities[each]
        assert abs(one.slope("force", each) - row[-1]) < 2e-5 * np.abs(row).max(), each
    assert one.slope("force", "f_0") == 1.0
    one.close()


@runs_here
def test_what_a_number_did_before_it_changed_is_not_counted(folders) -> None:
    """In mid-run k_e becomes another one; the opening in bump is that of both settings."""
    x, v = sine(0.5)

    def run(**parameters):
        one = Unit(folders["twin_tube"])
        one.initialise(x[0], v[0], setting=1, carry_derivatives=1, **parameters)
        one.run(x[:251], v[:251])
        before = [one.slope("pressure_2", name) for name in ("compression_opening", "k_e")]
        one.set("setting", 2)
        after = [one.slope("pressure_2", name) for name in ("compression_opening", "k_e")]
        one.run(x[250:260], v[250:260], start=0.25)
        told = before, after, one.slope("pressure_2", "compression_opening")
        pressure = one.get("pressure_2")
        one.close()
        return pressure, told

    _, ((shared, own), (still, anew), later) = run()
    assert shared != 0.0
    assert still == pytest.approx(shared, rel=1e-9)
    assert own != 0.0
    assert abs(anew) < 1e-9 * abs(own)
    ends = [run(compression_opening=3e5 + d)[0] for d in (-30.0, 30.0)]
    assert later == pytest.approx((ends[1] - ends[0]) / 60.0, rel=1e-3)


@runs_here
def test_slopes_by_parameters_cost_time_and_are_carried_where_that_was_said(folders) -> None:
    one = Unit(folders["twin_tube"])
    one.initialise(0.0, 0.1, setting=1)
    references = [(ct.c_uint * 1)(one.references[name]) for name in ("force", "k_e")]
    size, seed, found = ct.c_size_t(1), (ct.c_double * 1)(1.0), (ct.c_double * 1)()
    asked = (references[0], size, references[1], size, seed, found)
    assert one.call("GetDirectionalDerivative", *asked) == ERROR
    assert "carry_derivatives is 1 from the beginning" in one.said[-1]
    assert one.set("carry_derivatives", 1) == ERROR  # too late
    assert one.set("carry_derivatives", 2) == ERROR
    one.run(*(part[:40] for part in sine(0.4)))  # at rest nothing changes with the place
    assert one.slope("force", "displacement") != 0.0  # of the equations: always
    one.close()


@runs_here
@pytest.mark.parametrize("name", ["seals", "grip"])
def test_friction_is_kept_with_the_state(folders, name) -> None:
    x, v = sine(0.4)
    one = Unit(folders[name])
    one.initialise(x[0], v[0], setting=1)
    one.run(x[:172], v[:172])  # just behind a turn: friction is between its ends
    assert -0.99 < one.get("grip") < 0.99
    kept, size = one.state(), ct.c_size_t()
    first = one.run(x[171:300], v[171:300], start=0.171)
    assert one.call("SerializedFMUstateSize", kept, ct.byref(size)) == OK
    content = ct.create_string_buffer(size.value)
    assert one.call("SerializeFMUstate", kept, content, size) == OK
    other = Unit(folders[name])
    other.initialise()
    taken = ct.c_void_p(None)
    assert other.call("DeSerializeFMUstate", content, size, ct.byref(taken)) == OK
    other.restore(taken)
    assert np.array_equal(other.run(x[171:300], v[171:300], start=0.171), first)
    for each in (one, other):
        each.close()


@runs_here
@pytest.mark.parametrize(("motion", "limit"), [(sine, 0.1), (road, 5.0)])
def test_a_friction_that_remembers_in_co_simulation_at_1_ms(folders, motion, limit) -> None:
    fine, coarse = motion(1.0, 1e-4), motion(1.0, 1e-3)
    scale = 0.5 if motion is road else 1.0
    x, v = (scale * one for one in coarse)
    expected = core(SEALED, known_of("seals", SOFT), *(scale * one for one in fine))[10::10]
    one = Unit(folders["seals"])
    one.initialise(x[0], v[0], setting=1)
    assert rms(one.run(x, v) - expected) < limit
    one.close()


@runs_here
@pytest.mark.parametrize("name", ["twin_tube", "monotube", "seals"])
def test_a_car_at_rest_does_not_shake(folders, name) -> None:
    body, wheel, spring, tyre, h = 350.0, 40.0, 25e3, 200e3, 1e-3
    one = Unit(folders[name])
    one.initialise(setting=2)
    state, forces, rest = np.array([0.002, 0.0, 0.0, 0.0]), [], one.get("force")
    for i in range(4000):
        one.set("displacement", state[0] - state[1])
        one.set("velocity", state[2] - state[3])
        assert one.step(i * h, h) == OK
        force = one.get("force") - rest + spring * (state[0] - state[1])
        state[2] -= h * force / body
        state[3] += h * (force - tyre * state[1]) / wheel
        state[:2] += h * state[2:]
        forces.append(one.get("force"))
    # On its tyre the car goes on to swing at 3 Hz where friction only stores at such small ways.
    last = np.abs(np.fft.rfft(forces[-1000:]))[10:] / 500.0
    assert np.sqrt(0.5 * np.sum(last**2)) < 1.0
    one.close()


@runs_here
def test_indicators_cross_zero_where_equations_bend(folders) -> None:
    def indicator(place, name, x, v, y):
        one = opened(folders, name, x=x, v=v)
        one.at(0.0, x, v, y)
        found = one.numbers("GetEventIndicators", 4)[place]
        one.close()
        return found

    rest = [0.0, 0.0, 0.0]
    assert indicator(0, "twin_tube", 0.0, 0.99 * BAND, rest) < 0.0
    assert indicator(0, "twin_tube", 0.0, 1.01 * BAND, rest) > 0.0
    assert (
        indicator(0, "seals", 0.0, -1e-6, [*rest, 0.3])
        < 0.0
        < indicator(0, "seals", 0.0, 1e-6, [*rest, 0.3])
    )
    # Oil of 0.9 GPa that is 1e-3 of its volume short of a pressure of 4.6 bar.
    full = LAYOUTS[0].oil_density * LAYOUTS[0].chamber_1_volume
    empty = -full * LAYOUTS[0].gas_pressure / SOFT["k_e"]
    assert indicator(1, "twin_tube", 0.0, 0.0, [1.01 * empty, 0.0, 0.0]) < 0.0
    assert indicator(1, "twin_tube", 0.0, 0.0, [0.99 * empty, 0.0, 0.0]) > 0.0
    assert indicator(3, "monotube", 0.032 * 1.009, 0.0, [0.0, 0.0]) < 0.0
    assert indicator(3, "monotube", 0.032 * 1.011, 0.0, [0.0, 0.0]) > 0.0


@runs_here
def test_a_setting_may_change_and_the_states_follow_the_pressures(folders) -> None:
    one = opened(folders, "seals", x=0.01, v=0.2)
    y = [1.3e-3, -4e-4, 0.0, 0.37]
    one.at(0.0, 0.01, 0.2, y)
    before = [one.get(name) for name in OUTPUTS[1:3]]
    one.set("setting", 2)
    assert one.call("NewDiscreteStates", (ct.c_char * 64)()) == OK
    after = one.numbers("GetContinuousStates", 4)
    assert [one.get(name) for name in OUTPUTS[1:3]] == pytest.approx(before, rel=1e-9)
    assert after[0] != pytest.approx(y[0], rel=1e-3)  # stiffer oil holds less at this pressure
    assert after[3] == 0.37
    one.close()


@runs_here
def test_a_friction_without_a_state_cannot_be_made_to_remember(folders) -> None:
    one = Unit(folders["twin_tube"])
    one.initialise()
    reference = (ct.c_uint * 1)(100 + list(LAYOUTS[0].network.numbers).index("presliding"))
    value = (ct.c_double * 1)(1e-4)
    assert one.call("SetReal", reference, ct.c_size_t(1), value) == ERROR
    one.close()


@pytest.mark.parametrize("name", NAMED)
def test_what_stands_in_the_file(folders, name) -> None:
    root = ET.parse(folders[name] / "modelDescription.xml").getroot()  # noqa: S314
    assert root.find("ModelExchange").get("providesDirectionalDerivative") == "true"
    assert root.find("CoSimulation") is not None
    assert root.get("numberOfEventIndicators") == "4"
    rates = [int(one.get("index")) for one in root.find("ModelStructure/Derivatives")]
    listed = list(root.iter("ScalarVariable"))
    states = [int(listed[i - 1].find("Real").get("derivative")) for i in rates]
    assert [listed[i - 1].get("name") for i in states] == STATES[name]
    assert all(one.get("dependencies") is not None for one in root.iter("Unknown"))
    bare = io.BytesIO()
    with (
        zipfile.ZipFile(folders[name] / "unit.fmu") as archive,
        zipfile.ZipFile(bare, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as smaller,
    ):
        for one in archive.namelist():
            if not one.startswith("binaries"):
                smaller.writestr(one, archive.read(one))
    assert len(bare.getvalue()) < 60_000
