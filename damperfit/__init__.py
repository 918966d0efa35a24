"""damperfit reads damper rig logs and fits a physical damper model at every adjuster setting.

The Python API is one import path per name:

    from damperfit.readers import read_log
    from damperfit.conditioning import condition
    from damperfit.simulation import simulate
    from damperfit.identification import identify

This module imports nothing, so that ``damperfit --help`` starts at once.
"""

__all__ = ["__version__"]

__version__ = "0.1.0"
