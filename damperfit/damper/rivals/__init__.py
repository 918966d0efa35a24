"""Models of the literature, ranked beside the physical ones."""

from damperfit.damper.rivals.biviscous import Biviscous
from damperfit.damper.rivals.bouc_wen import BoucWen
from damperfit.damper.rivals.curves import Degressive, FourSlopes
from damperfit.damper.rivals.elastic_dashpot import (
    BesingerCebonCole,
    HagedornWallaschek,
    KaradayiMasada,
    SuraceWordenTomlinson,
)
from damperfit.damper.rivals.kwok import Kwok
from damperfit.damper.rivals.linear import Bilinear, Linear
from damperfit.damper.rivals.polynomials import (
    PolynomialInSpeed,
    PolynomialInStrokeAndSpeed,
    RestoringForceSurface,
)
from damperfit.damper.rivals.rival import Rival

__all__ = [
    "RIVALS",
    "BesingerCebonCole",
    "Bilinear",
    "Biviscous",
    "BoucWen",
    "Degressive",
    "FourSlopes",
    "HagedornWallaschek",
    "KaradayiMasada",
    "Kwok",
    "Linear",
    "PolynomialInSpeed",
    "PolynomialInStrokeAndSpeed",
    "RestoringForceSurface",
    "Rival",
    "SuraceWordenTomlinson",
]

RIVALS: tuple[type[Rival], ...] = (
    Linear,
    Bilinear,
    PolynomialInSpeed,
    PolynomialInStrokeAndSpeed,
    RestoringForceSurface,
    Degressive,
    FourSlopes,
    KaradayiMasada,
    HagedornWallaschek,
    SuraceWordenTomlinson,
    BesingerCebonCole,
    BoucWen,
    Biviscous,
    Kwok,
)
