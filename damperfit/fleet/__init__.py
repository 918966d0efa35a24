"""Many dampers: one Parquet part each, written by whoever fits it, and never done twice.

LOGS --sources--> files --tasks--> DamperTask (one damper) --engine--> one_damper --> part
     parts --collect--> one table
"""

import sys

from damperfit.keywords import FunctionPackage

__all__: list[str] = []

sys.modules[__name__].__class__ = FunctionPackage  # `damperfit.fleet(...)` is the function
