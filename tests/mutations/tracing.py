"""A pytest plugin: which test runs which line, and how long each takes.

`python -m pytest -p tests.mutations.tracing` with the folder named in DAMPERFIT_TRACE, in a tree
that `blocks.instrument` has compiled. A fixture that serves several tests is traced under a name of
its own, and so is the import of a test file: what they run counts for every test that uses them.
Processes that a test starts are traced as it.
"""

from __future__ import annotations

import builtins
import json
import os
import time
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

from tests.mutations.blocks import COUNTER

FOLDER, CONTEXT = "DAMPERFIT_TRACE", "DAMPERFIT_TRACE_CONTEXT"


def fixture_key(definition: object) -> str:
    return f"fixture {definition.baseid}::{definition.argname}"


class Tracing:
    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.hits = getattr(builtins, COUNTER)  # made by `sitecustomize` of the folder
        self.seen: dict[str, set[int]] = defaultdict(set)
        self.tests: dict[str, dict[str, object]] = {}
        self.fixtures: dict[str, float] = {}
        self.unfit: set[str] = set()  # failed or skipped: they tell nothing of a mutant
        self.now = ""

    def switch(self, context: str) -> str:
        self.keep()
        before, self.now = self.now, context
        os.environ[CONTEXT] = context
        return before

    def keep(self) -> None:
        found = np.flatnonzero(np.frombuffer(self.hits, dtype=np.uint8))
        self.seen[self.now].update(found.tolist())
        self.hits[:] = bytes(len(self.hits))

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
        found = {"tests": tests, "fixtures": self.fixtures}
        path = self.folder / f"times.{os.getpid()}.json"
        path.write_text(json.dumps(found), encoding="utf-8")


def pytest_configure(config):
    runs_nothing = config.getoption("numprocesses", None) and not hasattr(config, "workerinput")
    if not runs_nothing:
        config.pluginmanager.register(Tracing(Path(os.environ[FOLDER])))
