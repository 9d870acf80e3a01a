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

"""Planning in time for a start in motion: searches end early, and what they lack is said."""

from dataclasses import replace
from math import inf

from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.motion_law.cost import Strategy
from flat_planner_ros.core.planning.duration_rules import OnViolation
from flat_planner_ros.core.planning.limits import JointLimits
from flat_planner_ros.core.planning.request import PlanningOptions, Reason, RequestRejected
from flat_planner_ros.core.session.goal import Goal, GoalPoint
from flat_planner_ros.core.session.session import PlannerSession
from flat_planner_ros.core.session.settings import SessionSettings, StartSource
import numpy as np
import pytest

LIMITS = JointLimits.of(2, velocity=[12.0, inf])

SETTINGS = SessionSettings(
    joints=('joint1', 'joint2'),
    arm=PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5),
    options=PlanningOptions(strategy=Strategy.POLYNOMIAL),
    start_source=StartSource.PARAMETER,
    start_position=(0.0, 0.0),
    limits=LIMITS,
)

WAY = Goal(joint_names=('joint1',), points=(GoalPoint(time=2.0, positions=(2.0,)),))

THROUGH = replace(
    WAY, points=tuple(GoalPoint(time=0.0, positions=(angle,)) for angle in (1.2, 0.3, 1.7, -0.4))
)
"""Three via points whose times are chosen, and no duration."""

MOMENT = 0.7
"""Time in the running motion at which a goal comes [s]."""


class Ticking:
    """A clock that goes on each time it is asked, until searches are over; then it stands."""

    def __init__(self, begin, tick):
        self.time, self.tick, self.over = begin, tick, begin + 0.6 * SETTINGS.lookahead

    def __call__(self):
        self.time = min(self.time + self.tick, self.over)
        return self.time


def in_motion(**changes):
    """Return a session with a motion under way, and the present time."""
    planner = PlannerSession(replace(SETTINGS, **changes))
    return planner, planner.submit(WAY, 100.0).start + MOMENT


def taken_over(tick, goal=THROUGH, **changes):
    """Return the motion of a goal whose planning takes a time at each question [s]."""
    planner, now = in_motion(**changes)
    return planner.submit(goal, now, Ticking(now, tick))


def is_in_haste(motion):
    """Tell whether a motion is said to have been planned in haste."""
    return any('in haste' in remark for remark in motion.remarks)


def uses(motion):
    """Return the largest use of the limits, by dense sampling."""
    samples = motion.plan.at(np.linspace(0.0, motion.plan.duration, 20_001))
    return float((np.abs(samples.velocities) / LIMITS.velocity).max())


@pytest.mark.parametrize('tick', [0.001, 0.003, 0.01, 0.04])
@pytest.mark.parametrize('goal', [THROUGH, replace(WAY, points=THROUGH.points[-1:])])
def test_a_slow_search_is_content_with_what_obeys(goal, tick):
    free, hasty = taken_over(0.0, goal), taken_over(tick, goal)
    assert not is_in_haste(free)
    assert free.is_shortest
    assert is_in_haste(hasty) != hasty.is_shortest
    assert uses(hasty) <= 1.0 + 1e-9
    if tick >= 0.02:
        assert is_in_haste(hasty)
    # The times differ a little, with them the shortest duration; it is no worse than that.
    assert hasty.plan.duration > 0.98 * free.plan.duration
    passed = hasty.plan.at(np.array([point.time for point in hasty.plan.request.via]))
    angles = [point.positions[0] for point in goal.points[:-1]]
    assert passed.positions.sum(axis=1) == pytest.approx(angles, abs=1e-9)


def test_time_enough_changes_nothing():
    planner, now = in_motion()
    without_a_clock = planner.submit(THROUGH, now)
    with_one = taken_over(0.0)
    assert with_one.plan.duration == without_a_clock.plan.duration
    assert (with_one.samples.efforts == without_a_clock.samples.efforts).all()


def test_a_goal_at_rest_takes_the_time_it_needs():
    planner = PlannerSession(SETTINGS)
    slow = planner.submit(THROUGH, 100.0, Ticking(100.0, 0.5))
    free = PlannerSession(SETTINGS).submit(THROUGH, 100.0)
    assert slow.plan.duration == free.plan.duration
    assert not is_in_haste(slow)


def test_a_start_far_ahead_leaves_time():
    planner, now = in_motion()
    queued = replace(THROUGH, stamp=now + 1.0)
    assert not is_in_haste(planner.submit(queued, now, Ticking(now, 0.003)))


def test_a_stretched_motion_may_be_longer_than_it_had_to_be():
    fast = replace(WAY, points=(GoalPoint(time=0.1, positions=(-1.0,)),))
    scale = {'on_violation': OnViolation.SCALE}
    free, hasty = taken_over(0.0, fast, **scale), taken_over(0.02, fast, **scale)
    assert free.exceeded is not None
    assert hasty.exceeded is not None
    assert is_in_haste(hasty)
    assert hasty.plan.duration >= free.plan.duration
    assert uses(hasty) <= 1.0 + 1e-9


def test_a_search_that_finds_nothing_in_time_says_so():
    # The arm is faster already than it may be from now on: it may obey nowhere.
    planner, now = in_motion()
    planner.settings = replace(SETTINGS, limits=JointLimits.of(2, velocity=[0.5, inf]))
    with pytest.raises(RequestRejected) as free:
        planner.submit(THROUGH, now, Ticking(now, 0.0))
    assert free.value.reason is Reason.VELOCITY_LIMIT
    with pytest.raises(RequestRejected) as hasty:
        planner.submit(THROUGH, now, Ticking(now, 0.02))
    assert hasty.value.reason is Reason.BUSY
    assert 'no duration within the limits was found in the time until the start' in str(
        hasty.value
    )
