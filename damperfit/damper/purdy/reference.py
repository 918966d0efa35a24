"""What is drawn without logs: the reference set, and the families of curves of figures 4 to 9.

The reference set: synthetic parameters of a damper with twenty settings.

These numbers are this project's own. They are not Purdy's: the paper shows its parameters against
setting only as figures (14 to 16) and prints two numbers, R_m3 = 2.597e6 and f_f = 50 N, which are
used here. R_m1, R_m2 and K_e are smooth formulas chosen so that every qualitative statement of the
paper holds (R_m1 and R_m2 rise ever faster and jump at setting 20, K_e scatters about a rising
quadratic). They serve for samples, examples and tests; never as an answer of a fit.

With k = setting - 1:

    R_m1 = 1.4e4 + 700 k + 45 k^2                   setting 20: 4.9e4     s sqrt(N)/(m kg)
    R_m2 = 2.0e6 exp(0.1 k)                         setting 20: 1.7e7     N s/(m2 kg)
    R_m3 = 2.597e6                                                        N s/(m2 kg)
    K_e  = (5.0e8 + 1.2e7 k + 8e5 k^2) (1 + e_k)                          Pa
    f_f  = 50                                                             N
"""

import math
from typing import NamedTuple

from damperfit.damper.purdy.parameters import Parameters
from damperfit.errors import ConfigurationError

REFERENCE_SETTINGS: tuple[int, ...] = tuple(range(1, 21))

REFERENCE_SOURCE = "reference set shipped with damperfit (synthetic, not measured)"

# Scatter e_k of K_e over the settings, within 15 %.
_SCATTER = (
    *(0.0, 0.08, -0.12, 0.05, -0.06, 0.14, -0.10, 0.02, -0.04, 0.09),
    *(-0.13, 0.11, -0.02, -0.08, 0.15, -0.09, 0.04, 0.12, -0.11, 0.06),
)


def reference_parameters(setting: int) -> Parameters:
    """Return the synthetic parameters of one setting, 1 (softest) to 20; SI, ``f_0`` is 0.

    A `ConfigurationError`: the setting is not one of the twenty.

    Examples
    --------
    >>> reference_parameters(1)
    Parameters(r_m1=14000.0, r_m2=2000000.0, r_m3=2597000.0, k_e=500000000.0, f_f=50.0, f_0=0.0)
    >>> round(reference_parameters(10).r_m1)
    23945
    """
    if setting not in REFERENCE_SETTINGS:
        raise ConfigurationError(
            f"setting {setting} is not in the reference set; expected a whole number, 1 to 20",
            code="no-setting",
        )
    k = REFERENCE_SETTINGS.index(setting)
    r_m1, r_m2 = 1.4e4 + 700.0 * k + 45.0 * k**2, 2.0e6 * math.exp(0.1 * k)
    if setting == REFERENCE_SETTINGS[-1]:  # The last detent shuts the port almost completely.
        r_m1, r_m2 = 4.9e4, 1.7e7
    k_e = (5.0e8 + 1.2e7 * k + 8.0e5 * k**2) * (1.0 + _SCATTER[k])
    return Parameters(r_m1=r_m1, r_m2=r_m2, r_m3=2.597e6, k_e=k_e, f_f=50.0)


class Family(NamedTuple):
    """One family of curves."""

    name: str  # the parameter
    number: int  # of the figure
    factors: tuple[float, ...]  # what the parameter is multiplied with
    of_pressures: int = 0  # number of the figure of its chamber pressures; 0: there is none


FAMILIES = (
    Family("r_m1", 4, (0.8, 1.0, 1.2)),
    Family("r_m2", 5, (0.8, 1.0, 1.2)),
    Family("r_m3", 6, (0.5, 1.0, 1.5), of_pressures=7),
    Family("k_e", 8, (0.2, 1.0, 2.0)),
    Family("f_f", 9, (0.0, 1.0, 2.0)),
)
