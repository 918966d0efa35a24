"""What a terminal shows while a fleet is at work, and that nobody else sees it."""

from __future__ import annotations

import io
import re
import sys

import pytest

from damperfit.cli.progress import fleet_progress


class Screen(io.StringIO):
    """Takes what is shown; a terminal or not."""

    def __init__(self, *, is_terminal: bool) -> None:
        super().__init__()
        self.is_terminal = is_terminal

    def isatty(self) -> bool:
        return self.is_terminal


@pytest.mark.parametrize(
    ("is_terminal", "is_wanted", "is_shown"),
    [(True, True, True), (True, False, False), (False, True, False)],
)
def test_a_terminal_shows_how_many_how_fast_and_how_long_still(
    monkeypatch, is_terminal, is_wanted, is_shown
):
    screen = Screen(is_terminal=is_terminal)
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    with fleet_progress(4, is_wanted=is_wanted) as advance:
        for _ in range(3):
            advance()
    said = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", screen.getvalue())
    assert ("3/4" in said) is is_shown
    assert (re.search(r"\d+ a minute", said) is not None) is is_shown
    assert (re.search(r"\d:\d\d:\d\d", said) is not None) is is_shown
    assert bool(said) is is_shown
