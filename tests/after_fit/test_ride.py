"""The quarter car: against closed forms, against an integrator in time, along a measured stroke."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

import damperfit
from damperfit.after_fit import ride
from damperfit.after_fit.ride import Car, weighting_k
from damperfit.cli import main
from damperfit.configuration.damper_section import damper_record
from damperfit.damper.network import SteppedDamper
from damperfit.errors import DamperfitError
from damperfit.tested.setting import Setting
from tests.laws.valve_logs import VALUES, damper

CAR = Car(
    sprung_mass=300.0,
    unsprung_mass=40.0,
    spring=25e3,
    tyre=200e3,
    tyre_damping=20.0,
    motion_ratio=0.9,
    road="B",
    speed=15.0,
)


@pytest.fixture
def short_road(monkeypatch) -> None:
    """Half of it, where what is asked does not hang on its length."""
    monkeypatch.setattr(ride, "_SECONDS", 0.5 * ride._SECONDS)


def test_the_weighting_is_that_of_the_standard() -> None:
    """Table 3 of ISO 2631-1, W_k."""
    known = {0.5: 0.418, 1.0: 0.482, 2.0: 0.531, 4.0: 0.967, 6.3: 1.054, 16.0: 0.768, 80.0: 0.132}
    assert weighting_k(np.array([*known])) == pytest.approx([*known.values()], rel=0.01)


def test_the_road_has_the_roughness_of_its_class(fitted) -> None:
    road = ride._Road(fitted, CAR)
    profile = np.fft.irfft(road.profile, road.n)
    n, width = road.frequencies, road.frequencies[1]
    inside = (n / 15.0 >= 0.01) & (n / 15.0 <= 10.0)
    expected = np.sum(64e-6 * (n[inside] / 15.0 / 0.1) ** -2.0 / 15.0 * width)
    assert np.var(profile) == pytest.approx(expected, rel=1e-6)


def test_a_stiff_damper_on_a_rough_road_is_as_stepped_with_the_car(fitted, short_road) -> None:
    """The linear part is solved exactly over each step of the damper's."""
    setting, car = fitted.setting(20), CAR.but(road="D", speed=20.0)
    stiff = {name: 3.0 * setting.values[name] for name in ("r_m1", "r_m2", "r_m3")}
    own = replace(setting, parameters=setting.values.replace(stiff))
    found, road = ride.ride_on_road(fitted, car, (own,)).settings[0], ride._Road(fitted, car)
    stepped = SteppedDamper(fitted.damper, own.values, options=road.solver)
    whole, dt = np.zeros((8, 8)), 1.0 / 512.0
    whole[[0, 2], [1, 3]] = 1.0  # of the body's place and speed, and the wheel's
    whole[[1, 3], [[0], [2]]] = 25e3 * np.array([[-1 / 300.0, 1 / 40.0], [1 / 300.0, -9 / 40.0]])
    whole[3, 3:6], whole[1, 4] = (-0.5, 1 / 40.0, 1 / 40.0), -1 / 300.0  # damper and tyre push
    whole[4:6, 6:] = np.eye(2) / dt
    step = expm(dt * whole)[:4]
    push = np.fft.irfft((200e3 + 20.0 * road.s) * road.profile, road.n)
    state, force, at_rest, seen = np.zeros(4), 0.0, stepped.force, []
    for k in range(-road.n // 4, road.n):
        ahead = force
        for _ in range(2):
            changes = ahead - force, push[k] - push[k - 1]
            there = step @ [*state, force, push[k - 1], *changes]
            copy, stroke = stepped.copy(), 0.9 * (there[:2] - there[2:])
            ahead = 0.9 * (copy.step(*stroke, dt) - at_rest)
        stepped, state, force = copy, there, ahead
        seen.append((state[0] - state[2], force, push[k] - 200e3 * state[2] - 20.0 * state[3]))
    stroke, force, load = np.array(seen[-road.n :]).T
    felt = np.fft.rfft((25e3 * stroke + force) / 300.0) * weighting_k(road.frequencies)
    comfort = math.sqrt(2.0 * np.sum(np.abs(felt[1:]) ** 2)) / road.n
    assert found.comfort == pytest.approx(comfort, rel=0.01)
    assert found.wheel_load == pytest.approx(np.std(load), rel=0.01)
    # The damper's mean force, which moves the body by 17 mm, is no part of the ride.
    assert found.stroke == pytest.approx(0.9 * np.std(stroke), rel=0.1)


def test_a_car_is_a_file_or_keys_in_any_unit(short, tmp_path, capsys) -> None:
    path = tmp_path / "car.toml"
    path.write_text(
        '[car]\nsprung_mass = "300kg"\nunsprung_mass = "40kg"\nspring = "25N/mm"\n'
        'tyre = "200N/mm"\nroad = "B"\nspeed = "15m/s"\n'
    )
    keys = {"sprung_mass": 300, "unsprung_mass": 40, "spring": "25N/mm", "tyre": "200N/mm"}
    stiff = damperfit.ride(
        short / "results", car=keys | {"road": "b", "speed": "54km/h"}, setting=2
    )
    assert "body acceleration" in repr(stiff)
    assert main(["ride", str(short / "results"), "--car", str(path), "--json"]) == 0
    soft, again = json.loads(capsys.readouterr().out)["settings"]
    assert again["stroke"] == pytest.approx(stiff.settings[0].stroke)
    assert again["stroke"] < soft["stroke"]  # the stiffer setting moves less


def test_a_measured_stroke_dissipates_what_its_loop_encloses(fitted, tmp_path) -> None:
    """A sine of 20 mm at 1.5 Hz: the power of the bands is the energy of a cycle times 1.5 Hz."""
    time = np.arange(8000) / 1000.0
    path = tmp_path / "lap.csv"
    rows = (f"{t:.4f},{20.0 * math.sin(3.0 * math.pi * t):.6f}\n" for t in time)
    path.write_text("time_s,stroke_mm\n" + "".join(rows))
    driven = damperfit.ride(fitted, stroke=path, setting=10)
    power = sum(band.powers["10"] for band in driven.bands)
    seen = fitted.setting(10).simulate("sine", amplitude=0.02, frequency=1.5, cycles=4)
    last = slice(-667, None)  # one cycle at 1 kHz
    energy = np.trapezoid(seen.force[last], seen.displacement[last])
    assert power == pytest.approx(1.5 * energy, rel=0.02)
    assert sum(band.share for band in driven.bands) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("[car]\nspring = 1", "needs"),
        ("[car", "TOML"),
        ('[car]\nsprung_mass=300\nunsprung_mass=40\nspring=2e4\ntyre=2e5\nroad="Z"', "car.road"),
        ('[car]\nsprung_mass=300\nunsprung_mass=40\nspring=2e4\ntyre="2m"', "car.tyre"),
    ],
)
def test_a_car_that_is_none_is_refused_in_one_line(short, tmp_path, capsys, text, word) -> None:
    (tmp_path / "car.toml").write_text(text)
    assert main(["ride", str(short / "results"), "--car", str(tmp_path / "car.toml")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert word in line


def test_a_car_log_with_semicolons_and_decimal_commas_is_read(fitted, tmp_path) -> None:
    plain, german = tmp_path / "plain.csv", tmp_path / "german.csv"
    rows = [f"{t / 100:.2f},{5.0 * math.sin(t / 7):.4f}" for t in range(400)]
    plain.write_text("\n".join(["time_s,displacement_mm", *rows]))
    german.write_text(
        "\n".join(
            ["Time [s];Damper Pos [mm]", *(r.replace(",", ";").replace(".", ",") for r in rows)]
        )
    )
    first, second = (damperfit.ride(fitted, stroke=path, setting=10) for path in (plain, german))
    assert first.bands == second.bands


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "empty"),
        ("time,displacement\n" + "0,1\n" * 20, "unit"),
        ("time_s,x_mm\n0,1\n", "1 rows"),
        ("time_s,x_mm\n" + "0,1\n" * 20, "time"),
        ("time_s,x_mm\n" + "".join(f"{k},\n" for k in range(20)), "displacement"),
        ("time_s,x_mm\n" + "".join(f"{k / 10 + 40 * (k > 9)},1\n" for k in range(20)), "2 tests"),
    ],
)
def test_a_stroke_that_cannot_be_read_is_one_line(tmp_path, text, word) -> None:
    (tmp_path / "lap.csv").write_text(text)
    with pytest.raises(DamperfitError, match=word) as caught:
        ride.read_stroke(tmp_path / "lap.csv")
    assert "\n" not in str(caught.value)


def test_steps_of_the_converter_are_no_speed(tmp_path) -> None:
    """0.1 mm at 1 kHz would be 0.1 m/s in one sample of ten."""
    path = tmp_path / "lap.csv"
    x = (round(5.0 * math.sin(k / 160) / 0.1) * 0.1 for k in range(8000))
    rows = (f"{k / 1000:.3f},{value:.1f}\n" for k, value in enumerate(x))
    path.write_text("time_s,stroke_mm\n" + "".join(rows))
    motion = ride.read_stroke(path)
    assert np.abs(motion.velocity[500:-500]).max() < 1.3 * 5e-3 / 0.16


def test_the_rig_is_no_part_of_the_car() -> None:
    """Elasticity, play and lag of the rig change nothing on the road."""
    rigid = {"k_s": 0.0, "play": 0.0, "lag": 0.0, "f_0": 0.0}
    ridden = []
    for values in (VALUES, VALUES | rigid):
        record = {"configuration": {"damper": damper_record(damper())}}
        row = {"setting": Setting.of(1), **dict(damper().values(values))}
        run = damperfit.Run(record, {"parameters": [row]}, quantities=damper().quantities)
        ridden.append(ride.ride_on_road(run, CAR, run.settings).settings)
    assert ridden[0] == ridden[1]


@pytest.mark.parametrize("name", ["picture.svg", "new/picture.png"])
def test_a_ride_and_a_stroke_are_drawn(fitted, tmp_path, name) -> None:
    given = {"car": vars(CAR), "setting": 5}
    if name.endswith("svg"):
        given = {"stroke": tmp_path / "lap.csv", "setting": 5}
        rows = (f"{k / 200:.3f},{5.0 * math.sin(k / 9):.4f}" for k in range(800))
        given["stroke"].write_text("\n".join(["time_s,displacement_mm", *rows]))
    damperfit.ride(fitted, plot=tmp_path / name, **given)
    assert (tmp_path / name).stat().st_size > 5000
    with pytest.raises(DamperfitError, match="ends in"):
        damperfit.ride(fitted, plot=tmp_path / "x.jpg", **given)


def test_the_interval_is_how_far_the_errors_of_the_values_move_it(fitted, short_road) -> None:
    """Of one value 2 % off by noise and misfit, as at the ends of its interval."""
    setting = fitted.setting(3)
    noise, misfit = np.array([[0.012**2]]), {"r_m1": 0.016 * setting.values["r_m1"]}

    def ridden(step: float) -> np.ndarray:
        moved = setting.values.replace({"r_m1": setting.values["r_m1"] * math.exp(step)})
        known = {"own": ("r_m1",), "shared": (), "covariance": noise, "misfits": misfit}
        own = replace(setting, parameters=moved, **known)
        (row,) = ride.ride_on_road(fitted, CAR, (own,)).settings
        return np.array([row[1:3], row[5:7]])

    (low, _), (_, errors), (high, _) = map(ridden, (-0.0392, 0.0, 0.0392))
    assert errors == pytest.approx(0.5 * np.abs(high - low), rel=0.1)


def test_a_setting_that_is_beaten_within_its_interval_is_said_so() -> None:
    rows = [
        ride.RideOfSetting(label, comfort, load, 0.2, 0.01, 0.02, 2.0, 0.0, 0.0)
        for label, comfort, load in (("1", 1.0, 700.0), ("2", 1.02, 702.0), ("3", 1.2, 702.0))
    ]
    answer = ride.Ride(CAR, tuple(rows))
    assert (answer.pareto, answer.undecided) == (("1",), ("2", "3"))
    assert [row[-1] for row in answer.sheets()[0].rows] == ["*", "(*)", "(*)"]
    certain = ride.Ride(CAR, (rows[0], rows[2]._replace(wheel_load=704.0)))
    assert certain.undecided == ()


def test_a_car_that_needs_more_stroke_than_there_is_is_left_out(fitted, monkeypatch) -> None:
    monkeypatch.setattr(ride, "_SECONDS", 4.0)
    rough = CAR.but(road="F", speed=15.0)
    rides = ride.ride_on_road(fitted, rough, (fitted.setting(1), fitted.setting(20)))
    assert rides.lost == ("1",)
    assert "bump stops" in repr(rides)
