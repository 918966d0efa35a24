"""The program: ``damperfit``, and ``python -m damperfit``."""

import sys

from damperfit.own_process import begin

begin()  # before anything is imported that the working folder may hold too

from damperfit.cli import main  # noqa: E402

__all__ = ["main"]

if __name__ == "__main__":
    sys.exit(main())
