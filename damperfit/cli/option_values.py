"""The option that was typed for a file, before a sentence that begins with the file."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

__all__ = ["with_typed_option"]

_UNWRITTEN = "cannot write to "


def with_typed_option(message: str, argv: Sequence[str], options: Collection[str]) -> str:
    """Return a refusal that begins with a file, with the option before it that gave the file.

    Parameters
    ----------
    message : str
        As in "rig.toml:3: unknown key ...".
    argv : sequence of str
        What was typed.
    options : collection of str
        Those that take a file or folder.

    Examples
    --------
    >>> with_typed_option("a.toml:3: no", ["inspect", "--config", "a.toml"], {"--config"})
    '--config a.toml:3: no'
    >>> with_typed_option("cannot write to b: full", ["identify", "--out=b"], {"--out"})
    '--out b: cannot be written: full'
    """
    text = message.removeprefix(_UNWRITTEN)
    is_unwritten = text != message
    if any(message.startswith(f"{option[2:]} {value}:") for option, value in _typed(argv)):
        return f"--{message}"
    for option, value in _typed(argv):
        for place in _places(value, is_unwritten=is_unwritten) if option in options else ():
            rest = text.removeprefix(place)
            if rest == text or rest[:1] not in {":", "/", "\\"}:
                continue
            if is_unwritten:
                return f"{option} {value}: cannot be written{rest}"
            return f"{option} {value}{rest}"
    return message


def _places(value: str, *, is_unwritten: bool) -> Iterator[str]:
    """Yield what messages may call a file that was typed: itself, in full, where it would stand."""
    if not value:
        return
    path = Path(value)
    yield from (value, str(path))
    with suppress(OSError):  # the working folder is gone
        yield os.path.realpath(path)
    if is_unwritten and path.parent != Path():
        yield str(path.parent)


def _typed(argv: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield each option with what follows it, --name value or --name=value."""
    for word, after in zip(argv, (*argv[1:], ""), strict=True):
        if word.startswith("--"):
            option, equals, value = word.partition("=")
            yield option, value if equals else after
