"""Which tests may notice a mutant: those that run its line, the nearest and the fastest first.

A line at the top of a module or class runs when the module is imported, by whichever test comes
first. Its tests are those that run a function in which the name is read that the line defines, or
one of the names that are made from it.
"""

from __future__ import annotations

import ast
import difflib
import json
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

__all__ = ["Plan", "Selection", "Trace"]

# A test counts as so much slower by where it stands: it names what has changed, its file has the
# module's name, the package's, or another one.
_NAMED, _SAME, _NEAR, _ABROAD = 0.1, 0.3, 1.0, 4.0
_ONE_MORE = 0.5  # of the cases of one test each counts as so much slower than the one before
_IMPORT = "import "


@dataclass(frozen=True)
class Plan:
    """Tests in the order to run them, with the seconds they took."""

    tests: tuple[tuple[str, float], ...]

    def batches(self, budget: float) -> list[list[str]]:
        """Return the tests in heaps of rising cost, up to the budget, but at least one."""
        limits, heaps, spent = (2.0, 10.0, 40.0, budget), [[], [], [], []], 0.0
        for name, seconds in self.tests:
            if spent + seconds > budget and spent > 0.0:
                continue  # a later one may be quick
            spent += seconds
            place = next((k for k, limit in enumerate(limits) if spent <= limit), 3)
            heaps[place].append(name)
        return [heap for heap in heaps if heap]


@dataclass
class Trace:
    """One traced run: the tree that was traced, which tests ran which line, and how long they took.

    A later trace may hold some test files only: those that had changed.
    """

    folder: Path

    @cached_property
    def tree(self) -> Path:
        return self.folder / "tree"

    @cached_property
    def times(self) -> dict[str, dict]:
        return json.loads((self.folder / "times.json").read_text(encoding="utf-8"))

    @cached_property
    def test_files(self) -> set[str]:
        return {name.split("::")[0] for name in self.times["tests"]}

    @cached_property
    def users(self) -> dict[str, set[str]]:
        """Who asks for what serves several: tests for fixtures, all of them for kept results."""
        found = defaultdict(set)
        for name, test in self.times["tests"].items():
            for fixture in test["fixtures"]:
                found[fixture].add(name)
        for user, kept in self.times["uses"].items():
            for key in kept:
                found[key].add(user)
        return found

    def asking(self, context: str) -> set[str]:
        """Return the tests, and the imports of test files, for which a context was run."""
        found, seen, waiting = set(), set(), [context]
        while waiting:
            one = waiting.pop()
            if one in seen:
                continue
            seen.add(one)
            if one in self.times["tests"] or one.startswith(_IMPORT):
                found.add(one)
            waiting += self.users.get(one, ())
        return found

    @cached_property
    def measured(self) -> dict[str, dict[int, set[str]]]:
        """The contexts of each line, by file of the package as it was traced."""
        read = {
            name: json.loads((self.folder / f"{name}.json").read_text(encoding="utf-8"))
            for name in ("blocks", "hits")
        }
        found: dict[str, dict[int, set[str]]] = {path: {} for path, _ in read["blocks"]}
        for context, blocks in read["hits"].items():
            for k in blocks:
                path, spans = read["blocks"][k]
                for first, last in spans:
                    for line in range(first, last + 1):
                        found[path].setdefault(line, set()).add(context)
        return found

    def contexts(self, path: str, text: str) -> dict[int, set[str]]:
        """Return the contexts of each line of a file as it is now; new lines take their place's."""
        old = self._as_it_was(path, text)
        if old is None:
            return {}
        known = self.measured[old]
        before = (self.tree / old).read_text(encoding="utf-8").splitlines()
        now = text.splitlines()
        found: dict[int, set[str]] = {}
        matcher = difflib.SequenceMatcher(None, before, now, autojunk=False)
        for tag, i, j, k, n in matcher.get_opcodes():
            for line in range(k, n):
                if tag == "equal":
                    lines = range(i + line - k, i + line - k + 1)
                else:
                    lines = range(i, j) if j > i else range(max(i - 1, 0), i + 1)
                found[line + 1] = {c for one in lines for c in known.get(one + 1, ())}
        return found

    def _as_it_was(self, path: str, text: str) -> str | None:
        """Return the path that a file had when it was traced: its own, or that of one alike."""
        if path in self.measured:
            return path
        lines = set(text.splitlines())
        alike = {
            old: len(lines & set((self.tree / old).read_text(encoding="utf-8").splitlines()))
            for old in self.measured
        }
        best = max(alike, key=lambda old: alike[old], default=None)
        return best if best is not None and alike[best] > len(lines) / 2 else None


@dataclass(eq=False)
class Selection:
    """What the traces of the suite tell of the tree as it is now; the newest come last."""

    root: Path
    traces: Sequence[Trace]

    def __post_init__(self) -> None:
        self.tests, self.fixtures, self.owner = {}, {}, {}
        for trace in self.traces:
            self.owner |= dict.fromkeys(trace.test_files, trace)
            self.fixtures |= trace.times["fixtures"]
        for trace in self.traces:
            for name, test in trace.times["tests"].items():
                file = name.split("::")[0]
                if self.owner[file] is trace and (self.root / file).is_file():
                    self.tests[name] = test
        self._contexts: dict[str, dict[int, set[str]]] = {}

    @cached_property
    def by_file(self) -> dict[str, set[str]]:
        found = defaultdict(set)
        for name in self.tests:
            found[name.split("::")[0]].add(name)
        return found

    def contexts(self, path: str) -> dict[int, set[str]]:
        """Return, by line, the tests that run it, and "import FILE" for files that do so."""
        if path not in self._contexts:
            text = (self.root / path).read_text(encoding="utf-8")
            found = defaultdict(set)
            for trace in self.traces:
                for line, contexts in trace.contexts(path, text).items():
                    found[line] |= self._owned(trace, contexts)
            self._contexts[path] = found
        return self._contexts[path]

    def _owned(self, trace: Trace, contexts: set[str]) -> set[str]:
        found = set()
        for context in contexts:
            for name in trace.asking(context):
                file = name.removeprefix(_IMPORT).split("::")[0]
                if self.owner.get(file) is trace:
                    found.add(name)
        return found

    def of_lines(self, path: str, first: int, last: int, *, is_body: bool = True) -> set[str]:
        """Return the tests that run one of these lines, not counting imports of the module."""
        found: set[str] = set()
        by_line = self.contexts(path)
        for line in range(first, last + 1):
            for context in by_line.get(line, ()):
                if context in self.tests:
                    found.add(context)
                elif context.startswith(_IMPORT) and is_body:
                    found |= self.by_file.get(context.removeprefix(_IMPORT), set())
        return found

    def plan(self, path: str, first: int, last: int) -> Plan:
        """Return the tests for a change of these lines."""
        if not path.endswith(".py"):
            return self._ordered({n for n in self.tests if n.startswith("tests/damper/")}, path)
        tree = self._modules[path]
        function = _function_at(tree, first)
        if function is not None:
            own = self.of_lines(path, first, last)
            if self._is_called_at_import(path, function.name):
                readers = self._readers(path, {function.name})
                own = self.of_lines(path, first, last, is_body=False) | readers or own
            return self._ordered(own, path, function.name)
        names = _defined(tree, first)
        if any(name.startswith("def ") for name in names):  # a default, or a decorator
            own = {
                name
                for start, stop in self._bodies(tree, names)
                for name in self.of_lines(path, start, stop)
            } | self._looking_at(names)
            return self._ordered(own, path, *(name.removeprefix("def ") for name in names))
        found = self._readers(path, names) | self.of_lines(path, first, last, is_body=False)
        return self._ordered(found | self._naming(names), path, *names)

    def _is_called_at_import(self, path: str, name: str) -> bool:
        """Whether a module calls the function where it defines its constants: then it runs once."""
        return any(
            not isinstance(part, ast.FunctionDef | ast.AsyncFunctionDef)
            and _reads(part, {name}, set())
            for file in {path, *self._importing(name)}
            for statement in self._modules[file].body
            for part in _parts(statement)
        )

    def _importing(self, name: str) -> list[str]:
        return [file for file, tree in self._modules.items() if name in _imported(tree)]

    def _looking_at(self, names: set[str]) -> set[str]:
        """Return the tests of files that may look at a default without a call."""
        functions = {name.removeprefix("def ") for name in names}
        return {
            name
            for file, tests in self.by_file.items()
            if "signature(" in self._text(file)
            and any(function in self._text(file) for function in functions)
            for name in tests
        }

    def _naming(self, names: set[str]) -> set[str]:
        """Return the tests of files that name a constant themselves."""
        constants = {name for name in names if name.isupper()}
        return {
            name
            for file, tests in self.by_file.items()
            if any(constant in self._text(file) for constant in constants)
            for name in tests
        }

    @cache  # noqa: B019 - lives as long as the run
    def _text(self, file: str) -> str:
        return (self.root / file).read_text(encoding="utf-8")

    @cached_property
    def _modules(self) -> dict[str, ast.Module]:
        return {
            file.relative_to(self.root).as_posix(): ast.parse(file.read_text(encoding="utf-8"))
            for file in sorted((self.root / "damperfit").rglob("*.py"))
        }

    def _bodies(self, tree: ast.Module, names: set[str]) -> list[tuple[int, int]]:
        wanted = {name.removeprefix("def ") for name in names}
        return [
            (node.body[0].lineno, node.end_lineno or node.lineno)
            for node in ast.walk(tree)
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name in wanted
        ]

    def _readers(self, path: str, names: set[str]) -> set[str]:
        """Return the tests of functions that read these names, also through other constants."""
        names, found = set(names), set()
        for _ in range(4):
            more = set()
            for file, tree in self._modules.items():
                is_own = file == path
                seen = names if is_own else names & _imported(tree)
                attributes = {name for name in names if name.islower()}
                for statement in tree.body:
                    for part in _parts(statement):
                        if not _reads(part, seen, attributes):
                            continue
                        if isinstance(part, ast.FunctionDef):
                            body = part.body[0].lineno, part.end_lineno or part.lineno
                            found |= self.of_lines(file, *body)
                        else:
                            more |= _names_of(part)
                            if isinstance(part, ast.Assign | ast.AnnAssign):
                                span = part.lineno, part.end_lineno or part.lineno
                                found |= self.of_lines(file, *span, is_body=False)
            if more <= names:
                break
            names |= more
        return found

    def _ordered(self, names: set[str], path: str, *changed: str) -> Plan:
        """Put the tests in order: nearest and fastest first, of the cases of one test not all."""
        area, stem = path.split("/")[1].removesuffix(".py"), Path(path).stem
        places: dict[str, float] = {}

        def place(file: str) -> float:
            if file not in places:
                text = self._text(file)
                said = [name for name in changed if len(name) > 3 and name in text]
                places[file] = (
                    _NAMED if said
                    else _SAME if stem in file or f".{stem} import" in text
                    else _NEAR if area in file
                    else _ABROAD
                )  # fmt: skip
            return places[file]

        def cost(name: str) -> float:
            test = self.tests[name]
            fixtures = sum(self.fixtures.get(key, 0.0) for key in test["fixtures"])
            return (test["seconds"] + 0.5 * fixtures + 0.02) * place(name.partition("::")[0])

        costs, seen = {}, defaultdict(int)
        for one in sorted((cost(name), name) for name in names):
            grid = one[1].partition("[")[0]
            costs[one[1]] = one[0] * (1.0 + _ONE_MORE * seen[grid])
            seen[grid] += 1
        rows, paid = [], set()
        for name in sorted(names, key=lambda name: (costs[name], name)):
            test = self.tests[name]
            fresh = set(test["fixtures"]) - paid
            paid |= fresh
            rows.append((name, test["seconds"] + sum(self.fixtures.get(key, 0.0) for key in fresh)))
        return Plan(tuple(rows))


@cache
def _imported(tree: ast.Module) -> frozenset[str]:
    return frozenset(
        alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    )


def _function_at(tree: ast.Module, line: int) -> ast.AST | None:
    """Return the function in whose body a line stands; defaults and decorators are outside."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and (
            node.body[0].lineno <= line <= (node.end_lineno or node.lineno)
        ):
            return node
    return None


def _parts(statement: ast.stmt) -> list[ast.stmt]:
    if isinstance(statement, ast.ClassDef):
        return [part for inner in statement.body for part in _parts(inner)]
    return [statement]


def _names_of(statement: ast.stmt) -> set[str]:
    targets = []
    if isinstance(statement, ast.Assign):
        targets = statement.targets
    elif isinstance(statement, ast.AnnAssign | ast.AugAssign):
        targets = [statement.target]
    return {node.id for one in targets for node in ast.walk(one) if isinstance(node, ast.Name)}


def _defined(tree: ast.Module, line: int) -> set[str]:
    """Return what the statement at a line defines; a field or an enum's member by its own name."""
    for statement in tree.body:
        for part in _parts(statement):
            first = min([part.lineno, *(d.lineno for d in getattr(part, "decorator_list", ()))])
            if first <= line <= (part.end_lineno or part.lineno):
                if isinstance(part, ast.FunctionDef | ast.AsyncFunctionDef):
                    return {f"def {part.name}"}
                return _names_of(part)
    return set()


def _reads(part: ast.stmt, names: set[str], attributes: set[str]) -> bool:
    for node in ast.walk(part):
        if isinstance(node, ast.Name) and node.id in names and isinstance(node.ctx, ast.Load):
            return True
        if isinstance(node, ast.Attribute) and (node.attr in attributes or node.attr in names):
            return True
    return False
