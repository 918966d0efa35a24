"""How many failures of a fleet are told one by one."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from damperfit.cli.fleet import _held_lines, _say
from damperfit.shown import FleetDone


@pytest.mark.parametrize(("n", "more"), [(20, 0), (21, 1), (22, 2)])
def test_twenty_failures_are_told_one_by_one(capsys, n, more) -> None:
    failures = [f"{k}.csv: empty" for k in range(n)]
    one = SimpleNamespace(owner="SN1", failures=failures, gates=(), n_failures=n)
    found = FleetDone(Path("parts"))
    found.done, found.n_tasks = [one], 1
    _say(found, is_quiet=True)
    said = capsys.readouterr().err
    assert said.count(".csv: empty") == 20
    assert (f"and {more} more failures" in said) is bool(more)


@pytest.mark.parametrize("bands", [None, "bands"])
def test_a_fleet_is_held_against_the_bands_that_are_given(bands, monkeypatch, tmp_path) -> None:
    pages = []
    table = SimpleNamespace(num_rows=3)
    monkeypatch.setattr("damperfit.fleet.parts.collect", lambda _: table)
    monkeypatch.setattr("damperfit.fleet.survey.survey", lambda _: "survey")
    monkeypatch.setattr("damperfit.fleet.survey.fleet_against_bands", lambda *given: given)
    monkeypatch.setattr("damperfit.fleet.page.write_page", lambda *given: pages.append(given))
    found = FleetDone(tmp_path)
    found.collect(bands, is_reported=True)
    assert found.held == (None if bands is None else ("survey", "bands"))
    assert pages == [(tmp_path, "survey", found.held)]


@pytest.mark.parametrize(
    ("n", "last"),
    [(20, "SN19, 0.1 m/s bump: off"), (21, "and 1 more damper;"), (22, "and 2 more dampers;")],
)
def test_twenty_dampers_outside_of_their_bands_are_told(n, last) -> None:
    worst = [
        SimpleNamespace(run=f"SN{k}", setting="", speed=0.1, stroke="bump", words="off")
        for k in range(n)
    ]
    head, *lines = _held_lines(SimpleNamespace(worst=worst, source="a.csv", sentence="no"))
    assert head == "tolerance a.csv: no"
    assert len(lines) == min(n, 21)
    assert lines[-1].startswith(last)
    (line,) = _held_lines(SimpleNamespace(worst=[replaced(worst[0])], source="", sentence=""))[1:]
    assert line == "unknown, setting 7, 0.1 m/s bump: off"


def replaced(point: SimpleNamespace) -> SimpleNamespace:
    return SimpleNamespace(**vars(point) | {"run": "", "setting": 7})
