"""What holds for every test."""

from __future__ import annotations

from pathlib import Path

BENCHMARKS = Path(__file__).parent / "benchmarks"


def pytest_ignore_collect(collection_path, config):
    """Leave the benchmarks out, unless the command line names them."""
    if collection_path != BENCHMARKS:
        return None
    asked = [Path(config.invocation_params.dir, arg.split("::")[0]) for arg in config.args]
    return None if any(BENCHMARKS in (path, *path.parents) for path in asked) else True
