"""Libraries that read foreign formats: loaded when a log needs them, and kept to one exception."""

from __future__ import annotations

import importlib
import importlib.util
import logging
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from damperfit.errors import LogError
from damperfit.readers.channels import visible

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["check_library", "check_size", "load_library", "refusing_damage"]


def check_library(module: str, *, extra: str, reads: str, name: str) -> None:
    """Refuse a log whose library is not installed, without loading it; as `load_library`.

    Raises
    ------
    LogError
        The library is not there; names the command that installs it.
    """
    found = None
    with suppress(ImportError, ValueError):
        found = importlib.util.find_spec(module)
    if found is None:
        raise LogError(_missing(extra, reads, name))


def _missing(extra: str, reads: str, name: str) -> str:
    return f"{name}: {reads} needs one more library: pip install 'damperfit[{extra}]'"


def load_library(module: str, *, extra: str, reads: str, name: str) -> Any:
    """Return a library that is not installed with the program itself.

    Parameters
    ----------
    module : str
        As in "nptdms".
    extra : str
        Name of the optional dependency in the package.
    reads : str
        Format, for the message.
    name : str
        Log, for the message.

    Raises
    ------
    LogError
        The library is not there; names the command that installs it.
    """
    try:
        library = importlib.import_module(module)
    except ImportError as error:
        raise LogError(_missing(extra, reads, name)) from error
    # It may tell its own story on stderr, with bytes of the log in it.
    for name_of_logger in (module, *logging.root.manager.loggerDict):
        if name_of_logger.partition(".")[0] == module:
            logging.getLogger(name_of_logger).setLevel(logging.CRITICAL + 1)
    return library


@contextmanager
def refusing_damage(reads: str, *, name: str = "") -> Iterator[None]:
    """Turn whatever a library raises over damaged bytes into one line.

    Raises
    ------
    LogError
        The block raised anything but LogError and MemoryError.
    """
    try:
        yield
    except (LogError, MemoryError):
        raise
    except Exception as error:  # npTDMS alone raises five kinds, from KeyError to struct.error
        first = (str(error).splitlines() or [""])[0]
        reason = visible(first or type(error).__name__, limit=120)
        where = f"{name}: " if name else ""
        raise LogError(f"{where}damaged {reads}: {reason}; copy the log again") from error


def check_size(n_bytes: int, *, limit: int, what: str, name: str = "") -> None:
    """Refuse what would need more memory than the limit.

    Raises
    ------
    LogError
        n_bytes is more than the limit, or negative.
    """
    if not 0 <= n_bytes <= limit:
        where = f"{name}: " if name else ""
        raise LogError(
            f"{where}{what} claims {n_bytes} bytes, more than the limit of {limit} "
            "(rig.max_log_bytes)"
        )
