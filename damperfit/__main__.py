"""Lets ``python -m damperfit`` do what ``damperfit`` does."""

import sys

from damperfit.cli import main

if __name__ == "__main__":
    sys.exit(main())
