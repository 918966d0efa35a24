"""The 27 nonlinear regression problems of the NIST Statistical Reference Datasets.

Data, starting values and certified values are NIST's (public domain) and stand in `strd/`; the
models are written here from NIST's formulas, for complex parameters, so that a step along the
imaginary axis gives the Jacobian exactly.
"""

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_FOLDER = Path(__file__).parent / "strd"
# A complex step this small leaves neither truncation nor cancellation.
_STEP = 1e-50


@dataclass(frozen=True)
class Problem:
    """One problem: y = model(x; b) + e."""

    name: str
    difficulty: str
    model: Callable[..., NDArray[np.complex128]]
    predictors: tuple[Array, ...]
    response: Array
    starts: tuple[Array, Array]
    certified: Array
    deviations: Array
    sum_of_squares: float

    @property
    def freedom(self) -> int:
        return len(self.response) - len(self.certified)

    def residuals(self, b: Array) -> Array:
        """Return model minus data, shape (n,)."""
        with np.errstate(all="ignore"):
            return np.asarray(self.model(*self.predictors, *b) - self.response)

    def jacobian(self, b: Array) -> Array:
        """Return the derivative of the residuals by b, shape (n, k)."""
        columns = np.zeros((len(self.response), len(b)))
        with np.errstate(all="ignore"):
            for j in range(len(b)):
                bent = b.astype(complex)
                bent[j] += 1j * _STEP
                columns[:, j] = np.imag(self.model(*self.predictors, *bent)) / _STEP
        return columns


def _arctan(z):
    # NumPy's complex arctan loses small imaginary parts.
    slope = 1.0 / (1.0 + z.real**2)
    return np.arctan(z.real) + (1j * slope * z.imag if np.iscomplexobj(z) else 0.0)


def _polynomial(x, *b):
    return sum(c * x**k for k, c in enumerate(b))


def _gauss(x, b1, b2, b3, b4, b5, b6, b7, b8):
    first = b3 * np.exp(-((x - b4) ** 2) / b5**2)
    return b1 * np.exp(-b2 * x) + first + b6 * np.exp(-((x - b7) ** 2) / b8**2)


def _lanczos(x, b1, b2, b3, b4, b5, b6):
    return b1 * np.exp(-b2 * x) + b3 * np.exp(-b4 * x) + b5 * np.exp(-b6 * x)


def _cubics(x, b1, b2, b3, b4, b5, b6, b7):
    return _polynomial(x, b1, b2, b3, b4) / _polynomial(x, 1.0, b5, b6, b7)


def _seasons(x, b1, b2, b3, b4, b5, b6, b7, b8, b9):
    def wave(period, a, b):
        return a * np.cos(2 * np.pi * x / period) + b * np.sin(2 * np.pi * x / period)

    return b1 + wave(12.0, b2, b3) + wave(b4, b5, b6) + wave(b7, b8, b9)


MODELS: dict[str, Callable[..., NDArray[np.complex128]]] = {
    "Bennett5": lambda x, b1, b2, b3: b1 * (b2 + x) ** (-1.0 / b3),
    "BoxBOD": lambda x, b1, b2: b1 * (1.0 - np.exp(-b2 * x)),
    "Chwirut1": lambda x, b1, b2, b3: np.exp(-b1 * x) / (b2 + b3 * x),
    "Chwirut2": lambda x, b1, b2, b3: np.exp(-b1 * x) / (b2 + b3 * x),
    "DanWood": lambda x, b1, b2: b1 * x**b2,
    "ENSO": _seasons,
    "Eckerle4": lambda x, b1, b2, b3: b1 / b2 * np.exp(-0.5 * ((x - b3) / b2) ** 2),
    "Gauss1": _gauss,
    "Gauss2": _gauss,
    "Gauss3": _gauss,
    "Hahn1": _cubics,
    "Kirby2": lambda x, b1, b2, b3, b4, b5: (
        _polynomial(x, b1, b2, b3) / _polynomial(x, 1.0, b4, b5)
    ),
    "Lanczos1": _lanczos,
    "Lanczos2": _lanczos,
    "Lanczos3": _lanczos,
    "MGH09": lambda x, b1, b2, b3, b4: b1 * (x**2 + x * b2) / (x**2 + x * b3 + b4),
    "MGH10": lambda x, b1, b2, b3: b1 * np.exp(b2 / (x + b3)),
    "MGH17": lambda x, b1, b2, b3, b4, b5: b1 + b2 * np.exp(-x * b4) + b3 * np.exp(-x * b5),
    "Misra1a": lambda x, b1, b2: b1 * (1.0 - np.exp(-b2 * x)),
    "Misra1b": lambda x, b1, b2: b1 * (1.0 - (1.0 + b2 * x / 2.0) ** -2.0),
    "Misra1c": lambda x, b1, b2: b1 * (1.0 - (1.0 + 2.0 * b2 * x) ** -0.5),
    "Misra1d": lambda x, b1, b2: b1 * b2 * x / (1.0 + b2 * x),
    "Nelson": lambda x1, x2, b1, b2, b3: b1 - b2 * x1 * np.exp(-b3 * x2),  # of ln y
    "Rat42": lambda x, b1, b2, b3: b1 / (1.0 + np.exp(b2 - b3 * x)),
    "Rat43": lambda x, b1, b2, b3, b4: b1 / (1.0 + np.exp(b2 - b3 * x)) ** (1.0 / b4),
    "Roszman1": lambda x, b1, b2, b3, b4: b1 - b2 * x - _arctan(b3 / (x - b4)) / np.pi,
    "Thurber": _cubics,
}


@cache
def load(name: str) -> Problem:
    """Return a problem by NIST's name."""
    facts = tomllib.loads((_FOLDER / f"{name.lower()}.toml").read_text(encoding="utf-8"))
    response = np.array(facts["y"])
    return Problem(
        name=name,
        difficulty=facts["difficulty"],
        model=MODELS[name],
        predictors=tuple(np.array(facts[key]) for key in ("x", "x_2") if key in facts),
        response=np.log(response) if name == "Nelson" else response,
        starts=(np.array(facts["start_1"]), np.array(facts["start_2"])),
        certified=np.array(facts["certified"]),
        deviations=np.array(facts["standard_deviation"]),
        sum_of_squares=facts["residual_sum_of_squares"],
    )
