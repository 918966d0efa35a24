"""The named limits of the package: constants at the top of a module that a comparison reads.

Of a tuple or a dict of numbers each is one: NAME[0], NAME[key]. It counts as compared where its
name stands in a comparison or in `isclose`, in its own module or in one that imports it, or where a
variable does to which the same function has given a value made with it.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

__all__ = ["Limit", "constants_of", "find_constants", "find_limits", "names_in"]

_CLOSE = {"isclose", "allclose"}


@dataclass(frozen=True)
class Limit:
    """One named limit, with the place of its value in the file."""

    name: str  # conditioning/channels.py:_SPIKE
    path: str  # damperfit/conditioning/channels.py
    value: float
    line: int
    start: int
    last_line: int
    stop: int

    def with_value(self, text: str, value: float) -> str:
        """Return the file's text with another value in place of the limit's."""
        lines = text.encode().splitlines(keepends=True)
        first, last = self.line - 1, self.last_line - 1
        head, tail = lines[first][: self.start], lines[last][self.stop :]
        lines[first : last + 1] = [head + repr(value).encode() + tail]
        return b"".join(lines).decode()


def find_constants(root: Path) -> dict[str, Limit]:
    """Return all numbers that the package below a root names at the top of a module."""
    return {
        limit.name: limit for limits in constants_of(root).values() for limit in limits.values()
    }


@cache
def constants_of(root: Path) -> dict[str, dict[str, Limit]]:
    """Return the same by file and name."""
    return {path: _constants(path, tree) for path, tree in _trees(root).items()}


def find_limits(root: Path) -> dict[str, Limit]:
    """Return those of them that are compared with something."""
    trees, constants = _trees(root), constants_of(root)
    found: dict[str, Limit] = {}
    for path, tree in trees.items():
        names = {**names_in(tree, constants), **constants[path]}
        for name in _compared(tree, names) if names else ():
            found[names[name].name] = names[name]
    return {name: found[name] for name in sorted(found)}


@cache
def _trees(root: Path) -> dict[str, ast.Module]:
    return {
        path.relative_to(root).as_posix(): ast.parse(path.read_text(encoding="utf-8"))
        for path in sorted((root / "damperfit").rglob("*.py"))
    }


def _walk(top: ast.AST) -> Iterator[ast.AST]:
    """Yield a node and all below it, as `ast.walk`, in half the time."""
    left = [top]
    while left:
        node = left.pop()
        yield node
        for field in node._fields:
            value = getattr(node, field, None)
            if isinstance(value, list):
                left += [one for one in value if isinstance(one, ast.AST)]
            elif isinstance(value, ast.AST):
                left.append(value)


def _constants(path: str, tree: ast.Module) -> dict[str, Limit]:
    found: dict[str, Limit] = {}
    for name, value in _named(tree):
        number = _number(value)
        if number is not None:
            assert value.end_lineno is not None
            assert value.end_col_offset is not None
            found[name] = Limit(
                f"{path.removeprefix('damperfit/')}:{name}", path, number,
                value.lineno, value.col_offset, value.end_lineno, value.end_col_offset,
            )  # fmt: skip
    return found


def _named(tree: ast.Module) -> Iterator[tuple[str, ast.expr]]:
    """Yield what a module names at its top; of a tuple or a dict of numbers each, as NAME[key]."""
    for statement in tree.body:
        match statement:
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                yield from _of_name(name, value)
            case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value):
                yield from _of_name(name, value)
            case ast.Assign(targets=[ast.Tuple(elts=names)], value=ast.Tuple(elts=values)):
                for one, value in zip(names, values, strict=True):
                    yield ast.unparse(one), value


def _of_name(name: str, value: ast.expr) -> Iterator[tuple[str, ast.expr]]:
    match value:
        case ast.Tuple(elts=[_, *_] as values):
            keys = [str(k) for k in range(len(values))]
        case ast.Dict(keys=[_, *_] as words, values=values) if all(words):
            keys = [str(ast.literal_eval(one)) for one in words if isinstance(one, ast.Constant)]
        case _:
            yield name, value
            return
    if len(keys) == len(values) and all(_number(one) is not None for one in values):
        yield from ((f"{name}[{key}]", one) for key, one in zip(keys, values, strict=True))


def _number(value: ast.expr) -> float | None:
    """Return the number that an expression of numbers alone gives."""
    if any(
        not isinstance(node, ast.Constant | ast.BinOp | ast.UnaryOp | ast.operator | ast.unaryop)
        for node in _walk(value)
    ):
        return None
    number = eval(compile(ast.Expression(value), "", "eval"), {"__builtins__": {}})  # noqa: S307
    is_number = isinstance(number, int | float) and not isinstance(number, bool)
    return number if is_number else None


def names_in(tree: ast.Module, constants: dict[str, dict[str, Limit]]) -> dict[str, Limit]:
    """Return the limits that a module knows from others, by what it calls them."""
    found: dict[str, Limit] = {}
    for node in _parts(tree).imports:
        if node.module is None:
            continue
        place = node.module.replace(".", "/")
        for alias in node.names:
            called = alias.asname or alias.name
            for path in (f"{place}.py", f"{place}/__init__.py"):
                for name, limit in constants.get(path, {}).items():
                    base, bracket, key = name.partition("[")
                    if base == alias.name:
                        found[f"{called}{bracket}{key}"] = limit
            for name, limit in constants.get(f"{place}/{alias.name}.py", {}).items():
                found[f"{called}.{name}"] = limit
    return found


def _compared(tree: ast.Module, names: dict[str, Limit]) -> set[str]:
    by_base: dict[str, set[str]] = {}
    for name in names:
        by_base.setdefault(name.partition("[")[0], set()).add(name)
    found: set[str] = set()
    for nodes in _parts(tree).scopes:
        made: dict[str, set[str]] = {}
        for node in nodes:
            for target, value in _assigned(node):
                made.setdefault(target, set()).update(_read(value, by_base))
        for node in nodes:
            for part in _sides(node):
                found |= _read(part, by_base)
                for inner in _walk(part):
                    if isinstance(inner, ast.Name):
                        found |= made.get(inner.id, set())
    return found


_ASKED = {ast.Assign, ast.AnnAssign, ast.NamedExpr, ast.Compare, ast.Call}


@dataclass(frozen=True)
class _Parts:
    """What of a module is asked: its imports; of it and of each function what gives or compares.

    What stands in a function inside is of that alone; a lambda's is also of what is around it.
    """

    imports: list[ast.ImportFrom]
    scopes: list[list[ast.AST]]


@cache
def _parts(tree: ast.Module) -> _Parts:
    found = _Parts([], [[]])
    left: list[tuple[ast.AST, tuple[list[ast.AST], ...]]] = [(tree, (found.scopes[0],))]
    while left:
        node, scopes = left.pop()
        kind = type(node)
        if kind in _ASKED:
            for scope in scopes:
                scope.append(node)
        elif kind is ast.ImportFrom:
            found.imports.append(node)
        elif kind is ast.FunctionDef or kind is ast.Lambda:
            found.scopes.append([])
            scopes = (*(scopes if kind is ast.Lambda else ()), found.scopes[-1])
        for name in node._fields:
            value = getattr(node, name, None)
            if type(value) is list:
                left += [(one, scopes) for one in value if isinstance(one, ast.AST)]
            elif isinstance(value, ast.AST):
                left.append((value, scopes))
    return found


def _assigned(node: ast.AST) -> Iterator[tuple[str, ast.expr]]:
    match node:
        case ast.Assign(targets=targets, value=value):
            pairs = [(target, value) for target in targets]
        case ast.AnnAssign(target=target, value=ast.expr() as value):
            pairs = [(target, value)]
        case ast.NamedExpr(target=target, value=value):
            pairs = [(target, value)]
        case _:
            return
    for target, value in pairs:
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            both = list(zip(target.elts, value.elts, strict=False))
        else:
            both = [(target, value)]
        for one, other in both:
            for name in _walk(one):
                if isinstance(name, ast.Name):
                    yield name.id, other


def _sides(node: ast.AST) -> list[ast.expr]:
    if isinstance(node, ast.Compare):
        return [node.left, *node.comparators]
    if isinstance(node, ast.Call):
        called = node.func
        name = called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")
        if name in _CLOSE:
            return [*node.args, *(word.value for word in node.keywords)]
    return []


def _read(part: ast.AST, by_base: dict[str, set[str]]) -> set[str]:
    """Return which limits a part reads; `by_base` has NAME[0] and NAME[1] under NAME."""
    seen = {_dotted(n) for n in _walk(part) if isinstance(n, ast.Name | ast.Attribute)}
    return {name for base in seen & by_base.keys() for name in by_base[base]}


def _dotted(node: ast.expr) -> str:
    """Return a name with what it is a part of; nothing for what a call or an index gives."""
    match node:
        case ast.Name(id=name):
            return name
        case ast.Attribute(value=value, attr=name) if whole := _dotted(value):
            return f"{whole}.{name}"
    return ""
