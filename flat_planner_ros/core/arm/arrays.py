# Copyright 2026 flat_planner_ros developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Arrays and numbers: checked and locked, and linear algebra of one vector or of a stack."""

from collections.abc import Callable
from functools import cache
from math import inf, isfinite
from typing import Any, TypeVar

from flat_planner_ros.core.arm.errors import FlatPlannerError, InvalidModel
import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
"""Values in double precision, of any shape."""

ComplexArray = npt.NDArray[np.complex128]
"""The same for complex values."""

AnyArray = TypeVar('AnyArray', bound=npt.NDArray[Any])


def locked(array: AnyArray) -> AnyArray:
    """Return the very same array, which nobody can write to any more."""
    array.setflags(write=False)
    return array


def checked_array(
    name: str,
    values: npt.ArrayLike,
    unit: str,
    *,
    shape: tuple[int, ...] | None = None,
    lower: float = -inf,
    error: type[FlatPlannerError] = InvalidModel,
) -> FloatArray:
    """
    Return a locked copy of finite numbers.

    Parameters
    ----------
    name, values, unit
        What an error calls them, the numbers, and their unit.
    shape
        Shape that they must have; any by default.
    lower
        Least number that is allowed.
    error
        What is raised, with the first thing that is wrong.

    """
    array = np.array(values, dtype=float, order='C')
    if shape is not None and array.shape != shape:
        wanted = f'{shape[0]} entries' if len(shape) == 1 else f'shape {shape}'
        raise error(f'{name} must have {wanted}, got shape {array.shape}')
    is_finite = np.isfinite(array)
    if not is_finite.all():
        raise error(f'{name} must be finite, got {array[~is_finite][0]} {unit}')
    if (array < lower).any():
        raise error(f'{name} must be at least {lower:g} {unit}, got {array.min():g}')
    return locked(array)


def check_number(
    name: str,
    value: float,
    unit: str,
    *,
    above: float = -inf,
    lower: float = -inf,
    error: type[FlatPlannerError] = InvalidModel,
) -> None:
    """
    Refuse a number that is not finite, or not above one bound, or below another.

    Parameters
    ----------
    name, value, unit
        What an error calls it, the number, and its unit.
    above, lower
        It must be larger than the first and at least the second.
    error
        What is raised.

    """
    if isfinite(value) and value > above and value >= lower:
        return
    if above > -inf:
        raise error(f'{name} must be finite and above {above:g} {unit}, got {value:g}')
    if lower > -inf:
        raise error(f'{name} must be finite and at least {lower:g} {unit}, got {value:g}')
    raise error(f'{name} must be finite, got {value} {unit}')


def applied(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """Return the product of a matrix (..., n, n) with each vector (..., n), shape (..., n)."""
    # The first case is what simulations ask for, 4000 times per simulated second.
    product: FloatArray = (
        matrix.dot(vector) if vector.ndim == 1 else (matrix @ vector[..., None])[..., 0]
    )
    return product


def times_matrix(vector: FloatArray, matrix: FloatArray) -> FloatArray:
    """Return the product of each vector (..., n) with one matrix (n, n), shape (..., n)."""
    product: FloatArray = vector.dot(matrix)
    return product


def solved(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """
    Return the solutions of linear systems, shape (..., n).

    Parameters
    ----------
    matrix
        Symmetric and positive definite, shape (..., n, n); what it holds may be lost.
    vector
        Right-hand sides, shape (..., n).

    """
    if vector.ndim == 1:
        # A quarter of the time of numpy's, which looks after stacks; symmetric: .T is a view.
        solution: FloatArray = _positive_definite_solver()(matrix.T, vector, overwrite_a=1)[1]
        return solution
    return np.asarray(np.linalg.solve(matrix, vector[..., None])[..., 0], dtype=float)


@cache
def _positive_definite_solver() -> Callable[..., tuple[FloatArray, FloatArray, int]]:
    """Return LAPACK's dposv; slow to import, and only arms with coupled links need it."""
    from scipy.linalg.lapack import dposv

    return dposv  # type: ignore[no-any-return]


def last_of(values: FloatArray) -> FloatArray:
    """Return the last entry of each vector (..., n), shape (...)."""
    # A scalar, not an array without axes: ten times faster in what follows.
    last: FloatArray = values[-1] if values.ndim == 1 else values[..., -1]
    return last
