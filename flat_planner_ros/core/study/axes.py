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

"""
Axes of a study: what its rows vary, in turn or at random, each row known by its number alone.

Random numbers come from a counter: one stream per axis, keyed by the seed and the axis's name, and
in it one place per repetition. So a row can be had without those before it, an axis that is added
changes nothing of the others, and all combinations of the other axes meet the same random numbers:
what is compared is compared on the same arms.
"""

from dataclasses import dataclass
from enum import Enum
from hashlib import blake2b
from math import inf, isfinite, log, prod
from typing import Any

from flat_planner_ros.core.arm import FlatPlannerError, FloatArray
import numpy as np
from numpy.typing import NDArray

Column = NDArray[Any]
"""One value per row: floats where all are numbers, else objects."""

BLOCK = 4
"""Numbers of 64 bits that Philox makes at once."""

MANTISSA = 53
"""Bits of a share."""

MOST_ROWS = 10**9
"""Rows of a study: more would never end."""


class InvalidStudy(FlatPlannerError):
    """What is asked of a study has no meaning; the message says what would have."""


class Distribution(Enum):
    """How a random axis spreads."""

    UNIFORM = 'uniform'
    """Evenly between two numbers."""

    LOGUNIFORM = 'loguniform'
    """Evenly in the logarithm between two numbers above 0."""

    NORMAL = 'normal'
    """By Gauss, about a mean with a standard deviation."""

    CHOICE = 'choice'
    """One of some values, each as likely."""


@dataclass(frozen=True, kw_only=True)
class Turns:
    """
    Values that are taken in turn.

    Attributes
    ----------
    names
        What is set, one thing or several together.
    values
        In their order, each with one entry per name.

    """

    names: tuple[str, ...]
    values: tuple[tuple[Any, ...], ...]

    def __post_init__(self) -> None:
        """Refuse an axis without values."""
        if not self.values:
            raise InvalidStudy(f'the axis {", ".join(self.names)} has no values')

    def columns(self, places: NDArray[np.int64]) -> dict[str, Column]:
        """Return the values at some places, by name."""
        return {
            name: column(values)[places]
            for name, values in zip(self.names, zip(*self.values, strict=True), strict=True)
        }


@dataclass(frozen=True, kw_only=True)
class Draws:
    """
    Values that are drawn at random.

    Attributes
    ----------
    name
        What is set.
    distribution
        How they spread.
    spread
        Its two numbers, or the values of a choice.

    """

    name: str
    distribution: Distribution
    spread: tuple[Any, ...]

    def __post_init__(self) -> None:
        """Refuse numbers that describe no distribution."""
        kind, given = self.distribution, self.spread
        if kind is Distribution.CHOICE:
            if not given:
                raise InvalidStudy(f'{self.name}: a choice needs values')
            return
        if len(given) != 2 or not all(isfinite(number) for number in given):
            raise InvalidStudy(f'{self.name}: {kind.value} needs two numbers, got {list(given)}')
        first, second = given
        least = {Distribution.LOGUNIFORM: 0.0}.get(kind, -inf)
        if kind is Distribution.NORMAL and second < 0.0:
            raise InvalidStudy(f'{self.name}: a standard deviation is not below 0, got {second:g}')
        if kind is not Distribution.NORMAL and not least < first <= second:
            raise InvalidStudy(
                f'{self.name}: {kind.value} needs the lower number first'
                f'{", above 0" if least == 0.0 else ""}, got {first:g} and {second:g}'
            )

    def column(self, seed: int, first: int, stop: int) -> Column:
        """Return the values of the repetitions from one to before another."""
        shares = shares_of(seed, self.name, first, stop)
        if self.distribution is Distribution.CHOICE:
            places = (shares * len(self.spread)).astype(np.int64)
            return column(self.spread)[places]
        a, b = self.spread
        if self.distribution is Distribution.UNIFORM:
            return np.asarray(a + (b - a) * shares)
        if self.distribution is Distribution.LOGUNIFORM:
            return np.asarray(np.exp(log(a) + (log(b) - log(a)) * shares))
        # Imported here: it takes longer than a plan.
        from scipy.special import ndtri

        return np.asarray(a + b * ndtri(shares))


@dataclass(frozen=True, kw_only=True)
class Axes:
    """
    All axes of a study; its rows are their combinations.

    Attributes
    ----------
    turns
        Axes that are taken in turn; the last one changes fastest.
    draws
        Axes that are drawn anew for each repetition, the same for all combinations.
    repeats
        Rows for each combination of the first.
    seed
        Of the random numbers, at least 0.

    """

    turns: tuple[Turns, ...] = ()
    draws: tuple[Draws, ...] = ()
    repeats: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse two axes of one thing, and numbers of rows without meaning."""
        for name in self.names:
            if self.names.count(name) > 1:
                raise InvalidStudy(f'{name} is set by two axes')
        if not (self.repeats >= 1 and self.count <= MOST_ROWS):
            raise InvalidStudy(
                f'a study has 1 to {MOST_ROWS:g} rows, got {self.repeats} for each of '
                f'{self.count // max(self.repeats, 1)} combinations'
            )
        if not 0 <= self.seed < 2**63:
            raise InvalidStudy(f'seed must be from 0 to below 2^63, got {self.seed}')

    @property
    def names(self) -> tuple[str, ...]:
        """Return what is set, in the order of the axes."""
        taken = [name for axis in self.turns for name in axis.names]
        return (*taken, *(axis.name for axis in self.draws))

    @property
    def count(self) -> int:
        """Return the number of rows."""
        return self.repeats * prod(len(axis.values) for axis in self.turns)

    def columns(self, first: int, stop: int) -> dict[str, Column]:
        """Return the values of the rows from one to before another, by name."""
        if not 0 <= first < stop <= self.count:
            raise InvalidStudy(
                f'there is no row {stop - 1}: the study has rows 0 to {self.count - 1}'
            )
        found: dict[str, Column] = {}
        combination = np.arange(first, stop, dtype=np.int64) // self.repeats
        for axis in reversed(self.turns):
            combination, places = np.divmod(combination, len(axis.values))
            found.update(axis.columns(places))
        for draw in self.draws:
            parts = [draw.column(self.seed, *part) for part in self._repetitions(first, stop)]
            found[draw.name] = np.concatenate(parts)[self._places(first, stop)]
        return {name: found[name] for name in self.names}

    def _repetitions(self, first: int, stop: int) -> list[tuple[int, int]]:
        """Return the numbers of the repetitions that rows are, as runs without those between."""
        if stop - first >= self.repeats:
            return [(0, self.repeats)]
        begin, end = first % self.repeats, (stop - 1) % self.repeats + 1
        return [(begin, end)] if begin < end else [(begin, self.repeats), (0, end)]

    def _places(self, first: int, stop: int) -> NDArray[np.int64]:
        """Return where in these runs each row's repetition is."""
        if stop - first >= self.repeats:
            return np.arange(first, stop, dtype=np.int64) % self.repeats
        return np.arange(stop - first, dtype=np.int64)


def shares_of(seed: int, name: str, first: int, stop: int) -> FloatArray:
    """
    Return one random number per place of a stream, evenly in (0, 1).

    Parameters
    ----------
    seed, name
        Which stream.
    first, stop
        Places from one to before another.

    References
    ----------
    Philox 4x64: Salmon et al., Parallel random numbers: as easy as 1, 2, 3, SC11.

    """
    word = int.from_bytes(blake2b(name.encode(), digest_size=8).digest(), 'little')
    begin = first // BLOCK
    stream = np.random.Philox(
        key=np.array([seed, word], dtype=np.uint64),
        counter=np.array([begin, 0, 0, 0], dtype=np.uint64),
    )
    numbers = stream.random_raw(stop - BLOCK * begin)[first - BLOCK * begin :]
    # In the middle of equal parts: neither 0 nor 1 is met.
    shares = ((numbers >> np.uint64(64 - MANTISSA + 1)) + 0.5) * 0.5 ** (MANTISSA - 1)
    return np.asarray(shares, dtype=float)


def column(values: tuple[Any, ...]) -> Column:
    """Return values as an array, of floats where all are floats."""
    if all(type(value) is float for value in values):
        return np.array(values)
    made = np.empty(len(values), dtype=object)
    made[:] = values
    return made
