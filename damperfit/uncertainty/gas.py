"""The gas content that K_e of a joint fit follows from, with its intervals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.identification.gas_content import GAS_NAMES
from damperfit.uncertainty.intervals import Interval, make_interval, shared_covariance

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.identification import Sharing
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty.linearisation import Linearisation

__all__ = ["GasContent", "gas_content"]


@dataclass(frozen=True, slots=True)
class GasContent:
    """Trapped gas and stiffness of the oil, eq. (28), over all settings.

    Attributes
    ----------
    volume_ratio : float
        V_r, trapped gas over oil at the working pressure, dimensionless.
    stiffness : float
        K_B/C, bulk modulus of oil and tube without gas, Pa.
    volume_ratio_interval, stiffness_interval : Interval
        Their errors and 95 % intervals, as those of any shared parameter.
    correlation : float
        Of their logarithms.
    pressures : mapping of Setting to float
        Mean working pressure by setting, absolute, Pa.
    rises : mapping of Setting to float
        Misfit above that with a K_e of each setting's own, in units of the noise: 1 on average
        where the law holds.
    """

    volume_ratio: float
    stiffness: float
    volume_ratio_interval: Interval
    stiffness_interval: Interval
    correlation: float
    pressures: Mapping[Setting, float]
    rises: Mapping[Setting, float]

    @property
    def sentence(self) -> str:
        """For people."""
        gas, oil = self.volume_ratio_interval, self.stiffness_interval
        return (
            f"gas content: V_r = {100.0 * self.volume_ratio:.3g} % of the oil's volume (95 % from "
            f"{100.0 * gas.low:.3g} to {100.0 * gas.high:.3g} %) at the working pressure, K_B/C = "
            f"{self.stiffness / 1e6:.4g} MPa ({oil.low / 1e6:.4g} to {oil.high / 1e6:.4g} MPa)"
        )


def gas_content(linearised: Sequence[Linearisation], sharing: Sharing) -> GasContent | None:
    """Return the gas content of a campaign; None where K_e was not to follow from one.

    Parameters
    ----------
    linearised : sequence of Linearisation
        Of all settings.
    sharing : Sharing
        The law, and what was shared beside it.
    """
    law = sharing.gas
    if law is None:
        return None
    covariance = shared_covariance(linearised, sharing)[-len(GAS_NAMES) :, -len(GAS_NAMES) :]
    errors = np.sqrt(np.diag(covariance))
    values = zip((law.volume_ratio, law.stiffness), errors, strict=True)
    gas, oil = (make_interval(value, float(error)) for value, error in values)
    return GasContent(
        volume_ratio=law.volume_ratio,
        stiffness=law.stiffness,
        volume_ratio_interval=gas,
        stiffness_interval=oil,
        correlation=float(covariance[0, 1] / np.prod(errors)),
        pressures=dict(law.pressures),
        rises=dict(sharing.gas_rises),
    )
