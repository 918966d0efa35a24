"""How far each number may be trusted: covariance, intervals, what the residuals say."""

from damperfit.door import door

__getattr__ = door(__name__, "assessment", "covariance", "grades", "profiles", "residuals")
