"""Guards, defaults and skipped cases that hardly any input meets, over all packages."""

from __future__ import annotations

import time
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.cli import main as command
from damperfit.comparison.tolerance import Point
from damperfit.damper.rivals import BoucWen
from damperfit.errors import ConfigurationError
from damperfit.fleet import cluster
from damperfit.handover import combitable
from damperfit.handover.handed_over import _numbers
from damperfit.laws import bleeds, search
from damperfit.readers.dialect import _MAX_COLUMNS, find_dialect
from damperfit.readers.options import ReadOptions
from damperfit.report import tables as identify_summary_sheet
from damperfit.report.compared import tolerance_rows
from damperfit.run import law_choice, rod_area
from damperfit.uncertainty import profile_walk
from damperfit.uncertainty.correlated_noise import autocorrelation, stationary_covariance
from tests.test_report_limits import fit, rows_of


@pytest.mark.parametrize(("apart", "weight"), [(3, 1.0), (4, 1.0), (6, 0.5), (8, 0.0), (9, 0.0)])
def test_correlation_counts_whole_up_to_the_length_and_fades_to_twice_it(apart, weight) -> None:
    rng = np.random.default_rng(31)
    left = rng.standard_normal(20000)
    for k in range(1, len(left)):
        left[k] += 0.6 * left[k - 1]
    variance = float(left @ left) / len(left)
    slopes = np.zeros((len(left), 1))
    slopes[[300, 300 + apart]] = 1.0
    expected = 2.0 * variance * (1.0 + weight * autocorrelation(left, 9)[apart])
    assert stationary_covariance(slopes, left, 4)[0, 0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("spent", "looks"), [(4, 1), (5, 0)])
def test_a_limit_is_looked_for_while_the_budget_lasts(spent, looks, monkeypatch) -> None:
    monkeypatch.setattr(profile_walk, "interpolated_limit", lambda *_: (0.3, False))
    walker = SimpleNamespace(spent=spent, points=[], seen=0)

    def refit(_) -> None:
        walker.spent += 1
        walker.seen += 1

    walker.refit = refit
    assert profile_walk._crossing(walker, 1.0, profile_walk.Stride(budget=5)) == 0.3
    assert walker.seen == looks


def test_as_many_columns_as_the_limit_are_read() -> None:
    data = b"\n".join([b",".join([b"1.5"] * _MAX_COLUMNS)] * 3)
    assert find_dialect(data, ReadOptions(), name="a.csv").separator == ","


def test_a_row_of_a_band_says_which_stroke() -> None:
    point = Point(
        run="a", setting="1", speed=0.1, stroke="rebound", force=10.0, low=5.0, high=15.0,
        reach=1.0,
    )  # fmt: skip
    missing = Point(
        run="a", setting="1", speed=0.1, stroke="", force=10.0, low=5.0, high=15.0, reach=1.0
    )
    assert [row["stroke"] for row in tolerance_rows([point, missing])] == ["rebound", None]


@pytest.mark.parametrize(("width", "has_errors"), [(80, True), (81, False)])
def test_a_summary_has_eighty_columns_unless_it_is_told(width, has_errors, monkeypatch) -> None:
    rows = rows_of(fit(1), fit(2))
    widest = identify_summary_sheet.summary_sheet(rows, columns=10_000)
    monkeypatch.setattr(identify_summary_sheet, "sheet_width", lambda *_, **__: width)
    seen = identify_summary_sheet.summary_sheet(rows)
    assert (seen.headings == widest.headings) is has_errors


def test_only_options_of_files_are_those_of_files() -> None:
    from damperfit.cli.main import _file_options

    found = _file_options(["identify", "a.csv"])
    assert "--config" in found
    assert not {"--jobs", "--quiet", "--json"} & found


@pytest.mark.parametrize(("typed", "held_out"), [(["--hold-out", "*_b.csv"], True), ([], False)])
def test_models_predicts_the_logs_that_are_held_out(typed, held_out, monkeypatch) -> None:
    seen = []

    def choose(configuration, *_, **__):
        seen.append(configuration.hold_out)
        raise ConfigurationError("enough")

    monkeypatch.setattr(law_choice, "choose_law", choose)
    command(["models", "a.csv", *typed])
    assert ["*_b.csv" in str(one) for one in seen] == [held_out]


def test_tests_that_move_otherwise_leave_the_rod_to_the_others(monkeypatch) -> None:
    monkeypatch.setattr(rod_area, "moves_alike", lambda one, other: one.way == other.way)
    monkeypatch.setattr(rod_area, "_level", lambda trace, _: (1.2 * trace.gas, trace.gas))
    logs = [
        SimpleNamespace(gas_pressure=1e5, setting=1, gas=gas, way=way)
        for gas, way in ((400.0, "slow"), (100.0, "fast"), (200.0, "fast"))
    ]
    assert rod_area.rod_area_ratio(logs, None) == pytest.approx(1.2)
    assert rod_area.rod_area_ratio(logs[:2], None) is None


@pytest.mark.parametrize(("n", "is_alone"), [(1, True), (2, False)])
def test_a_layout_is_the_only_one_where_one_was_tried(n, is_alone, monkeypatch) -> None:
    monkeypatch.setattr(search, "effective_samples", lambda *_: 100.0)
    monkeypatch.setattr(search, "times_worse", lambda *_: 1.0)
    monkeypatch.setattr(search, "said_of_layout", lambda *_, is_alone, **__: is_alone)
    said = []
    course = SimpleNamespace(
        evidence=(),
        record=lambda _, reason, **__: said.append(reason),
        crossed=lambda one: one,
        enriched=lambda one, _: one,
    )
    search._Search.best_layout(course, [SimpleNamespace(score=float(k)) for k in range(n)])
    assert said == [is_alone] * n


def test_a_kind_of_bleed_that_cannot_be_fitted_leaves_the_others(monkeypatch) -> None:
    monkeypatch.setattr(bleeds, "_other_kinds", lambda _: (("a", "b", "no"), ("c", "d", "yes")))
    monkeypatch.setattr(bleeds, "_in_layers", lambda law, _: law)
    monkeypatch.setattr(bleeds, "valve_damper", lambda _: None)
    monkeypatch.setattr(bleeds, "freed_of", lambda _: ())
    monkeypatch.setattr(bleeds, "fits_better", lambda *_: (True, "better"))
    better = SimpleNamespace(n_quantities=3)
    course = SimpleNamespace(
        n_eff=100.0,
        fitted=lambda model, **_: better if model == "yes" else None,
        record=lambda *_, **__: None,
    )
    assert bleeds.with_bleeds_told(course, SimpleNamespace(n_quantities=3)) is better


def test_a_guess_of_hysteresis_has_the_peaks_that_were_measured() -> None:
    seen = SimpleNamespace(
        x=np.array([-0.02, 0.02]), rebound=900.0, bump=900.0, speed=0.3, middle=5.0
    )
    for start in BoucWen().guess(seen):
        assert start["alpha"] + start["c_r"] * seen.speed == pytest.approx(seen.rebound)
        assert start["alpha"] + start["c_b"] * seen.speed == pytest.approx(seen.bump)


@pytest.mark.parametrize(("late", "is_refused"), [(-5.0, False), (5.0, True)])
def test_a_fleet_does_not_wait_for_nobody(late, is_refused) -> None:
    waiting = SimpleNamespace(_client=SimpleNamespace(nthreads=dict))
    since = time.monotonic() - cluster._ALONE - late
    if is_refused:
        with pytest.raises(ConfigurationError, match="no worker for"):
            cluster.Cluster._refuse_to_wait_for_nobody(waiting, since)
    else:
        assert cluster.Cluster._refuse_to_wait_for_nobody(waiting, since) == since


def test_cells_without_a_number_are_left_out() -> None:
    cells = (2.0, None, "x", float("nan"), 3)
    assert _numbers([{"f": cell} for cell in cells], "f") == [2.0, 3.0]


@pytest.mark.parametrize("n", [1, 2])
def test_one_setting_needs_no_grid_of_settings(n, monkeypatch) -> None:
    speeds = np.array([-0.1, 0.0, 0.1])
    tables = [
        SimpleNamespace(
            setting=k + 1, speeds=speeds, forces=1e3 * speeds, gas_displacements=speeds,
            gas_forces=speeds, stroke=0.02, level=0.0,
        )
        for k in range(n)
    ]  # fmt: skip
    monkeypatch.setattr(combitable, "force_tables", lambda *_, **__: tables)
    monkeypatch.setattr(combitable, "provenance_lines", lambda *_, **__: [])
    monkeypatch.setattr(combitable, "gas_line", lambda *_, **__: "")
    monkeypatch.setattr(combitable, "matrix_name", lambda what, one: f"{what}_{one.setting}")
    monkeypatch.setattr(combitable, "setting_numbers", lambda _: np.arange(1.0, n + 1.0))
    options = SimpleNamespace(extend=None, stem="a")
    (text,) = combitable.write_combitable(None, options).values()
    assert (b" force(" in text) is (n > 1)
    assert text.count(b"force_") == n
