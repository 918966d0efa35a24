"""What each log is a test of: table, preamble, name; and what is kept from the fit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.io.tests_table import TestRow, TestsTable
from damperfit.recording import Recording
from damperfit.run import hold_out, labelling
from damperfit.run.labelling import Labels
from damperfit.run.logs import LogBatch, _distinct_names
from damperfit.tested.identity import Identity
from damperfit.tested.setting import Setting
from tests.fakes import campaign, fit, trace

PLAIN = load_configuration()
EMPTY = LogBatch((), (), (), (), 0)


def test_equal_names_are_told_apart_by_their_folders_and_others_stay_short() -> None:
    assert _distinct_names([Path("x/a.csv"), Path("y/b.csv")]) == ["a.csv", "b.csv"]
    names = _distinct_names([Path("x/a.csv"), Path("y/a.csv"), Path("y/b.csv")])
    assert names == ["x/a.csv", "y/a.csv", "b.csv"]


@pytest.mark.parametrize(
    ("has_pattern", "adjusters", "says"),
    [
        (False, ("adjuster",), True),
        (True, ("adjuster",), False),
        (False, ("rebound", "bump"), False),
    ],
)
def test_a_number_of_several_is_named_where_it_was_guessed(
    has_pattern, adjusters, says, monkeypatch
) -> None:
    monkeypatch.setattr(labelling, "one_of_several", lambda _: "3 of 3 and 4")
    labels = SimpleNamespace(has_pattern=has_pattern, adjusters=adjusters)
    said = Labels.one_of_several(labels, "s3_4.csv")
    assert (said is not None and str(said).startswith("s3_4.csv: of the numbers ")) is says


def test_a_table_of_tests_elsewhere_hides_none_beside_the_log(tmp_path) -> None:
    """Where tables speak for the logs beside them only; the one that names most of a path wins."""
    log = tmp_path / "here" / "day1" / "a.csv"
    tables = [
        SimpleNamespace(path=tmp_path / place / "tests.csv", rows=rows)
        for place, rows in (
            ("there", {"a.csv": "elsewhere"}),
            ("here", {"day1/a.csv": "most", "a.csv": "less", "b.csv": "another"}),
        )
    ]
    for is_beside, only, row in (
        (True, tables, "most"),
        (True, tables[:1], None),
        (False, tables[:1], "elsewhere"),
    ):
        assert Labels.row(SimpleNamespace(is_beside=is_beside, tables=only), log) == row


def test_of_tables_that_name_a_log_alike_the_nearest_speaks_in_any_order(tmp_path) -> None:
    """Folders within each other may hold logs of one name: the setting would be another test's."""
    log = tmp_path / "day1" / "repeated" / "a.csv"
    outer, inner = (
        SimpleNamespace(path=folder / "tests.csv", rows={"a.csv": folder.name})
        for folder in (log.parents[1], log.parent)
    )
    for tables in ((outer, inner), (inner, outer)):
        labels = SimpleNamespace(is_beside=True, tables=tables)
        assert Labels.row(labels, log) == "repeated"
        assert Labels.row(labels, log.parents[1] / "a.csv") == "day1"


@pytest.mark.parametrize(("adjusters", "setting"), [(("low", "high"), None), (("low",), "low 6")])
def test_a_setting_of_the_log_does_not_stand_for_half_a_row_of_the_table(
    adjusters, setting, tmp_path
) -> None:
    """The table says where one adjuster stands: the log's own number is no answer for both."""
    row = TestRow(2, {"low": 6}, Identity(), {})
    labels = Labels(adjusters, tables=(TestsTable(tmp_path / "tests.csv", {"a.csv": row}),))
    log = Recording("a.csv", "", "", Setting.of(3), np.arange(3.0), np.zeros(3), np.zeros(3))
    labelled, _ = labels.labelled(log, tmp_path / "a.csv")
    assert labelled.setting == (None if setting is None else Setting((("low", 6),)))


@pytest.mark.parametrize(("n", "is_said"), [(1, False), (2, True)])
def test_two_settings_show_what_differs_between_labels(n, is_said) -> None:
    settings = [Setting.of(f"L{6 - k} H1") for k in range(n)]
    said = labelling.Labels.taken_as_words(SimpleNamespace(adjusters=("adjuster",)), settings)
    assert ("taken as words" in said) is is_said


@pytest.mark.parametrize(
    "labels", [["L6 H1", "soft"], ["soft", "L6 H1"], ["soft", "hard"], ["L6 H1", "L6 R1"]]
)
def test_labels_of_unlike_letters_are_words(labels) -> None:
    settings = [Setting.of(label) for label in labels]
    assert not labelling.Labels.taken_as_words(SimpleNamespace(adjusters=("adjuster",)), settings)


def test_a_log_whose_cycles_cannot_be_parted_hides_none_behind_it(monkeypatch) -> None:
    def split(one, _):
        if one.setting == 1:
            raise ValueError("x")
        return one, replace(one, name=f"last of {one.name}")

    monkeypatch.setattr(hold_out, "split_cycles", split)
    traces = tuple(trace(setting) for setting in (1, 2, 3))
    options = replace(PLAIN.hold_out, patterns=(), cycles=1)
    parted = hold_out.part(replace(EMPTY, traces=traces), options, {})
    assert [one.setting for one in parted.batch.traces] == [2, 3]
    assert [one.setting for one in parted.held_out] == [2, 3]
    assert [one.setting for one in parted.batch.failures] == [1]


def test_transients_that_nobody_asked_for_are_of_logs_that_are_fitted_and_no_failure(
    monkeypatch,
) -> None:
    monkeypatch.setattr(hold_out, "transients", lambda one: replace(one, start_time=9.0))
    left = hold_out.Parted(replace(EMPTY, traces=(trace(1), trace(2))))
    parted = hold_out.with_transients(left, PLAIN.hold_out)
    assert [one.setting for one in parted.held_out] == [1, 2]
    assert not parted.is_asked
    cycles = replace(PLAIN.hold_out, patterns=(), cycles=1)
    assert hold_out.with_transients(left, cycles) is left
    # Setting 1 has no fit: that is said elsewhere. Setting 2 cannot be simulated beside its cycles.
    batch = hold_out.note_unpredicted(parted, campaign(fit(2)), ())
    assert batch.failures == ()
    (said,) = batch.remarks
    assert "beside its steady cycles cannot be simulated" in said
    asked = hold_out.with_transients(left, replace(PLAIN.hold_out, patterns=("transients",)))
    assert len(hold_out.note_unpredicted(asked, campaign(fit(2)), ()).failures) == 2
