"""Curves without time: points and loops, by stroke and setting, with the project's signs."""

import numpy as np
import pytest

from damperfit.errors import LogError, TimelessError
from damperfit.io import ReadOptions, read_curves, read_log

UNITS = {"units": {"velocity": "mm/s", "force": "N"}}
LABELS = ("25-4.3", "12-4.3")
ROWS = "50,100,50,200,50,80,50,150\n100,180,100,420,100,150,100,330\n200,300,200,900,,,200,700\n"
SHORT = "(25-4.3) V-C,C,V-R,R,(12-4.3) V-C,C,V-R,R"
TWICE = "\n100,300,-200,400,-250\n200,500,-350,600,-400\n"
SIGNED = "speed_m/s,force_N\n-0.1,200\n0.1,-300\n0.2,-500\n"
LONG = "Speed (m/s),Rebound (N),Bump (N)\n0.05,100,-50\n0.1,200,-90\n0.3,700,-300\n"
MAKER = {
    # Bump is written as positive numbers, inside it is negative; a blank was not measured.
    "25-4.3": ([(0.05, 200), (0.1, 420), (0.2, 900)], [(0.05, -100), (0.1, -180), (0.2, -300)]),
    "12-4.3": ([(0.05, 150), (0.1, 330), (0.2, 700)], [(0.05, -80), (0.1, -150)]),
}
TWO = ([(0.1, 300), (0.2, 500)], [(0.1, -200), (0.2, -350)])
OTHER = ([(0.1, 400), (0.2, 600)], [(0.1, -250), (0.2, -400)])
FORCE = {"units": {"force": "N"}}

# The file, declarations, and by label the points of rebound and bump.
READ = {
    **{
        f"settings and strokes, {names[:24]}...": (f"{names}\n{ROWS}", UNITS, MAKER)
        for names in (
            SHORT,
            ",".join(f"({one}) {name}" for one in LABELS for name in ("V-C", "C", "V-R", "R")),
            "(25-4.3) V-C,C,V-R,R,(12-4.3) V-C,C.1,V-R.1,R.1",
        )
    },
    "a row of units": (
        f"{SHORT}\n{','.join(['mm/s', 'daN'] * 4)}\n{ROWS}", {},
        {k: tuple([(v, 10 * f) for v, f in one] for one in both) for k, both in MAKER.items()},
    ),
    "one speed for both strokes": (
        LONG, {},
        {"log.csv": ([(0.05, 100), (0.1, 200), (0.3, 700)],
                        [(0.05, -50), (0.1, -90), (0.3, -300)])},
    ),
    "one force a setting": (
        "v [m/s];Click 3 (kN);Click 7 (kN)\n-0,1;-0,2;-0,3\n0,1;0,4;0,5\n0,2;0,8;0,9\n", {},
        {"Click 3": ([(0.1, 400), (0.2, 800)], [(0.1, -200)]),
         "Click 7": ([(0.1, 500), (0.2, 900)], [(0.1, -300)])},
    ),
    "a column of settings": (
        "setting,speed_mm/s,force_N\n3,-100,-200\n3,100,300\n7,-100,-250\n7,100,400\n", {},
        {"3": ([(0.1, 300)], [(0.1, -200)]), "7": ([(0.1, 400)], [(0.1, -250)])},
    ),
    **{
        f"a column {name}": (
            (f"{name};speed mm/s;rebound_N;compression_N\n3;100;300;-200\n3;200;500;-350\n"
            "7;100;400;-250\n"), {}, {"3": TWO, "7": ([(0.1, 400)], [(0.1, -250)])},
        )
        for name in ("click", "Clicks", "Klick", "Raste", "cran")
    },
    # A stroke that is there twice was one curve, the mean of both; the C of "clicks C" a degree.
    **{
        f"two curves: {names}": (f"speed mm/s,{names}{TWICE}", FORCE, {a: TWO, b: OTHER})
        for names, a, b in (
            ("0 clicks R,0 clicks C,4 clicks R,4 clicks C", "0 clicks", "4 clicks"),
            ("R_soft_N,C_soft_N,R_hard_N,C_hard_N", "soft", "hard"),
            ("Zug 3 (N),Druck 3 (N),Zug 7 (N),Druck 7 (N)", "3", "7"),
            ("rebound_N,bump_N,rebound_N.1,bump_N.1", "curve 1", "curve 2"),
        )
    },
    **{
        f"unit of a speed: {name}": (
            f"{name}\tforce N\n100\t300\n-200\t-500\n", {}, {"log.csv": ([(0.1, 300)],
                                                                          [(0.2, -500)])},
        )
        for name in ("speed mm/s", "velocity_mm_s", "Speed, mm/s", "vel_mm/s")
    },
    "declared columns": (
        "a,b\n-0.1,-200\n0.1,300\n0.2,500\n",
        {"columns": {"velocity": "a", "force": 2}, "units": {"velocity": "m/s", "force": "N"}},
        {"log.csv": ([(0.1, 300), (0.2, 500)], [(0.1, -200)])},
    ),
    "reversed displacement": (
        SIGNED, {"reverse_displacement": True}, {"log.csv": ([(0.1, 200)], [(0.1, -300),
                                                                            (0.2, -500)])},
    ),
    "reversed force": (
        SIGNED, {"reverse_force": True}, {"log.csv": ([(0.1, 300), (0.2, 500)], [(0.1, -200)])},
    ),
}  # fmt: skip
REFUSED = {
    "no units": (f"{SHORT}\n{ROWS}", {}, "(2) column 'C' has no unit, needed for force"),
    "opposite signs": (SIGNED, {}, "forces are positive where speeds are negative; declare which"),
    "one sign": (
        "speed_m/s,force_N\n0.05,100\n0.1,200\n0.2,500\n", {}, "which leaves open which is rebound",
    ),
    "a force without a speed": (
        "speed_m/s,Rebound (N)\n0.1,200\n,300\n0.2,500\n", {},
        "line 3: column 2, 'Rebound (N)': a force without a speed",
    ),
    "time": (
        "time_s,speed_m/s,force_N\n0,-0.1,200\n1,0.1,-300\n2,0.2,-500\n", {},
        "has a time column, so it is a log, not a curve",
    ),
    "no speed": ("displacement_mm,force_N\n1,2\n2,3\n3,4\n", {}, "no speed with a force beside it"),
}  # fmt: skip


def points(curve, stroke: str) -> list[tuple[float, float]]:
    return [(round(float(v), 6), float(f)) for v, f in zip(*curve.points(stroke), strict=True)]


@pytest.mark.parametrize(("text", "declared", "expected"), READ.values(), ids=READ)
def test_what_is_read(put, text, declared, expected) -> None:
    curves = read_curves(put(text), ReadOptions(**declared))
    found = {one.label: (points(one, "rebound"), points(one, "bump")) for one in curves}
    assert found == expected


@pytest.mark.parametrize(("text", "declared", "says"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_told_is_one_line(put, text, declared, says) -> None:
    with pytest.raises(LogError) as caught:
        read_curves(put(text), ReadOptions(**declared))
    message = str(caught.value)
    assert message.startswith("log.csv")
    assert says in message
    assert message.isprintable()


def test_forces_between_points(put) -> None:
    (curve,) = read_curves(put(LONG))
    assert curve.force_at(0.2, "bump") == pytest.approx(-195.0)
    beyond = (curve.force_at(0.31, "bump"), curve.force_at(0.04, "bump"))
    assert np.isnan([*beyond, curve.hysteresis_at(0.1, "bump")]).all()
    # In any order, and one twice.
    (curve,) = read_curves(put("speed_m/s,Rebound (N)\n0.3,700\n0.1,190\n0.2,450\n0.1,210\n"))
    assert curve.force_at(0.1, "rebound") == pytest.approx(200.0)
    assert curve.force_at(0.15, "rebound") == pytest.approx(325.0)


def test_a_loop_has_two_branches(put) -> None:
    t = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    v = 0.3 * np.sin(t)
    force = 1000.0 * v + 40.0 * np.cos(t)  # opening 80 N above closing near no speed
    rows = "".join(f"{a:.6f},{b:.4f}\n" for a, b in zip(v, force, strict=True))
    (curve,) = read_curves(put(f"velocity_m/s,force_N\n{rows}"))
    assert curve.force_at(0.15, "rebound") == pytest.approx(150.0, abs=0.5)
    assert curve.hysteresis_at(0.15, "rebound") == pytest.approx(80.0 * np.sqrt(0.75), abs=0.5)
    assert curve.force_at(0.15, "bump") == pytest.approx(-150.0, abs=0.5)


@pytest.mark.parametrize("positive", ["rebound", "compression"])
def test_a_stiffer_side_where_speeds_are_negative_is_asked_about(put, positive) -> None:
    """Compression is positive in many shops, and rebound is the stiffer stroke of most dampers."""
    sign = 1.0 if positive == "rebound" else -1.0
    rows = [(v, 400.0 * v + 20.0 * k) for k, v in enumerate((0.025, 0.05, 0.1, 0.25))]
    rows += [(-v, -0.6 * f) for v, f in rows]
    text = "".join(f"{sign * v},{sign * f}\n" for v, f in rows)
    (curve,) = read_curves(put(f"speed_m/s,force_N\n{text}"))
    asked = [note for note in curve.notes if "rig.reverse_force" in note]
    assert bool(asked) is (positive == "compression")


# A log, or what was meant as one


def test_as_a_log_they_are_told_to_lack_time(put) -> None:
    with pytest.raises(TimelessError, match="speed and force without time, and a fit needs"):
        read_log(put(LONG))
    for text, options in (
        ("displacement_mm,force_N\n1,2\n2,3\n3,4\n", ReadOptions()),
        ("time_s,speed_m/s,force_N\n0,1,2\n1,2,3\n2,3,4\n", ReadOptions()),
        ("speed_m/s,force_N\n1,2\n2,3\n3,4\n", ReadOptions(sample_rate=100.0)),
    ):
        with pytest.raises(LogError, match="no column for") as caught:
            read_log(put(text), options)
        assert type(caught.value) is LogError


@pytest.mark.parametrize(("n", "is_read"), [(500, True), (501, False)])
def test_hundreds_of_curves_have_a_limit(put, n, is_read) -> None:
    names = ",".join(f"Click {k} (N)" for k in range(n))
    rows = "".join(f"{v},{','.join([str(100 * v)] * n)}\n" for v in (-0.1, 0.1, 0.2))
    path = put(f"speed_m/s,{names}\n{rows}")
    if is_read:
        assert len(read_curves(path)) == n
    else:
        with pytest.raises(LogError, match="501 curves, more than the limit of 500"):
            read_curves(path)
