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

"""Models whose numbers no arm of this kind has: most likely given in another unit."""

from collections.abc import Iterator
from math import pi

from flat_planner_ros.core.arm import Drive, PlanarArm
from flat_planner_ros.ros.parameters.arm_model import arm_of, links_of
from flat_planner_ros.ros.parameters.row import Values

FREQUENCIES = (0.1, 50.0)
"""Natural frequencies for which motion laws are accurate [Hz] (README.md)."""

DAMPING_RATIO = 0.3
"""Largest damping ratio for which they are [-]."""

INERTIA_UNITS = {'kg mm^2': 1e-6, 'g m^2': 1e-3, 'g cm^2': 1e-7, 'g mm^2': 1e-9}
"""Units in which inertias are given elsewhere, the usual ones first [kg m^2]."""

LARGEST = {
    'link_length': (10.0, 'm', 'mm', 1e-3),
    'link_com': (10.0, 'm', 'mm', 1e-3),
    'counterbalance_arm': (10.0, 'm', 'mm', 1e-3),
    'link_mass': (1e3, 'kg', 'g', 1e-3),
    'counterbalance_mass': (1e3, 'kg', 'g', 1e-3),
}
"""Largest number of a robot's link, its unit, and the unit in which more is likely given."""


def doubts(values: Values) -> Iterator[str]:
    """
    Return a sentence on everything about a model that looks like a mistake.

    Parameters
    ----------
    values
        A valid nominal model.

    """
    links = links_of(values)
    for name, (largest, unit, other, factor) in LARGEST.items():
        numbers = links.get(name, ())
        worst = max(map(abs, numbers), default=0.0)
        if worst > largest:
            yield (
                f'model.{name} has {worst:g} {unit}, more than {largest:g} {unit}; if that is in '
                f'{other}, write {worst * factor:g}'
            )
    _, arm = arm_of(values)
    is_held = Drive(values.get('drive', Drive.EFFORT.value)) is Drive.POSITION
    yield from _doubts_of_mode(arm, is_held)


def _doubts_of_mode(arm: PlanarArm, is_held: bool) -> Iterator[str]:
    """Return what is strange about the oscillation of the passive joint."""
    mode = arm.natural_mode(held=is_held)
    frequency = mode.frequency / (2 * pi)
    low, high = FREQUENCIES
    if not low <= frequency <= high:
        yield (
            f'the natural frequency of this model is {frequency:.3g} Hz, outside {low:g} to '
            f'{high:g} Hz: stiffness {arm.stiffness:g} N m/rad, inertias '
            f'{arm.inertia_star.both:g} and {arm.inertia_star.last:g} kg m^2'
            f'{_likely_unit(arm, frequency)}'
        )
    if mode.damping_ratio > DAMPING_RATIO:
        yield (
            f'the damping ratio of this model is {mode.damping_ratio:.3g}, more than '
            f'{DAMPING_RATIO:g}: damping {arm.damping:g} N m s/rad'
        )


def _likely_unit(arm: PlanarArm, frequency: float) -> str:
    """Return in which unit inertias that are too large give a frequency within the range."""
    low, high = FREQUENCIES
    for unit, factor in INERTIA_UNITS.items():
        if frequency < low and low <= frequency / factor**0.5 <= high:
            both, last = (factor * inertia for inertia in arm.inertia_star)
            return f'; if the inertias are in {unit}, write [{both:g}, {last:g}]'
    return ''
