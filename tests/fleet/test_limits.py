"""How often what a network refused is tried again."""

from __future__ import annotations

import pytest

from damperfit.fleet import stores


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
