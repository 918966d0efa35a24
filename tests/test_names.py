"""One name, one thing: a name that several modules offer stands below, with the reason."""

from __future__ import annotations

import ast
import re
from collections import Counter, defaultdict
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "damperfit"

# Names that more than one module offers, and why no other word was taken.
ON_PURPOSE = {
    "answer": "what a child process calls in each reader that runs apart",
    "compare": "the command, the call of a notebook; of a model with one log in identification/",
    "configured": "keywords of a command, and of a call, to the configuration that they ask for",
    "declared_setting": "the setting that a command, and a call, is given",
    "effective_samples": "n_eff: of one stretch, and of all stretches that a law was fitted to",
    "export": "the command, and the call of a notebook",
    "identify": "the command, the call of a notebook, and the campaign that both run",
    "inspect": "the command, and the call of a notebook",
    "main": "what starts a program",
    "record": "the log file takes one, and run.json is one",
    "simulate": "the command, the call of a notebook, and the door to the core that both use",
    "Unknown": "the FMI standard's word in a model description; an unknown of a joint fit",
}


_DEFINED = re.compile(r"^(?:async )?(?:class|def) ([^\W_]\w*)", re.MULTILINE)


def offered(text: str) -> set[str]:
    """Classes and functions that a module defines and lists in `__all__`."""
    body = ast.parse(text).body
    listed = {
        item.value
        for node in body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
        for item in ast.walk(node.value)
        if isinstance(item, ast.Constant)
    }
    defined = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    return {node.name for node in body if isinstance(node, defined)} & listed


@cache
def twice() -> dict[str, list[str]]:
    """Names that more than one module offers, with the modules."""
    texts = {path: path.read_text(encoding="utf-8") for path in sorted(PACKAGE.rglob("*.py"))}
    defined = {path: set(_DEFINED.findall(text)) for path, text in texts.items()}
    counts = Counter(name for names in defined.values() for name in names)
    found = defaultdict(list)
    for path, text in texts.items():
        if all(counts[name] == 1 for name in defined[path]):
            continue  # parsing all of them takes half a second
        for name in offered(text):
            found[name].append(path.relative_to(PACKAGE).as_posix())
    return {name: paths for name, paths in found.items() if len(paths) > 1}


def test_what_a_module_offers_is_found() -> None:
    text = '__all__ = ["A", "f", "x"]\nx = 1\nclass A: ...\ndef f(): ...\ndef g(): ...\n'
    assert offered(text) == {"A", "f"}


def test_one_name_is_one_thing() -> None:
    unexplained = {name: paths for name, paths in twice().items() if name not in ON_PURPOSE}
    assert not unexplained, f"give one of each another name: {unexplained}"


def test_no_exception_is_left_over() -> None:
    assert sorted(set(ON_PURPOSE) - set(twice())) == []
