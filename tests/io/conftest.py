"""Logs that are written as a test has them."""

from pathlib import Path

import pytest


@pytest.fixture
def put(tmp_path):
    """Write text or bytes as a file, and return its path."""

    def write(content: str | bytes, name: str = "log.csv") -> Path:
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write
