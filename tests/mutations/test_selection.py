"""Which tests are chosen for a changed line, in which order, and what the budget leaves out."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("cosmic_ray", reason="comes with the extra `mutation`")

from tests.mutations.__main__ import _options, traced
from tests.mutations.selection import Plan, Selection, Trace

PACKAGE = """\
import functools
import sys
import time

LIMIT = 2.0


def in_a_child():
    return 1


def lasting():
    print("ready", flush=True)
    for _ in sys.stdin:
        print(asked(), flush=True)


def asked():
    return 2


def forked():
    return 3


@functools.lru_cache(maxsize=4)
def kept(n):
    return made(n)


def made(n):
    return n + 4


def cases(n):
    return n < LIMIT


def of_a_table(n):
    return {n: n}


TABLE = of_a_table(3)


def looked_up(n):
    return TABLE[n]


def never_called(
    n=5,
):
    return n
"""
TESTS = """\
import functools, os, signal, subprocess, sys, time
import pytest
from damperfit import parts

def start(code):
    return subprocess.Popen([sys.executable, "-c", f"from damperfit import parts; {code}"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env={"PYTHONPATH": os.getcwd()})

def test_killed():
    child = start("parts.in_a_child(); print('done', flush=True); parts.time.sleep(60)")
    assert child.stdout.readline() == "done\\n"
    child.kill()
    child.wait()

@functools.cache
def lasting_child():
    child = start("parts.lasting()")
    assert child.stdout.readline() == "ready\\n"
    return child

def test_starts():
    assert lasting_child().poll() is None

def test_asks():
    child = lasting_child()
    print("?", file=child.stdin, flush=True)
    assert child.stdout.readline() == "2\\n"

def test_ends():
    lasting_child().communicate()

def test_forks():
    pid = os.fork()
    if pid == 0:
        os._exit(0 if parts.forked() == 3 else 1)
    assert os.waitpid(pid, 0)[1] == 0

def test_first():
    assert parts.kept(1) == 5

def test_second():
    assert parts.kept(1) == 5

@functools.cache
def shared():
    return parts.made(7)

@pytest.fixture(scope="module")
def wide():
    return shared()

def test_third(wide):
    assert wide == 11

def test_fourth(wide):
    assert wide == 11

@pytest.mark.parametrize("n", range(4))
def test_case(n):
    assert parts.cases(n) == (n < 2)

def test_other():
    assert parts.cases(1)

def test_looked_up():
    assert parts.looked_up(3) == 3
"""
SIGNATURES = """\
import inspect
from damperfit import parts

def test_default():
    assert inspect.signature(parts.never_called).parameters["n"].default == 5
"""
FILES = {
    "pyproject.toml": "[tool.pytest.ini_options]\naddopts = ['--import-mode=importlib']\n",
    "damperfit/__init__.py": "",
    "damperfit/parts.py": PACKAGE,
    "tests/test_some.py": TESTS,
    "tests/test_signatures.py": SIGNATURES,
}


@pytest.fixture(scope="module")
def selection(tmp_path_factory):
    root = tmp_path_factory.mktemp("toy")
    for name, text in FILES.items():
        (root / name).parent.mkdir(exist_ok=True)
        (root / name).write_text(text, encoding="utf-8")
    return traced(root, root / "work", _options(["--jobs", "1", "--root", str(root)]))


def chosen(selection, line: str) -> list[str]:
    number = PACKAGE.splitlines().index(line) + 1
    plan = selection.plan("damperfit/parts.py", number, number)
    return [name.partition("::test_")[2] for name, _ in plan.tests]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "tests"),
    [
        ("    return 1", {"killed"}),
        ("    return 2", {"asks"}),  # of the child that `starts` has started
        ("    return 3", {"forks"}),
        ("    return made(n)", {"first", "second"}),
        ("    return n + 4", {"first", "second", "third", "fourth"}),
        ("    return {n: n}", {"looked_up", "killed", "starts", "asks", "ends"}),  # these import
        ("    return TABLE[n]", {"looked_up"}),
        ("    n=5,", {"default"}),
    ],
)
def test_those_are_chosen_for_which_the_line_runs(selection, line, tests) -> None:
    assert set(chosen(selection, line)) == tests


@pytest.mark.slow
def test_the_cases_of_one_test_do_not_stand_before_all_others(selection) -> None:
    names = chosen(selection, "    return n < LIMIT")
    assert sorted(names) == ["case[0]", "case[1]", "case[2]", "case[3]", "other"]
    assert names.index("other") < 2


def written(folder: Path, tests: dict[str, float], fixtures: dict[str, list[str]]) -> Selection:
    """Return what a trace told of a module of two lines, the second run by each of the tests."""
    place = folder / "work"
    (place / "tree" / "damperfit" / "near").mkdir(parents=True)
    (folder / "damperfit" / "near").mkdir(parents=True)
    for root in (folder, place / "tree"):
        text = "def broad():\n    return 1\n"
        (root / "damperfit" / "near" / "parts.py").write_text(text, encoding="utf-8")
    for name in tests:
        file = folder / name.partition("::")[0]
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("broad()\n" if "named" in name else "", encoding="utf-8")
    told = {
        "blocks": [["damperfit/near/parts.py", [[2, 2]]]],
        "hits": {name: [0] for name in tests},
        "times": {
            "tests": {
                name: {"seconds": seconds, "fixtures": fixtures.get(name, [])}
                for name, seconds in tests.items()
            },
            "fixtures": {"wide": 8.0},
            "uses": {},
        },
    }
    for name, what in told.items():
        (place / f"{name}.json").write_text(json.dumps(what), encoding="utf-8")
    return Selection(folder, [Trace(place)])


def test_what_names_the_function_comes_first_then_what_is_near_then_what_is_fast(tmp_path) -> None:
    tests = {
        "tests/far/test_a.py::quick": 0.0,
        "tests/far/test_a.py::slow": 5.0,
        "tests/near/test_b.py::middle": 0.03,
        "tests/near/test_parts.py::same": 0.1,
        "tests/far/test_named.py::named": 0.5,
    }
    found = written(tmp_path, tests, {}).plan("damperfit/near/parts.py", 2, 2)
    assert [name.partition("::")[2] for name, _ in found.tests] == [
        "same", "middle", "named", "quick", "slow",
    ]  # fmt: skip


def test_a_fixture_is_paid_by_the_first_that_asks_for_it(tmp_path) -> None:
    tests = {f"tests/near/test_b.py::{name}": 0.5 for name in "abc"}
    wide = {"tests/near/test_b.py::a": ["wide"], "tests/near/test_b.py::b": ["wide"]}
    found = written(tmp_path, tests, wide).plan("damperfit/near/parts.py", 2, 2)
    assert [(name[-1], seconds) for name, seconds in found.tests] == [
        ("c", 0.5), ("a", 8.5), ("b", 0.5),
    ]  # fmt: skip


def test_a_test_too_long_for_the_budget_does_not_keep_out_those_behind_it() -> None:
    plan = Plan((("a", 1.0), ("long", 50.0), ("b", 3.0), ("c", 6.5), ("d", 4.0)))
    assert plan.batches(12.0) == [["a"], ["b"], ["c"]]
    assert plan.batches(14.5) == [["a"], ["b"], ["c", "d"]]
    assert plan.batches(100.0) == [["a"], ["long", "b", "c", "d"]]
    assert Plan((("long", 50.0),)).batches(12.0) == [["long"]]


@pytest.mark.slow
def test_what_the_budget_cut_is_counted(tmp_path) -> None:
    files = {
        **FILES,
        "damperfit/parts.py": "def f(n):\n    return n + 1\n",
        "tests/test_some.py": (
            "import time\nfrom damperfit.parts import f\n\n"
            "def test_runs():\n    f(1)\n\n"
            "def test_tells():\n    time.sleep(0.7)\n    assert f(1) == 2\n"
        ),
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "tests.mutations", "--root", tmp_path, "--jobs", "1"]
    command += ["--count", "2", "--folder", tmp_path / "work", "--again", "--budget"]

    def last(budget: str) -> str:
        done = subprocess.run(
            [*map(str, command), budget], cwd=Path(__file__).parents[2],
            capture_output=True, text=True, timeout=120, check=False,
        )  # fmt: skip
        return done.stdout.splitlines()[-1], "not run for want of time: 1 test" in done.stdout

    assert last("0.5") == ("of those that survive, the budget cut the tests of 1", True)
    assert last("5") == ("of those that survive, the budget cut the tests of 0", False)
