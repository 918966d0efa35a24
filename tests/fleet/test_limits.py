"""How often what a network refused is tried again, and how long a list may take."""

from __future__ import annotations

import threading

import pytest

from damperfit.fleet import sources as stores


@pytest.mark.parametrize(("refusals", "is_fetched"), [(3, True), (4, False)])
def test_the_fourth_try_is_the_last(monkeypatch, refusals, is_fetched) -> None:
    monkeypatch.setattr(stores.time, "sleep", lambda _: None)
    left = [OSError("no route")] * refusals

    def act() -> str:
        if left:
            raise left.pop()
        return "log"

    if is_fetched:
        assert stores._patiently(act, "s3://logs/a.csv") == "log"
    else:
        with pytest.raises(stores.UnreachableError, match="tried 4 times: no route"):
            stores._patiently(act, "s3://logs/a.csv")


class Listing:
    """A store that answers at once but takes a while for a list, or until it may go on."""

    def __init__(self, takes: float) -> None:
        self.takes, self.lists = takes, 0
        self.go_on = threading.Event()

    def get_file_info(self, wanted: object) -> object:
        from pyarrow import fs

        if isinstance(wanted, str):
            return fs.FileInfo(wanted, fs.FileType.Directory)
        self.lists += 1
        self.go_on.wait(self.takes)
        return [fs.FileInfo(f"logs/D{k}/a.csv", fs.FileType.File) for k in range(3)]


def listing(monkeypatch: pytest.MonkeyPatch, *, takes: float, at_most: float) -> Listing:
    """Return a store in the place of all, with a tenth of a second for one answer."""
    store = Listing(takes)
    monkeypatch.setattr(stores, "_file_system", lambda _root: store)
    monkeypatch.setattr(stores, "_DEADLINE", 0.1)
    monkeypatch.setattr(stores, "_LISTED", at_most)
    monkeypatch.setattr(stores, "_PAUSE", 0.0)
    return store


def test_a_list_may_take_longer_than_an_answer(monkeypatch) -> None:
    store = listing(monkeypatch, takes=0.3, at_most=30.0)
    found = stores.listed("s3://logs", lambda name: name.endswith(".csv"))
    assert [name for _, name in found] == ["D0/a.csv", "D1/a.csv", "D2/a.csv"]
    assert store.lists == 1


def test_a_list_that_takes_too_long_is_asked_for_once_and_said_to_be_slow(monkeypatch) -> None:
    store = listing(monkeypatch, takes=30.0, at_most=0.2)
    said = "s3://logs: the list of its objects was not complete within 0.2 s; give the folders"
    with pytest.raises(stores.UnreachableError, match=said):
        stores.listed("s3://logs", lambda _name: True)
    store.go_on.set()
    assert store.lists == 1
