"""A tree whose functions count which of their blocks run: a trace for next to nothing.

What is compiled and kept in `__pycache__` says `__hits__[k] = 1` before each run of statements that
nothing parts; the sources stay as they are. Of 324 tests: 10 s of the processor with it as without,
15 s with a tracer that is called for each line.
"""

from __future__ import annotations

import ast
import importlib.util
import json
import marshal
from collections.abc import Iterator
from pathlib import Path

__all__ = ["COUNTER", "FOLDER", "OWNER", "compile_kept", "instrument"]

COUNTER = "__hits__"
FOLDER, OWNER = "DAMPERFIT_TRACE", "DAMPERFIT_TRACE_OWNER"
_CHECKED, _UNCHECKED = 0b11, 0b01  # flags of a file of bytecode: held to its source, or not

# Runs before anything else of the package, in each process that imports it. What is counted stands
# in a file that the tests' process reads whenever a test ends: of children that live on, are killed
# or forked too. A test may start them without our environment: then their parent is the tests'.
START = """
def _count_into_a_file(folder):
    import builtins, mmap, os, time

    if hasattr(builtins, "__hits__") or not os.path.exists(os.path.join(folder, "size")):
        return
    size = os.path.getsize(os.path.join(folder, "size"))
    owner = os.environ.get("DAMPERFIT_TRACE_OWNER") or os.getppid()
    path = os.path.join(folder, "live", f"{owner}.{os.getpid()}.{time.monotonic_ns()}")
    builtins.__hits__ = bytearray(size)
    try:
        with open(path + ".new", "wb+") as file:
            file.truncate(size)
            builtins.__hits__ = mmap.mmap(file.fileno(), size)
        os.rename(path + ".new", path)
    except OSError:  # a test of a full disk
        pass


_count_into_a_file"""


def instrument(tree: Path, folder: Path) -> None:
    """Compile the package of a tree so that it counts, and keep in a folder what is counted."""
    blocks: list[tuple[str, list[tuple[int, int]]]] = []
    for path in sorted((tree / "damperfit").rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        found = ast.parse(text)
        name = path.relative_to(tree).as_posix()
        for node in ast.walk(found):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                blocks += [(name, lines) for lines in _count(node, len(blocks))]
        if path.parent == tree / "damperfit" and path.name == "__init__.py":
            _put_first(found, f"{START}({str(folder.resolve())!r})\ndel _count_into_a_file\n")
        _keep(path, compile(ast.fix_missing_locations(found), str(path), "exec"), _UNCHECKED)
    (folder / "blocks.json").write_text(json.dumps(blocks), encoding="utf-8")
    (folder / "size").write_bytes(bytes(len(blocks)))
    (folder / "live").mkdir(exist_ok=True)


def _put_first(module: ast.Module, text: str) -> None:
    """Put statements before all others of a module, behind what must stand first."""
    place = sum(
        isinstance(one, ast.ImportFrom) and one.module == "__future__" for one in module.body
    ) + int(ast.get_docstring(module, clean=False) is not None)
    module.body[place:place] = ast.parse(text).body


def compile_kept(tree: Path) -> None:
    """Compile a tree once, so that a process in it compiles only what has changed since."""
    for path in sorted((tree / "damperfit").rglob("*.py")):
        _keep(path, compile(path.read_text(encoding="utf-8"), str(path), "exec"), _CHECKED)


def _keep(path: Path, code: object, flags: int) -> None:
    file = Path(importlib.util.cache_from_source(str(path)))
    file.parent.mkdir(exist_ok=True)
    head = importlib.util.MAGIC_NUMBER + flags.to_bytes(4, "little")
    mark = importlib.util.source_hash(path.read_bytes())
    file.write_bytes(head + mark + marshal.dumps(code))


def _count(function: ast.AST, first: int) -> Iterator[list[tuple[int, int]]]:
    """Put a mark before each block of a function's own statements; yield the lines of each."""
    k = first
    for lines, place in _blocks(function):
        body, start = place
        where = body[start]
        mark = ast.parse(f"{COUNTER}[{k}] = 1").body[0]
        for node in ast.walk(mark):
            if hasattr(node, "lineno"):
                node.lineno = node.end_lineno = where.lineno
        body.insert(start, mark)
        k += 1
        yield lines


def _blocks(function) -> list[tuple[list[tuple[int, int]], tuple[list, int]]]:
    """Return the blocks, those that stand last in a list of statements first: marks shift none."""
    found = []
    waiting = [(function.body, [])]
    while waiting:
        body, before = waiting.pop()
        begin = 0
        if body is function.body and ast.get_docstring(function, clean=False) is not None:
            begin = 1
        lines, start, mine = list(before), begin, []
        for k, one in enumerate(body[begin:], begin):
            parts = [] if isinstance(one, _SCOPES) else list(_parts(one))
            if not parts:
                is_function = isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef)
                last = max(one.lineno, one.body[0].lineno - 1) if is_function else one.end_lineno
                lines.append((one.lineno, last))
                continue
            stop = max(one.lineno, parts[0][0][0].lineno - 1)
            lines.append((one.lineno, stop))
            mine.append((lines, (body, start)))
            waiting += parts
            lines, start = [], k + 1
        if start < len(body):
            mine.append((lines, (body, start)))
        found += mine[::-1]
    return found


_SCOPES = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


def _parts(one: ast.stmt) -> Iterator[tuple[list[ast.stmt], list[tuple[int, int]]]]:
    """Yield the lists of statements within one, with lines that run with them."""
    for name in ("body", "handlers", "cases", "orelse", "finalbody"):
        for part in getattr(one, name, ()):
            if isinstance(part, ast.ExceptHandler):
                yield part.body, [(part.lineno, max(part.lineno, part.body[0].lineno - 1))]
            elif isinstance(part, ast.match_case):
                line = part.pattern.lineno
                yield part.body, [(line, max(line, part.body[0].lineno - 1))]
            else:
                break
        else:
            continue
        yield getattr(one, name), []
