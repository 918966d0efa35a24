"""Units for people: parsed, converted, named."""

import pytest

from damperfit.units.quantities import QuantityError
from damperfit.units.shown_units import SI, parse_units


@pytest.mark.parametrize(
    ("text", "force", "speed", "length"),
    [
        ("lbf,in/s", 1 / 4.4482216152605, 1 / 0.0254, 1.0),
        ("N, mm/s", 1.0, 1e3, 1.0),
        ("daN", 0.1, 1.0, 1.0),
        ("mm,kN", 1e-3, 1.0, 1e3),
    ],
)
def test_numbers_are_converted_and_what_is_not_named_is_si(text, force, speed, length) -> None:
    units = parse_units(text)
    assert units.show(1.0, "N") == pytest.approx(force)
    assert units.show(1.0, "m/s") == pytest.approx(speed)
    assert units.show(1.0, "m") == pytest.approx(length)
    assert units.show(5.0, "Pa") == 5.0
    assert not units.is_si


def test_si_is_left_as_it_is() -> None:
    assert parse_units("N,m/s").is_si
    assert SI.column("force_N", "N") == "force_N"
    assert SI.say("0.1 m/s, N") == "0.1 m/s, N"


@pytest.mark.parametrize(
    ("name", "unit", "told"),
    [
        ("force_N", "N", "force_lbf"),
        ("speed_m_per_s", "m/s", "speed_in_per_s"),
        ("f_f", "N", "f_f"),
        ("amplitude_m", "m", "amplitude_m"),
        ("energy_J", "J", "energy_J"),
    ],
)
def test_a_column_s_name_tells_the_unit_shown(name, unit, told) -> None:
    assert parse_units("lbf,in/s").column(name, unit) == told


def test_words_are_not_taken_for_units() -> None:
    say = parse_units("lbf,in/s").say
    assert say("force at 3.94 m/s, N") == "force at 3.94 in/s, lbf"
    assert say("N s/(m2 kg) in N/m, No. 5, 4 N") == "lbf s/(m2 kg) in N/m, No. 5, 4 lbf"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("lbf,furlong/s", "no unit 'furlong/s'; there are force N"),
        ("", "no unit ''"),
        ("N,daN", "N and daN are both of force"),
        ("bar", "no unit 'bar'"),
    ],
)
def test_what_is_no_unit_is_refused(text, said) -> None:
    with pytest.raises(QuantityError, match="--units") as caught:
        parse_units(text)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("the test's sine of 32 mm at 1.5 Hz", "the test's sine of 1.26 in at 1.5 Hz"),
        ("amplitude 19.6 to 25.4 mm, 30 degC", "amplitude 0.7717 to 1 in, 30 degC"),
        ("0.1 m/s, 12.6 mm2, 3 mm/s", "0.1 m/s, 12.6 mm2, 3 mm/s"),
    ],
)
def test_lengths_in_words_are_in_the_unit_that_is_shown(text: str, said: str) -> None:
    assert parse_units("in").say_lengths(text) == said
    assert parse_units("mm").say_lengths(text) == text
    assert parse_units("lbf,in/s").say_lengths(text) == text
