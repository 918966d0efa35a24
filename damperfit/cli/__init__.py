"""The command line: no numerical library before a command runs."""

import gc

_USUAL = gc.get_threshold()
gc.set_threshold(200_000)  # imports make many objects, and no garbage
try:
    from damperfit.cli.main import main
finally:
    gc.set_threshold(*_USUAL)

__all__ = ["main"]
