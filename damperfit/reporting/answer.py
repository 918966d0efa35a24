"""What a function returns for people and programs: it prints itself as text and in a notebook."""

from collections.abc import Sequence
from html import escape
from typing import Any

from damperfit.reporting.sheet import Sheet, html_table, text_table


class Answer:
    """An answer in a sentence and tables.

    Attributes
    ----------
    sentence : str
        The answer in words; empty: the tables are the answer.
    remarks : tuple
        What to know of it, a sentence each.
    """

    sentence: str = ""
    remarks: tuple[object, ...] = ()

    def sheets(self) -> Sequence[Sheet]:
        """Return its tables."""
        raise NotImplementedError

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        raise NotImplementedError

    def __repr__(self) -> str:
        tables = (text_table(sheet, 100) for sheet in self.sheets() if sheet.rows)
        notes = (f"note: {remark}" for remark in self.remarks)
        return "\n\n".join(filter(None, (self.sentence, *tables, "\n".join(notes))))

    def _repr_html_(self) -> str:
        texts = [f"<p>{escape(str(text))}</p>" for text in (self.sentence, *self.remarks) if text]
        return "".join([*texts, *(html_table(sheet) for sheet in self.sheets() if sheet.rows)])
