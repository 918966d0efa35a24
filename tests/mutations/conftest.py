"""Without the extra `mutation` nothing here can be imported; the tool's own test says so."""

from __future__ import annotations

from importlib.util import find_spec

if find_spec("cosmic_ray") is None:
    collect_ignore = [
        "blocks.py",
        "mutants.py",
        "operators.py",
        "running.py",
        "selection.py",
        "tracing.py",
    ]
