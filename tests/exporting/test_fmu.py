"""FMUs of FMI 2.0 and 3.0, run by small importers of our own against the core that fits."""

import ctypes as ct
import zipfile
from dataclasses import replace
from io import BytesIO
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from damperfit.damper.rivals import Linear
from damperfit.errors import ConfigurationError
from damperfit.exporting import fmu as libraries
from damperfit.exporting.fmu import exported_damper
from damperfit.exporting.targets import TARGETS
from damperfit.simulation import Motion, SolverOptions, simulate
from damperfit.tested.setting import Setting
from tests.exporting.clients import ERROR, OK, Unit, Unit3, unzip
from tests.exporting.units import (
    BAND,
    CASES,
    SOFT,
    STATES,
    core,
    exported,
    rms,
    road,
    runs_here,
    sine,
)

RATES = {"oil_1": "flow_1", "oil_2": "flow_2", "outside": "is_outside", "grip": "grip_rate"}
OUTPUTS = ("force", "pressure_1", "pressure_2", "pressure_3")


def member(content: bytes, name: str) -> str:
    with zipfile.ZipFile(BytesIO(content)) as archive:
        return archive.read(name).decode()


def fmu_of(run, version=2) -> bytes:
    return TARGETS[f"fmu{version}"].export(run).files["damper.fmu"]


# What stands in the file.


@pytest.mark.parametrize("version", [2, 3])
def test_what_stands_in_the_file(handed, version) -> None:
    first, *others = handed.settings
    known = {"own": ("f_f",), "shared": (), "covariance": np.array([[1e-4]])}
    tared = replace(first, parameters=first.values.replace(f_0=-12.5), **known)
    content = fmu_of(replace(handed, settings=(tared, *others)), version)
    with zipfile.ZipFile(BytesIO(content)) as archive:
        names = set(archive.namelist())
        sizes = [one.compress_size for one in archive.infolist() if "binaries" not in one.filename]
    assert sum(sizes) < 60_000
    assert {"resources/damper.txt", f"sources/fmi{version}.c", "sources/network.c"} <= names
    told = "modelDescription.xml" if version == 2 else "sources/buildDescription.xml"
    root = ET.fromstring(member(content, told))  # noqa: S314
    listed = {one.get("name") for kind in ("File", "SourceFile") for one in root.iter(kind)}
    assert listed == {name[8:] for name in names if name.endswith(".c")}
    assert member(content, "documentation/licenses/LICENSE.txt").startswith("MIT License")
    # Whose it is, where it holds and what was left out, and nothing of it as markup.
    page = member(content, "documentation/index.html")
    for fact in (
        *("A &lt;7&gt; &amp;", handed.run.digest, "amplitude to 32 mm", "no mounting (rigid)"),
        *("tare of the rig -12.5 to 0 N", "within 5 % of the damping"),
        "± 0.98",  # 1.96 times 1 % of 50 N
    ):
        assert fact in page
    described = ET.fromstring(member(content, "modelDescription.xml"))  # noqa: S314
    assert described.get("modelName") == 'front left A <7> & "8"'


def test_a_library_of_other_sources_is_none(tmp_path, monkeypatch) -> None:
    folder = tmp_path / "x86_64-linux"
    folder.mkdir()
    (folder / "damperfit.so").write_bytes(b"library")
    monkeypatch.setattr(libraries, "BINARIES", tmp_path)
    for digest, platforms in (("0" * 64, []), (libraries.sources_digest(), ["linux64"])):
        (folder / libraries.DIGEST).write_text(digest)
        assert [one.fmi2 for one in libraries.built()] == platforms


def test_another_model_is_refused(handed) -> None:
    linear = Linear()
    one = replace(handed.settings[0], parameters=linear.values({"c": 1e3, "f_0": 0.0}))
    with pytest.raises(ConfigurationError, match=r"linear cannot be an FMU.*--list"):
        fmu_of(replace(handed, damper=linear, settings=(one,)))


@pytest.mark.parametrize(
    ("places", "numbers", "start"),
    [
        (("soft", 1.5, "C8"), {1: "soft", 2: "1.5", 3: "C8"}, 2),
        ((-3, 0, 2), {-3: "-3", 0: "0", 2: "2"}, 0),
    ],
)
def test_settings_carry_their_labels(handed, places, numbers, start) -> None:
    """Whole numbers of one adjuster stay; others are counted, and the description says which."""
    settings = tuple(
        replace(one, setting=Setting.of(place))
        for one, place in zip(handed.settings, places, strict=True)
    )
    run = replace(handed, settings=settings)
    root = ET.fromstring(member(fmu_of(run), "modelDescription.xml"))  # noqa: S314
    (variable,) = [one for one in root.iter("ScalarVariable") if one.get("name") == "setting"]
    words = [str(k) if str(k) == word else f"{k}: {word}" for k, word in numbers.items()]
    assert variable.get("description").endswith("one of " + ", ".join(words))
    assert variable.find("Integer").get("start") == str(start)


# What it does.


@pytest.fixture(scope="session")
def folders(handed, tmp_path_factory):
    made = {}
    for name in CASES:
        for version in (2, 3):
            # What importers must not stumble over: blanks, per cent and umlauts in the path.
            folder = tmp_path_factory.mktemp(name) / "a b%20ü"
            made[name, version] = unzip(fmu_of(exported(handed, name), version), folder)
    return made


@pytest.fixture
def unit(folders):
    """Make instances, which are closed afterwards."""
    made = []

    def make(name, **how) -> Unit:
        made.append(Unit(folders[name, 2], **how))
        return made[-1]

    yield make
    for one in made:
        if one.component:
            one.close()


def opened(unit, name, x=0.0, v=0.0, setting=1) -> Unit:
    """An instance of model exchange."""
    one = unit(name, is_exchange=True)
    one.initialise(x, v, setting=setting)
    one.call("EnterContinuousTimeMode")
    return one


@runs_here
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize(("motion", "limit"), [(sine, 0.1), (road, 5.0)])
def test_co_simulation_at_1_ms_by_both_standards(unit, folders, name, motion, limit) -> None:
    (x, v), fine = motion(1.0), motion(1.0, 1e-4)
    for setting in (1, 2):
        expected = core(name, setting, *fine)[10::10]
        one = unit(name)
        one.initialise(x[0], v[0], setting=setting)
        force = one.run(x, v)
        assert rms(force - expected) < limit
        last = unit(name)
        last.initialise(x[0], v[0], setting=setting, input_extrapolation=0)
        assert rms(last.run(x, v, is_of_end=True) - expected) < 0.2
        other = Unit3(folders[name, 3])
        other.begin(x[0], v[0], setting)
        assert np.array_equal(other.run(x, v), force)  # bit for bit


@runs_here
@pytest.mark.parametrize("name", ["paper", "twin_tube", "monotube", "through_flow", "declared"])
def test_setting_and_numbers_may_change_in_mid_run_and_the_pressures_stay(unit, name) -> None:
    x, v = sine(1.4)
    own = {"k_e": 1e9, "f_f": 45.0}
    for change, setting, changed in (({"setting": 2}, 2, {}), (own, 1, own)):
        one = unit(name)
        one.initialise(x[0], v[0], setting=1)
        one.run(x[:251], v[:251])
        before = [one.get(f"pressure_{i}") for i in (1, 2)]
        for number, value in change.items():
            assert one.set(number, value) == OK
        assert [one.get(f"pressure_{i}") for i in (1, 2)] == pytest.approx(before, rel=3e-3)
        force = one.run(x[250:], v[250:], start=0.25)
        expected = core(name, setting, *sine(1.4, 1e-4), **changed)[2510::10]
        assert rms(force[700:] - expected[700:]) < 0.1


@runs_here
@pytest.mark.parametrize("name", ["paper", "twin_tube", "seals", "grip"])
def test_a_state_is_taken_up_bit_for_bit_also_from_its_bytes(unit, name) -> None:
    x, v = sine(0.4)
    one = unit(name)
    one.initialise(x[0], v[0], setting=1)
    one.run(x[:172], v[:172])  # just behind a turn: friction is between its ends
    kept, size = one.state(), ct.c_size_t()
    first = one.run(x[171:300], v[171:300], start=0.171)
    one.restore(kept)
    assert np.array_equal(one.run(x[171:300], v[171:300], start=0.171), first)
    assert one.call("SerializedFMUstateSize", kept, ct.byref(size)) == OK
    content = ct.create_string_buffer(size.value)
    assert one.call("SerializeFMUstate", kept, content, size) == OK
    other = unit(name)
    other.initialise()
    taken = ct.c_void_p(None)
    assert other.call("DeSerializeFMUstate", content, size, ct.byref(taken)) == OK
    other.restore(taken)
    assert np.array_equal(other.run(x[171:300], v[171:300], start=0.171), first)
    content[3] = b"?"
    assert other.call("DeSerializeFMUstate", content, size, ct.byref(taken)) == ERROR
    for each, state in ((one, kept), (other, taken)):
        assert each.call("FreeFMUstate", ct.byref(state)) == OK
        assert state.value is None


@runs_here
@pytest.mark.parametrize("name", ["paper", "twin_tube"])
def test_what_cannot_be_set_is_refused(unit, name) -> None:
    one = unit(name)
    one.initialise()
    assert one.set("setting", 7) == ERROR
    assert "was not identified" in one.said[-1]
    for variable, value in (
        ("k_e", -1.0), ("friction_band", 0.0), ("displacement", np.nan), ("velocity", np.inf),
        ("input_extrapolation", 3), ("force", 1.0),
    ):  # fmt: skip
        assert one.set(variable, value) == ERROR, variable
    assert one.set("f_f", 0.0) == one.set("f_0", -5.0) == OK
    if name == "twin_tube":
        assert one.set("carry_derivatives", 1) == ERROR  # too late
        # A friction that remembers would need a state.
        place = list(CASES[name][0].network.numbers).index("presliding")
        reference, value = (ct.c_uint * 1)(100 + place), (ct.c_double * 1)(1e-4)
        assert one.call("SetReal", reference, ct.c_size_t(1), value) == ERROR
    stranger = unit(name, token="{1234}")  # noqa: S106
    assert stranger.component is None
    assert "token" in stranger.said[-1]


@runs_here
def test_a_step_that_cannot_be_is_discarded_and_may_be_tried_again(unit, folders) -> None:
    x, v = sine(1.0)
    one = unit("paper")
    one.initialise(x[0], v[0], setting=1)
    one.run(x[:101], v[:101])
    before, reached = one.get("force"), ct.c_double()
    one.set("displacement", 0.5)
    assert one.step(0.1, 1e-3) == 2  # fmi2Discard
    assert "no volume" in one.said[-1]
    assert one.call("GetRealStatus", 2, ct.byref(reached)) == OK
    assert reached.value == pytest.approx(0.1)
    assert one.get("force") == before
    expected = core("paper", 1, *sine(1.0, interval=1e-4))[1010::10]
    assert rms(one.run(x[100:], v[100:], start=0.1) - expected) < 0.1
    other = Unit3(folders["paper", 3])
    other.begin(0.0, 0.1, 1)
    other.number("displacement", "Set", 0.5)
    assert other.step(0.0, 1e-3) == (2, 0.0)  # fmi3Discard


@runs_here
def test_it_begins_at_rest_and_the_air_on_the_rod_goes_along(handed, unit, tmp_path) -> None:
    one = unit("paper")
    one.initialise(0.01, 0.1, setting=2)
    at = np.array([0.01]), np.array([0.1])
    assert one.get("force") == pytest.approx(core("paper", 2, *at)[0])
    pressures = [one.get(f"pressure_{i}") for i in (1, 2, 3)]
    assert max(pressures) - min(pressures) < 1.0
    run = exported(handed, "paper")
    run = replace(run, damper=replace(run.damper, ambient_pressure=101325.0))
    with_air = Unit(unzip(fmu_of(run), tmp_path / "unit"))
    with_air.initialise(0.01, 0.1, setting=2)
    air = with_air.get("force") - one.get("force")
    with_air.close()
    assert air == pytest.approx(run.damper.rod_area * 101325.0, rel=1e-9)


@runs_here
def test_time_outside_of_the_tested_range_is_counted(unit) -> None:
    def seconds(amplitude: float) -> float:
        x, v = sine(2.0 / 3.0, amplitude=amplitude)
        one = unit("paper")
        one.initialise(x[0], v[0], setting=1)
        one.run(x, v)
        return one.get("seconds_outside_tested_range")

    assert seconds(0.032 * 1.009) == 0.0
    # Beyond |x| or |v| of the test by 1 % around each of the eight extremes of a cycle.
    share = 8.0 * np.arccos(1.01 * 0.032 / 0.036) / (2.0 * np.pi)
    assert seconds(0.036) == pytest.approx(share * 2.0 / 3.0, abs=0.006)


@runs_here
@pytest.mark.parametrize("name", ["paper", "twin_tube", "monotube", "seals"])
def test_a_car_at_rest_does_not_shake(unit, name) -> None:
    """A quarter car left to itself: its damper's force must come to rest."""
    body, wheel, spring, tyre, h = 350.0, 40.0, 25e3, 200e3, 1e-3
    one = unit(name)
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


# Derivatives, and model exchange.


@runs_here
@pytest.mark.parametrize("name", ["paper", "twin_tube", "monotube", "seals"])
def test_slopes_in_co_simulation_are_those_of_the_run(unit, name) -> None:
    x, v = sine(0.401)
    damper, values, _ = CASES[name]
    asked = [one for one in damper.names if one != "f_0"]
    tolerance = SolverOptions().tolerance if name == "paper" else 0.03
    response = simulate(
        values.replace(f_0=0.0), damper, Motion(1e-3, x, v), sensitivities=asked,
        options=SolverOptions(tolerance=tolerance, dead_band=BAND),
    )  # fmt: skip
    one = unit(name)
    carried = {} if name == "paper" else {"carry_derivatives": 1}
    one.initialise(x[0], v[0], setting=1, input_extrapolation=0, **carried)
    force = one.run(x, v, is_of_end=True)
    assert rms(force - response.force[1:]) < 1e-2
    for each in asked:
        row = response.sensitivities[each]
        assert abs(one.slope("force", each) - row[-1]) < 2e-5 * np.abs(row).max(), each
    assert one.slope("force", "f_0") == 1.0


@runs_here
def test_what_a_number_did_before_it_changed_is_not_counted(unit) -> None:
    """In mid-run k_e becomes another one; the opening in bump is that of both settings."""
    x, v = sine(0.5)

    def run(**parameters):
        one = unit("twin_tube")
        one.initialise(x[0], v[0], setting=1, carry_derivatives=1, **parameters)
        one.run(x[:251], v[:251])
        before = [one.slope("pressure_2", name) for name in ("compression_opening", "k_e")]
        one.set("setting", 2)
        after = [one.slope("pressure_2", name) for name in ("compression_opening", "k_e")]
        one.run(x[250:260], v[250:260], start=0.25)
        return one.get("pressure_2"), before, after, one.slope("pressure_2", "compression_opening")

    _, (shared, own), (still, anew), later = run()
    assert shared != 0.0
    assert still == pytest.approx(shared, rel=1e-9)
    assert abs(anew) < 1e-9 * abs(own)
    ends = [run(compression_opening=3e5 + d)[0] for d in (-30.0, 30.0)]
    assert later == pytest.approx((ends[1] - ends[0]) / 60.0, rel=1e-3)


@runs_here
@pytest.mark.parametrize("name", CASES)
def test_model_exchange_with_exact_inputs(unit, name) -> None:
    from scipy.integrate import solve_ivp

    w, a, duration, states = 2.0 * np.pi * 1.5, 0.032, 0.7, STATES[name]
    one = opened(unit, name, v=a * w, setting=2)

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
    expected = core(name, 2, *sine(duration, interval=fine), fine)
    seen = np.interp(done.t, np.arange(len(expected)) * fine, expected)
    settled = done.t > 0.1
    assert np.sqrt(np.mean((np.array(force) - seen)[settled] ** 2)) < 0.1


def points(name):
    """Rebound, bump, and near rest, where friction turns: x, v and the states."""
    damper, values, _ = CASES[name]
    for x, v, p_1, p_2 in (
        (0.01, 0.3, 21e5, 3e5), (-0.012, -0.25, 4e5, 9e5), (0.004, 0.003, 8e5, 4e5),
    ):  # fmt: skip
        v_1 = damper.chamber_1_volume - damper.annulus_area * x
        v_2 = damper.chamber_2_volume + damper.piston_area * x
        oil = [
            damper.oil_density * full * (p - damper.gas_pressure) / values.k_e
            for full, p in ((v_1, p_1), (v_2, p_2))
        ]
        held = dict(zip(("oil_1", "oil_2"), oil, strict=True)) | {"outside": 0.0, "grip": 0.37}
        yield x, v, [held[state] for state in STATES[name]]


@runs_here
@pytest.mark.parametrize("name", [name for name in CASES if name != "declared"])
def test_slopes_are_those_of_the_equations_and_each_is_declared(
    unit, folders, handed, name
) -> None:
    one, states = opened(unit, name), STATES[name]
    damper = exported_damper(exported(handed, name))
    # At its end without free gas an empty chamber has no slope by it.
    left_out = {"f_0"} | (set() if name == "seals" else {"free_gas"})
    numbers = [each["name"] for each in damper.numbers if each["name"] not in left_out]
    unknowns = (*OUTPUTS, *(RATES[state] for state in states if state != "outside"))
    followed = _declared(folders[name, 2])
    for x, v, y in points(name):
        one.at(0.0, x, v, y)
        at = {known: one.get(known) for known in [*numbers, "friction_band"]}
        at |= {"displacement": x, "velocity": v} | dict(zip(states, y, strict=True))
        del at["outside"]
        for known, here in at.items():
            d = 1e-6 * (abs(here) or 1e-3)
            found = {}
            sides = (-1.0 if here or known in states else 0.0, 1.0)  # no number is negative
            is_state_or_input = known in {"displacement", "velocity", *states}
            for side in sides:
                if is_state_or_input:
                    moved = dict(zip(states, y, strict=True)) | {"displacement": x, "velocity": v}
                    moved[known] += side * d
                    there = [moved[state] for state in states]
                    one.at(0.0, moved["displacement"], moved["velocity"], there)
                else:
                    assert one.set(known, here + side * d) == OK
                    one.get("force")  # takes the number up, at the pressures as they are
                    one.at(0.0, x, v, y)  # but it is the states that are held
                found[side] = np.array([one.get(unknown) for unknown in unknowns])
            if not is_state_or_input:
                one.set(known, here)
                one.get("force")
            one.at(0.0, x, v, y)
            numeric = (found[1.0] - found[sides[0]]) / (d * (1.0 - sides[0]))
            for unknown, expected in zip(unknowns, numeric, strict=True):
                exact = one.slope(unknown, known)
                size = abs(one.get(unknown)) / (abs(here) or 1e-3)
                error = abs(expected - exact)
                assert error <= 1e-4 * abs(exact) + 1e-8 * size, (unknown, known, exact, expected)
                if exact and is_state_or_input:
                    assert known in followed[unknown], (unknown, known)


def _declared(folder) -> dict[str, set[str]]:
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
def test_adjoint_and_directional_derivatives_are_of_one_matrix(folders) -> None:
    one = Unit3(folders["paper", 3], is_exchange=True)
    one.begin(0.01, 0.2, 1)
    size = ct.c_size_t(3)
    assert one.call("SetContinuousStates", (ct.c_double * 3)(8e-4, -2e-4, 0.0), size) == 0
    unknowns, knowns = (
        (ct.c_uint32 * 3)(*(one.references[name] for name in names))
        for names in (("force", "flow_1", "flow_2"), ("oil_1", "oil_2", "displacement"))
    )

    def matrix(name):
        rows = np.empty((3, 3))
        for k in range(3):
            seed, found = (ct.c_double * 3)(*np.eye(3)[k]), (ct.c_double * 3)()
            assert one.call(name, unknowns, size, knowns, size, seed, size, found, size) == 0
            rows[k] = found[:]
        return rows

    forward = matrix("GetDirectionalDerivative").T
    assert np.array_equal(forward, matrix("GetAdjointDerivative"))
    assert np.count_nonzero(forward) >= 6


@runs_here
def test_indicators_cross_zero_where_equations_bend(unit) -> None:
    def indicator(place, name, x, v, y):
        one = opened(unit, name, x, v)
        one.at(0.0, x, v, y)
        return one.numbers("GetEventIndicators", 4)[place]

    rest, damper = [0.0, 0.0, 0.0], CASES["twin_tube"][0]
    empty = -damper.oil_density * damper.chamber_1_volume * damper.gas_pressure / SOFT["k_e"]
    for place, name, below, above in (
        (0, "twin_tube", (0.0, 0.99 * BAND, rest), (0.0, 1.01 * BAND, rest)),
        (0, "seals", (0.0, -1e-6, [*rest, 0.3]), (0.0, 1e-6, [*rest, 0.3])),
        (1, "twin_tube", (0.0, 0.0, [1.01 * empty, *rest[:2]]), (0.0, 0.0, [0.99 * empty, 0, 0])),
        (3, "monotube", (0.032 * 1.009, 0.0, rest[:2]), (0.032 * 1.011, 0.0, rest[:2])),
    ):
        assert indicator(place, name, *below) < 0.0 < indicator(place, name, *above), name


@runs_here
def test_a_setting_may_change_and_the_states_follow_the_pressures(unit) -> None:
    one = opened(unit, "seals", 0.01, 0.2)
    y, info = [1.3e-3, -4e-4, 0.0, 0.37], (ct.c_int * 16)()
    one.at(0.0, 0.01, 0.2, y)
    before = [one.get(name) for name in OUTPUTS[1:3]]
    one.set("setting", 2)
    assert one.call("NewDiscreteStates", info) == OK
    assert info[3] == 1  # their values changed
    after = one.numbers("GetContinuousStates", 4)
    assert [one.get(name) for name in OUTPUTS[1:3]] == pytest.approx(before, rel=1e-9)
    assert after[0] != pytest.approx(y[0], rel=1e-3)  # stiffer oil holds less at this pressure
    assert after[3] == 0.37
