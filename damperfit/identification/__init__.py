"""From traces to parameters: residuals, starting values, one setting's fit, the campaign."""

from damperfit.identification.campaign import PROCEDURES, Campaign, identify
from damperfit.identification.failures import SettingFailure
from damperfit.identification.given_start import GivenStart, check_start
from damperfit.identification.model_versus_log import Comparison, compare, normalised_mse
from damperfit.identification.multistart import Search, Valley, describe_searches
from damperfit.identification.options import DETECT, FitOptions, check_options, shared_names
from damperfit.identification.outcome import Outcome, Status
from damperfit.identification.setting import Fit, LogFit
from damperfit.identification.sharing import Sharing
from damperfit.identification.unseen import put_together

__all__ = [
    "DETECT",
    "PROCEDURES",
    "Campaign",
    "Comparison",
    "Fit",
    "FitOptions",
    "GivenStart",
    "LogFit",
    "Outcome",
    "Search",
    "SettingFailure",
    "Sharing",
    "Status",
    "Valley",
    "check_options",
    "check_start",
    "compare",
    "describe_searches",
    "identify",
    "normalised_mse",
    "put_together",
    "shared_names",
]
