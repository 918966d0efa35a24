"""Rig logs to `Recording`: any file gives right numbers in SI or one sentence saying why not."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from damperfit.errors import LogError, TimelessError
from damperfit.io.options import ReadOptions

if TYPE_CHECKING:
    from damperfit.io.files import Source
    from damperfit.io.force_curves import ForceCurve
    from damperfit.io.formats import Table
    from damperfit.recording import Recording

__all__ = ["ReadOptions", "read_curves", "read_log", "read_logs"]

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
    from damperfit.io.recordings import make_recordings

    with _opened(path, options) as (source, tables, profiled, notes):
        try:
            return make_recordings(source, tables, profiled, notes)
        except LogError as error:
            from damperfit.io.force_curves import holds_curves

            if not holds_curves(tables, profiled):
                raise
            raise TimelessError(
                "speed and force without time, and a fit needs force and displacement over time; "
                f"damperfit inspect shows the curves, damperfit settings {source.name} finds a "
                "force among them",
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

    with _opened(path, options) as opened:
        return make_curves(*opened)


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


@contextmanager
def _opened(
    path: str | os.PathLike[str], options: ReadOptions
) -> Iterator[tuple[Source, tuple[Table, ...], ReadOptions, tuple[str, ...]]]:
    """Yield a file, its tables, and the options and notes of its profile."""
    from damperfit.io.files import read_source, unpack
    from damperfit.io.formats import find_format

    source = read_source(path, max_bytes=options.max_bytes)
    name = source.name
    try:
        options, notes = options.for_file(name)
        source, format_notes = unpack(source, max_bytes=options.max_bytes)
        yield source, find_format(source).read(source, options), options, (*notes, *format_notes)
    except LogError as error:
        place = error.problem.subject  # a reader's is the place in the file, as in ", row 5"
        if place and not place.startswith(","):
            raise
        raise error.at(subject=f"{name}{place}") from error.__cause__
