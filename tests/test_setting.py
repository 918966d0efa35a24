"""A setting is a label: one adjuster in whole clicks equals its number, any other is itself."""

import re

import pytest

from damperfit.tested.setting import (
    LONGEST_WORD,
    Setting,
    lines_of,
    parse_place,
    parse_setting,
    short_names,
)

TWO = ("rebound", "compression")


def two(rebound, compression):
    return Setting((("rebound", rebound), ("compression", compression)))


def test_one_adjuster_in_whole_clicks_is_its_number():
    setting = Setting.of(10)
    assert setting == 10
    assert hash(setting) == hash(10)
    assert {setting: "x"}[10] == "x"
    assert setting.cell == 10
    assert type(setting.cell) is int
    assert f"{setting}" == "10"
    assert setting > 9
    assert setting < 11
    assert setting != 11
    assert setting != "10"
    assert Setting((("rebound", 10),)) == 10


PLACES = {
    "10": 10,
    " 08 ": 8,
    "10.0": 10,
    "-3": -3,
    "+3": 3,
    "2.5": 2.5,
    "0": 0,
    "1000000": 1_000_000,
    **{word: word for word in ("soft", "full open", "härter", "a" * LONGEST_WORD)},
}


@pytest.mark.parametrize(("text", "place"), PLACES.items())
def test_a_place_is_clicks_or_a_word(text, place):
    assert parse_place(text) == place
    assert type(parse_place(text)) is type(place)


@pytest.mark.parametrize(
    "text",
    ["", "  ", "1000001", "-1000001", "1e3", "nan", "inf", "-infinity", "12345678901", "?", "1,5",
     "a" * (LONGEST_WORD + 1), "soft\n2"],
)  # fmt: skip
def test_what_is_no_place_is_refused(text):
    with pytest.raises(ValueError, match="expected clicks"):
        parse_place(text)


@pytest.mark.parametrize(
    "text",
    ["rebound=12, compression=8", "R12 C08", "r12c8", "C8 R12", "12/8", "12 8", "12;8",
     "12, 8", "12 / 8", "12; 8", "12|8", "rebound: 12; compression: 8",
     "Rebound 12, Compression 8"],
)  # fmt: skip
def test_a_label_of_two_adjusters(text):
    setting = parse_setting(text, TWO)
    assert setting == two(12, 8)
    assert (setting.label, setting.cell, setting.slug) == ("R12 C8", "R12 C8", "R12_C8")
    assert setting.number() is None
    assert setting.number("compression") == 8.0


@pytest.mark.parametrize("text", ["12", "R12", "R12 R8", "R12 C", "1/2/3", "", "hard"])
def test_half_a_label_is_refused(text):
    with pytest.raises(ValueError, match=r"expected|twice"):
        parse_setting(text, TWO)


LABELS = """
low_speed high_speed: L6 H1 -> 6 1
low_speed high_speed: H1 L6 -> 6 1
low_speed high_speed: LS6/HS1 -> 6 1
low_speed high_speed: 6l 1h -> 6 1
low_speed_compression high_speed_compression rebound: LSC 4 HSC 2 R 10 -> 4 2 10
rebound compression: C3R5 -> 5 3
bump rebound: b12-r8 -> 12 8
compression rebound: b12-r8 -> 12 8
rebound bump: reb 12 comp 8 -> 12 8
rebound compression: 12/8 -> 12 8
low_speed high_speed: A6 B1 -> the letters ., . name none
low_rebound low_bump: L6 H1 -> the letters ., . name none
low_speed high_speed: 6a 1b -> the letters ., . name none
"""


@pytest.mark.parametrize("row", LABELS.strip().splitlines())
def test_letters_name_adjusters_by_their_initials_and_strokes_and_are_never_words(row):
    names, text, expected = re.split(": | -> ", row)
    adjusters = names.split()
    if expected.startswith("the"):
        with pytest.raises(ValueError, match=expected) as found:
            parse_setting(text, adjusters)
        assert f"{adjusters[0]}=12" in str(found.value)
        return
    places = map(int, expected.split())
    assert parse_setting(text, adjusters).places == tuple(zip(adjusters, places, strict=True))


@pytest.mark.parametrize("text", ["10 clicks", "click 10", "R10", "10r", "rebound 10", "reb10"])
def test_the_only_adjuster_may_be_named_too(text):
    assert parse_setting(text, ["rebound"]).places == (("rebound", 10),)
    assert parse_setting("V10").cell == "V10"
    assert parse_setting("s10").cell == 10


@pytest.mark.parametrize("word", ["setting", "s", "S", "clicks"])
@pytest.mark.parametrize(
    ("said", "click"),
    [("-3", 3), ("3", 3), (" 3", 3), ("_3", 3), ("=3", 3), (": 3", 3), ("-03", 3), ("-2.5", 2.5),
     (" -3", -3), ("_-3", -3), ("=-3", -3), (": -3", -3), ("--3", -3)],
)  # fmt: skip
def test_a_hyphen_directly_behind_a_word_parts_and_is_no_sign(word, said, click):
    assert parse_setting(word + said) == click


def test_the_hyphen_of_a_label_alone_is_a_sign():
    assert [parse_setting(text) for text in ("-3", " -3", "-3 clicks", "setting: -3")] == [-3] * 4
    assert parse_setting("setting: s-3") == 3
    assert parse_setting("C-3", ["compression"]).places == (("compression", 3),)
    assert parse_setting("R12 C-3", TWO) == two(12, -3)  # our own label of several


def test_order_is_by_adjuster_by_number_words_last():
    given = [two(12, 8), two(2, 10), two("soft", 1), two(2, 9), two(-1, 3)]
    ordered = ["R-1 C3", "R2 C9", "R2 C10", "R12 C8", "R:soft C1"]
    assert [one.label for one in sorted(given)] == ordered
    assert [one.cell for one in sorted(map(Setting.of, ["V10", 3, "V2", -1]))] == [
        -1,
        3,
        "V2",
        "V10",
    ]


def test_from_closed_the_highest_click_is_the_softest():
    given = [two(2, 8), two(12, 8), two(2, 3)]
    order = sorted(given, key=lambda one: one.softness(["rebound"]))
    assert [one.label for one in order] == ["R12 C8", "R2 C3", "R2 C8"]
    assert sorted(given, key=lambda one: one.softness([])) == sorted(given)


def test_short_names_are_unlike_or_whole():
    assert short_names(TWO) == {"rebound": "R", "compression": "C"}
    assert short_names(("low_c", "low_r", "lever")) == {"low_c": "LC", "low_r": "LR", "lever": "L"}
    assert short_names(("high", "hard")) == {"high": "high", "hard": "hard"}


def test_lines_hold_the_other_adjusters():
    settings = [two(2, 8), two(4, 8), two(6, 8), two(4, 2), two(4, 20), two("soft", 8)]
    lines = {
        (line.adjuster, line.held): [s.label for s in line.settings] for line in lines_of(settings)
    }
    assert lines == {
        ("rebound", "compression 8"): ["R2 C8", "R4 C8", "R6 C8"],
        ("compression", "rebound 4"): ["R4 C2", "R4 C8", "R4 C20"],
    }
    (alone,) = lines_of([3, 1, 2])
    assert list(alone.numbers.values()) == [1.0, 2.0, 3.0]
    (words,) = lines_of(["soft", "hard"])
    assert words.settings == ()
    assert lines_of([]) == ()
