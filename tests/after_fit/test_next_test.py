"""The next test, and valves as parts, of small runs."""

import json
import math
import shutil

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import damperfit
from damperfit.cli import main
from damperfit.errors import ConfigurationError
from damperfit.reporting.report import report_sections
from damperfit.synthetic import SampleOptions, make_samples


def test_a_faster_test_narrows_the_bulk_modulus_and_none_is_beyond_the_rig(short) -> None:
    run = damperfit.load(short / "results")
    advice = run.advise("k_e", setting=1, max_stroke=0.02, max_speed=0.5, max_force="2kN")
    best = advice.tests[0]
    assert best.share < 0.7
    assert "shrinks to" in advice.sentence
    for test in advice.tests:
        assert test.amplitude <= 0.02
        assert test.speed <= 0.5 + 1e-9
        # Today's test at half the stroke and a third of the speed tells less than a fast one.
        assert best.rank <= test.rank


def test_the_rig_and_the_filter_are_those_of_the_run(tmp_path) -> None:
    """As declared for `identify`, not as they are by default."""
    make_samples(tmp_path, SampleOptions(settings=(10,), cycles=9.0, rig_filter=60.0))
    rig = {"filter": "analogue", "filter_corner": 60.0, "max_stroke": 0.025, "max_speed": 0.6}
    run = damperfit.identify([tmp_path / "setting_10.csv"], procedure="plain", rig=rig)
    advice = run.advise("r_m1")
    assert max(test.amplitude for test in advice.tests) == pytest.approx(0.025)
    assert max(test.speed for test in advice.tests) <= 0.6
    assert advice.tests[0].share < 0.8


def test_where_no_test_helps_the_answer_says_so(fitted) -> None:
    advice = fitted.advise("k_e", setting=10, max_stroke="1mm", max_speed="5mm/s")
    assert "no test is within the limits of the rig and above its noise" in advice.sentence
    assert not advice.sheets()
    advice = fitted.advise("k_e", setting=10, max_stroke="8mm", max_speed="0.1m/s")
    assert "no test within these limits" in advice.sentence
    assert " 0 %" not in advice.sentence


def test_which_test_tells_the_structures_that_remain(results, fitted, tmp_path, capsys) -> None:
    """Another model is told apart; other values of the chosen one are what a new fit would find."""
    known = {one.label: dict(one.values) for one in fitted.settings}
    bilinear = {"c_r": 3e3, "c_b": 3e3, "f_0": 0.0}

    def structure(title, damper, values) -> dict:
        settings = [{"setting": int(n), "values": mine} for n, mine in values.items()]
        return {"title": title, "damper": damper, "settings": settings}

    moved = {n: mine | {"f_f": 1.002 * mine["f_f"]} for n, mine in known.items()}
    record = fitted.record | {
        "law_choice": {
            "chosen": "the paper's model",
            "remaining": [
                structure("bilinear", {"model": "bilinear"}, dict.fromkeys(known, bilinear)),
                structure("again", dict(fitted.declared_damper), moved),
                {"title": "edited"},
                structure("edited", "bilinear", moved),
                structure("edited", {"model": "bilinear"}, {n: {"c_r": "x"} for n in known}),
            ],
        }
    }
    folder = shutil.copytree(results, tmp_path / "chosen")
    (folder / "run.json").write_text(json.dumps(record), encoding="utf-8")
    assert main(["advise", str(folder), "--for", "law", "--setting", "10", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    evidence = document["tests"][0]["evidence"]
    assert evidence["bilinear"] > 1e3
    assert evidence["again"] < 10.0
    assert "distinguishes the chosen structure from structure 1" in document["sentence"]
    assert main(["advise", str(results), "--for", "law"]) == 2
    assert "--model auto" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("choice", "code", "told"),
    [
        ({"remaining": [], "undecided": ["The layout."]}, 0, "note: The layout."),
        ({"remaining": []}, 0, "these logs have decided"),
        ({}, 2, "--model auto"),
    ],
)
def test_no_structure_remains(results, fitted, tmp_path, capsys, choice, code, told) -> None:
    """What the logs leave open otherwise is told, and is not called decided."""
    folder = shutil.copytree(results, tmp_path / "chosen")
    record = fitted.record | {"law_choice": {"chosen": "the paper's model", **choice}}
    (folder / "run.json").write_text(json.dumps(record), encoding="utf-8")
    assert main(["advise", str(folder), "--for", "law"]) == code
    out, err = capsys.readouterr()
    assert told in out + err
    assert ("have decided" in out) is (told == "these logs have decided")


def test_a_test_that_heats_too_much_is_none(fitted) -> None:
    free = fitted.advise("k_e", setting=10, max_speed=0.5)
    cool = fitted.advise("k_e", setting=10, max_speed=0.5, max_heat="20W")
    assert cool.tests[0].speed < free.tests[0].speed


@pytest.mark.parametrize("limit", [{"max_force": "500N"}, {"max_heat": "30W"}])
def test_logs_beyond_a_limit_of_the_next_test_still_count(fitted, limit) -> None:
    motion = {"max_stroke": "20mm", "max_speed": "0.15m/s"}  # below both limits
    free, limited = (
        fitted.advise("force@0.05m/s", setting=1, **motion, **more) for more in ({}, limit)
    )
    assert [one.share for one in limited.tests] == [one.share for one in free.tests]
    assert free.tests[0].share < 1.0


def test_logs_noisier_than_the_next_test_still_count(short) -> None:
    run = damperfit.load(short / "results")
    for log in run.record["inputs"]:
        finding = next(one for one in log["findings"] if one["name"] == "displacement_noise")
        finding["value"] = 30.0  # um, of which inspection warns at the speed of these logs
    advice = run.advise("k_e", setting="1", max_stroke="32mm", max_speed="0.6m/s")
    assert advice.tests[0].share < 0.8


def test_the_adjuster_as_one_hole_passes_the_flow_of_its_resistance(fitted) -> None:
    holes = {hole["setting"]: hole for hole in fitted.valves(cd=0.7, cd_spread=0.0).holes}
    density = fitted.damper.oil_density
    for setting in fitted.settings:
        hole = holes[setting.setting]
        flow = 0.7 * hole["area_m2"] * math.sqrt(2.0 * density * 1e5)
        assert flow == pytest.approx(math.sqrt(1e5) / setting.values["r_m1"])
        assert hole["area_ci_low_m2"] < hole["area_m2"] < hole["area_ci_high_m2"]


def test_the_page_and_the_command_show_the_stored_valves(fitted) -> None:
    (section,) = (one for one in report_sections(fitted) if "Valves" in one.title)
    assert section.sheets[0].rows == fitted.valves().sheets()[0].rows
    for row, stored in zip(fitted.valves().rows, fitted.rows("valve_parts"), strict=True):
        assert row.items() <= stored.items()
    made = fitted.valves(cd_spread=0.1 + 1e-9).rows  # not the stored coefficient
    names = ("area_m2", "diameter_m", "area_change_m2")
    for row, stored in zip(made, fitted.rows("valve_parts"), strict=True):
        assert [row[name] for name in names] == pytest.approx([stored[name] for name in names])


def test_the_sensitivity_is_the_slope_of_the_force(fitted) -> None:
    time = np.arange(1000) / 1000.0
    x, v = 0.01 * np.sin(9.0 * time), 0.09 * np.cos(9.0 * time)
    motion = damperfit.Motion(1e-3, x, v)
    seen = fitted.sensitivity(10, motion)
    setting, step = fitted.setting(10), 1e-4
    changed = setting.values.replace({"r_m1": setting.values["r_m1"] * (1.0 + step)})
    moved = fitted.damper.simulate(changed, motion, sensitivities=(), options=fitted.solver).force
    assert (fitted.simulate(10, motion).force == seen["force_N"]).all()
    slope = (moved - seen["force_N"]) / (step * setting.values["r_m1"])
    assert np.abs(slope - seen["r_m1"]).max() < 0.01 * np.abs(slope).max()


def test_the_noise_and_its_effective_rate_are_numbers(fitted) -> None:
    """Of 4 N of white noise at 500 Hz some more than 60 samples a second pass a filter of 30 Hz."""
    log = fitted.logs[0]
    assert 60.0 < log.effective_rate < 75.0
    assert log.noise == pytest.approx(4.0 * math.sqrt(log.effective_rate / 500.0), rel=0.1)


def test_a_part_is_sized_for_a_force(fitted) -> None:
    found = fitted.valves(force="900N", velocity="0.2m/s")
    (row,) = (one for one in found.sized if one["setting"] == 12)
    now, following = (one["area_m2"] for one in found.holes if one["setting"] in {12, 13})
    assert following < row["wanted"] < now  # 12.4, says `settings`
    assert row["now"] == now
    assert row["diameter_m"] == pytest.approx(math.sqrt(4.0 * row["wanted"] / math.pi))
    assert "at 20 of 20 settings" in repr(found)
    assert not fitted.valves(force="-900N", velocity="0.2m/s", stroke="rebound").sized


def test_a_preload_is_sized_with_and_without_a_seat(tmp_path) -> None:
    words = ("samples", str(tmp_path), "--model", "twin_tube", "--settings", "3", "--cycles", "6")
    assert main(words) == 0
    run = damperfit.identify([tmp_path / "setting_03.csv"], model="twin_tube")
    asked = {"force": "145N", "velocity": "0.1m/s"}
    for seat, told in ((None, "-"), ("10mm", " N on the seat")):
        found = run.valves(**asked, seat=seat)
        (row,) = (one for one in found.sized if one["unit"] == "Pa")
        assert (row["seat_force_N"] is None) is (seat is None)
        assert found.sheets()[-1].rows[-1][-1].endswith(told)
        assert "nan" not in repr(found)


def test_a_model_without_valves_has_none(short) -> None:
    found = damperfit.identify([short / "setting_01.csv"], model="bilinear")
    with pytest.raises(ConfigurationError, match="no orifices"):
        found.valves()


@pytest.mark.parametrize(
    ("words", "code"), [("advise {0} --for k_e --setting 1", 2), ("passport {0} --out {0}", 0)]
)
@pytest.mark.parametrize("value", [None, [1], [{"setting": []}]])
def test_an_edited_record_is_no_bug(edited, words, code, value) -> None:
    record = json.loads((edited / "run.json").read_text(encoding="utf-8"))
    if code:
        record["inputs"][0]["stretches"] = value
    else:
        record["inputs"] = value
    (edited / "run.json").write_text(json.dumps(record), encoding="utf-8")
    assert main(words.format(edited).split()) == code


def spoilt(folder, value: float):
    """Put another r_m2 at the first setting; return the settings."""
    table = pq.read_table(folder / "parameters.parquet")
    place = table.schema.names.index("r_m2")
    column = pa.array([value, *table["r_m2"].to_pylist()[1:]])
    table = table.set_column(place, table.schema.field(place), column)
    pq.write_table(table, folder / "parameters.parquet")
    return table["setting"].to_pylist()


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e200])
@pytest.mark.parametrize(
    "words", ["advise {0} --for k_e --setting 1", "passport {0} --out {0}", "valves {0}"]
)
def test_an_edited_table_is_no_bug(edited, value, words) -> None:
    spoilt(edited, value)
    assert main(words.format(edited).split()) in {0, 1, 2}


@pytest.mark.slow
def test_a_spoilt_number_costs_its_setting_alone(edited) -> None:
    """Of the others it is still told which test narrows it."""
    _, *others = spoilt(edited, 1e30)
    advice = damperfit.advise(edited, for_="k_e", max_speed="0.5m/s")
    assert advice.tests[0].share < 0.9
    assert set(advice.known["interval_now"]) == {str(n) for n in others}
