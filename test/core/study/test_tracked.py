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

"""Trackers side by side do to each arm what a tracker by itself does, or say that they cannot."""

from dataclasses import replace

from core.study.some_study import ARM, case
from flat_planner_ros.core.arm import FlatPlannerError, InvalidRequest
from flat_planner_ros.core.plant import DriveSettings
from flat_planner_ros.core.study import answer, PlantDisagrees, playing, tracked
from flat_planner_ros.core.study.tracked import tracked_end, tracked_ends
from flat_planner_ros.core.tracking import TrackedMotion, TrackerSettings, TrackerStack
import numpy as np
import pytest

FACTORS = ((1.2, 0.8), (0.8, 1.2), (1.0, 1.0))
"""Of stiffness and damping of the true arms."""


def arms(settings, factors=FACTORS, **more):
    """Return motions of different lengths on different arms, and their samples."""
    base = case(tracker=settings, start=(0.3, 0.0), **more)
    made = [
        replace(
            base,
            true=replace(ARM.scaled(stiffness=k, damping=c), viscous_friction=np.array([1e-4])),
            duration=0.8 + 0.1003 * place,
        )
        for place, (k, c) in enumerate(factors)
    ]
    return made, [answer(each).motion.samples for each in made]


def numbers(end):
    """Return a state as one row."""
    return np.hstack([end.positions[0], end.velocities[0]])


@pytest.mark.parametrize(
    'loop', [{}, {'delay': 0.0}, {'delay': 0.0033}, {'delay': 0.005, 'rate': 400.0}]
)
def test_side_by_side_is_one_by_one(loop):
    cases, motions = arms(TrackerSettings(**loop))
    together = tracked._together(cases, motions)
    for each, motion, end in zip(cases, motions, together, strict=True):
        # The plant's steps of the fourth order are all that differs.
        alone = numbers(tracked_end(each, motion))
        assert numbers(end) == pytest.approx(alone, abs=1e-7)
    states = np.array([numbers(end) for end in together])
    assert np.abs(states[0] - states[2]).max() > 1e-3
    again = tracked_ends(cases, motions, [False] * 3)
    assert [numbers(end).tolist() for end in again] == states.tolist()


def test_what_a_tracker_gives_up_goes_by_itself():
    most = max(np.abs(motion.efforts).max() for motion in arms(TrackerSettings())[1])
    for loop, factors in (
        ({'effort_limit': (0.9 * float(most),)}, FACTORS),
        ({'max_error': 0.02}, ((1.0, 1.0), (1.0, 1.0), (3.0, 1.0))),
    ):
        cases, motions = arms(TrackerSettings(**loop), factors)
        together = tracked._together(cases, motions)
        assert [end is None for end in together].count(True) == 1
        ends = tracked_ends(cases, motions, [False] * 3)
        place = together.index(None)
        alone = tracked_end(cases[place], motions[place])
        assert numbers(ends[place]).tolist() == numbers(alone).tolist()


def test_a_loop_that_is_none_is_said_of_each():
    cases, motions = arms(TrackerSettings(delay=0.05, bandwidth=60.0))
    ends = tracked_ends(cases, motions, [False] * 3)
    assert all(isinstance(end, FlatPlannerError) for end in ends)


@pytest.mark.parametrize(
    'more',
    [{'drives': DriveSettings(saturation=(0.1,))}, {'tracker': TrackerSettings(hold=False)}],
)
def test_other_drives_and_ends_go_one_by_one(more):
    cases, _ = arms(TrackerSettings())
    assert list(tracked._side_by_side(cases)) == [[0, 1, 2]]
    assert not list(tracked._side_by_side([replace(each, **more) for each in cases]))
    with pytest.raises(InvalidRequest, match='hold False'):
        TrackerStack(ARM, TrackerSettings(hold=False))


def test_the_plant_that_disagrees_stops_the_study(monkeypatch):
    cases, motions = arms(TrackerSettings())
    monkeypatch.setattr(playing, 'AGREEMENT', 1e-14)
    with pytest.raises(PlantDisagrees):
        tracked_ends(cases, motions, [True] * 3)
    tracked_ends(cases, motions, [False] * 3)


def test_a_motion_at_many_times_is_the_motion_at_each():
    _, (samples, *_) = arms(TrackerSettings())
    motion = TrackedMotion(
        start=0.5,
        times=samples.times,
        positions=samples.positions,
        velocities=samples.velocities,
        accelerations=samples.accelerations,
    )
    times = np.array([0.0, 0.5, 0.50001, 0.505, 0.9, motion.end, motion.end + 1e-9, 3.0])
    many = motion.through(times)
    for row, time in enumerate(times.tolist()):
        for table, one in zip(many, motion.at(time), strict=True):
            assert table[row].tolist() == pytest.approx(one.tolist(), rel=1e-12, abs=1e-12)
