"""Which parameters a simulation takes: also of a setting that no log was of."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from damperfit.errors import ConfigurationError
from damperfit.identification import Campaign
from damperfit.queries.one_simulation import choose_parameters
from damperfit.report import markdown_report
from damperfit.tables import make_tables, write_table
from damperfit.uncertainty import Prediction
from tests import fakes
from tests.identification.adjusted import HIGH, LOW, SETTINGS, at
from tests.test_report import FACTS

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
    write_table(path, make_tables(campaign()).parameters, suffix=suffix)
    for label in ("low_speed=14, high_speed=3", "LS14 HS3"):
        found = choose_parameters(setting=label, table=path, replaced={})
        assert (found.parameters.r_m1, found.parameters.r_m2) == (1e4, 4e6)
        assert "put together from the clicks of the settings of" in found.source
    assert found.setting == at(14, 3)
    with pytest.raises(ConfigurationError, match="no parameters of setting LS20 HS3; there are"):
        choose_parameters(setting="LS20 HS3", table=path, replaced={})


def test_what_is_only_predicted_stands_in_the_report() -> None:
    one = campaign()
    unseen = Prediction(at(14, 3), fakes.trace(9), False, 0.2, 0.1, 0.15, 0.2, is_unseen=True)
    tables = make_tables(one, predictions=(unseen,))
    last = tables.mse.to_pylist()[-1]
    assert (str(last["setting"]), last["role"]) == ("LS14 HS3", "held_out")
    text = markdown_report(tables, replace(FACTS, held_out=(unseen,)))
    assert "LS14 HS3" in text
    assert "parameters combined from settings that share its clicks" in text
