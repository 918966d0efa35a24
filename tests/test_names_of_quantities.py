"""A quantity's name stands with its model: what must treat it in its own way asks for its role."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import damperfit
from damperfit.damper.models import MODELS, model_named
from damperfit.damper.quantity import FRICTION, GAS_AMOUNT, OFFSET, STIFFNESS, VISCOUS

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(damperfit.__file__).parent
NAMED = re.compile(r"(?<![A-Za-z0-9])(?:r_m[123]|k_e|f_f|f_0)(?![A-Za-z0-9])")

# Models, the paper's procedure, made-up logs of the paper's damper, and the keys that users have.
OWN = ("damper/", "identification/paper/", "samples/", "configuration/")
# Elsewhere these texts may name one, and nothing else.
ALLOWED = {
    "handover/modelica.py": "the paper's equations, written in another language",
    "report/page/summary.py": "the paper's symbols, explained where a page shows its damper",
}
COLUMN = "r_m3_cavitation_margin"  # of the parameters table, which scripts of users read


def words_of(source: str) -> Iterator[tuple[int, str]]:
    """Names, attributes, arguments and texts of a module, but for its docstrings."""
    tree = ast.parse(source)
    told = {
        id(line.value)
        for node in ast.walk(tree)
        if isinstance(getattr(node, "body", None), list)
        for line in node.body
        if isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and id(node) not in told:
            text = node.value.decode("latin-1") if isinstance(node.value, bytes) else node.value
            if isinstance(text, str):
                yield node.lineno, text
        elif isinstance(node, ast.Name):
            yield node.lineno, node.id
        elif isinstance(node, ast.Attribute):
            yield node.lineno, node.attr
        elif isinstance(node, ast.keyword | ast.arg):
            yield node.lineno, node.arg or ""
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.lineno, node.name


def named(path: str, source: str) -> list[str]:
    """Return where a module names a quantity of the paper's model, which it must not."""
    if path.startswith(OWN) or not NAMED.search(source):
        return []
    found = [
        (line, word) for line, word in words_of(source) if NAMED.search(word) and word != COLUMN
    ]
    if path.startswith("cli/"):  # examples in help and messages
        found = [(line, word) for line, word in found if "=" not in word and " " not in word]
    return [f"{path}:{line}: {word[:60]}" for line, word in found]


def modules() -> Iterator[tuple[str, str]]:
    for path in sorted(ROOT.rglob("*.py")):
        yield path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")


def test_general_code_names_no_quantity() -> None:
    found = {path: named(path, source) for path, source in modules()}
    assert [line for path, lines in found.items() if path not in ALLOWED for line in lines] == []
    assert [path for path in ALLOWED if not found[path]] == []  # nothing is allowed in vain


@pytest.mark.parametrize(
    "line",
    [
        "x = values.r_m3",
        "x = values.replace(k_e=1.0)",
        'free = [name for name in names if name != "f_0"]',
        'how = "--free r_m1,r_m2"',
        "def of_f_f(): ...",
        'head = b"setting,r_m1,"',
        "options.fallback_r_m3",
    ],
)
def test_a_name_is_found_however_it_stands_there(line: str) -> None:
    assert len(named("run/new.py", line)) == 1
    assert named("damper/new.py", line) == []


def test_words_alike_and_docstrings_are_no_names() -> None:
    assert named("run/new.py", '"""As f_f."""\nx = "half_f_f2", stuff_f, "r_m4"') == []
    assert named("cli/new.py", 'help = "as in k_e=2e9"') == []
    assert named("cli/new.py", 'number = known["k_e"]') != []


@pytest.mark.parametrize("name", MODELS)
def test_every_model_says_what_part_its_quantities_play(name: str) -> None:
    roles = {one.name: one.role for one in model_named(name)().quantities}
    known = {"f_0": OFFSET, "f_f": FRICTION, "k_e": STIFFNESS, "gas_volume": GAS_AMOUNT}
    assert {key: role for key, role in roles.items() if key in known} == {
        key: role for key, role in known.items() if key in roles
    }
    assert set(roles.values()) <= {"", *known.values(), VISCOUS}
    assert list(roles.values()).count(OFFSET) == ("f_0" in roles)


def test_viscosity_acts_on_what_is_laminar() -> None:
    viscous = {
        name: {one.name for one in model_named(name)().quantities if one.role == VISCOUS}
        for name in ("purdy", "twin_tube", "linear", "bilinear")
    }
    assert viscous["purdy"] == {"r_m2", "r_m3"}
    slopes = {"rebound_slope", "compression_slope", "return_slope", "drag"}
    assert viscous["twin_tube"] == slopes
    assert viscous["linear"] == {"c"}
    assert viscous["bilinear"] == {"c_r", "c_b"}
