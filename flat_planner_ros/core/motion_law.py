"""
Motion law: the planned function of time, and every derivative of it, as a sum of modes.

A mode is an exponential (growing or decaying, perhaps oscillating) times a polynomial: the general
solution of a linear equation with constant coefficients ((24) of docs/derivation.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True, eq=False)
class Mode:
    """
    Real part of exp(rate (x - origin)) * sum_k coefficients[k] (x - origin)^k.

    Normalised time x runs from -1 to 1. The origin is the end where the mode is largest, so that
    no exponential overflows.

    Attributes
    ----------
    rate
        Characteristic root in units of 2 / duration [-].
    origin
        -1, 0 or 1 [-].
    coefficients
        Of ascending powers, shape (k,) [rad].

    """

    rate: complex
    origin: int
    coefficients: ComplexArray

    def __post_init__(self) -> None:
        """Lock the coefficients."""
        self.coefficients.setflags(write=False)

    def mirrored(self, sign: float) -> 'Mode':
        """Return sign times the mode run backwards, x -> -x."""
        alternating = sign * (-1.0) ** np.arange(len(self.coefficients))
        return Mode(
            rate=-self.rate,
            origin=-self.origin,
            coefficients=alternating * self.coefficients,
        )

    def scaled(self, factor: float) -> 'Mode':
        """Return factor times the mode."""
        return Mode(rate=self.rate, origin=self.origin, coefficients=factor * self.coefficients)

    def derivatives(self, order: int) -> ComplexArray:
        """Return the coefficients of the derivatives in x, shape (k, order + 1)."""
        table = np.empty((len(self.coefficients), order + 1), dtype=complex)
        table[:, 0] = self.coefficients
        powers = np.arange(1, len(self.coefficients))
        for column in range(1, order + 1):
            table[:, column] = self.rate * table[:, column - 1]
            table[:-1, column] += powers * table[1:, column - 1]
        return table


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionLaw:
    """
    A function of time on [0, duration], infinitely smooth.

    Attributes
    ----------
    duration
        Length of the motion [s].
    modes
        Their sum is the value [rad].

    """

    duration: float
    modes: tuple[Mode, ...]

    def __call__(self, t: ArrayLike, order: int = 0) -> FloatArray:
        """
        Return a derivative with respect to time.

        Parameters
        ----------
        t
            Times from the start of the motion [s], shape (m,).
        order
            Which derivative; 0 is the value itself.

        Returns
        -------
        FloatArray
            The derivative, shape (m,) [rad/s^order].

        """
        derivative: FloatArray = self.jet(t, order)[order]
        return derivative

    def jet(self, t: ArrayLike, order: int) -> FloatArray:
        """
        Return the value and its derivatives up to an order.

        Parameters
        ----------
        t
            Times from the start of the motion, shape (m,) [s].
        order
            Highest derivative wanted.

        Returns
        -------
        FloatArray
            Row k holds the k-th derivative, shape (order + 1, m) [rad/s^k].

        """
        times = np.atleast_1d(np.asarray(t, dtype=float))
        rate = 2.0 / self.duration
        # Both distances are formed from t: a boundary layer may be far thinner than the spacing
        # of floating-point numbers near x = 1.
        table = normalised_jet(self.modes, rate * times, rate * (self.duration - times), order)
        result: FloatArray = table * (rate ** np.arange(order + 1.0))[:, None]
        return result

    def transformed(self, factor: float, offset: float) -> 'MotionLaw':
        """Return offset + factor times this law."""
        constant = Mode(rate=0j, origin=0, coefficients=np.array([complex(offset)]))
        scaled = (mode.scaled(factor) for mode in self.modes)
        return MotionLaw(duration=self.duration, modes=(constant, *scaled))


def normalised_jet(
    modes: Sequence[Mode], after_start: FloatArray, before_end: FloatArray, order: int
) -> FloatArray:
    """
    Return the sum of modes and its derivatives with respect to x.

    Parameters
    ----------
    modes
        The terms.
    after_start, before_end
        x + 1 and 1 - x, both exact, shape (m,).
    order
        Highest derivative wanted.

    Returns
    -------
    FloatArray
        Row k holds the k-th derivative, shape (order + 1, m).

    """
    offsets = {-1: after_start, 0: 0.5 * (after_start - before_end), 1: -before_end}
    result = np.zeros((order + 1, len(after_start)))
    for origin, offset in offsets.items():
        pure = [m for m in modes if m.origin == origin and len(m.coefficients) == 1]
        if pure:
            rates = np.array([mode.rate for mode in pure])
            amplitudes = np.concatenate([mode.derivatives(order) for mode in pure])
            result += np.real(np.exp(np.outer(offset, rates)) @ amplitudes).T
    for mode in modes:
        if len(mode.coefficients) > 1:
            offset = offsets[mode.origin]
            values = np.polynomial.polynomial.polyval(offset, mode.derivatives(order))
            result += np.real(values * np.exp(mode.rate * offset) if mode.rate else values)
    return result
