"""Whose setting it is: said by a log, its name or a table of tests, or guessed from names."""

import itertools
import re

import pytest

from damperfit.errors import ConfigurationError, LogError
from damperfit.io import (
    ReadOptions,
    guess_settings,
    is_tests_table,
    one_of_several,
    read_log,
    read_logs,
    read_tests,
    unclear_names,
)

LOG = "time_s,displacement_mm,force_N\n0,1,2\n1,2,3\n"


TWO = ("rebound", "compression")
ORDER = {"option": 9, "parts": 10, "preamble": 11, "column": 12, "name": 13}


@pytest.fixture
def put(tmp_path):
    def write(text: str, name: str = "a.csv"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize(
    "ways", [w for n in range(6) for w in itertools.combinations(ORDER, n)], ids="-".join
)
def test_the_setting_is_taken_from_the_first_that_says_it(put, ways) -> None:
    head = "# setting: 11\n" if "preamble" in ways else ""
    names, field = (",setting", ",12") if "column" in ways else ("", "")
    rows = "".join(f"{i},{i},{i}{field}\n" for i in range(4))
    text = f"{head}time_s,displacement_mm,force_N{names}\n{rows}"
    recording = read_log(
        put(text, "log_s13.csv" if "name" in ways else "log.csv"),
        ReadOptions(
            setting=9 if "option" in ways else None, part_settings=(10,) if "parts" in ways else ()
        ),
    )
    assert recording.setting == (ORDER[ways[0]] if ways else None)
    doubt = "setting: 11 of the preamble; the file name says 13: check which is right"
    is_doubted = {"preamble", "name"} <= {*ways} and "option" not in ways
    assert (doubt in recording.notes) is is_doubted


@pytest.mark.parametrize(
    ("name", "cell", "serial"),
    [
        ("setting_10.csv", 10, None),
        ("Setting-3.csv", 3, None),
        ("setting_-3.csv", -3, None),
        ("run_s10_a.csv", 10, None),
        ("s7.csv", 7, None),
        ("S7 second.csv", 7, None),
        ("setting_1_s2.csv", 2, None),
        ("2021-05-04_setting_12_run2.csv", 12, None),
        ("runs10.csv", None, None),
        ("test_4.csv", None, None),
        ("wait_30s_2.csv", None, None),
        ("s10.5.csv", None, None),
        ("s1234_click02.csv", 2, None),
        ("click02_s5.csv", 2, None),
        ("s999.csv", 999, None),
        ("s1000.csv", None, None),
        ("SN1234_click08_1.5Hz.csv", 8, "1234"),
        ("clicks=-2.csv", -2, None),
        ("clicks_-2.csv", -2, None),
    ],
)
def test_a_setting_in_the_file_name(put, name, cell, serial) -> None:
    log = read_log(put(LOG, name))
    assert (None if log.setting is None else log.setting.cell) == cell
    assert log.metadata.get("serial") == serial


@pytest.mark.parametrize(("value", "cell"), [("soft", "soft"), ("2.5", "2.5"), ("-1", -1)])
def test_words_halves_and_negative_clicks_are_settings(put, value, cell) -> None:
    assert read_log(put(f"# setting: {value}\n{LOG}")).setting.cell == cell


@pytest.mark.parametrize("value", ["1e9", "nan", "?", "x" * 50])
def test_a_setting_that_is_no_label_is_refused(put, value) -> None:
    with pytest.raises(LogError, match=r"a\.csv: metadata 'setting': .*expected clicks"):
        read_log(put(f"# setting: {value}\n{LOG}"))


@pytest.mark.parametrize(
    ("name", "preamble", "pattern", "label"),
    [
        ("a.csv", "# setting: R12 C08\n", None, "R12 C8"),
        ("a.csv", "# rebound: 12\n# Compression: 8\n", None, "R12 C8"),
        ("R12_C08_1.5Hz.csv", "", None, "R12 C8"),
        ("x12y8.csv", "", r"x(?P<rebound>\d+)y(?P<compression>\d+)", "R12 C8"),
        ("12-8.csv", "# compression: 8\n", r"^(?P<rebound>\d+)", "R12 C8"),
        ("a.csv", "# rebound: 12\n", None, None),
    ],
)
def test_two_adjusters_are_found(put, name, preamble, pattern, label) -> None:
    more = {} if pattern is None else {"setting_pattern": pattern}
    log = read_log(put(preamble + LOG, name), ReadOptions(adjusters=TWO, **more))
    assert (log.setting and log.setting.label) == label


def test_adjusters_in_columns_cut_a_log(put) -> None:
    head = "time_s,displacement_mm,force_N,rebound,compression\n"
    path = put(head + "0,1,2,12,8\n1,2,3,12,8\n2,1,2,12,10\n3,2,3,12,10\n")
    logs = read_logs(path, ReadOptions(adjusters=TWO))
    assert [log.setting.label for log in logs] == ["R12 C8", "R12 C10"]


def test_an_own_pattern_and_an_unknown_group(put) -> None:
    options = ReadOptions(setting_pattern=r"klick(\d+)")
    assert read_log(put(LOG, "s3_Klick12.csv"), options).setting == 12
    with pytest.raises(ConfigurationError, match=r"group 'rebund'.*Did you mean 'rebound'"):
        ReadOptions(adjusters=TWO, setting_pattern=r"(?P<rebund>\d+)")


# Guesses from names.


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
        (["C=-3.csv", "C=0.csv"], [-3, 0], r"C=(?P<setting>-?\d+)"),
        (["front-3.csv", "front-4.csv"], [3, 4], r"front-(?P<setting>\d+)"),
        (["Links - 3.csv", "Links - 4.csv"], [3, 4], r"Links - (?P<setting>\d+)"),
        (["-3_5.csv", "-4_5.csv"], [3, 4], r"-(?P<setting>\d+)"),
    ],
)
def test_what_differs_is_the_setting(names, cells, pattern) -> None:
    guess = guess_settings(names)
    if cells:
        assert [guess.settings[name].places[0][1] for name in names] == cells
        assert "guessed from the file names" in str(guess.said or "")
        assert str(guess.said or "").endswith(f"--rig 'setting_pattern={pattern}'")
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
    assert str(guess.said or "") == ""
    has_number = any(re.search(r"\d", name) for name in names)
    assert bool(str(guess.way or "")) is has_number


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
    assert f"[adjusters] {declared}" in str(guess.way or "")
    assert str(guess.way or "").endswith(f"--rig 'setting_pattern={pattern}'")
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
    assert f"[adjusters] {declared}," in str(guess_settings(names).way or "")


@pytest.mark.parametrize(("name", "number"), [("s123_x02.csv", "123"), ("s1234_x02.csv", "")])
def test_a_serial_number_behind_s_is_not_said_to_be_the_setting(name, number) -> None:
    assert one_of_several(name) == number


def test_three_digits_are_clicks_and_four_are_not() -> None:
    assert guess_settings(["b_998.csv", "b_999.csv"]).settings
    assert not guess_settings(["b_999.csv", "b_1000.csv"]).settings


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
    advice = str(guess_settings(names).way or "")
    assert '[adjusters] a = "", b = "", c = "", d = ""' in advice
    pattern = r"^t\d+_(?P<a>\d+)_(?P<b>\d+)_(?P<c>\d+)_(?P<d>\d+)"
    assert advice.endswith(f"--rig 'setting_pattern={pattern}'")
    assert re.search(pattern, names[2]).groups() == ("2", "9", "8", "5")


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
        assert str(guess.way or "") == (f"--rig 'setting_pattern={pattern}'" if pattern else "")
    if finds:
        copied = re.search("setting_pattern=(.*)'", str(guess.way or ""))[1]
        assert [re.search(copied, name)["setting"] for name in names] == finds


# Tables of tests.


def table(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "tests.csv"
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16"])
@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_separators_umlauts_and_other_columns(tmp_path, encoding, mark) -> None:
    rows = [
        "Datei|Rebound|compression|S/N|Kunde|Farbe",
        "a.csv|12|-8|0077|Müller|grün",
        "|||||",
        "",
    ]
    path = table(tmp_path, "\r\n".join(rows).replace("|", mark), encoding)
    found = read_tests(path, TWO)
    row = found.rows["a.csv"]
    assert dict(row.places) == {"rebound": 12, "compression": -8}
    assert row.identity.describe() == {"serial": "0077", "customer": "Müller", "Farbe": "grün"}
    assert row.line == 2
    assert found.notes == ()


def test_labels_words_and_empty_cells(tmp_path) -> None:
    text = "file,setting,compression\na.csv,R12 C8,\nsub/b.csv,,soft\n'c.csv,,\n"
    rows = read_tests(table(tmp_path, text), TWO).rows
    assert dict(rows["a.csv"].places) == {"rebound": 12, "compression": 8}
    assert dict(rows["sub/b.csv"].places) == {"compression": "soft"}


def test_the_same_row_twice_is_one(tmp_path) -> None:
    assert (
        len(read_tests(table(tmp_path, "file,setting\na.csv,1\na.csv,1\n"), ("setting",)).rows) == 1
    )


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is empty"),
        (
            "flie,setting\na.csv,1\n",
            r":1: no column 'file'; found flie, setting; name the one",
        ),
        (
            "file,setting\na.csv,1\na.csv,2\n",
            r":3: 'a\.csv' is in line 2 too, with other values",
        ),
        ("file,serial\na.csv,1\n\na.csv,2\n", r":4: 'a\.csv' is in line 2 too"),
        ("file,setting\na.csv,1,2\n", r":2: 3 fields, but 2 names in line 1"),
        ("file,setting\n,1\n", r":2: no file name in column 'file'"),
        ("file,setting\na.csv,1e9\n", r":2: setting: found '1e9', expected clicks"),
        ("file,setting,setting\na.csv,1,2\n", r":1: two columns are named 'setting'"),
    ],
)
def test_a_bad_table_is_told_with_its_line(tmp_path, text, says) -> None:
    with pytest.raises(ConfigurationError, match=says):
        read_tests(table(tmp_path, text), ("setting",))


def test_a_label_that_names_one_of_two_adjusters_is_told(tmp_path) -> None:
    with pytest.raises(
        ConfigurationError, match=r":2: setting: found '12', expected a place for each"
    ):
        read_tests(table(tmp_path, "file,setting\na.csv,12\n"), TWO)


def test_a_misspelt_column_is_kept_and_said(tmp_path) -> None:
    found = read_tests(table(tmp_path, "file,rebond\na.csv,12\n"), TWO)
    assert dict(found.rows["a.csv"].places) == {}
    assert found.rows["a.csv"].identity.describe() == {"rebond": "12"}
    assert "column 'rebond' is kept as a remark" in found.notes[0]
    assert "'rebound'" in found.notes[0]


def test_a_log_of_that_name_is_no_table(tmp_path) -> None:
    assert not is_tests_table(table(tmp_path, "time_s,displacement_mm,force_N\n0,1,2\n"))
    assert is_tests_table(table(tmp_path, "Setting;File\n1;a.csv\n"))
    assert not is_tests_table(tmp_path / "other.csv")
