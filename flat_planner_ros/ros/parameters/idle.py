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

"""Parameters that matter with some strategies only, and are given beside another one."""

from collections.abc import Iterable, Iterator
from types import MappingProxyType

from flat_planner_ros.core.motion_law import Strategy

WITH_EFFORT = (Strategy.MIN_CONTROL_EFFORT, Strategy.MIXED)
WITH_ENERGY = (Strategy.MIN_POTENTIAL_ENERGY, Strategy.MIXED)

READERS = MappingProxyType(
    {
        'weights.effort': WITH_EFFORT,
        'weights.r': WITH_EFFORT,
        'weights.energy': WITH_ENERGY,
        'weights.p': WITH_ENERGY,
        'weights.Q': (Strategy.CUSTOM,),
        'insensitivity.nominal': (Strategy.INSENSITIVE,),
        'insensitivity.criterion': (Strategy.INSENSITIVE,),
        'insensitivity.weight': (Strategy.INSENSITIVE,),
        'insensitivity.max_effort_rms': (Strategy.INSENSITIVE,),
        'insensitivity.max_residual': (Strategy.INSENSITIVE,),
        'insensitivity.modes': (Strategy.INSENSITIVE,),
        'peak.intervals': (Strategy.MIN_PEAK_EFFORT,),
        'peak.effort_rate': (Strategy.MIN_PEAK_EFFORT,),
        'peak.insensitive': (Strategy.MIN_PEAK_EFFORT,),
    }
)
"""Strategies by the parameters that they alone look at."""


def idle_parameters(names: Iterable[str], strategy: Strategy) -> Iterator[str]:
    """
    Return a sentence on every parameter that a strategy does not look at.

    Parameters
    ----------
    names
        Parameters that somebody has given on purpose.
    strategy
        In use.

    """
    for name in names:
        readers = READERS.get(name, (strategy,))
        if strategy not in readers:
            known = ' or '.join(reader.value for reader in readers)
            yield f'{name} has no effect with strategy {strategy.value}, only with {known}'
