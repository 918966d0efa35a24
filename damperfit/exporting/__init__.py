"""A run exported to other programs: `targets` makes the files, `check` holds them against the logs.

(`damperfit.export` is the function, so the package has another name.)
"""

from damperfit.exporting.targets import (
    TARGETS,
    Export,
    ExportedRun,
    ExportOptions,
    Target,
    exported_run,
    find_target,
)

__all__ = [
    "TARGETS",
    "Export",
    "ExportOptions",
    "ExportedRun",
    "Target",
    "exported_run",
    "find_target",
]
