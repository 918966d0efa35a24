"""Limits of what a run says before and beside its fits: a case just inside, one just outside."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.errors import SimulationError
from damperfit.identification import unlike_motions as like_speeds
from damperfit.run import dampers, labelling
from damperfit.tested.setting import Setting


@pytest.mark.parametrize(("n", "is_read"), [(11, False), (12, True)])
def test_a_stroke_has_twelve_samples_near_the_speed(n, is_read) -> None:
    speed = np.concatenate([np.linspace(0.76, 0.94, n), np.linspace(0.1, 0.7, 40)])
    velocity = np.concatenate([speed, -speed])
    trace = SimpleNamespace(velocity=velocity, compared=slice(None))
    found = like_speeds._damping(trace, 500.0 * velocity, 1.0)
    assert (found is not None) is is_read
    assert not is_read or found == pytest.approx(0.85 * 500.0)


@pytest.mark.parametrize(("left", "is_reported"), [(0.24, True), (0.26, False)])
def test_fits_of_each_log_leave_a_quarter_of_what_both_miss(monkeypatch, left, is_reported) -> None:
    force = np.sin(np.linspace(0.0, 20.0, 200))
    log = SimpleNamespace(force=force, compared=slice(None))
    met = SimpleNamespace(first=log, second=log, differs=True)

    def missed(traces, *_):
        of_each = np.sqrt(left if len(traces) == 1 else 1.0)
        return [of_each * force for _ in traces]

    monkeypatch.setattr(like_speeds, "_missed", missed)
    monkeypatch.setattr(like_speeds, "_meeting", lambda *_: met)
    assert like_speeds._is_left_by_fits(met, None, None) is is_reported


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


@pytest.mark.parametrize(("n", "more"), [(5, ""), (6, " and 1 more")])
def test_five_dampers_are_named(n, more) -> None:
    assert dampers._listed([f"SN{k}" for k in range(n)]) == f"SN0, SN1, SN2, SN3, SN4{more}"


@pytest.mark.parametrize(("n", "more"), [(3, ""), (4, " and 1 more")])
def test_three_lost_rows_of_a_table_are_named(tmp_path, n, more) -> None:
    rows = {f"{k}.csv": SimpleNamespace(line=k + 2) for k in range(n)}
    path = tmp_path / "tests.csv"
    (said,) = labelling._unknown(SimpleNamespace(path=path, rows=rows))
    named = "line 2 '0.csv', line 3 '1.csv', line 4 '2.csv'"
    assert said == f"{path}: no such file: {named}{more}"


def test_a_log_that_cannot_be_fitted_contradicts_none(monkeypatch) -> None:
    def fails(*_):
        raise SimulationError("no")

    monkeypatch.setattr(like_speeds, "_missed", fails)
    met = SimpleNamespace(first=None, second=None)
    assert like_speeds._is_left_by_fits(met, None, None) is False
