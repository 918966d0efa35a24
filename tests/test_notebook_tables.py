"""Tables of a notebook as text."""

from __future__ import annotations

import builtins

from damperfit.report.notebook_tables import text_table
from damperfit.report.sheet import Sheet

SHEET = Sheet(("set", "f_f"), ("", "N"), (("1", "50"),), is_number=(False, True))
PLAIN = "set  f_f\n       N\n1     50"


class ZMQInteractiveShell:
    """By its name Rich knows a notebook."""


def test_a_table_is_returned_in_a_notebook_too(monkeypatch):
    monkeypatch.setattr(builtins, "get_ipython", ZMQInteractiveShell, raising=False)
    assert text_table(SHEET) == PLAIN


def test_a_table_as_text_is_plain_where_colours_are_forced(monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    assert text_table(SHEET) == PLAIN
