"""Mutants: where one may be made, which are drawn, which are left out and why.

A mutant has a key made of what stands around it (function, line, kind), not of its folder or
line number, and the draw takes the lowest hashes of keys with the seed: a module that moves, or
code that changes elsewhere, leaves the drawn mutants the same.
"""

from __future__ import annotations

import ast
import hashlib
import math
import re
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import parso

from tests.mutations.operators import KINDS, code

__all__ = ["TARGETS", "Mutant", "draw", "find_mutants", "known_mutants"]

HERE = Path(__file__).parent

# What is drawn from, by the name under which its share is told.
TARGETS: dict[str, tuple[str, ...]] = {
    "uncertainty": ("damperfit/uncertainty",),
    "identification": ("damperfit/identification",),
    "adjustment": ("damperfit/adjustment",),
    "conditioning": ("damperfit/conditioning",),
    "readers": ("damperfit/io",),
    "tables": ("damperfit/tables",),
    "report": ("damperfit/report",),
    "checks": ("damperfit/checks.py",),
    "exit codes": ("damperfit/errors.py", "damperfit/cli"),
    "run": ("damperfit/run",),
    "laws": ("damperfit/laws",),
    "damper": ("damperfit/damper", "damperfit/simulation"),
    "comparison": ("damperfit/comparison",),
    "queries": ("damperfit/queries",),
    "fleet": ("damperfit/fleet",),
    "exporting": ("damperfit/exporting",),
    "configuration": ("damperfit/configuration", "damperfit/tested", "damperfit/units"),
    "door": ("damperfit/api.py", "damperfit/asked.py", "damperfit/shown.py"),
}

_GUARD = 1e-200  # smaller numbers only keep a division from failing


@dataclass(frozen=True)
class Mutant:
    """One change of one file."""

    key: str
    target: str
    kind: str
    path: str
    line: int
    last_line: int
    before: str
    after: str
    text: str  # the whole file, changed
    function: str = ""

    @property
    def place(self) -> str:
        return f"{self.path}:{self.line}"


def _ancestors(node) -> Iterator:
    while node.parent is not None:
        yield node, node.parent
        node = node.parent


_NO_CODE = {"decorator", "import_from", "import_name", "assert_stmt"}
_ALIAS = re.compile(r"_?[A-Z]\w* = (dict|tuple|list|Callable|NDArray)\[")
_UNSEEN_CALL = re.compile(r"ThreadPoolExecutor|typer\.Option")  # number of threads, text of --help


def _is_left_out(node) -> bool:
    """Whether a change there has no meaning: annotations, decorators, imports, guards of types."""
    if node.type == "number" and "j" not in node.value.lower():
        value = abs(float(ast.literal_eval(node.value)))
        if 0.0 < value < _GUARD:
            return True
    return any(_means_nothing(child, parent) for child, parent in _ancestors(node))


def _means_nothing(child, parent) -> bool:
    kind, place = parent.type, parent.children.index(child)
    first = code(parent.children[0])
    return (
        kind in _NO_CODE
        or (kind == "raise_stmt" and child.type != "test")  # what an error says is text
        or (kind == "annassign" and place == 1)
        or (kind == "tfpdef" and place == 2)
        or (kind == "funcdef" and place > 0 and parent.children[place - 1] == "->")
        or (kind == "if_stmt" and "TYPE_CHECKING" in code(parent.children[1]))
        or (kind == "argument" and first in {"strict", "frozen", "slots"})
        or (kind == "atom_expr" and _UNSEEN_CALL.match(code(parent)) is not None)
        or (kind in {"atom_expr", "arglist"} and "max(1, jobs)" in code(parent))
        or (kind == "parameters" and child.type == "operator")  # the star before names
        or (kind == "param" and (child.type == "operator" or "jobs" in code(parent)))
        or (kind == "expr_stmt" and first in {"__all__", "__slots__"})
        or (kind == "expr_stmt" and _ALIAS.match(code(parent)) is not None)
    )


def _is_whole_number(node) -> bool:
    """Whether a comparison is one of whole numbers, where < and <= can be told apart by a test."""
    return any(
        re.search(
            r"\blen\(|\bn_\w+|^\d+$|count|\.size\b|_FEWEST|_ENOUGH|LEAST_FOR|\.shape\b", code(c)
        )
        for c in node.children[::2]
    )


def _is_apt(kind: str, node) -> bool:
    if kind == "boundary":
        return _is_whole_number(node)
    if (
        kind == "arithmetic"
    ):  # text and sets are joined by + and | too, and fail at once with - and &
        around = node.parent if node.type == "operator" else node
        return not any(
            c.type in {"string", "fstring", "strings", "keyword"} for c in around.children
        )
    return True


def _function_of(node) -> str:
    names = []
    for _, parent in _ancestors(node):
        if parent.type in {"funcdef", "classdef"}:
            names.append(parent.name.value)
    return ".".join(reversed(names))


def _statement(node):
    """Return the smallest statement around a node, without the body that it may have."""
    last = node
    for child, parent in _ancestors(node):
        if parent.type in {"suite", "file_input", "simple_stmt"}:
            return child
        last = parent
    return last


def find_mutants(path: Path, root: Path, target: str) -> list[tuple[Mutant, tuple[int, ...]]]:
    """Return the mutants that a file allows, without their text, and where each is made."""
    source = path.read_text(encoding="utf-8")
    lines = source.splitlines()
    found, seen = [], Counter()
    for ordinal, node in enumerate(_walk(parso.parse(source))):
        left_out = None
        for kind, operators in KINDS.items():
            for k, operator in enumerate(operators):
                for index, (start, _) in enumerate(operator.mutation_positions(node)):
                    if left_out is None:
                        left_out = _is_left_out(node)
                    if left_out or not _is_apt(kind, node):
                        continue
                    line = lines[start[0] - 1].strip()
                    key = f"{_function_of(node)}|{line}|{kind}|{k}.{index}"
                    seen[key] += 1
                    key = f"{path.stem}|{key}|{seen[key]}"
                    mutant = Mutant(
                        key=hashlib.sha256(key.encode()).hexdigest()[:12],
                        target=target,
                        kind=kind,
                        path=path.relative_to(root).as_posix(),
                        line=start[0],
                        last_line=start[0],
                        before=line,
                        after="",
                        text="",
                        function=_function_of(node),
                    )
                    found.append((mutant, (ordinal, list(KINDS).index(kind), k, index)))
    return found


def _walk(node) -> Iterator:
    yield node
    for child in getattr(node, "children", ()):
        yield from _walk(child)


def make(mutant: Mutant, place: tuple[int, ...], root: Path) -> Mutant:
    """Return the mutant with its text."""
    ordinal, kind, k, index = place
    source = (root / mutant.path).read_text(encoding="utf-8")
    tree = parso.parse(source)
    node = next(node for n, node in enumerate(_walk(tree)) if n == ordinal)
    operator = list(KINDS.values())[kind][k]
    parent = node.parent
    position = parent.children.index(node)
    statement = _statement(node)
    span = statement.start_pos[0], _header_end(statement)
    parent.children[position] = operator.mutate(node, index)
    text = tree.get_code()
    before, after = _difference(source, text)
    return _with_text(mutant, before, after, text, span)


def _header_end(statement) -> int:
    for child in getattr(statement, "children", ()):
        if child.type == "suite":
            return child.start_pos[0]
    return statement.end_pos[0]


def _with_text(mutant, before, after, text, span) -> Mutant:
    last = max(span[1], mutant.line)
    return replace(mutant, last_line=last, before=before, after=after, text=text)


def _difference(one: str, other: str) -> tuple[str, str]:
    """Return the lines that differ, each side on one line."""
    a, b = one.splitlines(), other.splitlines()
    start = next((k for k, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), 0)
    while a and b and a[-1] == b[-1] and min(len(a), len(b)) > start + 1:
        a.pop()
        b.pop()
    return tuple(" ".join(line.strip() for line in side[start:]) for side in (a, b))


def equivalent() -> dict[tuple[str, str, str], str]:
    """Return what was judged to change nothing, by function and changed line, with the reason."""
    rows = tomllib.loads((HERE / "equivalent.toml").read_text(encoding="utf-8"))
    return {
        (row["function"], row["before"], row["after"]): row["reason"]
        for row in rows.get("mutant", ())
    }


def files_of(target: Iterable[str], root: Path) -> list[Path]:
    found: list[Path] = []
    for name in target:
        path = root / name
        more = sorted(path.rglob("*.py")) if path.is_dir() else [path]
        if not more or not all(one.is_file() for one in more):
            raise SystemExit(f"tests.mutations: {name} is not there; correct TARGETS")
        found += more
    return found


def draw(
    root: Path, count: int, seed: int, targets: Mapping[str, Sequence[str]] = TARGETS
) -> list[Mutant]:
    """Return mutants spread over targets (by the root of their size) and, in each, over kinds."""
    known = equivalent()
    pools: dict[str, dict[str, list[tuple[str, Mutant, tuple[int, ...]]]]] = {}
    for target, names in targets.items():
        kinds = defaultdict(list)
        for path in files_of(names, root):
            for mutant, place in find_mutants(path, root, target):
                rank = hashlib.sha256(f"{seed}|{mutant.key}".encode()).hexdigest()
                kinds[mutant.kind].append((rank, mutant, place))
        pools[target] = {
            kind: sorted(found, key=lambda row: row[0]) for kind, found in kinds.items()
        }
    sizes = {t: math.sqrt(sum(len(p) for p in kinds.values())) for t, kinds in pools.items()}
    drawn = []
    for target, kinds in pools.items():
        quota = math.ceil(count * sizes[target] / sum(sizes.values()))
        drawn += _draw_from(kinds, quota, root, known)
    return drawn


def _draw_from(kinds, quota: int, root: Path, known) -> list[Mutant]:
    """Take from each kind in turn; one mutant a line."""
    rows = {kind: iter(pool) for kind, pool in sorted(kinds.items())}
    taken: dict[tuple[str, int], Mutant] = {}
    while rows and len(taken) < quota:
        for kind in list(rows):
            for _, mutant, place in rows[kind]:
                where = (mutant.path, mutant.line)
                if where in taken:
                    continue
                made = make(mutant, place, root)
                if (made.function, made.before, made.after) in known or not _compiles(made):
                    continue
                taken[where] = made
                break
            else:
                del rows[kind]
            if len(taken) >= quota:
                break
    return list(taken.values())


def _compiles(mutant: Mutant) -> bool:
    try:
        compile(mutant.text, mutant.path, "exec")
    except SyntaxError:
        return False
    return True


def known_mutants(root: Path, path: Path | None = None) -> list[Mutant]:
    """Return the wrong lines that once passed every test; each is found by its text.

    Raises
    ------
    SystemExit
        A text stands nowhere any more, or in several places: the list has to follow the code.
    """
    rows = tomllib.loads((path or HERE / "known.toml").read_text(encoding="utf-8"))["mutant"]
    sources = {
        file: file.read_text(encoding="utf-8")
        for suffix in ("*.py", "*.c", "*.h", "*.html", "*.js")
        for file in sorted((root / "damperfit").rglob(suffix))
    }
    found = []
    for row in rows:
        places = [(file, text) for file, text in sources.items() if row["before"] in text]
        count = sum(text.count(row["before"]) for _, text in places)
        if count != 1:
            raise SystemExit(
                f"known.toml: {row['name']}: {row['before']!r} stands in {count} places, not in one"
            )
        file, text = places[0]
        begin = text.index(row["before"])
        blank = len(row["before"]) - len(row["before"].lstrip())  # a line's end that says where
        line = text[: begin + blank].count("\n") + 1
        last = text[: begin + len(row["before"].rstrip())].count("\n") + 1
        found.append(
            Mutant(
                key=hashlib.sha256(row["name"].encode()).hexdigest()[:12],
                target="known",
                kind=row["name"],
                path=file.relative_to(root).as_posix(),
                line=line,
                last_line=last,
                before=" ".join(row["before"].split()),
                after=" ".join(row["after"].split()),
                text=text.replace(row["before"], row["after"]),
            )
        )
    return found
