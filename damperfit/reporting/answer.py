"""What a function returns for people and programs: it prints itself as text and in a notebook."""

from collections.abc import Sequence
from html import escape
from typing import Any

from damperfit.problem import Problem, Words
from damperfit.reporting.sheet import Sheet, html_table, text_table

_WORDS = Words("damperfit")


class Answer:
    """An answer in a sentence and tables.

    Attributes
    ----------
    sentence : str
        The answer in words; empty: the tables are the answer.
    remarks, warnings, notes : tuple
        What to know of it: what was missing, what to know before believing it, and the rest.
    """

    sentence: str = ""
    remarks: tuple[object, ...] = ()
    warnings: tuple[object, ...] = ()
    notes: tuple[object, ...] = ()

    def sheets(self) -> Sequence[Sheet]:
        """Return its tables."""
        raise NotImplementedError

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        raise NotImplementedError

    def __repr__(self) -> str:
        tables = (text_table(sheet, 100) for sheet in self.sheets() if sheet.rows)
        return "\n\n".join(filter(None, (self.sentence, *tables, "\n".join(self._to_know))))

    @property
    def _to_know(self) -> list[str]:
        every = (*self.remarks, *self.warnings, *self.notes)
        return list(
            dict.fromkeys(
                f"{item.severity}: {item.sentence(_WORDS)}"
                if isinstance(item, Problem)
                else f"note: {item}"
                for item in every
            )
        )

    def _repr_html_(self) -> str:
        texts = [escape(text) for text in (self.sentence, *self._to_know) if text]
        paragraphs = (f"<p>{text}</p>".replace("\n", "<br>") for text in texts)
        return "".join([*paragraphs, *(html_table(sheet) for sheet in self.sheets() if sheet.rows)])
