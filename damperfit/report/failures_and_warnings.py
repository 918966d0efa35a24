"""What a report tells besides the tables."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from damperfit.report.alike import shape_of, summarised

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.checks import Check
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty import Prediction

__all__ = ["Failure", "ReportFacts", "failure_lines"]

_MANY = 5  # tests of one file that fail alike and are listed one by one


@dataclass(frozen=True, slots=True)
class Failure:
    """One thing that went wrong while the rest went on.

    Attributes
    ----------
    log : str
        Name of the log; empty when it is a whole setting that failed.
    path : str
        Path of the log; empty likewise.
    setting : Setting or None
        Adjuster setting, when known.
    kind : str
        Name of the error class; the manual lists them (page gates).
    message : str
        One sentence: what, where, found, expected, what to do.
    trace : str
        Of an internal error, where it happened, for whoever mends it.
    """

    log: str
    path: str
    setting: Setting | None
    kind: str
    message: str
    trace: str = ""

    @property
    def place(self) -> str:
        """The log, else the setting, that has no result."""
        return self.log or (f"setting {self.setting}" if self.setting is not None else "")

    @property
    def is_left_out(self) -> bool:
        """Whether only strict quality refused the log: a gate that was missed, no failure."""
        return self.kind == "QualityError"

    def describe(self) -> dict[str, Any]:
        """Return the failure for run.json."""
        return {
            "log": self.log,
            "path": self.path,
            "setting": self.setting,
            "kind": self.kind,
            "message": self.message,
        }

    @property
    def line(self) -> str:
        """The failure as one line, its place first."""
        place = self.place
        has_place = not place or place in self.message
        return self.message if has_place else f"{place}: {self.message}"


def failure_lines(failures: Sequence[Failure]) -> list[str]:
    """Return a line for each failure; of many alike the first, and how many more.

    A logger that leaves out the setting does so in each of a file's hundreds of tests.
    """
    of_file: dict[tuple[str, str, str], list[Failure]] = {}
    for one in failures:
        shape = shape_of(one.message, one.log)
        of_file.setdefault((one.path or one.place, one.kind, shape), []).append(one)
    sentences = []
    for first, *others in of_file.values():
        if len(others) < _MANY:
            sentences += [(one.place, one.line) for one in (first, *others)]
        else:
            more = f"(and {len(others)} other tests of this file alike)"
            sentences.append((first.place, f"{first.line} {more}"))
    return list(summarised(sentences))


@dataclass(frozen=True, slots=True)
class ReportFacts:
    """What a report tells besides the tables.

    Attributes
    ----------
    version : str
        Version of damperfit.
    tested : str
        Whose test it is; empty where nobody said.
    procedure : tuple of str
        How the parameters were found, one sentence each.
    failures : tuple of Failure
        Logs and settings without a result.
    warnings : tuple of str
        What the reader should know before believing the numbers.
    gaps : tuple of (int, int)
        Runs of settings without a result, first and last, between the lowest and the highest one.
    gates : tuple of str
        Gates that were not met, one sentence each.
    advice : tuple of (str, str)
        Each outcome other than success that occurred, and what to do about it.
    trust : tuple of str
        What the residuals say of noise and lack of fit, one sentence each.
    held_out : tuple of Prediction
        What was not fitted but predicted.
    identifiability : tuple of str
        Parameters that the logs do not tell, and those that are tied, one sentence each.
    undetermined : tuple of str
        Those of them that are not determined, which the command says too.
    taken : tuple of str
        Tables of tests that were used, which the command says too.
    searches : tuple of str
        What fits from many starts found, one sentence each.
    cavitation : tuple of str
        How near the chambers are to zero pressure, one sentence each.
    across : tuple of str
        What shows only across the settings, one sentence each.
    checks : tuple of Check
        Every check, with reason.
    withheld : tuple of str
        Settings whose grade is withheld, and why.
    stretches : tuple of mapping
        What was compared, stretch by stretch, as in run.json.
    law_choice : mapping
        Which laws were tried, as in run.json; empty where the logs did not choose.
    is_interrupted : bool
        The run was stopped before all settings were done.
    """

    version: str
    procedure: tuple[str, ...] = ()
    tested: str = ""
    failures: tuple[Failure, ...] = ()
    warnings: tuple[str, ...] = ()
    gaps: tuple[tuple[int, int], ...] = ()
    gates: tuple[str, ...] = ()
    advice: tuple[tuple[str, str], ...] = ()
    trust: tuple[str, ...] = ()
    held_out: tuple[Prediction, ...] = ()
    identifiability: tuple[str, ...] = ()
    undetermined: tuple[str, ...] = ()
    taken: tuple[str, ...] = ()
    searches: tuple[str, ...] = ()
    cavitation: tuple[str, ...] = ()
    across: tuple[str, ...] = ()
    checks: tuple[Check, ...] = ()
    withheld: tuple[str, ...] = ()
    stretches: tuple[Mapping[str, Any], ...] = ()
    law_choice: Mapping[str, Any] = field(default_factory=dict)
    is_interrupted: bool = False
