"""How many failures of a fleet are told one by one."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from damperfit.cli.fleet import _say


@pytest.mark.parametrize(("n", "more"), [(20, 0), (21, 1), (22, 2)])
def test_twenty_failures_are_told_one_by_one(capsys, n, more) -> None:
    failures = [f"{k}.csv: empty" for k in range(n)]
    one = SimpleNamespace(owner="SN1", failures=failures, gates=(), n_failures=n)
    _say([one], 1, Path("parts"), is_quiet=True, is_stopped=False)
    said = capsys.readouterr().err
    assert said.count(".csv: empty") == 20
    assert (f"and {more} more failures" in said) is bool(more)
