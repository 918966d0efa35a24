"""Cp, Cpk and run rules of fleets whose answers are known."""

import json
import math

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from scipy.stats import chi2

from damperfit.cli.main import main
from damperfit.comparison import Tolerance
from damperfit.comparison.tolerance import Band
from damperfit.fleets.parts import part_path, write_part
from damperfit.fleets.survey import DOMINATES, capability, fleet_against_bands, run_rules, survey
from tests.fleet.made_up import SETTINGS, fleet_table

REBOUND, BUMP = "force_rebound_260_mm_per_s_N", "force_bump_260_mm_per_s_N"
ERROR = "force_rebound_260_mm_per_s_se_N"
BAND = Tolerance("bands.csv", bands=(Band("1", 0.26, "rebound", 940.0, 1030.0),))


def table(forces, error: float = 0.0, dates=None):
    """One force of setting 1 over dampers in order, everything else all alike."""
    names = [f"D{k + 1}" for k in range(len(forces))]
    changed = {
        (name, setting): {REBOUND: 1000.0, BUMP: -500.0, ERROR: error}
        for name in names
        for setting in SETTINGS
    }
    for name, force in zip(names, forces, strict=True):
        changed[name, "1"] = {REBOUND: force, BUMP: -500.0, ERROR: error}
    made = fleet_table(len(forces), dates=dates)
    rows = [row | changed[row["damper"], row["setting"]] for row in made.to_pylist()]
    return pa.Table.from_pylist(rows)


def capable(forces, error=0.0):
    found = survey(table(forces, error))
    return capability(found, fleet_against_bands(found, BAND))


def spread(n: int, mean: float, s: float) -> np.ndarray:
    values = np.random.default_rng(1).normal(size=n)
    return mean + s * (values - values.mean()) / values.std(ddof=1)


@pytest.mark.parametrize("error", [0.0, 6.0])
def test_the_measurement_is_taken_out_of_cp_and_cpk(error):
    # Dampers scatter by 8 N whatever the measurement adds to that.
    n, total = 30, math.hypot(8.0, error)
    (row,) = capable(spread(n, 1000.0, total), error)
    assert (row["s_N"], row["measurement_s_N"]) == (pytest.approx(8.0), pytest.approx(error))
    assert (row["cp"], row["cpk"]) == (pytest.approx(90 / 48), pytest.approx(30 / 24))
    variances = total**2 * (n - 1) / chi2.ppf([0.025, 0.975], n - 1) - error**2
    ends = 90.0 / (6.0 * np.sqrt(variances))
    assert [row["cp_ci_low"], row["cp_ci_high"]] == pytest.approx(ends.tolist(), rel=1e-6)
    if not error:  # Bissell's own formula
        reach = 1.959964 * math.sqrt(1 / (9 * n) + 1.25**2 / (2 * (n - 1)))
        assert row["cpk_ci_high"] - row["cpk"] == pytest.approx(reach)


def test_where_the_measurement_scatters_more_there_is_no_index():
    (row,) = capable(spread(12, 1000.0, 5.0), 5.1)
    assert (row["s_N"], row["cp"], row["cpk"], row["note"]) == (0.0, None, None, DOMINATES)
    # Little more than it: from this side no end can be told.
    (row,) = capable(spread(12, 1000.0, 6.0), 5.1)
    assert row["cp"] > row["cp_ci_low"]
    assert row["cp_ci_high"] is None


def test_ten_dampers_with_errors_are_the_least():
    assert len(capable(spread(10, 1000.0, 5.0))) == 1
    assert capable(spread(9, 1000.0, 5.0)) == []
    assert capable(spread(20, 1000.0, 5.0), math.nan) == []


def days(n: int) -> list[str]:
    return [f"2026-03-{1 + k:02d}" for k in range(n)]


# Sigma by the moving range is 1.048 N: half the steps are of 1 N, as 0 1 0 -1 makes them.
QUIET = [1000.0 + (0, 1, 0, -1)[k % 4] for k in range(20)]


@pytest.mark.parametrize(
    ("changed", "rules", "ends"),
    [
        ({}, None, None),
        ({9: 1003.0}, None, None),
        ({9: 1003.2}, "1", ("D10", "D10")),
        ({9: 997.8, 11: 997.8}, "2", ("D10", "D12")),
        ({8: 1002.0, 9: 1001.2, 11: 1001.2, 12: 1001.2}, "3", ("D9", "D13")),
        ({5: 1000.0} | dict.fromkeys(range(6, 14), 1000.9), "4", ("D7", "D14")),
        ({5: 1000.0} | dict.fromkeys(range(6, 13), 1000.9) | {13: 999.0}, None, None),
    ],
)
def test_each_rule_names_the_dampers_of_its_own(changed, rules, ends):
    forces = list(QUIET)
    for place, force in changed.items():
        forces[place] = force
    # The median stays 1000 N and the moving range 1 N beside what is asked for.
    forces = [*QUIET, *forces, *QUIET]
    dates = [str(date)[:10] for date in pd.date_range("2026-01-01", periods=len(forces))]
    sentences, rows = run_rules(survey(table(forces, dates=dates)))
    found = [(row["rules"], row["first_damper"], row["last_damper"]) for row in rows]
    if rules is None:
        assert found == []
    else:
        first, last = (f"D{int(name[1:]) + 20}" for name in ends)
        assert found == [(rules, first, last)]
        assert f"D{int(ends[0][1:]) + 20} (2026-01-" in sentences[0]


def test_one_shift_of_many_forces_is_one_sentence():
    changed = {
        (f"D{k}", s): {REBOUND: 1100.0 * (1 + number), BUMP: -550.0 * (1 + number)}
        for k in range(16, 21)
        for number, s in enumerate(SETTINGS)
    }
    (sentence,), rows = run_rules(survey(fleet_table(20, dates=days(20), changed=changed)))
    assert "at setting 1 is above its median at D16 (2026-03-16) to D20 (2026-03-20)" in sentence
    assert sentence.endswith("with it 6 of 6 forces are off.")
    assert {row["side"] for row in rows if row["stroke"] == "bump"} == {"below"}


@pytest.mark.parametrize("dates", [None, ["2026-03-01"] * 20])
def test_without_two_dates_there_are_no_run_rules(dates):
    assert run_rules(survey(table([*QUIET[:-1], 1100.0], dates=dates))) == ([], [])


def test_the_command_writes_both(tmp_path, capsys):
    forces = [*spread(19, 1000.0, 2.0), 1020.0]
    whole = table(forces, 1.0, days(20))
    for k in range(20):
        rows = whole.slice(3 * k, 3).drop_columns(["serial"])
        write_part(part_path(tmp_path, f"D{k + 1}", "k"), rows, {"logs": [str(k)]})
    assert main(["fleet", "--tolerance", "5%", "--report", "--json", "--out", str(tmp_path)]) == 0
    document = json.loads(capsys.readouterr().out)
    (worst, *_) = document["capability"]
    assert (worst["setting"], worst["stroke"], worst["n_dampers"]) == ("1", "rebound", 20)
    assert "D20 (2026-03-20) by rule 1" in document["shifts"][0]
    page = (tmp_path / "_fleet" / "fleet.html").read_text()
    assert document["shifts"][0] in page
    assert "<h2>Capability</h2>" in page
    for name, key in (("capability", "capability"), ("run_rules", "run_rules")):
        written = pd.read_csv(tmp_path / "_fleet" / f"fleet_{name}.csv")
        assert len(written) == len(document[key])
