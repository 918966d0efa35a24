"""How many unknowns a shared quantity is, and which of them a setting has."""

from __future__ import annotations

import pytest

from damperfit.identification.sharing import Sharing
from damperfit.identification.unknowns import Unknown, unknown_at, unknowns_of
from damperfit.tested.setting import Setting
from tests.identification.adjusted import HIGH, LOW, SETTINGS, at


def test_as_many_as_the_adjusters_have_clicks() -> None:
    found = unknowns_of(("a", "b", "c"), {"a": (LOW,), "b": (LOW, HIGH)}, SETTINGS)
    assert [one.name for one in found] == ["a", "a", "b", "b", "b", "b", "c"]
    assert found[1].label == "a at low_speed 14"
    assert found[2].label == "b at low_speed 6, high_speed 1"
    assert found[-1].label == "c"


def test_a_setting_has_one_of_them() -> None:
    follows = {"a": (HIGH,)}
    mine = unknown_at("a", follows, at(6, 3))
    assert mine == unknown_at("a", follows, at(14, 3)) == Unknown("a", ((HIGH, 3),))
    assert mine.holds_at(at(20, 3))
    assert not mine.holds_at(at(6, 1))
    assert unknown_at("a", {}, at(6, 3)).holds_at(Setting.of(4))


def test_a_click_that_the_fit_has_not_seen_is_shared_with_none() -> None:
    sharing = Sharing(
        ("a", "b", "f"), ("a", "b"), {"a": (LOW,)}, is_detected=True, settings=SETTINGS
    )
    assert sharing.found_at(at(6, 1)) == ("a", "b")
    assert sharing.found_at(at(20, 1)) == ("b",)
    assert sharing.common == ("b",)
    assert sharing.whose("a", at(6, 1)) == "all settings at low_speed 6"
    assert sharing.whose("b", at(6, 1)) == "all settings"
    assert sharing.sentence == (
        "The logs show that a follows low_speed; f is each setting's own; everything else is "
        "shared by all 4 settings"
    )


@pytest.mark.parametrize(
    ("jointly", "said"),
    [
        (("a", "b"), "everything is shared by all 4 settings"),
        (("a",), "b is each setting's own; everything else is shared by all 4 settings"),
    ],
)
def test_that_nothing_follows_an_adjuster_is_said_where_it_was_asked(jointly, said) -> None:
    sharing = Sharing(("a", "b"), jointly, {}, is_detected=True, settings=SETTINGS)
    assert sharing.sentence == f"The logs show that {said}"


def test_nothing_is_said_where_parameters_were_named() -> None:
    assert Sharing(("r_m1", "r_m3"), ("r_m3",), settings=SETTINGS).sentence == ""
