"""Which blocks of a function run, and on which lines they stand."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("cosmic_ray", reason="comes with the extra `mutation`")

from tests.mutations.blocks import OWNER, compile_kept, instrument

SOURCE = '''\
def f(x):
    """Doc."""
    a = 1
    if x == 1:
        a = 2
    elif x == 2:
        a = 3
    else:
        a = 4
    try:
        b = 1 / x
    except (ZeroDivisionError,
            ValueError):
        b = 0
    else:
        b += 1
    finally:
        c = 1
    for k in range(x):
        a += k
    match x:
        case 2:
            a = 9
        case _ if x > 5:
            a = 10
    def g():
        return [i for i in range(
            3)]
    class K:
        def m(self):
            return 5
    return (a,
        b, c) if x < 9 else (g(), K().m())
'''
ALWAYS = {3, 4, 10, 11, 18, 19, 21, 26, 29, 32, 33}


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    root = tmp_path_factory.mktemp("tree")
    (root / "damperfit").mkdir()
    (root / "damperfit" / "__init__.py").write_text("", encoding="utf-8")
    (root / "damperfit" / "one.py").write_text(SOURCE, encoding="utf-8")
    return root


def printed(tree: Path, code: str, **more: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tree, env={**os.environ, **more},
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize(
    ("x", "more"),
    [
        (0, {6, 8, 9, 12, 13, 14, 24}),  # 8 and 24: where an `else` and a guard stand
        (1, {5, 16, 20, 24}),
        (2, {6, 7, 16, 20, 22, 23}),
        (9, {6, 8, 9, 16, 20, 24, 25, 27, 28}),
    ],
)
def test_lines_are_those_of_the_blocks_that_run(tree, tmp_path, x, more) -> None:
    """A header counts with what stands before it, and what only stands beside a block does not."""
    instrument(tree, tmp_path)
    printed(tree, f"from damperfit.one import f; f({x})", **{OWNER: "1"})
    blocks = json.loads((tmp_path / "blocks.json").read_text(encoding="utf-8"))
    (counted,) = (path.read_bytes() for path in (tmp_path / "live").glob("1.*"))
    hits = [k for k, one in enumerate(counted) if one]
    assert {blocks[k][0] for k in hits} == {"damperfit/one.py"}
    lines = {line for k in hits for first, last in blocks[k][1] for line in range(first, last + 1)}
    assert ALWAYS <= lines
    bodies = {5, 7, 9, 14, 16, 20, 23, 25, 27}
    assert lines & bodies == more & bodies


def test_what_is_kept_compiled_follows_its_source(tree) -> None:
    """A mutant must not be passed over for the bytecode of the file before it."""
    compile_kept(tree)
    ask = "import damperfit.one as m; print(m.f.__doc__, m.f(2))"
    assert printed(tree, ask) == "Doc. (9, 1.5, 1)"
    path = tree / "damperfit" / "one.py"
    path.write_text(SOURCE.replace("a = 9", "a = 8"), encoding="utf-8")
    assert printed(tree, ask) == "Doc. (8, 1.5, 1)"
