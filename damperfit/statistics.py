"""Quantiles that several layers judge by."""

__all__ = ["CHI_SQUARED_95", "NORMAL_95"]

# Within so many standard errors lie 95 of 100 normal values.
NORMAL_95 = 1.959964
# Below lies a chi-square of one freedom in 95 of 100 cases: NORMAL_95 squared.
CHI_SQUARED_95 = 3.84
