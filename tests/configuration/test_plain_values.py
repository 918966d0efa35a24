"""Values of keys by themselves."""

from __future__ import annotations

import pytest

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


def test_what_is_no_text_is_left_to_the_schema() -> None:
    value = [1.0]
    assert quantity_or_word("time", "auto").func(value) is value
