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
"""Trajectories of a motion planner as goals: the corners of their paths, at their times."""

from dataclasses import replace

from flat_planner_ros.core.session import Goal, GoalPoint, path_goal
import numpy as np
import pytest

JOINTS = ('joint1', 'joint2')


def trajectory(path, *, has_velocities=True):
    """Return a trajectory through poses, one each 10 ms, that is at rest at both ends."""
    rates = np.gradient(np.array(path), 0.01, axis=0)
    rates[[0, -1]] = 0.0
    return Goal(
        joint_names=JOINTS,
        points=tuple(
            GoalPoint(
                time=0.01 * k,
                positions=tuple(pose),
                velocities=tuple(rate) if has_velocities else (),
            )
            for k, (pose, rate) in enumerate(zip(path, rates.tolist(), strict=True))
        ),
    )


def between(*corners, count=60):
    """Return poses on the lines between corners, with speed going up and down on each."""
    shares = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, count))
    parts = [
        np.array(a) + shares[:, None] * (np.array(b) - a)
        for a, b in zip(corners, corners[1:], strict=False)
    ]
    return np.concatenate([parts[0], *(part[1:] for part in parts[1:])]).tolist()


def test_a_straight_path_has_an_end_only():
    asked = trajectory(between((0.0, 0.0), (1.0, 0.5)))
    goal = path_goal(asked)
    assert goal.points == (asked.points[0], asked.points[-1])
    assert '0 of its 58 points' in goal.remarks[0]


@pytest.mark.parametrize('corner', [(1.0, 0.2), (1.5, 0.0)])
def test_corners_and_points_of_return_are_passed_at_their_times(corner):
    asked = trajectory(between((0.0, 0.0), corner, (0.5, 0.0)))
    goal = path_goal(asked)
    assert len(goal.points) == 3
    assert goal.points[1].positions == pytest.approx(corner)
    assert goal.points[1].time == pytest.approx(0.59)
    assert not goal.points[1].velocities


def test_no_point_is_far_from_the_polygon_of_those_that_are_passed():
    s = np.linspace(0.0, 1.0, 200)
    path = np.stack([s, 0.3 * np.sin(5.0 * s)], axis=1)
    goal = path_goal(trajectory(path.tolist()))
    kept = np.array([point.positions for point in goal.points])
    assert 5 < len(kept) < 20
    between_them = np.interp(path[:, 0], kept[:, 0], kept[:, 1])
    assert np.abs(between_them - path[:, 1]).max() < 0.02


def test_points_without_velocities_are_left_alone():
    asked = trajectory(between((0.0, 0.0), (1.0, 0.5), count=20), has_velocities=False)
    assert path_goal(asked) == asked


def test_what_no_goal_can_be_is_left_for_its_refusal():
    asked = trajectory(between((0.0, 0.0), (1.0, 0.5)))
    odd = replace(asked.points[3], positions=(1.0,))
    spoilt = replace(asked, points=(*asked.points[:3], odd, *asked.points[4:]))
    assert path_goal(spoilt) == spoilt
