"""The error of results that cannot be written, which keeps them; it loads nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.errors import OutputError

if TYPE_CHECKING:
    from damperfit.run.result import RunResult

__all__ = ["UnwrittenError"]


class UnwrittenError(OutputError):
    """The results cannot be written; what was found is not lost with them.

    Attributes
    ----------
    result : RunResult
        What the run found.
    owner : str
        Of several dampers, whose result it is.
    """

    def __init__(self, cause: OutputError, result: RunResult, owner: str = "") -> None:
        super().__init__(str(cause))
        self.problem = cause.problem
        self.result = result
        self.owner = owner
