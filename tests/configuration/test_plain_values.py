"""Values of keys by themselves, and whose key a mistake is told of."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from damperfit.configuration.blamed_places import with_place
from damperfit.configuration.plain_values import known_or_detect, quantity, quantity_or_word


@pytest.mark.parametrize(
    ("value", "found"), [("auto", "auto"), ("2ms", 2e-3), (3e-3, 3e-3), ("0.004", 4e-3)]
)
def test_a_quantity_or_one_word(value, found) -> None:
    assert quantity_or_word("time", "auto").func(value) == found


@pytest.mark.parametrize("value", ["automatic", "2mm", "", "auto "])
def test_another_word_is_no_quantity(value) -> None:
    with pytest.raises(ValueError, match=r"time|expected|number"):
        quantity_or_word("time", "auto").func(value)


def test_a_bare_number_is_taken_as_it_is() -> None:
    assert quantity("length").func("32mm") == pytest.approx(0.032)
    assert quantity("length").func(0.032) == 0.032
    with pytest.raises(ValueError, match="auto"):
        quantity("length").func("auto")


@pytest.mark.parametrize("value", [True, False, "detect"])
def test_known_or_to_be_found(value) -> None:
    assert known_or_detect(value) is value


@pytest.mark.parametrize("value", ["yes", 1, None])
def test_neither_known_nor_to_be_found(value) -> None:
    with pytest.raises(ValueError, match="expected true, false or 'detect'"):
        known_or_detect(value)


def layer(source: str, **values: object) -> SimpleNamespace:
    return SimpleNamespace(values=values, name_of=lambda section, key: f"{source}: {section}.{key}")


FILE = layer(
    "mine.toml:3", rig={"columns": {"force": "F (N)"}, "skew": "2ms"}, test={"date": "x", "rig": ""}
)
TYPED = layer("--rig", rig={"skew": "3ms"}, output={"checks": ["purdy2000", "nonsense"]})


@pytest.mark.parametrize(
    ("message", "told"),
    [
        ("skew: found 9 s", "--rig: rig.skew: found 9 s"),  # the last that was typed
        ("rig_skew: found 9 s", "--rig: rig.skew: found 9 s"),
        ("columns: no 'F (N)'", "mine.toml:3: rig.columns: no 'F (N)'"),
        ("no column 'F (N)'", "mine.toml:3: rig.columns: no column 'F (N)'"),
        ("'force' is twice", "mine.toml:3: rig.columns: 'force' is twice"),
        ("no check 'nonsense'", "--rig: output.checks: no check 'nonsense'"),
        ("skew = 2ms: too long", "mine.toml:3: rig.skew: skew = 2ms: too long"),
        ("no check 'other'", "no check 'other'"),
        ("empty ''", "empty ''"),
        ("date is wrong", "date is wrong"),
    ],
)
def test_a_mistake_is_told_of_the_key_that_was_typed(message, told) -> None:
    assert with_place(message, (FILE, TYPED)) == told


def test_what_is_no_text_is_left_to_the_schema() -> None:
    value = [1.0]
    assert quantity_or_word("time", "auto").func(value) is value
