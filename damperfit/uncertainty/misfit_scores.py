"""What a misfit that repeats may do to the parameters: scores of the repeating residual by blocks.

Noise differs from cycle to cycle; what repeats does so in every one, and no number of cycles makes
it less. Had the test been another (other speeds, another stroke), it would weigh otherwise. How
much otherwise is seen inside the cycle: its blocks of phase pull the parameters to and fro, and
their pulls, which cancel at the minimum, are taken for independent::

    M = B/(B - k) sum over blocks of s_b s_b'        s_b = sum over the block of w^2 J r_repeating

in place of the covariance of the scores that noise gives.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.uncertainty.thinning import middles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.recording import Stretch
    from damperfit.uncertainty.linearisation import Linearisation

    FloatArray = NDArray[np.float64]

__all__ = ["misfit_scores"]

# Blocks of a cycle. Misfits behind a 30 Hz filter at 1.5 Hz have some 20 independent values.
_BLOCKS = 16


def misfit_scores(linearised: Linearisation) -> FloatArray:
    """Return the matrix M of a setting's repeating misfit, shape (k, k), in the order of the model.

    Parameters
    ----------
    linearised : Linearisation
        Of the setting, with its curves.
    """
    n_free = len(linearised.names)
    pulls: list[FloatArray] = []
    for log, seen in zip(linearised.fit.logs, linearised.logs, strict=True):
        trace, stride = log.trace, seen.stride
        for stretch, place, rows in zip(
            trace.stretches, trace.places, seen.rows(trace), strict=True
        ):
            block, repeating = _blocks(stretch, seen.residuals[place])
            middle, counts = middles(stretch.n_samples, stride)
            pulled = counts * (seen.weights[place] ** 2 * repeating)[middle]
            scores = seen.jacobian[rows] * pulled[:, None]
            pulls.extend(scores[block[middle] == k].sum(axis=0) for k in range(_BLOCKS))
    table = np.array(pulls)
    few = len(table) / max(len(table) - n_free, 1)
    return np.asarray(few * table.T @ table)


def _blocks(stretch: Stretch, residuals: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """Return the block of each sample, and the residual without what differs between cycles."""
    n = len(residuals)
    if stretch.n_cycles < 2:
        return np.arange(n) * _BLOCKS // n, residuals
    starts = stretch.cycle_starts - stretch.first
    cycles = np.interp(np.arange(n), starts, np.arange(len(starts)))
    phase = cycles % 1.0
    n_bins = max(_BLOCKS, round(float(np.mean(np.diff(starts)))))
    bins = np.minimum((phase * n_bins).astype(np.int64), n_bins - 1)
    counts = np.maximum(np.bincount(bins, minlength=n_bins), 1)
    mean = np.bincount(bins, weights=residuals, minlength=n_bins) / counts
    return bins * _BLOCKS // n_bins, mean[bins]
