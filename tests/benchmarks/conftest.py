"""Benchmarks need pytest-benchmark, of the extra `test-all`."""

from pathlib import Path

import pytest

HERE = Path(__file__).parent


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items) -> None:
    for item in items:
        if HERE in item.path.parents and "slow" not in item.keywords:
            item.add_marker(pytest.mark.extras)
