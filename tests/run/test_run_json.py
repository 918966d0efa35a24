"""Warnings about files with the same bytes: one line a set, none for the tests in one file."""

from __future__ import annotations

from damperfit.run.logs import LogBatch, LogFacts
from damperfit.run.remarks import _twin_warnings


def _warned(*logs: tuple[str, str, str]) -> list[str]:
    facts = tuple(LogFacts(log, path, sha256, {}) for log, path, sha256 in logs)
    return list(_twin_warnings(LogBatch((), facts, (), (), len(facts))))


def test_two_files_with_the_same_bytes_are_named() -> None:
    assert _warned(
        ("a.csv", "x/a.csv", "1"), ("b.csv", "x/b.csv", "1"), ("c.csv", "c.csv", "2")
    ) == ["b.csv: holds the same bytes as a.csv; both are used"]


def test_many_are_one_line() -> None:
    logs = [(f"{n}.csv", f"{n}.csv", "1") for n in range(5)]
    assert _warned(*logs) == ["1.csv and 3 other logs: hold the same bytes as 0.csv"]


def test_the_tests_in_one_file_are_no_twins() -> None:
    # Used to warn of each part of a file with several tests.
    assert _warned(("a.txt part 1", "a.txt", "1"), ("a.txt part 2", "a.txt", "1")) == []
