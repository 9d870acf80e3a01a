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


"""Moving pictures: what they show is the simulated arm, and how it would move without a plan."""

from flat_planner_ros.core import (
    EffortProfile,
    MotionRequest,
    plan,
    PlanarArm,
    PlanningOptions,
    rollout,
    ViaPoint,
)
from flat_planner_ros.figures.animation import FRAME_RATE, outline
from flat_planner_ros.figures.plan_animation import AFTERWARDS, plan_scenes, stiff_turn
from flat_planner_ros.ros.programs import flat_plan
import numpy as np
from PIL import Image
import pytest

ARM = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
REQUEST = MotionRequest(start=(0.2, 0.0), final=(2.0, 0.0), duration=0.8)


def test_with_the_plan_the_arm_comes_to_rest_and_without_it_swings():
    stiff, planned = plan_scenes(plan(REQUEST, ARM, PlanningOptions()))
    assert np.abs(planned.positions - planned.ghost).max() < 1e-4
    after = stiff.times > REQUEST.duration
    assert np.abs(planned.positions[after, 1]).max() < 1e-4
    assert np.abs(stiff.positions[after, 1]).max() > 0.05
    for scene in (stiff, planned):
        assert scene.ghost[-1] == pytest.approx(REQUEST.final)


def test_the_turn_for_a_stiff_joint_is_right_for_one():
    motion = plan(REQUEST, ARM, PlanningOptions())
    times, positions, velocities, efforts = stiff_turn(motion)
    profile = EffortProfile(start=0.0, times=times, efforts=efforts[:, :-1])
    stiff = ARM.scaled(stiffness=1e3)
    run = rollout(stiff, profile, REQUEST.duration, step=2e-4, position=REQUEST.start)
    assert run.positions[-1] == pytest.approx(positions[-1], abs=2e-3)
    assert np.gradient(positions[:, 0], times) == pytest.approx(velocities[:, 0], abs=1e-2)


def test_a_plan_through_points_stands_alone():
    request = MotionRequest(
        start=(0.0, 0.0), final=(1.0, 0.0), duration=1.0, via=(ViaPoint(time=0.5, values=(0.8,)),)
    )
    (scene,) = plan_scenes(plan(request, ARM, PlanningOptions()))
    assert np.abs(scene.positions - scene.ghost).max() < 1e-4


def test_links_are_equally_long_and_angles_add_up():
    points = outline(np.array([np.pi / 2, -np.pi / 2]))
    assert points == pytest.approx(np.array([[0.0, 0.0, 0.5], [0.0, 0.5, 0.5]]))


def test_flat_plan_writes_a_picture_that_moves_in_real_time(tmp_path):
    path = tmp_path / 'turn.gif'
    arguments = ['joint1=1', '--duration', '0.2', '--animate', str(path)]
    assert flat_plan.main(arguments) == 0
    with Image.open(path) as picture:
        assert picture.n_frames == round((0.2 + AFTERWARDS) * FRAME_RATE) + 1
        assert picture.info['duration'] == 1000 / FRAME_RATE


def test_what_is_no_moving_picture_is_refused(capsys):
    with pytest.raises(SystemExit):
        flat_plan.main(['joint1=1', '--duration', '1', '--animate', 'turn.png'])
    assert '.gif' in capsys.readouterr().err
