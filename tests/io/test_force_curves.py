"""Curves without time: points and loops, by stroke and setting, with the project's signs."""

from __future__ import annotations

import json

import numpy as np
import pytest

from damperfit.errors import LogError, TimelessError
from damperfit.io import ReadOptions, read_curves, read_log

UNITS = ReadOptions(units={"velocity": "mm/s", "force": "N"})
BY_SETTING = """(25-4.3) V-C,C,V-R,R,(12-4.3) V-C,C,V-R,R
50,100,50,200,50,80,50,150
100,180,100,420,100,150,100,330
200,300,200,900,,,200,700
"""
LABELS = ("25-4.3", "12-4.3")
LONG = "Speed (m/s),Rebound (N),Bump (N)\n0.05,100,-50\n0.1,200,-90\n0.3,700,-300\n"


@pytest.fixture
def put(tmp_path):
    def write(text: str, name: str = "curves.csv"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


def _points(curve, stroke: str) -> list[tuple[float, float]]:
    return [(round(float(v), 6), float(f)) for v, f in zip(*curve.points(stroke), strict=True)]


@pytest.mark.parametrize(
    "names",
    [
        "(25-4.3) V-C,C,V-R,R,(12-4.3) V-C,C,V-R,R",
        ",".join(f"({one}) {name}" for one in LABELS for name in ("V-C", "C", "V-R", "R")),
        "(25-4.3) V-C,C,V-R,R,(12-4.3) V-C,C.1,V-R.1,R.1",
    ],
)
def test_columns_by_setting_and_stroke(put, names) -> None:
    text = BY_SETTING.replace(BY_SETTING.splitlines()[0], names)
    first, second = read_curves(put(text), UNITS)
    assert (first.label, second.label) == ("25-4.3", "12-4.3")
    assert _points(first, "rebound") == [(0.05, 200.0), (0.1, 420.0), (0.2, 900.0)]
    # Bump is written as positive numbers; inside it is negative.
    assert _points(first, "bump") == [(0.05, -100.0), (0.1, -180.0), (0.2, -300.0)]
    assert _points(second, "bump") == [(0.05, -80.0), (0.1, -150.0)]  # a blank was not measured
    assert first.notes[-1] == "bump: forces reversed, as they are of the other sign"


def test_a_units_row_below_such_names(put) -> None:
    units = ",".join(["mm/s", "daN"] * 4)
    first, _ = read_curves(put(BY_SETTING.replace("\n", f"\n{units}\n", 1)))
    assert _points(first, "rebound")[0] == (0.05, 2000.0)


def test_one_speed_for_both_strokes(put) -> None:
    (curve,) = read_curves(put(LONG))
    assert curve.label == "curves.csv"
    assert _points(curve, "rebound") == [(0.05, 100.0), (0.1, 200.0), (0.3, 700.0)]
    assert _points(curve, "bump") == [(0.05, -50.0), (0.1, -90.0), (0.3, -300.0)]
    assert curve.force_at(0.2, "bump") == pytest.approx(-195.0)
    assert np.isnan(curve.force_at(0.31, "bump"))
    assert np.isnan(curve.force_at(0.04, "bump"))
    assert np.isnan(curve.hysteresis_at(0.1, "bump"))


def test_one_force_a_setting_beside_one_speed(put) -> None:
    text = "v [m/s];Click 3 (kN);Click 7 (kN)\n-0,1;-0,2;-0,3\n0,1;0,4;0,5\n0,2;0,8;0,9\n"
    first, second = read_curves(put(text))
    assert (first.label, second.label) == ("Click 3", "Click 7")
    assert _points(second, "rebound") == [(0.1, 500.0), (0.2, 900.0)]
    assert _points(first, "bump") == [(0.1, -200.0)]


def test_a_column_of_settings_parts_the_rows(put) -> None:
    text = "setting,speed_mm/s,force_N\n3,-100,-200\n3,100,300\n7,-100,-250\n7,100,400\n"
    curves = read_curves(put(text))
    assert [curve.label for curve in curves] == ["3", "7"]
    assert _points(curves[1], "bump") == [(0.1, -250.0)]


@pytest.mark.parametrize("name", ["click", "Clicks", "Klick", "Raste", "cran"])
def test_a_column_of_clicks_does_too(put, name) -> None:
    """All clicks were one curve, whose forces were their mean."""
    head = f"{name};speed mm/s;rebound_N;compression_N\n"
    curves = read_curves(put(head + "3;100;300;-200\n3;200;500;-350\n7;100;400;-250\n"))
    assert [curve.label for curve in curves] == ["3", "7"]
    assert _points(curves[0], "rebound") == [(0.1, 300.0), (0.2, 500.0)]
    assert _points(curves[1], "bump") == [(0.1, -250.0)]


@pytest.mark.parametrize(
    ("names", "labels"),
    [
        ("0 clicks R,0 clicks C,4 clicks R,4 clicks C", ["0 clicks", "4 clicks"]),
        ("R_soft_N,C_soft_N,R_hard_N,C_hard_N", ["soft", "hard"]),
        ("Zug 3 (N),Druck 3 (N),Zug 7 (N),Druck 7 (N)", ["3", "7"]),
        ("rebound_N,bump_N,rebound_N.1,bump_N.1", ["curve 1", "curve 2"]),
    ],
)
def test_a_stroke_that_is_there_twice_is_two_curves(put, names, labels) -> None:
    """Both were one curve, the mean of both; and the C of "clicks C" was a degree."""
    text = f"speed mm/s,{names}\n100,300,-200,400,-250\n200,500,-350,600,-400\n"
    curves = read_curves(put(text), ReadOptions(units={"force": "N"}))
    assert [curve.label for curve in curves] == labels
    assert _points(curves[0], "rebound") == [(0.1, 300.0), (0.2, 500.0)]
    assert _points(curves[1], "bump") == [(0.1, -250.0), (0.2, -400.0)]


@pytest.mark.parametrize("speed", ["speed mm/s", "velocity_mm_s", "Speed, mm/s", "vel_mm/s"])
def test_a_speeds_unit_is_the_whole_of_it(put, speed) -> None:
    """The s of mm/s was taken for seconds, and the speed had no unit."""
    separator = "\t" if "," in speed else ","
    text = separator.join([speed, "force N"]) + "\n"
    text += "\n".join(separator.join(row) for row in (("100", "300"), ("-200", "-500"))) + "\n"
    (curve,) = read_curves(put(text))
    assert _points(curve, "rebound") == [(0.1, 300.0)]


def test_columns_may_be_declared(put) -> None:
    path = put("a,b\n-0.1,-200\n0.1,300\n0.2,500\n")
    with pytest.raises(LogError, match="no speed with a force beside it"):
        read_curves(path)
    declared = ReadOptions(
        columns={"velocity": "a", "force": 2}, units={"velocity": "m/s", "force": "N"}
    )
    (curve,) = read_curves(path, declared)
    assert _points(curve, "rebound") == [(0.1, 300.0), (0.2, 500.0)]


def test_speeds_without_sign_take_the_stroke_from_the_force(put) -> None:
    (curve,) = read_curves(put("speed_m/s,force_N\n0.1,300\n0.1,-200\n0.2,500\n0.2,-320\n"))
    assert _points(curve, "bump") == [(0.1, -200.0), (0.2, -320.0)]
    assert "rebound: where forces are positive, as logged" in curve.notes


def test_points_in_any_order_and_twice(put) -> None:
    (curve,) = read_curves(put("speed_m/s,Rebound (N)\n0.3,700\n0.1,190\n0.2,450\n0.1,210\n"))
    assert curve.force_at(0.1, "rebound") == pytest.approx(200.0)
    assert curve.force_at(0.15, "rebound") == pytest.approx(325.0)


def test_a_loop_has_two_branches(put) -> None:
    t = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    v = 0.3 * np.sin(t)
    force = 1000.0 * v + 40.0 * np.cos(t)  # opening 80 N above closing near no speed
    text = "velocity_m/s,force_N\n" + "".join(
        f"{a:.6f},{b:.4f}\n" for a, b in zip(v, force, strict=True)
    )
    (curve,) = read_curves(put(text))
    assert curve.force_at(0.15, "rebound") == pytest.approx(150.0, abs=0.5)
    assert curve.hysteresis_at(0.15, "rebound") == pytest.approx(80.0 * np.sqrt(0.75), abs=0.5)
    assert curve.force_at(0.15, "bump") == pytest.approx(-150.0, abs=0.5)


def test_any_format_may_hold_them(put) -> None:
    columns = {"speed_m/s": [0.1, 0.2], "Rebound (N)": [1.0, 2.0], "setting": 5}
    (curve,) = read_curves(put(json.dumps(columns), "curves.json"))
    assert curve.label == "5"
    assert _points(curve, "rebound") == [(0.1, 1.0), (0.2, 2.0)]


REFUSED = {
    "no units": (
        BY_SETTING,
        "(--rig units.velocity=m/s); (2) column 'C' has no unit, needed for force",
    ),
    "opposite signs": (
        "speed_m/s,force_N\n-0.1,200\n0.1,-300\n0.2,-500\n",
        "forces are positive where speeds are negative; declare which counts positive in bump",
    ),
    "one sign": (
        "speed_m/s,force_N\n0.05,100\n0.1,200\n0.2,500\n",
        "all speeds and forces are of one sign, which leaves open which is rebound",
    ),
    "a force without a speed": (
        "speed_m/s,Rebound (N)\n0.1,200\n,300\n0.2,500\n",
        "line 3: column 2, 'Rebound (N)': a force without a speed",
    ),
    "text": (
        "speed_m/s,Rebound (N)\n0.1,200\n0.15,OVR\n0.2,500\n",
        "line 3: column 2, 'Rebound (N)' is 'OVR', expected a number",
    ),
    "infinite": ("speed_m/s,Rebound (N)\n0.1,200\n0.15,inf\n0.2,500\n", "is infinite"),
    "blank": ("speed_m/s,Rebound (N),Bump (N)\n,,1\n,,2\n,,3\n", "a force without a speed"),
    "time": (
        "time_s,speed_m/s,force_N\n0,-0.1,200\n1,0.1,-300\n2,0.2,-500\n",
        "has a time column, so it is a log, not a curve",
    ),
    "no speed": ("displacement_mm,force_N\n1,2\n2,3\n3,4\n", "no speed with a force beside it"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_told_is_one_line(put, case) -> None:
    text, says = REFUSED[case]
    with pytest.raises(LogError) as caught:
        read_curves(put(text))
    message = str(caught.value)
    assert message.startswith("curves.csv")
    assert says in message
    assert message.isprintable()


def test_declared_signs_are_taken(put) -> None:
    path = put("speed_m/s,force_N\n-0.1,200\n0.1,-300\n0.2,-500\n")
    (curve,) = read_curves(path, ReadOptions(reverse_displacement=True))
    assert _points(curve, "rebound") == [(0.1, 200.0)]
    (other,) = read_curves(path, ReadOptions(reverse_force=True))
    assert _points(other, "rebound") == [(0.1, 300.0), (0.2, 500.0)]


# A log, or what was meant as one


def test_as_a_log_they_are_told_to_lack_time(put) -> None:
    with pytest.raises(TimelessError, match="speed and force without time, and a fit needs"):
        read_log(put(LONG))


@pytest.mark.parametrize(
    "text",
    [
        "displacement_mm,force_N\n1,2\n2,3\n3,4\n",  # no speed
        "time_s,speed_m/s,force_N\n0,1,2\n1,2,3\n2,3,4\n",  # time, but no displacement
    ],
)
def test_what_is_no_curve_keeps_its_own_sentence(put, text) -> None:
    with pytest.raises(LogError, match="no column for") as caught:
        read_log(put(text))
    assert type(caught.value) is LogError


def test_with_a_declared_rate_it_is_a_log(put) -> None:
    with pytest.raises(LogError, match="no column for displacement") as caught:
        read_log(put("speed_m/s,force_N\n1,2\n2,3\n3,4\n"), ReadOptions(sample_rate=100.0))
    assert type(caught.value) is LogError


def test_hundreds_of_curves_have_a_limit(put) -> None:
    def table(n: int) -> str:
        names = ",".join(f"Click {k} (N)" for k in range(n))
        rows = "".join(f"{v},{','.join([str(100 * v)] * n)}\n" for v in (-0.1, 0.1, 0.2))
        return f"speed_m/s,{names}\n{rows}"

    assert len(read_curves(put(table(500)))) == 500
    with pytest.raises(LogError, match="501 curves, more than the limit of 500"):
        read_curves(put(table(501)))
