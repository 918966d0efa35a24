"""Memory and open files with many logs; `tests.benchmarks.many_logs` gives the figures."""

from __future__ import annotations

import sys

import pytest

from tests.benchmarks.many_logs import measure, write_logs


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize(("command", "mb_a_log"), [("inspect", 0.05), ("identify", 0.35)])
def test_many_small_logs(tmp_path, command, mb_a_log) -> None:
    # inspect used to keep every trace, identify all sensitivities of all settings.
    uses = []
    for n_logs in (40, 400):
        folder = tmp_path / str(n_logs)
        folder.mkdir()
        write_logs(folder, n_logs)
        uses.append(measure(command, folder, "--quiet"))
    assert [use.code for use in uses] == [0, 0]
    few, many = uses
    assert many.peak_mb - few.peak_mb < 360 * mb_a_log
    assert many.open_files < 40
