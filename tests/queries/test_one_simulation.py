"""Which parameters a simulation takes: also of a setting that no log was of."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from damperfit.errors import ConfigurationError
from damperfit.identification import Campaign, Status
from damperfit.queries.simulations import ChosenParameters, choose_parameters
from damperfit.results import Tested
from damperfit.tables.files import write_table
from damperfit.tables.rows import make_tables
from tests import fakes
from tests.identification.adjusted import HIGH, LOW, SETTINGS, at

BLEED, OPENING = {6: 2e4, 14: 1e4}, {1: 3e6, 3: 4e6}


def campaign() -> Campaign:
    """Three of four settings, with a value for each click."""
    fits = []
    for one in SETTINGS[:3]:
        fit = fakes.fit(1)
        values = fit.parameters.replace(r_m1=BLEED[one.place(LOW)], r_m2=OPENING[one.place(HIGH)])
        fits.append(replace(fit, setting=one, parameters=values))
    return replace(fakes.campaign(*fits), fits=tuple(fits))


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_setting_that_was_not_tested_is_put_together(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"parameters{suffix}"
    write_table(path, make_tables(campaign())["parameters"], suffix=suffix)
    for label in ("low_speed=14, high_speed=3", "LS14 HS3"):
        found = choose_parameters(setting=label, table=path, replaced={})
        assert (found.parameters.r_m1, found.parameters.r_m2) == (1e4, 4e6)
        assert "put together from the clicks of the settings of" in found.source
    assert found.setting == at(14, 3)
    with pytest.raises(ConfigurationError, match="no parameters of setting LS20 HS3; there are"):
        choose_parameters(setting="LS20 HS3", table=path, replaced={})


def undetermined_campaign() -> Campaign:
    """As `campaign`, with a blow-off that opens in no log of the third click."""
    one = campaign()
    status = {**one.fits[1].status, "r_m2": Status.NOT_IDENTIFIABLE}
    return replace(one, fits=(one.fits[0], replace(one.fits[1], status=status), one.fits[2]))


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_value_that_no_log_limits_is_named_where_it_acts(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"parameters{suffix}"
    write_table(path, make_tables(undetermined_campaign())["parameters"], suffix=suffix)
    unseen = choose_parameters(setting="LS14 HS3", table=path, replaced={})
    (said,) = unseen.warnings(0.1)
    assert said == (
        "r_m2 at setting LS14 HS3: the logs of the settings that it is put together from set no "
        "upper limit, so these forces may be far off; fit a log of this setting, or replace the "
        "value"
    )
    given = choose_parameters(setting="LS14 HS3", table=path, replaced={"r_m2": "3e6"})
    assert given.warnings(0.1) == ()
    own = choose_parameters(setting="LS6 HS3", table=path, replaced={})
    assert own.warnings(9.0) == ()  # nobody knows what was tested
    faster = replace(own, tested=Tested(1, 0.03, 0.1, (0.5, 0.5)))
    assert faster.warnings(0.1) == ()
    assert "r_m2: the logs of setting LS6 HS3 set no upper limit" in faster.warnings(0.2)[1]
    assert choose_parameters(setting="LS6 HS1", table=path, replaced={}).warnings(0.1) == ()


@pytest.mark.parametrize(("speed", "n"), [(0.209, 0), (0.211, 1)])
def test_a_speed_beyond_the_tests_is_extrapolated(speed: float, n: int) -> None:
    tested = Tested(1, 0.03, 0.2, (1.0, 1.5))
    one = ChosenParameters(fakes.fit(1).parameters, None, "", tested=tested)
    assert len(one.warnings(speed)) == n
    if n:
        assert one.warnings(speed) == (
            "never tested: 0.211 m/s (tested: up to 0.2 m/s); there the force is extrapolated",
        )
    assert one.warnings(0.1, amplitude=0.031, frequency=1.55) == ()
    (said,) = one.warnings(0.1, amplitude=0.11, frequency=15.0)
    assert "110 mm (tested: up to 30 mm), 15 Hz (tested: 1 to 1.5 Hz)" in said


@pytest.mark.parametrize(("warmth", "n"), [
    (19.05, 0), (18.95, 1), (55.95, 0), (56.05, 1), (None, 0),
])  # fmt: skip
def test_a_temperature_beyond_the_tests_is_extrapolated(warmth: float | None, n: int) -> None:
    one = ChosenParameters(
        fakes.fit(1).parameters, None, "", tested=Tested(temperatures=(20.0, 55.0))
    )
    said = one.warnings(0.1, warmth)
    assert len(said) == n
    if n:
        ends = "the tests were at 20 to 55 degC; beyond that the viscosity is extrapolated"
        assert said == (f"{warmth:.3g} degC: {ends}",)
    assert replace(one, tested=Tested()).warnings(0.1, warmth) == ()


def test_the_run_tells_at_which_temperatures_it_was(tmp_path: Path) -> None:
    path = tmp_path / "parameters.csv"
    path.write_text("setting,r_m1,r_m2,r_m3,k_e,f_f\n1,1e4,2e6,3e6,9e8,20\n")
    logs = [{"temperature_degC": 21.5}, {"temperature_degC": None}, {"temperature_degC": 48.0}]
    record = {"configuration": {"damper": {}}, "inputs": logs}
    (tmp_path / "run.json").write_text(json.dumps(record))
    assert choose_parameters(setting=1, table=path, replaced={}).tested.temperatures == (21.5, 48.0)
