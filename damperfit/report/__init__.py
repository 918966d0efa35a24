"""Tables, text, figures and pages of a run, for people; each module is imported by its name."""

import sys

from damperfit.keywords import FunctionPackage

__all__: list[str] = []

sys.modules[__name__].__class__ = FunctionPackage  # `damperfit.report(...)` is the function
