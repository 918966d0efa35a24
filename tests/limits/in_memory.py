"""Limits moved in memory: one process imports the tests once and runs them for each value.

A constant is set where it stands and in each module that has imported it. What a module has made of
it while it was imported (another constant, a default) keeps its value: such a limit passes here
unnoticed, and only a changed copy of the tree tells.
"""

from __future__ import annotations

import ast
import io
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path

import pytest
from _pytest.runner import runtestprotocol

from tests.limits.finding import Limit, constants_of, names_in

__all__ = ["Move", "noticed_in_memory"]

Move = tuple[Limit, float, str]  # a limit, its other value, the test that should fail


class _Moves:
    """The plugin: in place of the tests once, those of each move with the constant moved."""

    def __init__(self, root: Path, moves: Sequence[Move]) -> None:
        self.root, self.moves = root, moves
        self.constants = constants_of(root)
        self.imported: dict[Path, dict[str, Limit]] = {}
        self.failing: set[str] = set()  # without any change
        self.noticed = [False] * len(moves)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session):
        by_test: dict[str, list[pytest.Item]] = {}
        for item in session.items:
            by_test.setdefault(item.nodeid.partition("[")[0], []).append(item)
            by_test.setdefault(item.nodeid, []).append(item)
        for test in dict.fromkeys(test for _, _, test in self.moves):
            if not by_test.get(test) or _fails(by_test[test]):
                self.failing.add(test)
        for k, (limit, value, test) in enumerate(self.moves):
            with self._moved(limit, value):
                self.noticed[k] = test not in self.failing and _fails(by_test[test])
        return True

    @contextmanager
    def _moved(self, limit: Limit, value: float) -> Iterator[None]:
        places = [
            (module, name.partition("[")[0], name.partition("[")[2].rstrip("]"))
            for module, name in self._places(limit)
        ]
        before = [getattr(module, name) for module, name, _ in places]
        for (module, name, key), old in zip(places, before, strict=True):
            setattr(module, name, _with(old, key, value) if key else value)
        try:
            yield
        finally:
            for (module, name, _), old in zip(places, before, strict=True):
                setattr(module, name, old)

    def _places(self, limit: Limit) -> Iterator[tuple[object, str]]:
        for name, module in list(sys.modules.items()):
            file = getattr(module, "__file__", None)
            if name.split(".")[0] not in {"damperfit", "tests"} or not file:
                continue
            path = Path(file)
            if path == self.root / limit.path:
                yield module, limit.name.partition(":")[2]
            elif path.suffix == ".py":
                for called, one in self._names(path).items():
                    if one.name == limit.name and hasattr(module, called.partition("[")[0]):
                        yield module, called

    def _names(self, path: Path) -> dict[str, Limit]:
        if path not in self.imported:
            tree = ast.parse(path.read_text(encoding="utf-8"))
            self.imported[path] = names_in(tree, self.constants)
        return self.imported[path]


def _with(old: tuple[float, ...] | dict[object, float], key: str, value: float) -> object:
    if isinstance(old, tuple):
        return tuple(value if str(k) == key else one for k, one in enumerate(old))
    return {k: value if str(k) == key else one for k, one in old.items()}


def _fails(items: Sequence[pytest.Item]) -> bool:
    return any(
        report.failed
        for item in items
        for report in runtestprotocol(item, log=False, nextitem=None)
    )


def noticed_in_memory(root: Path, moves: Sequence[Move]) -> tuple[list[bool], set[str]]:
    """Return of each move whether its test notices it, and the tests that fail without any."""
    plugin = _Moves(root, moves)
    tests = sorted({test for _, _, test in moves})
    options = [
        "-q",
        "-n0",
        "-p",
        "no:cacheprovider",
        "--no-header",
        "--benchmark-disable",
        "-m",
        "",
    ]
    with redirect_stdout(io.StringIO()):
        pytest.main([*options, *tests], plugins=[plugin])
    return plugin.noticed, plugin.failing
