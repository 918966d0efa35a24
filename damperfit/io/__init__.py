"""Rig logs to `Recording`: any file gives right numbers in SI or one sentence saying why not."""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

from damperfit.errors import LogError, TimelessError
from damperfit.io.labels import Guess, guess_settings, one_of_several, unclear_names
from damperfit.io.options import Profile, ReadOptions
from damperfit.io.tests_table import TestRow, TestsTable, is_tests_table, read_tests

if TYPE_CHECKING:
    from damperfit.io.files import Source
    from damperfit.io.force_curves import ForceCurve
    from damperfit.io.formats import Table
    from damperfit.recording import Recording

__all__ = [
    "ForceCurve",
    "Guess",
    "Profile",
    "ReadOptions",
    "TestRow",
    "TestsTable",
    "guess_settings",
    "is_tests_table",
    "one_of_several",
    "read_curves",
    "read_log",
    "read_logs",
    "read_tests",
    "unclear_names",
]

_DEFAULTS = ReadOptions()


def read_logs(
    path: str | os.PathLike[str], options: ReadOptions = _DEFAULTS
) -> tuple[Recording, ...]:
    """Return every test in a log file of any known format, in SI, with the project's signs.

    Raises
    ------
    LogError
        The file cannot be read as force and displacement over time; one line that says why.
        TimelessError where it holds speed and force without time, which `read_curves` reads.
    """
    from damperfit.io.force_curves import holds_curves
    from damperfit.io.recordings import make_recordings

    source, tables, options, notes = _opened(path, options)
    try:
        return make_recordings(source, tables, options, notes)
    except LogError as error:
        if not holds_curves(tables, options):
            raise
        raise TimelessError(
            f"speed and force without time, and a fit needs force and displacement "
            f"over time; damperfit inspect shows the curves, damperfit settings {source.name} "
            "finds a force among them",
            subject=source.name,
            code="no-time",
        ) from error


def read_curves(
    path: str | os.PathLike[str], options: ReadOptions = _DEFAULTS
) -> tuple[ForceCurve, ...]:
    """Return the curves of force over speed, points or loops, in a file without time.

    Raises
    ------
    LogError
        The file holds no speed with a force, or a unit, a value or the stroke cannot be determined.
    """
    from damperfit.io.force_curves import make_curves

    return make_curves(*_opened(path, options))


def read_log(path: str | os.PathLike[str], options: ReadOptions = _DEFAULTS) -> Recording:
    """Return the one test in a log file; as `read_logs`, which returns several."""
    recordings = read_logs(path, options)
    if len(recordings) != 1:
        name = recordings[0].name.removesuffix(" part 1")
        raise LogError(
            f"holds {len(recordings)} tests; read_logs gives them all",
            subject=name,
            code="several-tests",
        )
    return recordings[0]


def _opened(
    path: str | os.PathLike[str], options: ReadOptions
) -> tuple[Source, tuple[Table, ...], ReadOptions, tuple[str, ...]]:
    """Return a file, its tables, and the options and notes of its profile."""
    from damperfit.io.files import read_source, unpack
    from damperfit.io.formats import find_format

    source = read_source(path, max_bytes=options.max_bytes)
    options, notes = options.for_file(source.name)
    source, format_notes = unpack(source, max_bytes=options.max_bytes)
    return source, find_format(source).read(source, options), options, (*notes, *format_notes)


def __getattr__(name: str) -> Any:
    if name != "ForceCurve":  # which takes a module that logs do not need
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module("damperfit.io.force_curves").ForceCurve
