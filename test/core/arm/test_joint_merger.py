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

"""Joint states in parts: merged at the times of the last joint, exact where they were read."""

from flat_planner_ros.core.arm import JointMerger, JointSample
import numpy as np
import pytest

JOINTS = ('joint1', 'joint2')


def swing(time):
    """Return the angles of two joints at a time, and their velocities."""
    return np.sin([3.0 * time, 20.0 * time]), np.cos([3.0 * time, 20.0 * time]) * [3.0, 20.0]


def part(index, time, **given):
    """Return what a driver says of one joint."""
    position, velocity = swing(time)
    values = {'positions': position, 'velocities': velocity, **given}
    return [index], JointSample(
        time=time,
        **{name: None if v is None else np.array([v[index]]) for name, v in values.items()},
    )


def fed(merger, *readings, **given):
    """Return the samples that readings give, each the index of a joint and a time."""
    return [s for index, time in readings for s in merger.add(*part(index, time, **given))]


def in_turn(period, delay, until=1.0):
    """Return readings of joint 1 every period and of joint 2 every 5 ms, joint 1 coming late."""
    slow = [(k * period + delay, 0, k * period) for k in range(int(until / period) + 1)]
    fast = [(k * 0.005, 1, k * 0.005 + 1e-4) for k in range(int(until / 0.005) + 1)]
    return [(index, time) for _, index, time in sorted(slow + fast)]


@pytest.mark.parametrize(('period', 'delay'), [(0.02, 0.0), (0.02, 0.03), (0.001, 0.01)])
def test_two_drivers_give_the_last_joint_as_read_and_the_other_in_between(period, delay):
    samples = fed(JointMerger(JOINTS), *in_turn(period, delay))
    assert len(samples) > 180
    times = [sample.time for sample in samples]
    assert (np.diff(times) > 0.0).all()
    for sample in samples:
        position, velocity = swing(sample.time)
        assert sample.positions[1] == position[1]
        assert sample.velocities[1] == velocity[1]
        assert sample.efforts is None
        # (h / 2)^4 / 4! of the fourth derivative, that of a cubic's error at most.
        assert abs(sample.positions[0] - position[0]) <= 81.0 * (period / 2) ** 4 / 24.0 + 1e-15
        assert abs(sample.velocities[0] - velocity[0]) < 1e-4


def test_without_velocities_joints_are_joined_by_straight_lines():
    (sample,) = fed(JointMerger(JOINTS), (0, 0.0), (1, 0.005), (0, 0.02), velocities=None)
    assert sample.time == 0.005
    assert sample.velocities is None
    assert sample.positions[0] == pytest.approx(swing(0.02)[0][0] / 4.0, rel=1e-12)


def test_a_joint_that_was_not_heard_near_enough_gives_no_sample():
    merger = JointMerger(JOINTS)
    assert not fed(merger, (0, 0.0), (1, 0.1), (0, 0.2))
    assert merger.lack == (
        'joint2 was last heard 0.100 s before joint1 on joint_states '
        '(joint_states.tolerance 0.05 s)'
    )
    merger.tolerance = 0.1
    assert merger.lack == ''
    assert [s.time for s in fed(merger, (1, 0.2), (1, 0.3), (0, 0.4))] == [0.2, 0.3]


def test_a_joint_never_heard_is_named():
    merger = JointMerger(('joint1', 'joint2', 'joint3'))
    assert merger.lack == ''
    fed(merger, (0, 1.0))
    assert merger.lack == ('joint2, joint3 have not been heard on joint_states; heard: joint1')
    fed(merger, (1, 1.0))
    assert merger.lack == 'joint3 has not been heard on joint_states; heard: joint1, joint2'


def test_late_readings_are_left_out_and_a_clock_set_back_starts_again():
    merger = JointMerger(JOINTS)
    assert len(fed(merger, (0, 5.0), (1, 5.0), (0, 4.99), (1, 4.995), (1, 5.0))) == 1
    assert not fed(merger, (1, 1.0))
    assert merger.lack == 'joint1 has not been heard on joint_states; heard: joint2'
    assert len(fed(merger, (0, 1.0))) == 1


def test_what_waits_too_long_for_a_silent_joint_is_forgotten():
    merger = JointMerger(JOINTS)
    fed(merger, (0, 0.0), *((1, 0.001 * k) for k in range(1, 5000)))
    samples = fed(merger, (0, 4.999))
    assert [round(1e3 * s.time) for s in samples] == list(range(4949, 5000))
