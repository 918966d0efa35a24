"""A run exported to other programs: a table of targets, and what each of them holds.

`tables` is what is exported: the damper, and the force by speed with its intervals. `targets` says
what there is and writes it, `check` holds what was written against the logs. Nothing here writes to
disk. (`damperfit.export` is the function, so the package has another name.)
"""

from damperfit.exporting.tables import ExportedRun, exported_run
from damperfit.exporting.targets import TARGETS, Export, ExportOptions, Target, find_target

__all__ = [
    "TARGETS",
    "Export",
    "ExportOptions",
    "ExportedRun",
    "Target",
    "exported_run",
    "find_target",
]
