"""Whose setting it is: said by a log, its name or a table of tests, or guessed from names."""

import itertools
import re

import pytest

from damperfit.errors import ConfigurationError, LogError
from damperfit.io import ReadOptions, read_log, read_logs
from damperfit.io.labels import guess_settings, one_of_several, unclear_names
from damperfit.io.tests_table import is_tests_table, read_tests

LOG = "time_s,displacement_mm,force_N\n0,1,2\n1,2,3\n"


TWO = ("rebound", "compression")
ORDER = {"option": 9, "parts": 10, "preamble": 11, "column": 12, "name": 13}


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
        ("setting_-3.csv", -3, None),
        ("run_s10_a.csv", 10, None),
        ("runs10.csv", None, None),
        ("wait_30s_2.csv", None, None),
        ("s10.5.csv", None, None),
        ("s1234_click02.csv", 2, None),
        ("s999.csv", 999, None),
        ("s1000.csv", None, None),
        ("SN1234_click08_1.5Hz.csv", 8, "1234"),
        ("clicks=-2.csv", -2, None),
    ],
)
def test_a_setting_in_the_file_name(put, name, cell, serial) -> None:
    log = read_log(put(LOG, name))
    assert (None if log.setting is None else log.setting.cell) == cell
    assert log.metadata.get("serial") == serial


def test_words_halves_and_negative_clicks_are_settings_and_what_is_no_label_is_refused(put) -> None:
    for value, cell in (("soft", "soft"), ("2.5", "2.5"), ("-1", -1)):
        assert read_log(put(f"# setting: {value}\n{LOG}")).setting.cell == cell
    for value in ("1e9", "nan", "?", "x" * 50):
        with pytest.raises(LogError, match=r"log\.csv: metadata 'setting': .*expected clicks"):
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
        (
            "a.csv",
            "Rebound clicks = 12 from open\nBump: soft\nCompression adjuster;8\n",
            None,
            "R12 C8",
        ),
    ],
)
def test_two_adjusters_are_found(put, name, preamble, pattern, label) -> None:
    more = {} if pattern is None else {"setting_pattern": pattern}
    log = read_log(put(preamble + LOG, name), ReadOptions(adjusters=TWO, **more))
    assert (log.setting and log.setting.label) == label


@pytest.mark.parametrize(
    ("line", "cell"),
    [
        ("Adjuster : 3 clicks from open", 3), ("Einstellung: 4 Klicks ab offen", 4),
        ("R\u00e9glage;5 crans", 5), ("Adjuster: Öhlins", None), ("Bump clicks: 3", None),
        ("setting: 2.0 clicks out from closed", 2),
    ],
)  # fmt: skip
def test_clicks_in_the_words_of_a_logger_are_a_setting_and_said(put, line, cell) -> None:
    log = read_log(put(f"{line}\n{LOG}"))
    assert (log.setting and log.setting.cell) == cell
    assert any(line.casefold()[:5] in said for said in log.notes) is (cell in {3, 4, 5})


def test_adjusters_in_columns_cut_a_log(put) -> None:
    head = "Rebound clicks: 5\ntime_s,displacement_mm,force_N,rebound,compression\n"
    path = put(head + "0,1,2,12,8\n1,2,3,12,8\n2,1,2,12,10\n3,2,3,12,10\n")
    logs = read_logs(path, ReadOptions(adjusters=TWO))
    assert [log.setting.label for log in logs] == ["R12 C8", "R12 C10"]


def test_an_own_pattern_and_an_unknown_group(put) -> None:
    options = ReadOptions(setting_pattern=r"klick(\d+)")
    assert read_log(put(LOG, "s3_Klick12.csv"), options).setting == 12
    with pytest.raises(ConfigurationError, match=r"group 'rebund'.*Did you mean 'rebound'"):
        ReadOptions(adjusters=TWO, setting_pattern=r"(?P<rebund>\d+)")


# Guesses from names.


# File names, parted by commas -> the clicks that are guessed, and the pattern that is offered.
GUESSED = r"""
D7_C02, D7_C08 -> 2, 8 -> C(?P<setting>\d+)
SN1234_click08_1.5Hz -> 8 -> click(?P<setting>\d+)
SN1_click2_1Hz, SN1_click4_2Hz -> 2, 4 -> click(?P<setting>\d+)
08, 09 -> 8, 9 -> ^\D*(?P<setting>\d+)
R12_C08, R12_C10 -> 8, 10 -> C(?P<setting>\d+)
23degC_3, 24degC_4 -> 3, 4 -> degC_(?P<setting>\d+)
klick_0.5, klick_1 -> 0.5, 1 -> klick_(?P<setting>\d+(?:\.\d)?)
s1234_2, s1234_4 -> 2, 4 -> _(?P<setting>\d+)
few_5_reglage8, few_7_reglage8 -> 8, 8 -> reglage(?P<setting>\d+)
5_Re\u0301glage8, 7_Re\u0301glage8 -> 8, 8 -> glage(?P<setting>\d+)
Versuch1_3, Versuch2_4 -> 3, 4 -> _(?P<setting>\d+)
front -3, front 0 -> -3, 0 -> front (?P<setting>-?\d+)
-3_5, -4_5 -> 3, 4 -> -(?P<setting>\d+)
"""


def parted(row: str) -> list[str]:
    """The columns of a row of such a table."""
    return [part.strip() for part in f"{row} ".split("-> ")]


def named(text: str) -> list[str]:
    """File names, .csv where no suffix is given."""
    plain = (
        re.sub(r"\\u(....)", lambda code: chr(int(code[1], 16)), name) for name in text.split(", ")
    )
    return [name if name.endswith(".gz") else f"{name}.csv" for name in plain]


@pytest.mark.parametrize("first", ["R12_C08", "R12C08", "reb12_comp8"])
def test_of_two_adjusters_one_was_turned(first) -> None:
    names = [f"run_{first}.csv", f"run_{first.replace('12', '6')}.csv"]
    guess = guess_settings(names)
    assert guess.adjusters == ("rebound", "compression")
    assert [place.places[0][1] for place in guess.settings.values()] == [12, 6]
    for name, clicks in zip(names, ("12", "6"), strict=True):
        assert re.search(guess.pattern, name)["rebound"] == clicks


@pytest.mark.parametrize("row", GUESSED.strip().splitlines())
def test_what_differs_is_the_setting(row) -> None:
    given, clicks, pattern = parted(row)
    names, cells = named(given), [float(one) for one in clicks.split(", ")]
    (pattern,) = named(pattern)
    pattern = pattern.removesuffix(".csv")
    guess = guess_settings(names)
    assert [guess.settings[name].places[0][1] for name in names] == cells
    assert "guessed from the file names" in str(guess.finding)
    assert str(guess.finding).endswith(f"--rig 'setting_pattern={pattern}'")
    # What is to be copied finds the same.
    assert [float(list(re.finditer(pattern, name))[-1]["setting"]) for name in names] == cells


@pytest.mark.parametrize(
    "given",
    """
t1_2_2_24_24_x5_100psi, t2_4_4_24_24_x5_100psi
run1_a3_32mm, run2_a3_32mm, run3_a5_32mm
a_0.5, a_1.5
SN1234, SN1235
b_999, b_1000
a_3, b_x_4
test_1_25 \u00b0C, test_2_35 \u00b0C
Lauf_1, Lauf_2
Pr\u00fcfling_1, Pr\u00fcfling_2
k_3, k_4, broken, other
log
""".strip().splitlines(),
)
def test_a_choice_is_no_guess(given) -> None:
    """Several numbers, one log alone, a speed, halves, counts, serials, degrees, two kinds."""
    guess = guess_settings(named(given))
    assert guess.settings == {}
    assert str(guess.finding or "") == ""


# File names -> the adjusters to declare, and the pattern to copy where the names tell it.
SEVERAL = r"""
c10_r12, c8_r14 -> compression = "", rebound = "" -> c(?P<compression>\d+)_r(?P<rebound>\d+)
R12C08, R12C10, R10C08 -> rebound = "", compression = "" -> R(?P<rebound>\d+)C(?P<compression>\d+)
D7_LSC-2_HSC-1_1Hz, D7_LSC-4_HSC-3_1Hz -> lsc = "", hsc = "" -> LSC-(?P<lsc>\d+)_HSC-(?P<hsc>\d+)
5_3, 6_4 -> a = "", b = "" -> ^(?P<a>\d+)_(?P<b>\d+)
\u04361_b3, \u04362_b4 -> a = "", b = "" ->
x1_3, x2_4 -> a = "", b = "" ->
x1_b3, x2_b4 -> x = "", compression = "" ->
a5_x1_b3, a5_x2_b4 -> x = "", compression = "" ->
x1_b3_k1_q2, x2_b4_k2_q3 -> x = "", compression = "", k = "", q = "" ->
"""


@pytest.mark.parametrize(
    ("given", "labels"),
    [
        ("R12_C08, R10_C10", ["R12 C8", "R10 C10"]),
        ("run c10 r12, run c8 r14", ["C10 R12", "C8 R14"]),
        ("L06_H1_1Hz, L10_H3_1Hz", ["L6 H1", "L10 H3"]),
        ("D7_LSC2_HSC1, D7_LSC4_HSC3", ["L2 H1", "L4 H3"]),
        ("x1_b3, x2_b4", ["None", "None"]),
        ("5_3, 6_4", ["None", "None"]),
        ("R12_C08, R10_C10, broken", ["None", "None", "None"]),
    ],
)
def test_numbers_of_both_strokes_or_speeds_are_one_label(given, labels) -> None:
    """Logs named so were all refused. Other words, or numbers alone, are asked about."""
    settings = guess_settings(named(given)).settings
    assert [str(settings.get(name)) for name in named(given)] == labels


@pytest.mark.parametrize("row", SEVERAL.strip().splitlines())
def test_several_adjusters_are_offered_a_pattern_for_all(row) -> None:
    """The pattern to copy read one of the two; R12C08 was taken for C alone, R 12 for degrees."""
    given, declared, pattern = parted(row)
    names = named(given)
    guess = guess_settings(names)
    assert f"[adjusters] {declared}" in str(guess.advice)
    if pattern:
        assert str(guess.advice).endswith(f"--rig 'setting_pattern={pattern}'")
        found = [re.search(pattern, name, re.IGNORECASE).groups() for name in names]
        numbers = [re.findall(r"\d+", name)[-2 - ("Hz" in name) :][:2] for name in names]
        assert found == [tuple(two) for two in numbers]


@pytest.mark.parametrize(
    ("given", "is_unclear"),
    [
        ("t1_2_24_s1, t1_2_24_s5, t1_2_12_s1, t1_2_12_s5", True),  # s is the speed of the test
        ("t1_2_2_s5, t1_4_4_s5", True),  # two numbers differ beside it: no count
        ("t1_2_24_s1, t1_2_24_s5", False),  # only s differs
        ("001_s5, 002_s5, 003_s6", False),  # a count of the logs
        ("1_s5, 1_s6, 2_s6", True),  # no count: 1 is there twice
        ("run1_s5, run1_s6, run2_s5", False),  # runs are counted
        ("t1_2_24_s5", False),  # one name
        ("c2_x24, c2_x12, c4_x12", False),  # no s
    ],
)
def test_s_is_no_setting_for_certain_where_other_numbers_differ(given, is_unclear) -> None:
    names = named(given)
    assert unclear_names(names) == (frozenset(names) if is_unclear else frozenset())


def test_clicks_and_a_speed_are_asked_about_with_a_pattern_for_the_clicks() -> None:
    clicks = ("2_2_8_4", "2_9_8_5", "4_9_3_4")
    names = [f"t1_{one}_s{s}_100psi.csv" for one in clicks for s in (1, 5)]
    advice = str(guess_settings(names).advice)
    assert '[adjusters] a = "", b = "", c = "", d = ""' in advice
    pattern = r"^t\d+_(?P<a>\d+)_(?P<b>\d+)_(?P<c>\d+)_(?P<d>\d+)"
    assert advice.endswith(f"--rig 'setting_pattern={pattern}'")
    assert re.search(pattern, names[2]).groups() == ("2", "9", "8", "5")


def test_a_name_of_another_kind_costs_the_others_nothing() -> None:
    """A broken file among good ones took their settings from all."""
    found = guess_settings(["k_3.csv", "k_4.csv", "broken.csv"]).settings
    assert {*found} == {"k_3.csv", "k_4.csv"}
    assert [one_of_several(name) for name in ("s123_x02.csv", "s1234_x02.csv")] == ["123", ""]


# File names -> what the offered pattern finds, and that pattern.
WORDS = r"""
soft, mid, hard -> soft, mid, hard -> ^(?P<setting>[^\W\d_]+)
D7 soft 1.5Hz, D7 hard 1.5Hz -> soft, hard -> 7 (?P<setting>[^\W\d_]+)
clk+0, clk-12, clk-4 -> +0, -12, -4 -> clk(?P<setting>[+-]?\d+)
D7 clk +4, D7 clk -4 -> +4, -4 ->
soft_a, hard_b -> ->
soft -> ->
"""


@pytest.mark.parametrize("row", WORDS.strip().splitlines())
def test_a_word_or_a_sign_is_asked_about_with_an_option_to_copy(row) -> None:
    """`clk-4` beside `clk+0` was read as setting 4."""
    given, finds, pattern = parted(row)
    guess = guess_settings(named(given))
    assert not guess.settings
    told = re.search("setting_pattern=(.*)'", str(guess.advice or ""))
    assert bool(told) is bool(finds)
    if told:
        assert told[1] == (pattern or told[1])
        found = [re.search(told[1], name)["setting"] for name in named(given)]
        assert found == finds.split(", ")


# Tables of tests.


def table(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "tests.csv"
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16"])
@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_separators_umlauts_and_other_columns(tmp_path, encoding, mark) -> None:
    head = "Datei|Rebound|compression|S/N|Kunde|Farbe"
    rows = [head, "a.csv|12|-8|0077|Müller|grün", "|||||", ""]
    path = table(tmp_path, "\r\n".join(rows).replace("|", mark), encoding)
    found = read_tests(path, TWO)
    row = found.rows["a.csv"]
    assert dict(row.places) == {"rebound": 12, "compression": -8}
    assert row.identity.describe() == {"serial": "0077", "customer": "Müller", "Farbe": "grün"}
    assert row.line == 2
    assert found.notes == ()


def test_labels_words_and_empty_cells_and_the_same_row_twice(tmp_path) -> None:
    text = "file,setting,compression\na.csv,R12 C8,\nsub/b.csv,,soft\n'c.csv,,\na.csv,R12 C8,\n"
    rows = read_tests(table(tmp_path, text), TWO).rows
    assert dict(rows["a.csv"].places) == {"rebound": 12, "compression": 8}
    assert dict(rows["sub/b.csv"].places) == {"compression": "soft"}
    assert len(rows) == 3


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is empty"),
        ("flie,setting\na.csv,1\n", r":1: no column 'file'; found flie, setting; name the one"),
        ("file,setting\na.csv,1\na.csv,2\n", r":3: 'a\.csv' is in line 2 too, with other values"),
        ("file,setting\na.csv,1,2\n", r":2: 3 fields, but 2 names in line 1"),
        ("file,setting\n,1\n", r":2: no file name in column 'file'"),
        ("file,setting\na.csv,1e9\n", r":2: setting: found '1e9', expected clicks"),
        ("file,setting,setting\na.csv,1,2\n", r":1: two columns are named 'setting'"),
    ],
)
def test_a_bad_table_is_told_with_its_line(tmp_path, text, says) -> None:
    with pytest.raises(ConfigurationError, match=says):
        read_tests(table(tmp_path, text), ("setting",))
    half = table(tmp_path, "file,setting\na.csv,12\n")  # one of two adjusters
    with pytest.raises(ConfigurationError, match=":2: setting: found '12', expected a place for"):
        read_tests(half, TWO)


def test_a_misspelt_column_is_kept_and_said(tmp_path) -> None:
    found = read_tests(table(tmp_path, "file,rebond\na.csv,12\n"), TWO)
    row = found.rows["a.csv"]
    assert (dict(row.places), row.identity.describe()) == ({}, {"rebond": "12"})
    assert "column 'rebond' is kept as a note" in found.notes[0]
    assert "'rebound'" in found.notes[0]


def test_a_log_of_that_name_is_no_table(tmp_path) -> None:
    assert not is_tests_table(table(tmp_path, "time_s,displacement_mm,force_N\n0,1,2\n"))
    assert is_tests_table(table(tmp_path, "Setting;File\n1;a.csv\n"))
    assert not is_tests_table(tmp_path / "other.csv")
