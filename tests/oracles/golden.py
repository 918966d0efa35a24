"""Known forces and pressures of the standard test, found by two independent implementations.

R_m3 2.597e6, f_f 50, P_0 4.6e5, gamma 1.4, fourth cycle from rest; x = 0.032 sin(2 pi phase).
"""

from damperfit.damper.purdy.parameters import Parameters

PHASES = (0.1, 0.2, 0.4, 0.6, 0.9)


def _set(r_m1: float, r_m2: float, k_e: float) -> Parameters:
    return Parameters(r_m1=r_m1, r_m2=r_m2, r_m3=2.597e6, k_e=k_e, f_f=50.0)


SET_M = _set(1.8e4, 3.527e6, 3.65e8)

# Parameters, then force (N), P_1, P_2, P_3 (bar) at each phase.
GOLDEN = (
    (
        _set(1.2e4, 1.5e6, 2.4e8),
        (
            (368.48, 10.7635, 0.9875, 4.1077),
            (53.30, 4.8305, 2.6319, 3.8478),
            (-382.12, 7.7371, 9.5046, 4.0831),
            (-439.10, 9.6212, 11.4444, 5.1678),
            (318.08, 11.3577, 2.1075, 5.1986),
        ),
    ),
    (
        SET_M,
        (
            (673.35, 19.3538, 0.9808, 4.0985),
            (98.41, 6.1143, 2.6379, 3.8447),
            (-651.20, 11.9179, 16.0451, 4.0720),
            (-769.65, 15.6614, 19.9817, 5.1492),
            (581.15, 18.7484, 2.0898, 5.1882),
        ),
    ),
    (
        _set(3.0e4, 8.293e6, 4.54e8),
        (
            (1745.22, 49.5604, 0.9602, 4.0771),
            (267.65, 10.8895, 2.6379, 3.8412),
            (-1291.08, 22.4560, 31.9300, 4.0424),
            (-1776.15, 37.5798, 47.9358, 5.0735),
            (1338.13, 40.0526, 2.0594, 5.1604),
        ),
    ),
)
