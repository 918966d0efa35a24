"""What holds for every test."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# How long an example takes says something of the machine, nothing of the code.
settings.register_profile("damperfit", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("damperfit")

BENCHMARKS = Path(__file__).parent / "benchmarks"


def pytest_ignore_collect(collection_path, config):
    """Leave the benchmarks out, unless the command line names them."""
    if collection_path != BENCHMARKS:
        return None
    asked = [Path(config.invocation_params.dir, arg.split("::")[0]) for arg in config.args]
    return None if any(BENCHMARKS in (path, *path.parents) for path in asked) else True


@pytest.fixture(scope="session", autouse=True)
def _each_steady_cycle_is_integrated_once():
    """Let make-believe logs of one damper share its steady cycle, a second of SciPy each."""
    from damperfit.samples import logs

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(logs, "steady_cycle", cache(logs.steady_cycle))
        yield
