"""A results folder handed over to other programs: one file a target, an explicit table of targets.

`handed_over` reads the folder back, `targets` says what there is and how each is written, and each
target has a file of its own that makes bytes of a `HandedOver`. Nothing here writes to disk.
"""

from damperfit.handover.handed_over import HandedOver, HandedSetting, Tested, hand_over
from damperfit.handover.road import what_is_lost
from damperfit.handover.targets import TARGETS, ExportOptions, Target, find_target

__all__ = [
    "TARGETS",
    "ExportOptions",
    "HandedOver",
    "HandedSetting",
    "Target",
    "Tested",
    "find_target",
    "hand_over",
    "what_is_lost",
]
