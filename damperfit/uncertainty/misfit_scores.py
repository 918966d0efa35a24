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

from damperfit.uncertainty.rows import BLOCKS, Phases

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.uncertainty.linearisation import Linearisation
    from damperfit.uncertainty.rows import EverySample

    FloatArray = NDArray[np.float64]

__all__ = ["misfit_scores"]


def misfit_scores(linearised: Linearisation) -> FloatArray:
    """Return the matrix M of a setting's repeating misfit, shape (k, k), in the order of the model.

    Parameters
    ----------
    linearised : Linearisation
        Of the setting, with its curves.
    """
    n_free = len(linearised.names)
    pulls: list[FloatArray] = []
    for seen in linearised.logs:
        for slopes in seen.slopes:
            block, repeating = _blocks(slopes.rows, slopes.residuals)
            weight = slopes.read(seen.weights)[0]
            times = slopes.rows.spacing * slopes.rows.n_cycles
            scores = slopes.by * (times * weight**2 * repeating)[:, None]
            pulls.extend(scores[block == k].sum(axis=0) for k in range(BLOCKS))
    table = np.array(pulls)
    few = len(table) / max(len(table) - n_free, 1)
    return np.asarray(few * table.T @ table)


def _blocks(
    rows: EverySample | Phases, residuals: FloatArray
) -> tuple[NDArray[np.int64], FloatArray]:
    """Return the block of each row, and the residual without what differs between cycles: (m,)."""
    stretch, n = rows.stretch, residuals.shape[1]
    if isinstance(rows, Phases) or stretch.n_cycles < 2:
        return np.arange(n) * BLOCKS // n, residuals.mean(axis=0)
    starts = stretch.cycle_starts - stretch.first
    cycles = np.interp(np.arange(n), starts, np.arange(len(starts)))
    phase = cycles % 1.0
    n_bins = max(BLOCKS, round(float(np.mean(np.diff(starts)))))
    bins = np.minimum((phase * n_bins).astype(np.int64), n_bins - 1)
    counts = np.maximum(np.bincount(bins, minlength=n_bins), 1)
    mean = np.bincount(bins, weights=residuals[0], minlength=n_bins) / counts
    return bins * BLOCKS // n_bins, mean[bins]
