"""A pytest plugin: which test runs which line, and how long each takes.

`python -m pytest -p tests.mutations.tracing` with the folder named in DAMPERFIT_TRACE, in a tree
that `blocks.instrument` has compiled. What serves several tests is traced under a name of its own:
a wide fixture, the import of a test file, a function whose results are kept. What it runs counts
for every test that uses it, not for the one that came first. Processes that a test starts are
traced as it, and those that outlive it as the next one.
"""

from __future__ import annotations

import builtins
import functools
import json
import mmap
import os
import threading
import time
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

from tests.mutations.blocks import COUNTER, FOLDER, OWNER

__all__ = ["Counters", "Tracing", "fixture_key", "kept_results_are_told"]


def fixture_key(definition: object) -> str:
    return f"fixture {definition.baseid}::{definition.argname}"


class Counters:
    """What runs in this process and in those that it has started, since it was last asked."""

    def __init__(self, folder: Path) -> None:
        self.size = (folder / "size").stat().st_size
        self.own = mmap.mmap(-1, self.size)  # shared with forks
        self.live = folder / "live"
        self.of_children: dict[str, mmap.mmap] = {}
        self.begins = f"{os.getpid()}."

    def taken(self) -> list[int]:
        """Return the blocks that have run, and begin anew."""
        found = [self._read(self.own)]
        names = [one.name for one in os.scandir(self.live) if one.name.startswith(self.begins)]
        for name in names:
            if name.endswith(".new"):
                continue
            is_over = not _is_alive(int(name.split(".")[1]))  # asked first: it may go on meanwhile
            if name not in self.of_children:
                with (self.live / name).open("rb+") as file:
                    self.of_children[name] = mmap.mmap(file.fileno(), self.size)
            found.append(self._read(self.of_children[name]))
            if is_over:
                self.of_children.pop(name).close()
                (self.live / name).unlink()
        return np.unique(np.concatenate(found)).tolist()

    def _read(self, counters: mmap.mmap) -> np.ndarray:
        found = np.flatnonzero(np.frombuffer(counters[:], dtype=np.uint8))
        if len(found):
            counters[:] = bytes(self.size)
        return found


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass
    return True


class Tracing:
    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.counters = Counters(folder)
        setattr(builtins, COUNTER, self.counters.own)
        self.seen: dict[str, set[int]] = defaultdict(set)
        self.uses: dict[str, set[str]] = defaultdict(set)  # kept results, by who asks for them
        self.tests: dict[str, dict[str, object]] = {}
        self.fixtures: dict[str, float] = {}
        self.unfit: set[str] = set()  # failed or skipped: they tell nothing of a mutant
        self.now = ""

    def switch(self, context: str) -> str:
        self.keep()
        before, self.now = self.now, context
        return before

    def keep(self) -> None:
        self.seen[self.now].update(self.counters.taken())

    @pytest.hookimpl(wrapper=True)
    def pytest_make_collect_report(self, collector):
        before = self.switch(f"import {collector.nodeid.split('::')[0]}")
        try:
            return (yield)
        finally:
            self.switch(before)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        before = self.switch(item.nodeid)
        began, self.spent = time.perf_counter(), 0.0
        try:
            return (yield)
        finally:
            self.switch(before)
            known = getattr(item, "_fixtureinfo", None)
            wide = [
                fixture_key(found[-1])
                for found in (known.name2fixturedefs.values() if known else ())
                if found[-1].scope != "function"
            ]
            seconds = time.perf_counter() - began - self.spent
            self.tests[item.nodeid] = {"seconds": round(seconds, 4), "fixtures": wide}

    def pytest_runtest_logreport(self, report):
        if not report.passed:
            self.unfit.add(report.nodeid)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef):
        if fixturedef.scope == "function":
            return (yield)
        key = fixture_key(fixturedef)
        before = self.switch(key)
        began, outside = time.perf_counter(), self.spent
        try:
            return (yield)
        finally:
            self.switch(before)
            whole = time.perf_counter() - began
            self.fixtures[key] = round(whole - (self.spent - outside), 4)
            self.spent = outside + whole

    def pytest_sessionfinish(self):
        self.keep()
        hits = {name: sorted(found) for name, found in self.seen.items() if found}
        path = self.folder / f"hits.main.{os.getpid()}.json"
        path.write_text(json.dumps(hits), encoding="utf-8")
        tests = {name: test for name, test in self.tests.items() if name not in self.unfit}
        uses = {name: sorted(keys) for name, keys in self.uses.items()}
        found = {"tests": tests, "fixtures": self.fixtures, "uses": uses}
        path = self.folder / f"times.{os.getpid()}.json"
        path.write_text(json.dumps(found), encoding="utf-8")


def kept_results_are_told(tracing: Tracing) -> None:
    """Let `functools.cache` and `lru_cache` tell who asks, and trace what is made under a name."""
    lru_cache = functools.lru_cache

    def told(function, keep):
        if function.__module__.split(".")[0] not in {"damperfit", "tests"}:
            return keep(function)
        key = f"kept {function.__module__}.{function.__qualname__}"

        def make(*values, **named):
            if threading.current_thread() is not threading.main_thread():
                return function(*values, **named)
            before = tracing.switch(key)
            try:
                return function(*values, **named)
            finally:
                tracing.switch(before)

        inner = keep(make)

        @functools.wraps(function)
        def asked(*values, **named):
            tracing.uses[tracing.now].add(key)
            return inner(*values, **named)

        for name in ("cache_info", "cache_clear", "cache_parameters"):
            setattr(asked, name, getattr(inner, name))
        return asked

    def of_size(maxsize=128, typed=False):  # noqa: FBT002 - as the library has it
        if callable(maxsize):
            return told(maxsize, lru_cache())
        return lambda function: told(function, lru_cache(maxsize=maxsize, typed=typed))

    functools.lru_cache = of_size
    functools.cache = lambda function: told(function, lru_cache(maxsize=None))


def pytest_configure(config):
    runs_nothing = config.getoption("numprocesses", None) and not hasattr(config, "workerinput")
    if not runs_nothing:
        os.environ[OWNER] = str(os.getpid())
        tracing = Tracing(Path(os.environ[FOLDER]))
        kept_results_are_told(tracing)
        config.pluginmanager.register(tracing)
