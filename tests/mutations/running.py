"""Mutants tried: one warm process that forks for each, so that a mutant costs its tests alone.

The process has imported what the tests need of other people's libraries, but nothing of ours. A
child gets a copy of the tree in which one file is changed, as its folder and first on the path, and
so do the processes that its tests start.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import time
import traceback
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.mutations.blocks import compile_kept
from tests.mutations.mutants import Mutant
from tests.mutations.selection import Plan

__all__ = ["PLUGINS", "Result", "Workspace", "build_core", "preload", "run_mutants", "run_tests"]

PLUGINS = (
    "xdist.plugin", "pytest_benchmark.plugin", "hypothesis", "_hypothesis_pytestplugin",
)  # fmt: skip
_PRELOADED = (
    *PLUGINS,
    "numpy", "scipy.signal", "scipy.optimize", "scipy.interpolate", "scipy.stats",
    "scipy.linalg", "scipy.special", "scipy.integrate", "pandas", "pyarrow", "pyarrow.parquet",
    "pydantic", "rich.console", "rich.table", "typer", "typer.testing", "matplotlib",
    "matplotlib.figure", "matplotlib.backends.backend_agg", "matplotlib.backends.backend_svg",
    "hypothesis", "h5py", "nptdms", "openpyxl", "python_calamine", "threadpoolctl",
    "markdown_it", "concurrent.futures.thread", "asammdf", "jinja2", "PIL.Image",
)  # fmt: skip
_COPIED = ("damperfit", "tests", "configs", "sample_runs", ".ci", ".github")
_OPTIONS = (
    "-q",
    "-x",
    "--disable-plugin-autoload",
    *(
        word
        for name in ("xdist.plugin", "pytest_benchmark.plugin", "_hypothesis_pytestplugin")
        for word in ("-p", name)
    ),
    "-n0",
    "--no-header",
    "--tb=line",
    "--benchmark-disable",
    "-Wignore::pytest.PytestAssertRewriteWarning",
)  # plugins are there already
_OURS = 71  # exit code of a child that failed by our own fault
_ENOUGH_S = 20.0
_SLOWER = 4.0  # than when it was traced, before a test counts as hanging


@dataclass(frozen=True)
class Result:
    """What became of a mutant."""

    key: str
    status: str  # killed, survived, timeout, unseen
    killer: str = ""
    seconds: float = 0.0
    tests: int = 0
    cut: int = 0  # tests that run its line, for which the budget left no time


@dataclass
class Workspace:
    """A copy of the tree in which a file is changed and put back."""

    root: Path
    folder: Path

    def make(self) -> Workspace:
        if self.folder.exists():
            shutil.rmtree(self.folder)
        self.folder.mkdir(parents=True)
        skipped = shutil.ignore_patterns("__pycache__", "results", ".*_cache")
        for name in filter(lambda name: (self.root / name).is_dir(), _COPIED):
            shutil.copytree(self.root / name, self.folder / name, ignore=skipped)
        for path in self.root.iterdir():
            if path.is_file():
                shutil.copy2(path, self.folder)
        compile_kept(self.folder)
        return self

    def change(self, mutant: Mutant) -> bool:
        """Write the mutant; False where the compiler refuses it."""
        (self.folder / mutant.path).write_text(mutant.text, encoding="utf-8")
        return mutant.path.endswith(".py") or not _is_core(mutant.path) or build_core(self.folder)

    def restore(self, mutant: Mutant) -> None:
        shutil.copy2(self.root / mutant.path, self.folder / mutant.path)
        if _is_core(mutant.path):
            core = next((self.root / "damperfit" / "damper").glob("_core*"))
            for path in (self.root / "damperfit" / "damper").glob("_core*.so"):
                core = path
            shutil.copy2(core, self.folder / "damperfit" / "damper")


def _is_core(path: str) -> bool:
    return path.endswith((".c", ".h"))


def build_core(folder: Path) -> bool:
    """Compile the core of a tree in place, as pyproject.toml says."""
    place = folder / "damperfit" / "damper"
    sources = sorted(map(str, (place / "core").glob("*.c")))
    target = next(place.glob("_core*.so"))
    target.unlink()  # a process that has it loaded keeps the old one
    compiler = (sysconfig.get_config_var("CC") or "cc").split()
    include = sysconfig.get_paths()["include"]
    command = [
        *compiler, "-shared", "-fPIC", "-std=c99", "-O3", "-ffp-contract=off", "-fno-math-errno",
        f"-I{include}",
        *sources, "-o", str(target), "-lm",
    ]  # fmt: skip
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def preload(names: Iterable[str] = _PRELOADED) -> None:
    """Import what every child needs and no mutant touches."""
    os.environ.setdefault("MPLBACKEND", "Agg")
    for name in names:
        try:
            importlib.import_module(name)
        except ImportError:
            continue
    gc.collect()
    gc.freeze()  # or each child looks for garbage among what it shares
    ours = [name for name in sys.modules if name.split(".")[0] == "damperfit"]
    if ours:
        raise SystemExit(f"tests.mutations: {ours[0]} must not be loaded here")


class _Chosen:
    """The plugin of a child: runs the tests asked for, by file, and keeps the first that fails."""

    def __init__(self, names: Sequence[str]) -> None:
        self.order = {name: k for k, name in enumerate(names)}
        files: dict[str, int] = {}
        for name in names:
            files.setdefault(name.split("::")[0], len(files))
        self.files = files
        self.failed = ""

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items):
        found = {item: self._place(item.nodeid) for item in items}
        items[:] = sorted(
            (item for item in items if found[item] is not None),
            key=lambda item: (self.files[item.nodeid.split("::")[0]], found[item]),
        )

    def _place(self, name: str) -> int | None:
        """Return where a test stands in the order; its function's name stands for all its cases."""
        return self.order.get(name, self.order.get(name.split("[", maxsplit=1)[0]))

    def pytest_runtest_logreport(self, report):
        if report.failed and not self.failed:
            self.failed = report.nodeid

    def pytest_collectreport(self, report):
        if report.failed and not self.failed:
            self.failed = f"import of {report.nodeid}"


def _child(folder: Path, names: Sequence[str], log: Path, more: Sequence[str]) -> None:
    os.setpgid(0, 0)  # a group that can be killed, of the session that may be favoured
    with log.with_suffix(".out").open("wb") as out:
        os.dup2(out.fileno(), 1)
        os.dup2(out.fileno(), 2)
    os.chdir(folder)
    sys.dont_write_bytecode = False  # what is kept is held to its source
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    os.environ |= {"PYTHONPATH": str(folder), "OMP_NUM_THREADS": "1"}
    sys.path[:] = [str(folder), *(p for p in sys.path if p and not Path(p, "damperfit").is_dir())]
    for name in [n for n in sys.modules if n.split(".")[0] in {"tests", "damperfit"}]:
        del sys.modules[name]
    importlib.invalidate_caches()
    chosen = _Chosen(names)
    code = pytest.main([*_OPTIONS, *more, *chosen.files], plugins=[chosen])
    log.write_text(json.dumps({"code": int(code), "failed": chosen.failed}), encoding="utf-8")
    sys.stdout.flush()
    os._exit(0)


@dataclass
class _Running:
    pid: int
    log: Path
    began: float
    seconds: float  # that it may take where it has a core of its own

    def hangs(self, now: float) -> bool:
        """Whether it is late, also for what its share of the cores is while others use them."""
        share = max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))
        return now > self.began + share * self.seconds


def _start(folder: Path, names: Sequence[str], seconds: float, more: Sequence[str]) -> _Running:
    log = folder.parent / f"{folder.name}.json"
    log.unlink(missing_ok=True)
    sys.stdout.flush()
    sys.stderr.flush()
    pid = os.fork()
    if pid == 0:
        try:
            _child(folder, names, log, more)
        except BaseException:  # noqa: BLE001 - or the child would go on as its parent
            traceback.print_exc()
        os._exit(_OURS)
    return _Running(pid, log, time.monotonic(), _ENOUGH_S + _SLOWER * seconds)


def _ended(running: _Running) -> str | None:
    """Return "" for all passed, the test that failed, "timeout"; None while it runs."""
    pid, status = os.waitpid(running.pid, os.WNOHANG)
    if pid == 0:
        if not running.hangs(time.monotonic()):
            return None
        os.killpg(running.pid, signal.SIGKILL)
        os.waitpid(running.pid, 0)
        return "timeout"
    if status == _OURS << 8:
        raise SystemExit(f"tests.mutations: a child failed; see {running.log.with_suffix('.out')}")
    if not running.log.exists():
        return "the process died"
    told = json.loads(running.log.read_text(encoding="utf-8"))
    if told["code"] in (0, 5):
        return ""
    return told["failed"] or f"pytest ended with {told['code']}"


def run_tests(folder: Path, names: Sequence[str], seconds: float, more: Sequence[str] = ()) -> str:
    """Run tests in a child and wait; as `_ended` tells."""
    running = _start(folder, names, seconds, more)
    while (told := _ended(running)) is None:
        time.sleep(0.02)
    return told


@dataclass
class _Slot:
    """One mutant at a time in a workspace of its own."""

    space: Workspace
    mutant: Mutant | None = None
    heaps: list[list[str]] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)
    running: _Running | None = None
    began: float = 0.0
    ran: int = 0

    def take(self, mutant: Mutant, plan: Plan, budget: float) -> Result | None:
        self.mutant, self.began, self.ran = mutant, time.monotonic(), 0
        self.seconds = dict(plan.tests)
        self.heaps = plan.batches(budget)
        if not self.heaps:
            return self._done("unseen", "")
        if not self.space.change(mutant):
            return self._done("killed", "the compiler")
        self._next()
        return None

    def _next(self) -> None:
        names = self.heaps.pop(0)
        self.ran += len(names)
        self.running = _start(self.space.folder, names, sum(self.seconds[n] for n in names), ())

    def look(self) -> Result | None:
        assert self.running is not None
        told = _ended(self.running)
        if told is None:
            return None
        if told == "" and self.heaps:
            self._next()
            return None
        status = "timeout" if told == "timeout" else "killed" if told else "survived"
        return self._done(status, told)

    def _done(self, status: str, killer: str) -> Result:
        mutant = self.mutant
        assert mutant is not None
        self.space.restore(mutant)
        self.mutant, self.running = None, None
        seconds, cut = round(time.monotonic() - self.began, 1), len(self.seconds) - self.ran
        return Result(
            mutant.key, status, killer, seconds, self.ran, cut if status == "survived" else 0
        )


def run_mutants(
    spaces: Sequence[Workspace],
    work: Iterable[tuple[Mutant, Plan]],
    *,
    budget: float,
) -> Iterator[tuple[Mutant, Result]]:
    """Yield each mutant with what became of it, as they end."""
    slots, waiting = [_Slot(space) for space in spaces], iter(work)
    is_empty = False
    while True:
        for slot in slots:
            while slot.mutant is None and not is_empty:
                row = next(waiting, None)
                if row is None:
                    is_empty = True
                    break
                result = slot.take(*row, budget)
                if result is not None:
                    yield row[0], result
            if slot.mutant is not None:
                mutant = slot.mutant
                result = slot.look()
                if result is not None:
                    yield mutant, result
        if is_empty and all(slot.mutant is None for slot in slots):
            return
        time.sleep(0.02)
