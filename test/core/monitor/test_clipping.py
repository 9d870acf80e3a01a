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

"""Efforts that something clips are told from those that are played, and from a swing."""

from flat_planner_ros.core.monitor.clipping import clipped_remark
from flat_planner_ros.core.monitor.motion_record import PlannedMotion
import numpy as np
import pytest

TIMES = np.linspace(0.0, 1.0, 101)
PLANNED = 0.02 * np.sin(2.0 * np.pi * TIMES)
MOTION = PlannedMotion(
    joint_names=('joint1', 'joint2'),
    start=10.0,
    times=TIMES,
    positions=np.zeros((101, 2)),
    efforts=np.stack((PLANNED, np.zeros(101)), axis=-1),
)


def said(measured, motion=MOTION):
    """Return the remark on efforts of joint 1 that were measured at the points of the plan."""
    efforts = np.stack((measured, np.full(101, np.nan)), axis=-1)
    return clipped_remark(motion, 10.0 + TIMES, efforts)


def noise(size):
    return size * np.random.default_rng(1).normal(size=101)


@pytest.mark.parametrize('sensor', [0.0, 5e-5])
@pytest.mark.parametrize('bound', [0.018, 0.012, 0.004])
def test_a_bound_on_the_effort_is_told(bound, sensor):
    assert said(np.clip(PLANNED, -bound, bound) + noise(sensor)).startswith(
        'the effort of joint1 was clipped at 0.0'
    )
    assert 'N m, 0.02 N m were planned' in said(np.clip(PLANNED, -bound, bound))


@pytest.mark.parametrize(
    'measured',
    [
        PLANNED,
        PLANNED + noise(1e-3),
        0.8 * PLANNED,  # another calibration
        PLANNED + 5e-3 * np.sin(40.0 * TIMES),  # a controller that corrects
        np.clip(PLANNED, -0.0199, 0.0199),
        np.full(101, np.nan),
        np.zeros(101),
    ],
    ids=['played', 'noise', 'less', 'corrected', 'hardly', 'not measured', 'nothing'],
)
def test_nothing_is_said_of_other_efforts(measured):
    assert said(measured) == ''


def test_nothing_is_said_without_planned_efforts():
    bare = PlannedMotion(
        joint_names=MOTION.joint_names, start=10.0, times=TIMES, positions=MOTION.positions
    )
    assert said(np.clip(PLANNED, -0.01, 0.01), bare) == ''
