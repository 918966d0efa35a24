"""What each log is a test of: table, preamble, name; and what is kept from the fit."""

from dataclasses import replace

import numpy as np
import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.recording import Recording
from damperfit.run import preparation as parting
from damperfit.run.logs import Labels, Log, LogBatch, read_batch
from damperfit.tested.setting import Setting
from tests.fakes import campaign, fit, trace

PLAIN = load_configuration()


def labels(paths, adjusters="", **rig):
    text = load_configuration(overlay={"rig": rig} if rig else {})
    if adjusters:
        reading = text.reading.but(adjusters=tuple(adjusters.split()))
        text = replace(text, reading=reading)
    return Labels(paths, text)


def labelled(path, paths, adjusters="", setting=None):
    log = Recording(path.name, "", "", setting, np.arange(3.0), np.zeros(3), np.zeros(3))
    return labels(paths, adjusters).labelled(log, path)[0].setting


def test_equal_names_are_told_apart_by_their_folders_and_others_stay_short(tmp_path) -> None:
    paths = [tmp_path / place for place in ("x/a.csv", "y/a.csv", "y/b.csv")]
    for given, names in (
        (paths, ["x/a.csv", "y/a.csv", "b.csv"]),
        ([paths[0], paths[2]], ["a.csv", "b.csv"]),
    ):
        assert [one.log for one in read_batch(given, PLAIN, jobs=1).logs] == names


@pytest.mark.parametrize(
    ("tables", "setting"),
    [
        ({"here": "day1/a.csv,1\na.csv,2\nb.csv,3"}, 1),  # the one that names most of a path
        ({"there": "a.csv,1"}, None),  # a table speaks for the logs beside it
        ({"here": "a.csv,1", "here/day1": "a.csv,2"}, 2),  # of two alike the nearest
    ],
)
def test_of_tables_of_tests_the_nearest_row_speaks(tables, setting, tmp_path) -> None:
    path = tmp_path / "here" / "day1" / "a.csv"
    others = []
    for folder, rows in tables.items():
        (tmp_path / folder).mkdir(parents=True, exist_ok=True)
        (tmp_path / folder / "tests.csv").write_text(f"file,setting\n{rows}\n")
        others.append(tmp_path / folder / "z.csv")
    for paths in ([path, *others], [*reversed(others), path]):
        assert labelled(path, paths) == (None if setting is None else Setting.of(setting))


@pytest.mark.parametrize(
    ("adjusters", "setting"), [("low high", None), ("low", Setting((("low", 6),)))]
)
def test_a_setting_of_the_log_does_not_stand_for_half_a_row_of_the_table(
    adjusters, setting, tmp_path
) -> None:
    """The table says where one adjuster stands: the log's own number is no answer for both."""
    (tmp_path / "tests.csv").write_text("file,low\na.csv,6\n")
    path = tmp_path / "a.csv"
    assert labelled(path, [path], adjusters, Setting.of(3)) == setting


@pytest.mark.parametrize(
    ("settings", "is_said"),
    [
        *(("L6 H1, L5 H1", True), ("L6 H1, soft", False), ("soft, L6 H1", False)),
        # One setting does not show what differs.
        *(("L6 H1", False), ("soft, hard", False), ("L6 H1, L6 R1", False)),
    ],
)
def test_labels_with_numbers_are_said_to_be_words(settings, is_said) -> None:
    logs = [Log(one, one, "", {"setting": Setting.of(one)}) for one in settings.split(", ")]
    assert [("taken as words" in str(one)) for one in labels([]).remarks(logs)] == [True] * is_said


@pytest.mark.parametrize(
    ("adjusters", "rig", "is_said"),
    [("", {}, True), ("", {"setting_pattern": r"s(?P<setting>\d+)"}, False), ("a b", {}, False)],
)
def test_a_number_of_several_is_named_where_it_was_guessed(adjusters, rig, is_said) -> None:
    facts = {"notes": ["setting: from the file name"]}
    said = list(labels([], adjusters, **rig).remarks([Log("", "run_s3_4.csv", "", facts)]))
    assert [one.code for one in said] == ["one-of-several"] * is_said


def test_a_log_whose_cycles_cannot_be_parted_hides_none_behind_it(monkeypatch) -> None:
    def split(one, _):
        if one.setting == 1:
            raise ValueError("x")
        return one, replace(one, name=f"last of {one.name}")

    monkeypatch.setattr(parting, "split_cycles", split)
    batch = LogBatch(traces=[trace(setting) for setting in (1, 2, 3)])
    parting.part(batch, replace(PLAIN.hold_out, patterns=(), cycles=1), {})
    told = (
        [one.setting for one in many] for many in (batch.traces, batch.held_out, batch.failures)
    )
    assert [*told] == [[2, 3], [2, 3], [1]]


@pytest.mark.parametrize(
    ("options", "held", "n_failures"),
    [
        ({"patterns": (), "cycles": 1}, [], 0),
        # Setting 1 has no fit: that is said elsewhere. 2 cannot be simulated beside its cycles.
        ({}, [1, 2], 0),
        ({"patterns": ("transients",)}, [1, 2], 2),
    ],
)
def test_transients_that_nobody_asked_for_are_of_logs_that_are_fitted_and_no_failure(
    monkeypatch, options, held, n_failures
) -> None:
    monkeypatch.setattr(parting, "transients", lambda one: replace(one, start_time=9.0))
    batch = LogBatch(traces=[trace(1), trace(2)])
    parting.hold_out_transients(batch, replace(PLAIN.hold_out, **options))
    parting.note_unpredicted(batch, campaign(fit(2)), ())
    assert [one.setting for one in batch.held_out] == held
    assert len(batch.failures) == n_failures
    if not options:
        (said,) = map(str, batch.remarks)
        assert "beside its steady cycles cannot be simulated" in said
