"""Which wrong lines do the tests notice? Mutants of the numerics, drawn afresh, one at a time.

    python -m tests.mutants --seed 7 --count 150      # at night: an hour; ends with 1 above 8 %

A mutant changes one comparison, operator, number, truth value or sign. It meets the numbers of
`test_numbers.py` first, those that have noticed most of its package before the others, and of those
the quick ones; then the tests of its package and those that import its module, until one fails;
of both only what calls the function. One that survives is printed with its line: it is either
equivalent, or a case of behaviour is missing. `--tell` prints what has noticed the others.

Counted apart and not tried: `<` for `<=` where only two equal floats tell them apart: a quotient
beside a decimal fraction, or something measured beside a multiple of something else that is
measured. Comparisons of counts, steps, declared values, with zero or a whole number are tried.
"""

import argparse
import ast
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, is_dataclass
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FunctionType
from typing import Any

import hypothesis  # noqa: F401 - it warns where pytest, which then ends, is the first to load it
import pytest

from tests import test_numbers

ROOT = Path(__file__).parents[1]
NUMERICS = (
    *("adjustment", "checks.py", "conditioning", "damper", "identification", "laws"),
    *("simulation.py", "uncertainty"),
)
PATIENCE = 300  # s a mutant; a loop without end is noticed

_ORDERS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE)
_COUNTS = re.compile(
    r"\b(n|n_\w+|\w*count\w*|len|sum|mean_of|size|shape|ceil|floor|rint|int|length|steady|stop)\b"
)
_COMPARISONS = {
    ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==",
}  # fmt: skip
_OPERATORS = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.Pow: "*"}
# Keywords of `zip` and of dataclasses: our own arrays are as long, and nobody changes or compares.
_WITHOUT_EFFECT = {"strict", "frozen", "slots", "eq"}
_NAMES = {"min": "max", "max": "min", "argmin": "argmax", "argmax": "argmin"}


@dataclass(frozen=True)
class Mutant:
    """One change: of `file` (from the root) the text between two offsets becomes another."""

    file: str
    function: str
    line: int
    start: int
    stop: int
    text: str
    is_order: bool  # `<` for `<=`, and it may be of counts
    is_equivalent: bool

    def applied(self, root: Path) -> str:
        """Return the file's source with the change."""
        source = (root / self.file).read_bytes()
        return (source[: self.start] + self.text.encode() + source[self.stop :]).decode()


def mutants_of(root: Path, file: Path) -> list[Mutant]:
    """Return every mutant of a module."""
    source = file.read_bytes()
    begins = [0]
    for line in source.splitlines(keepends=True):
        begins.append(begins[-1] + len(line))
    module, place = ast.parse(source), str(file.relative_to(root))
    floats = _floats_of(module)
    found: list[Mutant] = []

    def add(node: ast.AST, text: str, function: str) -> None:
        start = begins[node.lineno - 1] + node.col_offset  # type: ignore[attr-defined]
        stop = begins[node.end_lineno - 1] + node.end_col_offset  # type: ignore[attr-defined]
        at = node.lineno  # type: ignore[attr-defined]
        is_order = isinstance(node, ast.Compare) and isinstance(node.ops[0], _ORDERS)
        is_same = is_order and _differs_at_equality(node, floats)
        found.append(Mutant(place, function, at, start, stop, text, is_order, is_same))

    def visit(node: ast.AST, function: str) -> None:
        if isinstance(node, ast.FunctionDef):
            for child in (*node.args.kw_defaults, *node.args.defaults, *node.body):
                if child is not None and not _is_text(child):
                    visit(child, node.name)
            return
        if isinstance(node, ast.AnnAssign) and node.value is not None:
            visit(node.value, function)
            return
        if isinstance(node, ast.keyword) and node.arg in _WITHOUT_EFFECT:
            return
        changed = _changed(node)
        if changed is not None:
            add(node, changed, function)
        for child in ast.iter_child_nodes(node):
            visit(child, function)

    visit(module, "")
    return found


def _floats_of(module: ast.Module) -> dict[str, float]:
    """Return the module's constants that are floats, by name."""
    return {
        target.id: node.value.value
        for node in module.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
        for target in node.targets
        if isinstance(target, ast.Name) and isinstance(node.value.value, float)
    }


def _differs_at_equality(node: ast.Compare, floats: dict[str, float]) -> bool:
    """Whether the mutant of an order differs only where a measured float is equal to another."""
    sides = node.left, node.comparators[0]
    if _COUNTS.search(ast.unparse(node)):
        return False

    def number(side: ast.AST) -> float:
        if isinstance(side, ast.Name):
            return floats.get(side.id, 0.0)
        is_float = isinstance(side, ast.Constant) and isinstance(side.value, float)
        return side.value if is_float else 0.0  # type: ignore[attr-defined]

    def is_multiple(side: ast.AST) -> bool:
        if not (isinstance(side, ast.BinOp) and isinstance(side.op, ast.Mult)):
            return False
        return 1e-3 < number(side.left) < 1e3 or is_multiple(side.left)

    is_quotient = any(isinstance(inner, ast.Div) for side in sides for inner in ast.walk(side))
    is_fraction = any(not number(side).is_integer() for side in sides)
    return any(map(is_multiple, sides)) or (is_fraction and is_quotient)


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _changed(node: ast.AST) -> str | None:  # noqa: PLR0911 - a kind of node each
    """Return the source of a node with one mistake, None where there is none to make."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in _COMPARISONS:
        left, right = ast.unparse(node.left), ast.unparse(node.comparators[0])
        more = ast.unparse(node)[len(f"{left} {_sign(node.ops[0])} {right}") :]
        return f"({left} {_COMPARISONS[type(node.ops[0])]} {right}{more})"
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        if any(_is_string(side) for side in (node.left, node.right)):
            return None
        left, right = f"({ast.unparse(node.left)})", f"({ast.unparse(node.right)})"
        return f"({left} {_OPERATORS[type(node.op)]} {right})"
    if isinstance(node, ast.BoolOp):
        word = " or " if isinstance(node.op, ast.And) else " and "
        return f"({word.join(f'({ast.unparse(value)})' for value in node.values)})"
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
        return f"({ast.unparse(node.operand)})"
    if isinstance(node, ast.Constant):
        value = node.value
        if isinstance(value, bool):
            return str(not value)
        if isinstance(value, int | float):
            return repr(value + 1) if isinstance(value, int) else repr(1.5 * value + 0.1)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _NAMES:
        return ast.unparse(node).replace(node.func.id, _NAMES[node.func.id], 1)
    return None


def _sign(operator: ast.cmpop) -> str:
    return ast.unparse(ast.Compare(ast.Name("a"), [operator], [ast.Name("b")]))[2:-2]


def _is_string(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str)
    )


def tests_of(file: str, root: Path) -> list[str]:
    """Return the tests of a module's package, and those that import the module."""
    place = Path(file).with_suffix("")
    package, module = place.parts[1], ".".join(place.parts)
    folder = root / "tests" / package
    own = sorted(folder.glob("test_*.py")) or [root / "tests" / f"test_{package}.py"]
    others = [
        path
        for path in sorted((root / "tests").rglob("test_*.py"))
        if path not in own and path.name != "test_numbers.py"
        if module in path.read_text(encoding="utf-8")
    ]
    doctests = [root / file] if ">>>" in (root / file).read_text(encoding="utf-8") else []
    return [str(path.relative_to(root)) for path in (*doctests, *own, *others) if path.exists()]


def noticed_by(mutant: Mutant | None, work: Callable[[], str]) -> str:
    """Return what some work notices in a copy of this process with a mutant; empty: nothing."""
    reading, writing = os.pipe()
    copy = os.fork()
    if not copy:
        signal.alarm(PATIENCE)
        quiet = os.open(os.devnull, os.O_WRONLY)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        word = "an error"
        try:
            if mutant is not None:
                install(mutant)
            word = work()
        finally:
            os.write(writing, word.encode())
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        word = pipe.read()
    return ("its end" if os.waitpid(copy, 0)[1] else "") or word


def install(mutant: Mutant) -> None:
    """Give the module that is loaded the code and the numbers of the mutant."""
    module = sys.modules[".".join(Path(mutant.file).with_suffix("").parts)]
    changed = {"__name__": module.__name__, "__file__": module.__file__}
    changed["__package__"] = module.__package__
    exec(compile(mutant.applied(ROOT), mutant.file, "exec"), changed)  # noqa: S102 - our own
    for name, new in changed.items():
        old = vars(module).get(name)
        if getattr(new, "__module__", module.__name__) != module.__name__:
            continue
        if isinstance(new, type):
            for inner, value in vars(new).items():
                _replace(vars(old).get(inner), value, partial(setattr, old, inner))
        elif not name.startswith("__"):
            _replace(old, new, partial(_set_everywhere, name, old))


def _replace(old: Any, new: Any, set_: Callable[[Any], None]) -> None:
    for wrapped in ("__wrapped__", "fget", "func", "__func__"):
        if hasattr(new, wrapped) and hasattr(old, wrapped):
            _replace(getattr(old, wrapped), getattr(new, wrapped), lambda _: None)
            return
    if isinstance(new, FunctionType) and isinstance(old, FunctionType):
        old.__code__, old.__defaults__ = new.__code__, new.__defaults__
        old.__kwdefaults__ = new.__kwdefaults__
    elif isinstance(new, dict) and isinstance(old, dict):
        for key, value in new.items():
            _replace(old.get(key), value, partial(old.__setitem__, key))
    elif is_dataclass(new) and not isinstance(new, type) and is_dataclass(old):
        for one in fields(new):
            changed = partial(object.__setattr__, old, one.name)
            _replace(getattr(old, one.name), getattr(new, one.name), changed)
    elif isinstance(new, tuple | list) and isinstance(old, tuple | list):
        if len(new) == len(old) and not any(map(_differ, old, new)):
            for pair in zip(old, new, strict=True):
                _replace(*pair, lambda _: None)
        else:
            set_(new)
    elif _is_plain(new) and new != old:
        set_(new)


def _differ(old: Any, new: Any) -> bool:
    return _is_plain(new) and new != old


def _is_plain(value: Any) -> bool:
    if isinstance(value, dict):
        value = (*value, *value.values())
    if isinstance(value, tuple | list | set | frozenset):
        return all(map(_is_plain, value))
    return isinstance(value, str | int | float | bool | None)


def _set_everywhere(name: str, old: Any, new: Any) -> None:
    for other in list(sys.modules.values()):
        if getattr(other, "__name__", "").startswith("damperfit") and vars(other).get(name) is old:
            setattr(other, name, new)


def calls_of(work: Callable[[], str]) -> frozenset[tuple[str, str]]:
    """Return files and functions of the package that some work calls; it must notice nothing."""

    def traced() -> str:
        codes = set[Any]()
        sys.settrace(lambda frame, *_: codes.add(frame.f_code))
        word = work()
        sys.settrace(None)
        return word or "".join(f"\n{code.co_filename}:{code.co_name}" for code in codes)

    word = noticed_by(None, traced)
    assert word.startswith("\n"), f"without a mutant: {word}"
    places = (line.rpartition(":") for line in word.splitlines() if f"{ROOT}/damperfit" in line)
    return frozenset((file.removeprefix(f"{ROOT}/"), name) for file, _, name in places)


def number_moved(names: list[str]) -> str:
    """Return the first case of the snapshot of which a number has moved."""
    for name in names:
        try:
            test_numbers.check(name)
        except Exception:  # noqa: BLE001 - whatever it is, it is noticed
            return f"numbers of {name}"
    return ""


class _Failed:
    """The first test that fails."""

    name = ""

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed and not self.name:
            self.name = report.nodeid


def test_failed(arguments: list[str]) -> str:
    """Return the first test that fails."""
    failed = _Failed()
    code = pytest.main(arguments, plugins=[failed])
    none = {pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED}
    return failed.name or ("" if code in none else "the collection of tests")


def noticed_anew(mutant: Mutant | None, tests: list[str]) -> str:
    """Return whether a copy of everything notices what is made when a module is loaded."""
    with TemporaryDirectory() as place:
        copy = shutil.copytree(ROOT, Path(place) / "copy", ignore=shutil.ignore_patterns(".*"))
        if mutant is not None:
            (copy / mutant.file).write_text(mutant.applied(ROOT), encoding="utf-8")
        pytest_ = [sys.executable, "-m", "pytest", "-q", "-x", "-n0"]
        done = subprocess.run(
            [*pytest_, "tests/test_numbers.py", *tests], cwd=copy, check=False, capture_output=True
        )
    return "a new process" if done.returncode else ""


def main() -> int:
    """Draw, try and print; 1 where more than the allowed share survives."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=150)
    parser.add_argument("--part", default="1/1", help="K/N: every N-th of them, from the K-th")
    parser.add_argument("--packages", default=",".join(NUMERICS))
    parser.add_argument("--tell", action="store_true", help="print all, and what notices them")
    parser.add_argument("--without-numbers", action="store_true", help="leave test_numbers.py out")
    parser.add_argument("--at-most", type=float, default=8.0, help="per cent that may survive")
    options = parser.parse_args()
    files = [
        file
        for package in options.packages.split(",")
        for place in [ROOT / "damperfit" / package]
        for file in ([place] if place.is_file() else sorted(place.rglob("*.py")))
        if file.name != "build_backend.py"
    ]
    mutants = [mutant for file in files for mutant in mutants_of(ROOT, file)]
    chooser = random.Random(options.seed)  # noqa: S311
    first, step = map(int, options.part.split("/"))
    chooser.shuffle(mutants)
    tried = [k for k, mutant in enumerate(mutants, start=1) if not mutant.is_equivalent]
    n_drawn = tried[: options.count][-1]
    drawn = [mutant for mutant in mutants[:n_drawn] if not mutant.is_equivalent][first - 1 :: step]
    print(
        f"{n_drawn} drawn, {n_drawn - len(tried[: options.count])} of them equivalent", flush=True
    )
    for file in sorted((ROOT / "damperfit").rglob("*.py")):
        if file.name != "__main__.py" and "binaries" not in file.parts:
            import_module(".".join(file.relative_to(ROOT).with_suffix("").parts))
    survivors, orders, seconds, kills = 0, 0, dict[str, float](), Counter[tuple[str, str]]()
    quiet = ("-q", "-x", "-n0", "-W", "ignore::pytest.PytestAssertRewriteWarning")  # loaded already

    @cache
    def calls(kind: str, name: str) -> frozenset[tuple[str, str]]:
        if kind == "numbers":
            return calls_of(partial(number_moved, [name]))
        return calls_of(partial(test_failed, [*quiet, name]))

    def meeting(mutant: Mutant, kind: str, names: Iterable[str]) -> list[str]:
        place = mutant.file, mutant.function
        return [name for name in names if not mutant.function or place in calls(kind, name)]

    for name in () if options.without_numbers else test_numbers.CASES:
        begin = time.perf_counter()
        calls("numbers", name)
        seconds[name] = time.perf_counter() - begin
    for number, mutant in enumerate(drawn, start=1):
        package = Path(mutant.file).parts[1]
        order = meeting(mutant, "numbers", seconds)
        order.sort(key=lambda name: (-kills[package, name], seconds[name]))
        killer = noticed_by(mutant, partial(number_moved, order))
        kills[package, killer.removeprefix("numbers of ")] += 1
        if not killer and (tests := meeting(mutant, "tests", tests_of(mutant.file, ROOT))):
            killer = noticed_by(mutant, partial(test_failed, [*quiet, *tests]))
        if not killer and not mutant.function:
            killer = noticed_anew(mutant, tests_of(mutant.file, ROOT))
            assert not killer or not noticed_anew(None, tests_of(mutant.file, ROOT))
        survivors += not killer
        orders += not killer and mutant.is_order
        if not killer or options.tell:
            source = (ROOT / mutant.file).read_text(encoding="utf-8").splitlines()
            line = f"{mutant.file}:{mutant.line}: {source[mutant.line - 1].strip()}"
            print(f"{line}  ->  {mutant.text}", f"[{killer}]" * bool(killer), flush=True)
        print(f"{number}: {survivors} survive", file=sys.stderr, flush=True)
    share, killed = 100.0 * survivors / len(drawn), len(drawn) - survivors
    print(f"{len(drawn)} tried, {killed} killed, {survivors} survive: {share:.1f} %")
    print(f"{orders} of the survivors differ at equality alone")
    return int(share > options.at_most)


if __name__ == "__main__":
    sys.exit(main())
