"""Units: factors against their definitions, text against numbers, refusals."""

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from damperfit.units.quantities import (
    _TABLE,
    QuantityError,
    find_unit,
    parse_quantity,
    units_of,
)
from damperfit.units.shown_units import SI, parse_units

# One of each unit in SI, from its legal definition; temperatures are degrees Celsius inside.
PSI = 6894.757293168361
VALUES = {
    "length": {"m": 1.0, "mm": 1e-3, "cm": 0.01, "um": 1e-6, "in": 0.0254}
    | dict.fromkeys(("\N{MICRO SIGN}m", "\N{GREEK SMALL LETTER MU}m"), 1e-6),
    "force": {"N": 1.0, "mN": 1e-3, "daN": 10.0, "kN": 1e3, "kip": 4448.2216152605, "tf": 9806.65}
    | {"lbf": 4.4482216152605, "klbf": 4448.2216152605, "kgf": 9.80665, "gf": 0.00980665},
    "time": {
        "s": 1.0,
        "sec": 1.0,
        "ms": 1e-3,
        "us": 1e-6,
        "min": 60.0,
        "h": 3600.0,
        "day": 86400.0,
    },
    "pressure": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5, "psi": PSI},
    "absolute pressure": {"Pa": 1.0, "Paa": 1.0, "kPa": 1e3, "kPaa": 1e3, "MPa": 1e6, "MPaa": 1e6}
    | {"bar": 1e5, "bara": 1e5, "psi": PSI, "psia": PSI, "kPag": 102325.0, "MPag": 1101325.0}
    | {"barg": 201325.0, "psig": 108219.75729316836},
    "frequency": {"Hz": 1.0, "kHz": 1e3},
    "temperature": {"degC": 1.0, "\N{DEGREE SIGN}C": 1.0, "K": -272.15, "degF": -17.22222222222222},
    "velocity": {"m/s": 1.0, "mm/s": 1e-3, "cm/s": 0.01, "in/s": 0.0254, "km/h": 1 / 3.6}
    | {"mph": 0.44704},
    "mass": {"kg": 1.0, "lb": 0.45359237},
    "density": {"kg/m3": 1.0, "g/cm3": 1e3},
    "area": {"m2": 1.0, "cm2": 1e-4, "mm2": 1e-6},
    "volume": {"m3": 1.0, "l": 1e-3, "cm3": 1e-6},
    "stiffness": {"N/m": 1.0, "N/mm": 1e3, "kN/mm": 1e6},
    "voltage": {"V": 1.0, "mV": 1e-3},
    "power": {"W": 1.0, "kW": 1e3},
}
DEFINITIONS = [(kind, unit, one) for kind, units in VALUES.items() for unit, one in units.items()]


def test_every_unit_has_its_definition_above() -> None:
    assert all(set(units_of(kind)) <= set(units) for kind, units in VALUES.items())
    assert set(VALUES) == set(_TABLE)


SPELLINGS = """
time: msec mSec millisecond milliseconds -> ms
time: sec Sec SEC secs second seconds Sek sek -> s
length: MM millimeter millimeters millimetre millimetres -> mm
length: micron microns -> um
length: in. IN inch inches -> in
force: newton newtons Newton Newtons -> N
force: lb Lbf LBF lbs Lbs LBS pound pounds -> lbf
force: kp Kgf KGF -> kgf
force: kips Kip Kips KIP KIPS klbf KLBF -> kip
force: DAN -> daN
force: KN -> kN
"""


@pytest.mark.parametrize("row", SPELLINGS.strip().splitlines())
def test_spellings_are_of_one_unit(row: str) -> None:
    dimension, spellings, symbol = re.split(": | -> ", row)
    assert {find_unit(name, dimension).symbol for name in spellings.split()} == {symbol}


@pytest.mark.parametrize(("dimension", "unit", "expected"), DEFINITIONS)
def test_one_of_each_unit_is_its_definition(dimension: str, unit: str, expected: float) -> None:
    assert parse_quantity(f"1{unit}", dimension) == pytest.approx(expected, rel=1e-14)
    array = find_unit(unit, dimension).to_si(np.array([1.0, 1.0]))
    np.testing.assert_allclose(array, [expected, expected], rtol=1e-13)


TEXTS = """
length: 32mm 0.032
length: 19 mm 0.019
length: 0.032 0.032
length: 1e-999mm 0
pressure: 4.6bar 460000
velocity: 0.1mm/s 0.0001
frequency: 1.5e3Hz 1500
temperature: -40degF -40
temperature: 299.15K 26
force: +.5kN 500
"""


@pytest.mark.parametrize("row", TEXTS.strip().splitlines())
def test_text_becomes_the_nearest_float(row: str) -> None:
    # Exactly: 4.6 * 1e5 in floats is 459999.99999999994.
    dimension, text, expected = re.fullmatch(r"(\w+): (.*) (\S+)", row).groups()
    assert parse_quantity(f" {text} ", dimension) == float(expected)
    assert parse_quantity(float(expected), dimension) == float(expected)


@pytest.mark.parametrize(
    "text", ["", "mm", "nan", "inf", "1e999", "1e999mm", "3 4mm", "1_000", "0x10", "1,5mm", "٣mm"]
)
def test_what_is_no_finite_number_is_refused(text: str) -> None:
    with pytest.raises(QuantityError):
        parse_quantity(text, "length")


SLIPS = """
force newtn newton
force n N
length milimeters millimeters
length inchs inches
length CM cm
time secnds seconds
pressure BAR bar
pressure mpa MPa
frequency HZ Hz
"""


@pytest.mark.parametrize("row", SLIPS.strip().splitlines())
def test_a_slip_gets_the_unit_that_was_meant(row: str) -> None:
    dimension, name, meant = row.split()
    with pytest.raises(QuantityError, match=rf"Did you mean '{meant}'\?"):
        find_unit(name, dimension)


PREFIXES = (*"TGMkhdcmuµnp", "da", "kilo", "mega", "milli", "centi", "micro", "deca", "nano")
UNKNOWN = {
    "force": "ozf ton tonf dyn MN Mn poundal kpf Nm kilonewton",
    "length": "mil thou ft Mm yd centimeters decimeter micrometers nanometre",
    "time": "h hours minutes microseconds mseconds MS",
    "pressure": "hPa mbar mPa ksi psf atm",
    "velocity": "m/min ft/s knots",
}


def test_no_hint_offers_a_unit_of_another_size() -> None:
    # "kip" was answered with "kp", 454 times less.
    names = [
        (dimension, prefix + unit)
        for dimension in _TABLE
        for spellings in _TABLE[dimension]
        for unit in spellings.split()
        for prefix in PREFIXES
    ]
    names += [(dimension, name) for dimension in UNKNOWN for name in UNKNOWN[dimension].split()]
    refusals = [said for said in (_refusal(*name) for name in names) if said]
    assert len(refusals) > 0.9 * len(names)
    assert [said for said in refusals if "Did you mean" in said] == []


def _refusal(dimension: str, name: str) -> str:
    try:
        find_unit(name, dimension)
    except QuantityError as error:
        return str(error)
    return ""


# Not `st.text`, which first makes a table of all characters: 2 s.
@given(st.lists(st.integers(0, 0xD7FF).map(chr), max_size=12).map("".join))
def test_any_text_is_a_finite_number_or_our_error(text: str) -> None:
    try:
        value = parse_quantity(text, "force")
    except QuantityError:
        return
    assert math.isfinite(value)


# Units for people: parsed, converted, named.


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
    shown = [units.show(1.0, one) for one in ("N", "m/s", "m", "Pa")]
    assert shown == pytest.approx([force, speed, length, 1.0])
    assert (units.is_si, parse_units("N,m/s").is_si) == (False, True)


def test_columns_and_words_have_the_unit_that_is_shown() -> None:
    units = parse_units("lbf,in/s")
    told = {"force_N": "N", "speed_m_per_s": "m/s", "f_f": "N", "amplitude_m": "m", "energy_J": "J"}
    names = [units.column(name, unit) for name, unit in told.items()]
    assert names == ["force_lbf", "speed_in_per_s", "f_f", "amplitude_m", "energy_J"]
    assert SI.column("force_N", "N") == "force_N"
    words = "N s/(m2 kg) in N/m, No. 5, 4 N at 0.1 m/s"
    assert units.say(words) == "lbf s/(m2 kg) in N/m, No. 5, 4 lbf at 0.1 in/s"
    assert [each.write_length(0.0254, ".3g") for each in (units, SI)] == ["25.4 mm"] * 2
    assert [parse_units(unit).write_length(0.0508, ".3g") for unit in ("in", "mm")] == [
        *("2 in", "50.8 mm")
    ]


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
