"""From traces to parameters: the problem of one setting or of several, its fit, the campaign."""

from damperfit.door import door

__getattr__ = door(
    __name__, "procedures", "options", "outcome", "sharing", "logs", "fit_setting", "fit_problem"
)
