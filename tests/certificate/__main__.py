"""Certificate of the fit driver: the NIST nonlinear regression problems from both starts.

    python -m tests.certificate

For each case the correct digits (of the worst parameter, of the worst standard deviation, of the
residual sum of squares; 11 are certified) of damperfit's driver, of SciPy's `least_squares` with
method lm and of `curve_fit` with method trf, both at their defaults. The driver runs with the same
options in all cases; `STOPPING` in `tests/certificate/fits.py` is all in which they differ from
those of a damper's fit, and says why.
"""

from __future__ import annotations

import argparse
import sys

from damperfit.identification.trust_region import Stopping
from tests.certificate.fits import (
    STOPPING,
    Digits,
    Result,
    attempt,
    by_curve_fit,
    by_damperfit,
    by_least_squares,
)
from tests.certificate.problems import MODELS, Array, Problem, load

SOLVED = 6.0


def main() -> int:
    """Print the table; return 1 when the driver misses a case."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.certificate",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--log", action="store_true", help="logarithms, where all is positive")
    parser.add_argument("--as-dampers", action="store_true", help="stop as a damper's fit does")
    given = parser.parse_args()
    stopping = Stopping() if given.as_dampers else STOPPING

    def ours(problem: Problem, start: Array) -> Result:
        return by_damperfit(problem, start, stopping=stopping, is_log=given.log)

    solvers = {"damperfit": ours, "lm": by_least_squares, "trf": by_curve_fit}
    columns = "".join(f"  {name:>9s}: b   sd  rss" for name in solvers)
    print(f"{'problem':9s} {'level':8s} start evaluations{columns}")
    solved = dict.fromkeys(solvers, 0)
    known = dict.fromkeys(solvers, 0)
    cases = [(load(name), k) for name in MODELS for k in (0, 1)]
    if given.log:
        cases = [(p, k) for p, k in cases if min(p.starts[k].min(), p.certified.min()) > 0.0]
    for problem, k in cases:
        digits = {name: attempt(fit, problem, problem.starts[k]) for name, fit in solvers.items()}
        for name, one in digits.items():
            solved[name] += one.parameters >= SOLVED
            known[name] += one.deviations >= SOLVED
        spent = ours(problem, problem.starts[k]).evaluations
        shown = "".join(_cell(one) for one in digits.values())
        print(f"{problem.name:9s} {problem.difficulty:8s} {k + 1:5d} {spent:11d}{shown}")
    for name in solvers:
        print(
            f"{name}: parameters to 6 digits in {solved[name]} of {len(cases)}, "
            f"standard deviations in {known[name]}"
        )
    return int(solved["damperfit"] < len(cases))


def _cell(digits: Digits) -> str:
    numbers = (digits.parameters, digits.deviations, digits.sum_of_squares)
    return " " * 6 + "".join(f"{number:6.1f}" for number in numbers)


if __name__ == "__main__":
    sys.exit(main())
