"""What CONTRIBUTING.md names is there: files, folders, modules that are run, names in a file."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
SHAPE = TEXT.partition("    damperfit/\n")[2].partition("\nImports go")[0]
CODE = {name for text in re.findall(r"`([^`]+)`", TEXT) for name in [text.replace("\n", " ")]}
SUFFIX = re.compile(r"\.(py|c|h|md|toml|yml|json)$")
MADE = {"run.json", "report.md", "tests.csv"}  # by a run, not in the tree
CHANGES = (
    "law", "unit", "finding", "key of run.json", "check", "figure", "statistical limit",
    "rig option", "reader", "exit code", "column", "command",
)  # fmt: skip


@cache
def paths() -> frozenset[str]:
    """Every file and folder of the tree, from the root on."""
    return frozenset(
        path.relative_to(ROOT).as_posix()
        for name in ("damperfit", "tests", ".ci")
        for path in (ROOT / name, *(ROOT / name).rglob("*"))
        if "__pycache__" not in path.parts
    ) | {path.name for path in ROOT.iterdir()}


def is_there(name: str) -> bool:
    """Whether a file or folder ends so: paths are named from the package or from a folder in it."""
    name = name.strip("/")
    return any(one == name or one.endswith(f"/{name}") for one in paths())


def named_paths() -> list[str]:
    words = (word.partition("::")[0] for text in CODE for word in text.split())
    found = {word for word in words if re.fullmatch(r"[\w./-]+", word)}
    return sorted(
        word
        for word in found
        if (SUFFIX.search(word) or (word.endswith("/") and len(word) > 1)) and word not in MADE
    )


def in_the_shape() -> list[str]:
    """Paths of the tree at the top, by how far each name is set in."""
    found, folders = [], {}
    for line in SHAPE.splitlines():
        entry = re.match(r"( +)([\w.]+(?:/|\.py|\.toml|, [\w., ]+\.py)?)(?=  |$| )", line)
        if entry is None:
            continue
        depth, name = len(entry[1]), entry[2]
        above = "".join(folders[k] for k in sorted(folders) if k < depth)
        if name.endswith("/"):
            folders = {k: one for k, one in folders.items() if k < depth} | {depth: name}
            found.append(f"damperfit/{above}{name}")
        elif name.endswith((".py", ".toml")):
            found += [f"damperfit/{above}{one}" for one in name.split(", ")]
    return found


def test_a_path_that_is_not_there_would_be_noticed() -> None:
    assert is_there("damper/core/laws.h")
    assert not is_there("damper/core/flaws.h")
    assert len(named_paths()) > 80
    assert len(in_the_shape()) > 100


def test_each_path_is_there() -> None:
    assert [name for name in named_paths() if not is_there(name)] == []


def test_the_shape_of_the_house_is_that_of_the_folder() -> None:
    assert [name for name in in_the_shape() if name.rstrip("/") not in paths()] == []


def test_each_module_that_is_run_is_there() -> None:
    names = sorted(set(re.findall(r"python -m (tests[\w.]+)", TEXT)))
    assert len(names) > 20
    for name in names:
        path = ROOT / name.replace(".", "/")
        assert path.with_suffix(".py").is_file() or (path / "__main__.py").is_file(), name


@pytest.mark.parametrize(
    "name", sorted(set(re.findall(r"`(\w+)`[^`]{0,30}\(`([\w/.]+\.py)`", TEXT)))
)
def test_each_name_stands_in_the_file_beside_it(name: tuple[str, str]) -> None:
    """As in: a row in `FORMATS` (`readers/formats.py`)."""
    word, file = name
    texts = [
        (ROOT / one).read_text(encoding="utf-8")
        for one in paths()
        if one == file or one.endswith(f"/{file}")
    ]
    assert any(re.search(rf"\b{word}\b", text) for text in texts)


@pytest.mark.parametrize("change", CHANGES)
def test_each_of_twelve_changes_has_its_place(change: str) -> None:
    """A row of the table names a file or folder that is there."""
    table = TEXT.partition("### Where a change goes")[2].partition("###")[0]
    (row,) = [line for line in table.splitlines() if line.startswith(f"| {change} |")]
    named = re.findall(r"`([\w./-]+)`", row)
    assert named
    assert all(is_there(one) for one in named)


def test_a_decision_has_ten_lines_at_most() -> None:
    decisions = TEXT.partition("## Decisions")[2]
    each = re.split(r"\n\n(?=\*\*)", decisions.strip())
    assert len(each) > 40
    assert [one[:60] for one in each if len(one.replace("\n\n", "\n").splitlines()) > 10] == []


def test_no_module_has_more_than_four_hundred_lines() -> None:
    lines = {
        path.relative_to(ROOT).as_posix(): len(path.read_text(encoding="utf-8").splitlines())
        for path in (ROOT / "damperfit").rglob("*.*")
        if path.suffix in {".py", ".c", ".h"}
    }
    assert {name: n for name, n in lines.items() if n > 400} == {}
