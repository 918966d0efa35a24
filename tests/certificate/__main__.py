"""Certificate of the fit driver: the NIST nonlinear regression problems from both starts.

    python -m tests.certificate

How many of the 54 cases the driver has to six digits in every parameter, and in every standard
deviation (11 are certified): with the tolerances that these problems ask for; in logarithms, where
all is positive; with the rules of a damper's fit, its limit of 100 evaluations among them.
`--cases` shows the correct digits of each case: worst parameter, worst standard deviation, residual
sum of squares.
"""

import argparse
import sys

from tests.certificate.fits import ROWS, SOLVED, attempt
from tests.certificate.problems import MODELS, load


def main() -> int:
    """Print the table; return 1 when the driver misses a case."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", action="store_true", help="digits of every case")
    given = parser.parse_args()
    missed = 0
    for name, fit in ROWS.items():
        cases = [(load(one), k) for one in MODELS for k in (0, 1)]
        if name == "in logarithms":
            cases = [(p, k) for p, k in cases if min(p.starts[k].min(), p.certified.min()) > 0.0]
        found = [attempt(fit, problem, problem.starts[k]) for problem, k in cases]
        solved = sum(one.parameters >= SOLVED for one in found)
        known = sum(one.deviations >= SOLVED for one in found)
        print(
            f"{name:20s} {solved} of {len(cases)} to {SOLVED:g} digits, standard deviations {known}"
        )
        missed += name == "damperfit" and solved < len(cases)
        if given.cases:
            for (problem, k), one in zip(cases, found, strict=True):
                digits = (one.parameters, one.deviations, one.sum_of_squares)
                numbers = "".join(f"{number:6.1f}" for number in digits)
                print(f"    {problem.name:9s} {problem.difficulty:8s} {k + 1}{numbers}")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
