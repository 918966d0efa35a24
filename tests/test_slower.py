"""Each case of slower.toml is there, and so is the quicker one that stands for it."""

from __future__ import annotations

import ast
import tomllib
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SLOWER = tomllib.loads((Path(__file__).parent / "slower.toml").read_text(encoding="utf-8"))


@cache
def _functions(file: str) -> dict[str, ast.FunctionDef]:
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    return {node.name: node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


@pytest.mark.parametrize("quicker", SLOWER)
def test_a_quicker_case_stands_for_the_slower_ones(quicker: str) -> None:
    moved = {case for cases in SLOWER.values() for case in cases}
    assert quicker not in moved
    for case in (quicker, *SLOWER[quicker]):
        file, _, name = case.partition("::")
        function = _functions(file)[name.partition("[")[0]]
        assert not any("slow" in ast.unparse(one) for one in function.decorator_list
                       if "parametrize" not in ast.unparse(one)), case  # fmt: skip
        assert "[" not in name or any(
            "parametrize" in ast.unparse(one) for one in function.decorator_list
        )


def test_what_a_limit_rests_on_is_not_among_them() -> None:
    held = (Path(__file__).parent / "limits" / "held.toml").read_text(encoding="utf-8")
    for cases in SLOWER.values():
        for case in cases:
            assert f'{case.removeprefix("tests/").partition("[")[0]}"' not in held, case
