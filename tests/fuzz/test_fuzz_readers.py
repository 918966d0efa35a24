"""A short run of the fuzzer over every format; the long one is a command of its own."""

import pytest

from tests.fuzz.fuzz_readers import APART, PromiseBroken, Tally, attempt, fuzz
from tests.io import binary_logs, scenarios


@pytest.mark.parametrize("name", [*scenarios.WRITERS, *binary_logs.WRITERS, "curves"])
def test_damaged_logs_are_read_or_refused(tmp_path, name) -> None:
    binary_logs.needs(*binary_logs.WRITERS[name][2] if name in binary_logs.WRITERS else ())
    runs = 2 if name in APART or name.startswith("MATLAB") else 12  # 0.5 s each
    tally = fuzz(name, runs=runs, seed=1, folder=tmp_path, keep=tmp_path / "kept")
    assert tally.read + tally.refused == runs
    assert tally.refused > 0 or runs == 2


def test_the_fuzzer_sees_a_promise_broken(tmp_path, monkeypatch) -> None:
    def broken(*_) -> None:
        raise KeyError("force")

    monkeypatch.setattr("tests.fuzz.fuzz_readers.read_logs", broken)
    with pytest.raises(PromiseBroken, match="KeyError"):
        attempt(b"time_s", tmp_path / "log.csv", Tally())
