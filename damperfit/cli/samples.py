"""``damperfit samples``: synthetic rig logs with known parameters."""

from __future__ import annotations

from typing import Any

from damperfit import api
from damperfit.cli.command import Shown, command, looking_on
from damperfit.cli.console import print_json, print_lines, say

__all__ = ["samples"]


@command(api.samples)
def samples(how: Shown, **given: Any) -> int:
    """Write make-believe rig logs with known parameters.

    Example: damperfit samples my_runs --settings 1-5
    """
    files = api.samples(**given, watch=looking_on(is_quiet=how.quiet))
    written = [str(path) for path in files]
    if not how.quiet:
        say(f"damperfit: {files.notes[0]}")
    if how.json:
        print_json({"logs": written[:-2], "files": written})
    elif not how.quiet:
        print_lines(written)
    return 0
