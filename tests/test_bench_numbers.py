"""The frozen figures are there for every case, and a number that has moved is named."""

import math
import tomllib
from dataclasses import replace
from pathlib import Path

from tests.ablation import PIECES, switched_off
from tests.bench_numbers import CASES, Row, load_frozen, moved

ROW = Row("purdy: r_m1", 1e-3, 2e-3, math.nan, 1.0, 2.0, 0.9, 95, 100, 20, 1.5)


def test_every_case_is_frozen_and_no_other() -> None:
    assert {*load_frozen()} == {case.name for case in CASES}


def test_what_has_moved_is_named_and_what_takes_longer_has_not() -> None:
    assert moved(replace(ROW, fit=1.01e-3, error_se=2.05, cpu_s=9.0, evaluations=99), ROW) == []
    assert moved(replace(ROW, fit=1.03e-3), ROW) == ["fit"]
    assert moved(replace(ROW, fit_worst=1.9e-3), ROW) == ["fit_worst"]
    assert moved(replace(ROW, rms_se=1.1, covered=94), ROW) == ["rms_se", "covered"]
    assert moved(replace(ROW, held_worst=0.1, law="twin_tube: k_s"), ROW) == ["held_worst", "law"]


def test_rows_of_the_ablation_are_of_known_pieces() -> None:
    rows = tomllib.loads(Path(__file__).with_name("ablation.toml").read_text(encoding="utf-8"))
    for name, row in rows.items():
        assert {*row} == {"piece", "data", "lost"}, name
        assert name in PIECES or "removed" in row["piece"], name


def test_a_piece_that_is_named_is_there(monkeypatch) -> None:
    import importlib

    for module, path, _ in PIECES.values():
        owner = importlib.import_module(f"damperfit.{module}")
        *classes, attribute = path.split(".")
        for one in classes:
            owner = getattr(owner, one)
        monkeypatch.setattr(owner, attribute, getattr(owner, attribute))
    for name in PIECES:
        switched_off(name)
