"""Certificate of the fit driver: the NIST nonlinear regression problems from both starts.

    python -m tests.certificate

For each solver: how many of the 54 cases it has to six digits in every parameter, and in every
standard deviation (11 are certified). First on equal terms, damperfit's driver beside SciPy's
`least_squares` and `curve_fit`: the same functions in the same units, the same exact Jacobian,
tolerances and limit. Then each by rules of its own: the driver with those of a damper's fit, SciPy
with its defaults, whose tolerances of 1e-8 and difference quotients ask for less. `--cases` shows
the correct digits of each case: worst parameter, worst standard deviation, residual sum of squares.
"""

import argparse
import sys
from functools import partial

from tests.certificate.fits import (
    EQUAL_ROWS,
    OWN_ROWS,
    SOLVED,
    Digits,
    attempt,
    by_damperfit,
)
from tests.certificate.problems import MODELS, load


def main() -> int:
    """Print the table; return 1 when the driver misses a case on equal terms."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.certificate",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--cases", action="store_true", help="digits of every case")
    parser.add_argument("--log", action="store_true", help="the driver in logarithms alone")
    given = parser.parse_args()
    cases = [(load(name), k) for name in MODELS for k in (0, 1)]
    tables = {"on equal terms": EQUAL_ROWS, "by its own rules": OWN_ROWS}
    if given.log:
        cases = [(p, k) for p, k in cases if min(p.starts[k].min(), p.certified.min()) > 0.0]
        tables = {"where all is positive": {"in logarithms": partial(by_damperfit, is_log=True)}}
    missed = 0
    for title, rows in tables.items():
        print(f"{title:28s}parameters  standard deviations  of {len(cases)} to {SOLVED:g} digits")
        for name, fit in rows.items():
            found = [attempt(fit, problem, problem.starts[k]) for problem, k in cases]
            solved = sum(one.parameters >= SOLVED for one in found)
            known = sum(one.deviations >= SOLVED for one in found)
            print(f"  {name:26s}{solved:10d}{known:21d}")
            missed += name == "damperfit" and solved < len(cases)
            if given.cases:
                for (problem, k), one in zip(cases, found, strict=True):
                    print(f"    {problem.name:9s} {problem.difficulty:8s} {k + 1}{_cell(one)}")
    return int(missed > 0)


def _cell(digits: Digits) -> str:
    numbers = (digits.parameters, digits.deviations, digits.sum_of_squares)
    return " " * 6 + "".join(f"{number:6.1f}" for number in numbers)


if __name__ == "__main__":
    sys.exit(main())
