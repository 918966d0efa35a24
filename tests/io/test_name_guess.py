"""Settings guessed from what differs between the names of logs; a choice is no guess."""

from __future__ import annotations

import re

import pytest

from damperfit.io import ReadOptions, guess_settings, one_of_several, read_log, unclear_names

LOG = "time_s,displacement_mm,force_N\n0,1,2\n1,2,3\n"


@pytest.mark.parametrize(
    ("names", "cells", "pattern"),
    [
        (["D7_C02.csv", "D7_C08.csv"], [2, 8], r"C(?P<setting>\d+)"),
        (["SN1234_click08_1.5Hz.csv"], [8], r"click(?P<setting>\d+)"),
        (["SN1_click2_1Hz.csv", "SN1_click4_2Hz.csv"], [2, 4], r"click(?P<setting>\d+)"),
        (["08.csv", "09.csv"], [8, 9], r"^\D*(?P<setting>\d+)"),
        (["R12_C08.csv", "R12_C10.csv"], [8, 10], r"C(?P<setting>\d+)"),
        (["run1_a3_32mm.txt", "run2_a3_32mm.txt", "run3_a5_32mm.txt"], [], r"a(?P<setting>\d+)"),
        (["D7_b3.csv.gz", "D7_b4.csv.gz"], [3, 4], r"b(?P<setting>\d+)"),
        (["23degC_3.csv", "24degC_4.csv"], [3, 4], r"degC_(?P<setting>\d+)"),
        (["5kN_3.csv", "6kN_4.csv"], [3, 4], r"kN_(?P<setting>\d+)"),
        (["1.5Hz_3.csv", "2.5Hz_4.csv"], [3, 4], r"Hz_(?P<setting>\d+)"),
        (["klick_0.5.csv", "klick_1.csv"], [0.5, 1], r"klick_(?P<setting>\d+(?:\.\d)?)"),
        (["s1234_2.csv", "s1234_4.csv"], [2, 4], r"_(?P<setting>\d+)"),
        (["lot999_7.csv", "lot999_9.csv"], [7, 9], r"_(?P<setting>\d+)"),
        (["few_5_reglage8.csv", "few_7_reglage8.csv"], [8, 8], r"reglage(?P<setting>\d+)"),
        (["x5_Réglage 8.csv", "x7_Réglage 8.csv"], [8, 8], r"Réglage (?P<setting>\d+)"),
        (["5_Re\u0301glage8.csv", "7_Re\u0301glage8.csv"], [8, 8], r"glage(?P<setting>\d+)"),
        (["b5_cran2.csv", "b7_cran4.csv"], [2, 4], r"cran(?P<setting>\d+)"),
        (["Versuch1_3.csv", "Versuch2_4.csv"], [3, 4], r"_(?P<setting>\d+)"),
        (["b_3_25°C.csv", "b_4_35°C.csv"], [3, 4], r"b_(?P<setting>\d+)"),
        (["front -3.csv", "front 0.csv"], [-3, 0], r"front (?P<setting>-?\d+)"),
        (["front-3.csv", "front-4.csv"], [3, 4], r"front-(?P<setting>\d+)"),
        (["Links - 3.csv", "Links - 4.csv"], [3, 4], r"Links - (?P<setting>\d+)"),
        (["-3_5.csv", "-4_5.csv"], [3, 4], r"-(?P<setting>\d+)"),
    ],
)
def test_what_differs_is_the_setting(names, cells, pattern) -> None:
    guess = guess_settings(names)
    if cells:
        assert [guess.settings[name].places[0][1] for name in names] == cells
        assert "guessed from the file names" in guess.sentence
        assert guess.sentence.endswith(f"--rig 'setting_pattern={pattern}'")
        # What is to be copied finds the same.
        found = [float(list(re.finditer(pattern, name))[-1]["setting"]) for name in names]
        assert found == cells


@pytest.mark.parametrize(
    "names",
    [
        ["R12_C08.csv", "R10_C10.csv"],  # two adjusters
        ["t1_2_2_24_24_x5_100psi.csv", "t2_4_4_24_24_x5_100psi.csv"],
        ["D7_C08.csv"],  # one log: nothing differs
        ["run_1Hz.csv", "run_2Hz.csv"],  # a speed
        ["a_0.5.csv", "a_1.5.csv"],  # without a word no half clicks
        ["test1.csv", "test2.csv"],  # a count
        ["SN1234.csv", "SN1235.csv"],
        ["b_1234.csv", "b_1235.csv"],  # four digits
        ["a_3.csv", "b_x_4.csv"],  # names of two kinds
        ["test_1_25C.csv", "test_2_35C.csv"],  # clicks, or degrees
        ["test_1_25 °C.csv", "test_2_35 °C.csv"],
        ["Lauf_1.csv", "Lauf_2.csv"],
        ["Essai1.csv", "Essai2.csv"],
        ["Prüfling_1.csv", "Prüfling_2.csv"],
        ["Amort_série_12.csv", "Amort_série_13.csv"],
        ["log.csv"],
        [],
    ],
)
def test_a_choice_is_no_guess(names) -> None:
    guess = guess_settings(names)
    assert guess.settings == {}
    assert guess.sentence == ""
    has_number = any(re.search(r"\d", name) for name in names)
    assert bool(guess.advice) is has_number


@pytest.mark.parametrize(
    ("names", "declared", "pattern", "places"),
    [
        (
            ["c10_r12.csv", "c8_r14.csv"],
            'compression = "", rebound = ""',
            r"c(?P<compression>\d+)_r(?P<rebound>\d+)",
            [("10", "12"), ("8", "14")],
        ),
        (
            ["R12C08.csv", "R12C10.csv", "R10C08.csv"],
            'rebound = "", compression = ""',
            r"R(?P<rebound>\d+)C(?P<compression>\d+)",
            [("12", "08"), ("12", "10"), ("10", "08")],
        ),
        (
            ["D7_LSC-2_HSC-1_1Hz.csv", "D7_LSC-4_HSC-3_1Hz.csv"],
            'lsc = "", hsc = ""',
            r"LSC-(?P<lsc>\d+)_HSC-(?P<hsc>\d+)",
            [("2", "1"), ("4", "3")],
        ),
        (
            ["5_3.csv", "6_4.csv"],
            'a = "", b = ""',
            r"^(?P<a>\d+)_(?P<b>\d+)",
            [("5", "3"), ("6", "4")],
        ),
    ],
)
def test_two_adjusters_are_offered_a_pattern_for_both(names, declared, pattern, places) -> None:
    """The pattern to copy read one of the two; R12C08 was taken for C alone, R 12 for degrees."""
    guess = guess_settings(names)
    assert guess.settings == {}
    assert f"[adjusters] {declared}" in guess.advice
    assert guess.advice.endswith(f"--rig 'setting_pattern={pattern}'")
    found = [re.search(pattern, name, re.IGNORECASE) for name in names]
    assert [match.groups() for match in found] == places


@pytest.mark.parametrize(
    ("names", "declared"),
    [
        (["x1_x3.csv", "x2_x4.csv"], 'a = "", b = ""'),  # one word for both
        (["ж1_b3.csv", "ж2_b4.csv"], 'a = "", b = ""'),  # no key can be called so
        (["x1_3.csv", "x2_4.csv"], 'a = "", b = ""'),  # no word at all
        (["x1_b3.csv", "x2_b4.csv"], 'x = "", compression = ""'),
        (["a5_x1_b3.csv", "a5_x2_b4.csv"], 'x = "", compression = ""'),  # one does not differ
        (["x1_b3_5Hz.csv", "x2_b4_6Hz.csv"], 'x = "", compression = ""'),  # one has a unit
        (["x1_b3_k1_q2.csv", "x2_b4_k2_q3.csv"], 'x = "", compression = "", k = "", q = ""'),
    ],
)
def test_numbers_without_names_of_their_own_are_counted(names, declared) -> None:
    assert f"[adjusters] {declared}," in guess_settings(names).advice


def test_one_number_that_differs_is_not_several_adjusters() -> None:
    """Of two kinds of names neither has most, so that nothing is guessed."""
    guess = guess_settings(["b_3.csv", "b_4.csv", "x_y_5.csv", "x_y_6.csv"])
    assert guess.settings == {}
    assert guess.advice.endswith(r"--rig 'setting_pattern=b_(?P<setting>\d+)'")
    assert "[adjusters]" not in guess.advice


@pytest.mark.parametrize(("name", "number"), [("s123_x02.csv", "123"), ("s1234_x02.csv", "")])
def test_a_serial_number_behind_s_is_not_said_to_be_the_setting(name, number) -> None:
    assert one_of_several(name) == number


def test_three_digits_are_clicks_and_four_are_not() -> None:
    assert guess_settings(["b_998.csv", "b_999.csv"]).settings
    assert not guess_settings(["b_999.csv", "b_1000.csv"]).settings


@pytest.mark.parametrize(
    ("name", "cell", "serial"),
    [
        ("s1234_click02.csv", 2, None),
        ("click02_s5.csv", 2, None),
        ("s999.csv", 999, None),
        ("s1000.csv", None, None),
        ("SN1234_click08_1.5Hz.csv", 8, "1234"),
        ("setting_-3.csv", -3, None),
        ("setting-3.csv", 3, None),
        ("clicks=-2.csv", -2, None),
        ("clicks_-2.csv", -2, None),
    ],
)
def test_a_serial_number_is_no_setting(tmp_path, name, cell, serial) -> None:
    (tmp_path / name).write_text(LOG)
    log = read_log(tmp_path / name)
    assert (None if log.setting is None else log.setting.cell) == cell
    assert log.metadata.get("serial") == serial


TWO = ("rebound", "compression")


@pytest.mark.parametrize(
    ("name", "preamble", "pattern"),
    [
        ("a.csv", "# setting: R12 C08\n", None),
        ("a.csv", "# rebound: 12\n# Compression: 8\n", None),
        ("R12_C08_1.5Hz.csv", "", None),
        ("x12y8.csv", "", r"x(?P<rebound>\d+)y(?P<compression>\d+)"),
        ("12-8.csv", "# compression: 8\n", r"^(?P<rebound>\d+)"),
    ],
)
def test_two_adjusters_are_found(tmp_path, name, preamble, pattern) -> None:
    (tmp_path / name).write_text(preamble + LOG)
    more = {} if pattern is None else {"setting_pattern": pattern}
    log = read_log(tmp_path / name, ReadOptions(adjusters=TWO, **more))
    assert log.setting is not None
    assert log.setting.label == "R12 C8"


def test_adjusters_in_columns_cut_a_log(tmp_path) -> None:
    rows = [(0, 1, 2, 12, 8), (1, 2, 3, 12, 8), (2, 1, 2, 12, 10), (3, 2, 3, 12, 10)]
    head = "time_s,displacement_mm,force_N,rebound,compression\n"
    text = head + "".join(",".join(map(str, row)) + "\n" for row in rows)
    (tmp_path / "a.csv").write_text(text)
    from damperfit.io import read_logs

    logs = read_logs(tmp_path / "a.csv", ReadOptions(adjusters=TWO))
    assert [log.setting.label for log in logs] == ["R12 C8", "R12 C10"]


def test_half_a_setting_is_none(tmp_path) -> None:
    (tmp_path / "a.csv").write_text("# rebound: 12\n" + LOG)
    assert read_log(tmp_path / "a.csv", ReadOptions(adjusters=TWO)).setting is None


def test_an_unknown_group_is_refused() -> None:
    from damperfit.errors import ConfigurationError

    with pytest.raises(ConfigurationError, match=r"group 'rebund'.*Did you mean 'rebound'"):
        ReadOptions(adjusters=TWO, setting_pattern=r"(?P<rebund>\d+)")


CLICKS = [f"t1_{low}_{high}_s{speed}.csv" for low, high in ((2, 24), (2, 12)) for speed in (1, 5)]


@pytest.mark.parametrize(
    ("names", "is_unclear"),
    [
        (CLICKS, True),  # s is the speed of the test
        (["t1_2_2_s5.csv", "t1_4_4_s5.csv"], True),  # two numbers differ beside it: no count
        (["t1_2_24_s1.csv", "t1_2_24_s5.csv"], False),  # only s differs
        (["001_s5.csv", "002_s5.csv", "003_s6.csv"], False),  # a count of the logs
        (["1_s5.csv", "1_s6.csv", "2_s6.csv"], True),  # no count: 1 is there twice
        (["run1_s5.csv", "run1_s6.csv", "run2_s5.csv"], False),  # runs are counted
        (["t1_2_24_s5.csv"], False),  # one name
        (["c2_x24.csv", "c2_x12.csv", "c4_x12.csv"], False),  # no s
    ],
)
def test_s_is_no_setting_for_certain_where_other_numbers_differ(names, is_unclear) -> None:
    assert unclear_names(names) == (frozenset(names) if is_unclear else frozenset())


def test_clicks_and_a_speed_are_asked_about_with_a_pattern_for_the_clicks() -> None:
    clicks = ("2_2_8_4", "2_9_8_5", "4_9_3_4")
    names = [f"t1_{one}_s{s}_100psi.csv" for one in clicks for s in (1, 5)]
    advice = guess_settings(names).advice
    assert '[adjusters] a = "", b = "", c = "", d = ""' in advice
    pattern = r"^t\d+_(?P<a>\d+)_(?P<b>\d+)_(?P<c>\d+)_(?P<d>\d+)"
    assert advice.endswith(f"--rig 'setting_pattern={pattern}'")
    assert re.search(pattern, names[2]).groups() == ("2", "9", "8", "5")


def test_five_numbers_that_differ_are_nobodys_adjusters() -> None:
    guess = guess_settings(["x1_b3_k1_q2_z5.csv", "x2_b4_k2_q3_z6.csv"])
    assert "[adjusters]" not in guess.advice


@pytest.mark.parametrize(
    ("names", "n_guessed"),
    [
        (["k_3.csv", "k_4.csv", "broken.csv"], 2),
        (["k_3.csv", "k_4.csv", "broken.csv", "other.csv"], 0),  # no more than half
        (["k_3.csv", "broken.csv"], 0),  # one name shows nothing
    ],
)
def test_a_name_of_another_kind_costs_the_others_nothing(names, n_guessed) -> None:
    """A broken file among good ones took their settings from all."""
    settings = guess_settings(names).settings
    assert len(settings) == n_guessed
    assert "broken.csv" not in settings


@pytest.mark.parametrize(
    ("names", "pattern", "finds"),
    [
        (["soft.csv", "mid.csv", "hard.csv"], r"^(?P<setting>[^\W\d_]+)", ["soft", "mid", "hard"]),
        (["D7_soft.csv", "D7_hard.csv"], r"7_(?P<setting>[^\W\d_]+)", ["soft", "hard"]),
        (
            ["D7 soft 1.5Hz.csv", "D7 hard 1.5Hz.csv"],
            r"7 (?P<setting>[^\W\d_]+)",
            ["soft", "hard"],
        ),
        (
            ["soft_1.csv", "soft_2.csv", "hard_1.csv", "hard_2.csv"],
            None,
            ["soft"] * 2 + ["hard"] * 2,
        ),
        (
            ["clk+0.csv", "clk-12.csv", "clk-4.csv"],
            r"clk(?P<setting>[+-]?\d+)",
            ["+0", "-12", "-4"],
        ),
        (["D7 clk +4.csv", "D7 clk -4.csv"], None, ["+4", "-4"]),
        (["soft_a.csv", "hard_b.csv"], "", []),  # two words differ
        (["soft.csv", "hard_02.csv"], "", []),  # names of another kind
        (["soft.csv"], "", []),
    ],
)
def test_a_word_or_a_sign_is_asked_about_with_an_option_to_copy(names, pattern, finds) -> None:
    """`clk-4` beside `clk+0` was read as setting 4."""
    guess = guess_settings(names)
    assert not guess.settings
    if pattern is not None:
        assert guess.advice == (f"--rig 'setting_pattern={pattern}'" if pattern else "")
    if finds:
        copied = re.search("setting_pattern=(.*)'", guess.advice)[1]
        assert [re.search(copied, name)["setting"] for name in names] == finds
