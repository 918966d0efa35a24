"""``damperfit report``: a results folder to one HTML page and figures, without fitting again."""

from __future__ import annotations

from typing import Any

from damperfit import api
from damperfit.cli.command import Shown, command
from damperfit.cli.console import print_json, say

__all__ = ["report"]


@command(api.report)
def report(how: Shown, **given: Any) -> int:
    """Write report.html, one page that opens anywhere, from a results folder.

    Units are those of the run unless --units says otherwise.
    Damper and rig are those of the run; a --config is only checked.

    Example: damperfit report results --figures svg
    """
    files = api.report(**given)
    for remark in files.remarks:
        say(f"damperfit: {given['results']}: {remark}")
    if how.json:
        print_json({"files": [str(path) for path in files], "remarks": list(files.remarks)})
    elif not how.quiet:
        more = f" and {len(files) - 1} figures" if len(files) > 1 else ""
        say(f"damperfit: {files[0]} written{more}")
    return 1 if files.remarks else 0
