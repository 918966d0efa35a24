"""What holds for every test."""

import compileall
import gc
import importlib.util
import json
import marshal
import os
import re
import shlex
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from itertools import count
from pathlib import Path

import pytest
import typer.main
from _pytest.assertion import rewrite
from _pytest.doctest import DoctestModule

# The workers share the cores; threads of BLAS in each of them get in one another's way.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("HYPOTHESIS_NO_PLUGINS", "1")  # of Trio, where it is installed: 0.2 s each

TESTS = Path(__file__).parent
PACKAGE = TESTS.parent / "damperfit"


@pytest.fixture(scope="session", autouse=True)
def _children_find_the_tests():
    """Readers of our tests run in a child, which has no working folder on its import path."""
    from damperfit import workers

    begin = f"import sys; sys.path.append({str(TESTS.parent)!r})\n"
    workers._NEW = begin + workers._NEW


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(file_path):
    """Look for doctests where there are some: each module takes its time."""
    found = yield
    if PACKAGE in file_path.parents and b">>>" in file_path.read_bytes():
        return found
    return [one for one in found if not isinstance(one, DoctestModule)]


def pytest_configure(config):
    """Keep what is compiled, also where Python is told to write no bytecode: 7 s of each run."""
    gc.set_threshold(50_000, 20, 20)  # nothing that is imported and collected is garbage: 1 s each
    if not hasattr(config, "cache"):
        return  # told to keep nothing
    kept, rewrite_test = config.cache.mkdir("asserts"), rewrite._rewrite_test

    def place_of(path):
        mine = f"{importlib.util.source_hash(str(path).encode()).hex()}-"
        text = importlib.util.source_hash(path.read_bytes()).hex()
        tag = f"{sys.implementation.cache_tag}-pytest-{pytest.__version__}"
        return mine, kept / f"{mine}{text}-{tag}"

    def rewritten(path, config=config):
        mine, file = place_of(path)
        if file.exists():
            return marshal.loads(file.read_bytes())  # noqa: S302 - our own
        found = rewrite_test(path, config)
        for old in kept.glob(f"{mine}*"):
            old.unlink(missing_ok=True)
        draft = file.with_name(f"draft-{os.getpid()}")
        draft.write_bytes(marshal.dumps(found))
        draft.replace(file)
        return found

    rewrite._rewrite_test = rewritten
    if config.option.dist == "no" or config.getoption("--hypothesis-profile"):
        _have_profiles()  # the controller of workers needs none
    if hasattr(config, "workerinput"):
        return
    # Some hundred processes of this run load the package: a tenth of each of them.
    work = [(_compiled, path) for path in PACKAGE.rglob("*.py")]
    if not config.option.file_or_dir:  # else the few that are asked for
        tests = (path for path in TESTS.rglob("*.py") if _is_rewritten(path.name))
        work += [(rewritten, path) for path in tests if not place_of(path)[1].exists()]
    _side_by_side(work)


def _have_profiles():
    """How long an example takes says something of the machine, nothing of the code."""
    from hypothesis import HealthCheck, settings  # pytest rewrites it too: what is kept serves it

    quiet = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
    settings.register_profile("damperfit", max_examples=15, **quiet)
    settings.register_profile("thorough", max_examples=300, **quiet)
    settings.load_profile("damperfit")


def _compiled(path):
    compileall.compile_file(path, quiet=2)


def _is_rewritten(name):
    return name == "conftest.py" or name.startswith("test_")


def _side_by_side(work):
    """Do it here and in a copy of this process, for each worker would do all of it by itself."""
    if not hasattr(os, "fork"):
        return
    copy = os.fork()
    for do, path in work[bool(copy) :: 2]:
        with suppress(SyntaxError, ValueError):  # whoever imports it will say so
            do(path)
    if not copy:
        os._exit(0)
    os.waitpid(copy, 0)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Leave every n-th of the cases of a grid that is marked `one_in` to the default suite."""
    seen = Counter()
    slower = set((TESTS / "slower.txt").read_text(encoding="utf-8").splitlines())
    for item in items:
        if item.nodeid in slower:
            item.add_marker(pytest.mark.slow)
        if mark := item.get_closest_marker("one_in"):
            grid = item.nodeid.partition("[")[0]
            if seen[grid] % mark.args[0]:
                item.add_marker(pytest.mark.slow)
            seen[grid] += 1


def pytest_collection_finish(session):
    """Let what stands now be: no garbage to look for, and nothing for a fork to copy."""
    gc.freeze()  # arrays and tables leave few cycles: looking for them took a fiftieth


_PLACES = count()


@pytest.fixture
def tmp_path(request, tmp_path_factory) -> Path:
    """An empty folder; pytest's own looks through all those before it for a number: 1 ms each."""
    name = re.sub(r"\W", "_", request.node.name)[:30]
    place = tmp_path_factory.getbasetemp() / f"{name}{next(_PLACES)}"
    place.mkdir(mode=0o700)
    return place


@pytest.fixture(scope="session")
def first_command(tmp_path_factory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """A folder with what the README's commands need after the first of them, and what it said."""
    root = Path(__file__).parents[1]
    readme = (root / "README.md").read_text(encoding="utf-8")
    (command,) = re.findall(r"^    .*pip install \. && (.*)$", readme, flags=re.MULTILINE)

    def run(folder: Path) -> None:
        shutil.copytree(root / "sample_runs", folder / "sample_runs")
        done = subprocess.run(
            [sys.executable, "-m", *shlex.split(command)],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(root), "COLUMNS": "120"},
            capture_output=True,
            text=True,
            check=False,
            timeout=120,
        )
        said = [done.args, done.returncode, done.stdout, done.stderr]
        (folder.parent / "said.json").write_text(json.dumps(said), encoding="utf-8")

    folder = _made_once(tmp_path_factory, "first_command", run)
    said = json.loads((folder.parent / "said.json").read_text(encoding="utf-8"))
    return folder, subprocess.CompletedProcess(*said)


def _made_once(tmp_path_factory, name: str, make: Callable[[Path], None]) -> Path:
    """Return a folder that one worker of this session fills, while others wait for it."""
    place = tmp_path_factory.getbasetemp()
    place = (place.parent if "PYTEST_XDIST_WORKER" in os.environ else place) / name
    folder, ended = place / "clone", place / "ended"
    try:
        place.mkdir()
    except FileExistsError:
        for _ in range(3000):
            if ended.exists():
                return folder
            time.sleep(0.1)
        pytest.fail(f"{name}: another worker has not come to its end")
    folder.mkdir()
    try:
        make(folder)
    finally:
        ended.touch()
    return folder


@pytest.fixture(scope="session")
def sample_results(first_command) -> Path:
    """The same folder, with `results` in it: copy it, for others read it too."""
    folder, done = first_command
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="session", autouse=True)
def _the_core_makes_the_samples():
    """Let make-believe logs share steady cycles, which take SciPy a second each."""
    from damperfit import synthetic as logs
    from tests.quick_cycles import quick_cycle

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(logs, "steady_cycle", cache(quick_cycle))
        yield


@pytest.fixture(scope="session", autouse=True)
def _the_command_line_is_built_once():
    """Let commands run in this process share what a process builds once: 40 ms of each call."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(typer.main, "get_command", cache(typer.main.get_command))
        yield


@pytest.fixture(scope="session", autouse=True)
def _nothing_waits_for_the_disk():
    """No test can see whether files have reached the disk, and each run waits fifteen times."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _: None)
        yield
