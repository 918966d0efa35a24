"""The mutation run on a toy package with a line that its test holds and one that it only runs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("cosmic_ray", reason="comes with the extra `mutation`")

from tests.mutations import mutants, operators
from tests.mutations.running import _Running

ROOT = Path(__file__).parents[2]
TOY = {
    "pyproject.toml": "[tool.pytest.ini_options]\naddopts = ['--import-mode=importlib']\n",
    "damperfit/__init__.py": "",
    "damperfit/limits.py": (
        '"""A limit with a test on both sides, and a size that nobody looks at."""\n'
        "LIMIT = 2.0\n\n\n"
        "def is_wide(x: float) -> bool:\n    return x > LIMIT\n\n\n"
        "def size(n: int) -> int:\n    return n * 3\n\n\n"
        "def never(n: int) -> int:\n    return n - 7\n"
    ),
    "tests/test_limits.py": (
        "from damperfit.limits import is_wide, size\n\n\n"
        "def test_limit():\n    assert is_wide(2.1)\n    assert not is_wide(1.9)\n\n\n"
        "def test_size():\n    size(4)\n"
    ),
}


@pytest.fixture(scope="module")
def toy(tmp_path_factory):
    root = tmp_path_factory.mktemp("toy")
    for name, text in TOY.items():
        (root / name).parent.mkdir(exist_ok=True)
        (root / name).write_text(text, encoding="utf-8")
    return root


def run(toy, *more):
    command = [sys.executable, "-m", "tests.mutations", "--root", toy, "--folder", toy / "work"]
    done = subprocess.run(
        [*map(str, command), "--jobs", "1", *more],
        cwd=ROOT, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode in {0, 1}, done.stderr
    return done


@pytest.mark.slow
def test_what_is_held_is_killed_and_what_is_only_run_survives(toy) -> None:
    done = run(toy, "--count", "50")
    assert done.returncode == 1
    alive = [line for line in done.stdout.splitlines() if line.startswith("damperfit/limits.py")]
    assert {line.split()[0] for line in alive} == {
        "damperfit/limits.py:10",
        "damperfit/limits.py:14",
    }
    assert {line.split(":")[1].split()[0] for line in alive if "no test runs it" in line} == {"14"}
    assert "  - return n * 3" in done.stdout
    drawn, survive = done.stdout.splitlines()[-2].split()[1:3]
    assert (int(drawn), int(survive)) == (4, 2)  # one a line: LIMIT, is_wide, size, never


@pytest.mark.slow
def test_a_run_goes_on_where_it_was(toy) -> None:
    done, again = run(toy, "--count", "50"), run(toy, "--count", "50")
    assert "0 mutants tried" in again.stderr
    assert again.stdout == done.stdout


def test_the_draw_follows_the_seed_and_not_the_place(tmp_path) -> None:
    def drawn(seed, folder, lead=""):
        path = tmp_path / folder / "damperfit" / "limits.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(lead + TOY["damperfit/limits.py"], encoding="utf-8")
        found = mutants.draw(tmp_path / folder, 3, seed, {"all": ("damperfit",)})
        return [(one.before, one.after) for one in found]

    assert drawn(1, "a") == drawn(1, "b") == drawn(1, "c", "import math\n\n")
    assert len({tuple(drawn(seed, "a")) for seed in range(5)}) > 1


@pytest.mark.parametrize(
    "line",
    [
        "x: dict[str, int | None]",
        "def f(x: int | None = None) -> tuple[int, str]: ...",
        "@dataclass(frozen=True)\nclass A: ...",
        "assert x is not None",
        "if TYPE_CHECKING:\n    y = 1 + 2",
        "x = 1e-300",
        "with ThreadPoolExecutor(max(1, 2)) as pool: ...",
        "z = zip(a, strict=True)",
    ],
)
def test_what_means_nothing_is_left_out(tmp_path, line) -> None:
    path = tmp_path / "one.py"
    path.write_text(f"{line}\n", encoding="utf-8")
    assert mutants.find_mutants(path, tmp_path, "all") == []


OURS = [
    one
    for kind in operators.KINDS.values()
    for one in kind
    if type(one).__module__ == operators.__name__
]


@pytest.mark.parametrize("operator", OURS, ids=lambda one: type(one).__name__)
def test_each_operator_does_what_its_examples_say(operator) -> None:
    import parso

    for example in operator.examples():
        tree, count = parso.parse(example.pre_mutation_code), 0
        for node in list(mutants._walk(tree)):
            for index, _ in enumerate(operator.mutation_positions(node)):
                if count == example.occurrence:
                    parent, place = node.parent, node.parent.children.index(node)
                    parent.children[place] = operator.mutate(node, index)
                count += 1
        assert " ".join(tree.get_code().split()) == " ".join(example.post_mutation_code.split())


def test_a_known_mutant_that_is_no_longer_there_is_told(tmp_path) -> None:
    (tmp_path / "damperfit").mkdir()
    (tmp_path / "damperfit" / "one.py").write_text("LIMIT = 2.0\n", encoding="utf-8")
    rows = tmp_path / "known.toml"
    text = "[[mutant]]\nname = 'wide'\nbefore = 'LIMIT = {}'\nafter = 'LIMIT = 4.0'\n"
    rows.write_text(text.format("2.0"), encoding="utf-8")
    (found,) = mutants.known_mutants(tmp_path, rows)
    assert (found.place, found.text) == ("damperfit/one.py:1", "LIMIT = 4.0\n")
    (tmp_path / "damperfit" / "one.py").write_text("A = 1\nLIMIT = 2.0\n", encoding="utf-8")
    rows.write_text(text.replace("'LIMIT = {}'", '"\\nLIMIT = 2.0\\n"'), encoding="utf-8")
    (found,) = mutants.known_mutants(tmp_path, rows)
    assert (found.line, found.last_line) == (2, 2)
    rows.write_text(text.format("3.0"), encoding="utf-8")
    with pytest.raises(SystemExit, match=r"wide: 'LIMIT = 3\.0' stands in 0 places"):
        mutants.known_mutants(tmp_path, rows)


def test_the_known_mutants_are_still_to_be_found() -> None:
    assert len(mutants.known_mutants(ROOT)) >= 20


@pytest.mark.parametrize(("load", "late"), [(0.0, 41.0), (3.0, 41.0), (20.0, 201.0)])
def test_a_test_hangs_after_what_it_may_take_on_its_share_of_the_cores(
    monkeypatch, load, late
) -> None:
    """With twenty jobs on two cores seven of thirty-three "hung", which counts as caught."""
    monkeypatch.setattr(os, "cpu_count", lambda: 4)
    monkeypatch.setattr(os, "getloadavg", lambda: (load, 0.0, 0.0))
    running = _Running(0, Path(), began=1000.0, seconds=40.0)
    assert running.hangs(1000.0 + late)
    assert not running.hangs(1000.0 + late - 2.0)
