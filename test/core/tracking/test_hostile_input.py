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

"""Whatever a tracker is fed, it raises nothing, and its efforts are within the limit."""

from copy import deepcopy

from core.conftest import ARM
from core.tracking.closed_loop import motion_of, samples_of
from flat_planner_ros.core.arm import FlatPlannerError, JointSample
from flat_planner_ros.core.tracking import Phase, TrackedMotion, Tracker, TrackerSettings
from hypothesis import example, given, settings
from hypothesis import strategies as st
import numpy as np
from random_cases import cases

LIMIT = 0.02
"""Largest effort [N m]."""

PERIOD = 0.002
"""Time between two samples that are as they should be [s]."""

FRESH = Tracker(ARM, TrackerSettings(effort_limit=(LIMIT,)))
SAMPLES = samples_of()

wild = st.one_of(
    st.floats(-4.0, 4.0),
    st.floats(),  # NaN, infinities and denormals among them
    st.sampled_from([0.0, -0.0, 1e6, -1e300, 5e-324]),
)
pairs = st.tuples(wild, wild)
steps = st.one_of(
    st.floats(0.0, 0.01), st.sampled_from([0.0, 0.03, 0.06, 1.0, -1.0, -1e-3, 1e9, -1e9])
)
events = st.one_of(
    st.tuples(st.just('true'), st.integers(1, 60)),
    st.tuples(st.just('true'), st.integers(1, 60)),
    st.tuples(st.just('sample'), pairs, st.one_of(st.none(), pairs), steps, steps),
    st.tuples(st.just('watch'), steps),
    st.tuples(st.just('release')),
    st.tuples(st.just('drop')),
    st.tuples(st.just('follow'), st.floats(-1.0, 0.1)),
    st.tuples(
        st.just('follow any'),
        st.lists(st.tuples(st.floats(0.0, 1e9), pairs, pairs), min_size=1, max_size=4),
        wild,
    ),
)


class Player:
    """A tracker whose arm is where it should be, but for what is done to it."""

    def __init__(self):
        """Begin with a tracker that is certified, and has heard of the arm."""
        self.tracker, self.now, self.faults = deepcopy(FRESH), 100.0, []
        self.motion = motion_of(SAMPLES, start=100.1)
        self.true(10)

    def true(self, count):
        """Show samples of the planned motion."""
        for _ in range(count):
            self.now += PERIOD
            self.sample(self.motion.at(self.now).positions, None, 0.0, 0.0)

    def sample(self, positions, velocities, step, lag):
        """Show any sample."""
        self.now += step
        sample = JointSample(
            time=self.now - lag,
            positions=np.array(positions, dtype=float),
            velocities=None if velocities is None else np.array(velocities, dtype=float),
        )
        self.check(self.tracker.hear(sample, self.now))

    def watch(self, step):
        """Let time pass."""
        self.now += step
        self.check(self.tracker.watch(self.now))

    def release(self):
        """Let go."""
        self.tracker.release(self.now)

    def drop(self):
        """Let go at once."""
        self.check(self.tracker.drop(self.now))

    def follow(self, delay):
        """Follow a motion that is as it should be."""
        motion = motion_of(SAMPLES, start=self.now + delay)
        try:
            self.tracker.follow(motion, self.now)
        except FlatPlannerError:
            return
        self.motion = motion

    def follow_any(self, points, start):
        """Follow anything."""
        times, positions, velocities = zip(*points, strict=True)
        try:
            motion = TrackedMotion(
                start=self.now + start,
                times=np.array(times),
                positions=np.array(positions, dtype=float),
                velocities=np.array(velocities, dtype=float),
            )
            self.tracker.follow(motion, self.now)
        except FlatPlannerError:
            return

    def check(self, efforts):
        """Check what is to be applied, and that an idle tracker says at most once why it is."""
        if efforts is not None:
            assert np.isfinite(efforts).all()
            assert (np.abs(efforts) <= LIMIT).all()
        fault = self.tracker.take_fault()
        if fault:
            self.faults.append(fault)
            assert self.tracker.phase is not Phase.TRACKING


@settings(max_examples=cases(2000, 20), deadline=None, derandomize=True, database=None)
@given(st.lists(events, max_size=30))
@example([('follow', 0.0), ('true', 1), ('sample', (0.0, 1e6), None, -1e9, 0.0)])
def test_no_exception_and_no_effort_beyond_the_limit(story):
    player = Player()
    for name, *given_ in story:
        getattr(player, name.replace(' ', '_'))(*given_)
    player.watch(0.0)
    player.tracker.release(player.now)
    player.watch(10.0)
    assert player.tracker.phase is Phase.IDLE
    count = len(player.faults)
    player.true(30)
    assert len(player.faults) == count


def test_the_stories_reach_motions():
    player = Player()
    player.follow(0.02)
    player.true(200)
    assert player.tracker.phase is Phase.TRACKING
    player.sample((np.nan, 0.0), None, PERIOD, 0.0)
    (fault,) = player.faults
    assert 'not finite' in fault
