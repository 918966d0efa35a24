"""Text of logs and configurations as it may be shown: `printable`."""

from __future__ import annotations

__all__ = ["printable"]


def printable(text: str) -> str:
    r"""Return the text with control characters and reversed writing as escapes.

    Examples
    --------
    >>> print(printable("run_1\x1b[0m"))
    run_1\x1b[0m
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
