"""Every named limit stands in held.toml, with its tests; `python -m tests.limits` proves them.

A comparison with a number of a name decides something: a verdict, a sentence, a refusal. Each has a
test that fails when the limit is a little higher and one that fails when it is a little lower, or
a reason why it needs none.
"""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

from tests.limits.finding import find_constants, find_limits
from tests.limits.table import HELD, limits_of, read_table

ROOT = Path(__file__).parents[2]
TABLE = read_table(HELD)


def test_every_limit_has_its_tests_or_a_reason() -> None:
    limits, constants = find_limits(ROOT).keys(), find_constants(ROOT).keys()
    known = TABLE.held.keys() | TABLE.exempt.keys()
    missing = {name for name in limits if not {name, name.partition("[")[0]} & known}
    assert not missing, "python -m tests.limits --seek looks for tests of them"
    whole = {name.partition("[")[0] for name in constants}
    assert not known - constants - whole, "no longer in the package"
    assert not TABLE.held.keys() & TABLE.exempt.keys()


def test_every_limit_that_is_said_to_be_held_is_moved() -> None:
    """Also one that is in a product before it is compared."""
    assert not TABLE.held.keys() - limits_of(ROOT, TABLE).keys()


@cache
def _tests_of(file: str) -> set[str]:
    path = ROOT / file
    if not path.is_file():
        return set()
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def test_the_tests_of_a_limit_are_there() -> None:
    assert len(TABLE.held) > 300
    for name, held in TABLE.held.items():
        for test in held.tests:
            file, _, function = test.partition("::")
            assert function.startswith("test_"), (name, test)
            assert function in _tests_of(file), (name, test)


def test_every_reason_is_one() -> None:
    assert all(len(reason.split()) >= 3 for reason in TABLE.exempt.values())
    assert all(one.why for one in TABLE.held.values() if one.by is not None)


MODULE = """
from damperfit.other import FAR
from damperfit import other

_SPIKE: float = 0.02
_COUNT = 3
_SUM = 24 + 8
_USED = 7.0
_NAMES = ("a", "b")
_LOW, _HIGH = 0.1, 10
_BETWEEN = (2.0, 3.0)
_EACH = {"force": 5.0}


def is_spike(x):
    allowed = _SPIKE * x.max()
    return x > allowed or len(x) < _COUNT


def is_far(x):
    return isclose(x, 1.0, rel_tol=FAR) or x < other.NEAR + _SUM


def scaled(x):
    return _USED * x if _LOW < x < _HIGH else 0.0


def is_between(x):
    return _BETWEEN[0] < x < _BETWEEN[1] or x > _EACH["force"]
"""


def test_limits_are_found_where_they_are_compared(tmp_path) -> None:
    (tmp_path / "damperfit").mkdir()
    (tmp_path / "damperfit" / "one.py").write_text(MODULE)
    (tmp_path / "damperfit" / "other.py").write_text("FAR = 1e-9\nNEAR = -2.0\nNOT = 1\n")
    found = find_limits(tmp_path)
    assert set(found) == {
        "one.py:_SPIKE",
        "one.py:_COUNT",
        "one.py:_SUM",
        "one.py:_LOW",
        "one.py:_HIGH",
        "one.py:_BETWEEN[0]",
        "one.py:_BETWEEN[1]",
        "one.py:_EACH[force]",
        "other.py:FAR",
        "other.py:NEAR",
    }
    upper = found["one.py:_BETWEEN[1]"]
    assert upper.with_value(MODULE, 4.0) == MODULE.replace("3.0)", "4.0)")
    spike = found["one.py:_SPIKE"]
    assert spike.with_value(MODULE, 0.03) == MODULE.replace("0.02", "0.03")
    assert found["one.py:_SUM"].with_value(MODULE, 35) == MODULE.replace("24 + 8", "35")
    assert "one.py:_USED" in find_constants(tmp_path)
