"""Rig logs to `Recording`: any file gives right numbers in SI or one sentence saying why not."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.errors import LogError
from damperfit.readers.options import Profile, ReadOptions

if TYPE_CHECKING:
    import os

    from damperfit.recording import Recording

__all__ = ["Profile", "ReadOptions", "read_log", "read_logs"]

_DEFAULTS = ReadOptions()


def read_logs(
    path: str | os.PathLike[str], options: ReadOptions = _DEFAULTS
) -> tuple[Recording, ...]:
    """Return every test in a log file, in SI, with the project's signs.

    Parameters
    ----------
    path : path-like
        Log of any known format (`damperfit.readers.formats.FORMATS`).
    options : ReadOptions, optional
        Declared columns, units, signs and setting.

    Raises
    ------
    LogError
        The file cannot be read as force and displacement over time; one line that says why.
    """
    from damperfit.readers.assembly import make_recordings
    from damperfit.readers.files import read_source
    from damperfit.readers.formats import find_format
    from damperfit.readers.gzip import unpack

    source = read_source(path, max_bytes=options.max_bytes)
    options, notes = options.for_file(source.name)
    source, format_notes = unpack(source, max_bytes=options.max_bytes)
    tables = find_format(source).read(source, options)
    return make_recordings(tables, source, options, (*notes, *format_notes))


def read_log(path: str | os.PathLike[str], options: ReadOptions = _DEFAULTS) -> Recording:
    """Return the one test in a log file, in SI, with the project's signs.

    Raises
    ------
    LogError
        As `read_logs`; also when the file holds several tests.
    """
    recordings = read_logs(path, options)
    if len(recordings) != 1:
        name = recordings[0].name.removesuffix(" part 1")
        raise LogError(f"{name}: holds {len(recordings)} tests; read_logs gives them all")
    return recordings[0]
