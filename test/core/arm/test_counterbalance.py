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

"""Counterbalances: computed, advised, lost."""

import re

from flat_planner_ros.core.arm.counterbalance import (
    counterbalances,
    displaced_com,
    suggest_counterbalances,
)
from flat_planner_ros.core.arm.errors import InvalidModel, NotFlat
from flat_planner_ros.core.arm.planar_arm import PlanarArm
import numpy as np
import pytest

SIZES = [2, 3, 4, 5, 6, 7]


def links_of(n):
    """Return links with their centres of mass beyond the joints."""
    rng = np.random.default_rng(n)
    return {
        'link_length': rng.uniform(0.2, 0.5, n),
        'link_com': rng.uniform(0.05, 0.3, n),
        'link_mass': rng.uniform(0.1, 0.8, n),
    }


def arm_with(links, mass, arm):
    """Return an arm with counterbalances."""
    return PlanarArm.from_links(
        **links,
        link_inertia=np.full(len(links['link_mass']), 1e-3),
        counterbalance_mass=mass,
        counterbalance_arm=arm,
        stiffness=1.0,
        damping=0.0,
    )


def moments(links, mass, arm):
    """Return the static moments of the last two links from every mass and its place."""
    length, com, own = (links[name] for name in ('link_length', 'link_com', 'link_mass'))
    last = own[-1] * com[-1] - mass[1] * arm[1]
    inner = own[-2] * com[-2] - mass[0] * arm[0] + (own[-1] + mass[1]) * length[-2]
    return inner, last


@pytest.mark.parametrize('n', SIZES)
@pytest.mark.parametrize('given', [{'mass': [0.9, 0.3]}, {'arm': [0.12, 0.05]}])
def test_counterbalances_make_an_arm_flat(n, given):
    links = links_of(n)
    with pytest.raises(NotFlat):
        arm_with(links, [0.9, 0.3], [0.12, 0.05]).check_flat()
    found = counterbalances(**links, **given)
    for name, values in given.items():
        np.testing.assert_array_equal(getattr(found, name), values)
    np.testing.assert_allclose(moments(links, *found), 0.0, atol=1e-15)
    arm_with(links, *found).check_flat()


def test_the_last_counterbalance_rides_on_the_link_before():
    """Twice its mass at half its arm takes more of the other one."""
    links = links_of(3)
    light, heavy = (counterbalances(**links, arm=[0.1, arm]) for arm in (0.1, 0.05))
    more = heavy.mass[1] - light.mass[1]
    assert more == pytest.approx(light.mass[1])
    assert heavy.mass[0] - light.mass[0] == pytest.approx(more * links['link_length'][1] / 0.1)


@pytest.mark.parametrize('n', SIZES)
def test_the_remedy_is_one(n):
    """Both ways that the sentence offers make the arm flat as they are printed."""
    links, mass, arm = links_of(n), [0.5, 0.2], [0.15, 0.06]
    text = suggest_counterbalances(**links, counterbalance_mass=mass, counterbalance_arm=arm)
    offers = re.findall(r'counterbalance_(mass|arm) = \[(\S+), (\S+)\]', text)
    assert [name for name, *_ in offers] == ['arm', 'mass']
    for name, *numbers in offers:
        mended = {'mass': mass, 'arm': arm, name: [float(number) for number in numbers]}
        arm_with(links, mended['mass'], mended['arm']).check_flat()


@pytest.mark.parametrize('n', SIZES)
def test_an_arm_without_counterbalances_is_suggested_some(n):
    links = links_of(n)
    text = suggest_counterbalances(
        **links, counterbalance_mass=[0.0, 0.0], counterbalance_arm=[0.0, 0.0]
    )
    offers = {
        name: [float(x) for x in numbers]
        for name, *numbers in re.findall(
            r'counterbalance_(mass|arm) = \[([^,]+), ([^\]]+)\]', text
        )
    }
    assert offers['arm'] == pytest.approx(links['link_length'][-2:] / 4)
    arm_with(links, offers['mass'], offers['arm']).check_flat()


def test_the_remedy_leaves_out_what_is_impossible():
    links = links_of(3)
    text = suggest_counterbalances(
        **links, counterbalance_mass=[0.5, 0.2], counterbalance_arm=[0.15, 0.0]
    )
    assert 'counterbalance_arm = [' in text
    assert 'counterbalance_mass = [' not in text
    links['link_com'][-1] = -0.1
    text = suggest_counterbalances(
        **links, counterbalance_mass=[0.5, 0.2], counterbalance_arm=[0.15, 0.1]
    )
    assert text == 'no counterbalance behind the joints can balance it'


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'mass': None}, 'either the masses'),
        ({'arm': [0.1, 0.1]}, 'either the masses'),
        ({'mass': [0.5, 0.0]}, 'link 3 must have mass above 0'),
        ({'mass': None, 'arm': [0.0, 0.1]}, 'link 2 must have arm above 0'),
        ({'mass': [0.5, -0.1]}, 'counterbalance_mass must be at least 0'),
        ({'link_com': [0.1, 0.1, -0.02]}, 'link 3 has its centre of mass 0.02 m behind joint 3'),
        ({'link_com': [0.1, 0.1]}, 'link_com must have 3 entries'),
        ({'link_length': [0.1]}, 'at least 2 links'),
    ],
)
def test_refuses_what_cannot_be_balanced(change, message):
    good = {**links_of(3), 'mass': [0.5, 0.2]}
    counterbalances(**good)
    with pytest.raises(InvalidModel, match=message):
        counterbalances(**{**good, **change})


def test_a_balanced_link_needs_no_counterbalance():
    links = {**links_of(2), 'link_com': [0.0, 0.0], 'link_length': [0.0, 0.2]}
    for given in ({'mass': [0.0, 0.0]}, {'arm': [0.0, 0.0]}):
        found = counterbalances(**links, **given)
        np.testing.assert_array_equal(found, 0.0)


@pytest.mark.parametrize('n', SIZES)
@pytest.mark.parametrize('imbalance', [(1e-3, 0.0), (0.0, -2e-3), (1e-3, 4e-3)])
def test_lost_balance_is_the_static_moment_asked_for(n, imbalance):
    links = links_of(n)
    found = counterbalances(**links, arm=[0.1, 0.1])
    com = displaced_com(links['link_com'], links['link_mass'], imbalance)
    arm = arm_with({**links, 'link_com': com}, *found)
    np.testing.assert_allclose(arm.static_moment[-2:], imbalance, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(com[:-2], links['link_com'][:-2])
    with pytest.raises(NotFlat):
        arm.check_flat()


def test_refuses_to_displace_nothing():
    with pytest.raises(InvalidModel, match='link 2 has no mass'):
        displaced_com([0.1, 0.1], [0.1, 0.0], [0.0, 1e-3])
    np.testing.assert_array_equal(displaced_com([0.1, 0.1], [0.1, 0.0], [0.0, 0.0]), 0.1)
