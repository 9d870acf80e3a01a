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

"""Samples as a table do what they do one by one."""

from dataclasses import replace

from flat_planner_ros.core.arm import SampleTable, TurnCounter
from flat_planner_ros.core.monitor import MonitorSettings, PlannedMotion, VibrationMonitor
from flat_planner_ros.core.monitor.motion_record import Record, RECORD_LIMIT
import numpy as np
import pytest

SETTINGS = MonitorSettings(window=0.5, timeout=0.2, fits_model=True)
DURATION, PERIOD = 0.5, 0.005


def motions():
    """Return motions to and fro; the fourth cuts the third's window short, one is spliced in."""
    s = np.linspace(0.0, 1.0, 21)
    path = 10 * s**3 - 15 * s**4 + 6 * s**5
    return [
        PlannedMotion(
            joint_names=('joint1', 'joint2'),
            start=start,
            times=DURATION * s,
            positions=np.stack((path if number % 2 == 0 else 1.0 - path, 0.0 * s), axis=1),
        )
        for number, start in enumerate((0.3, 1.6, 3.0, 3.6, 3.8, 5.5))
    ]


def samples(seed):
    """Return samples of an arm that swings, and when they came; many of them are spoilt."""
    random = np.random.default_rng(seed)
    times = np.arange(0.0, 7.0, PERIOD)
    positions = np.zeros((times.size, 2))
    for motion in motions():
        started = times >= motion.start
        positions[started] = [motion.reference(time)[0] for time in times[started]]
    positions[:, 1] += 0.02 * np.cos(9.8 * times)
    positions += 1e-4 * random.standard_normal(positions.shape)
    for row in random.integers(0, times.size, 12 * (seed > 0)):
        kind = random.integers(5)
        if kind == 0:
            positions[row] = np.nan
        elif kind == 1:
            positions[row:] += 0.7  # put elsewhere
        elif kind == 2:
            times[row] = times[row - 1]
        elif kind == 3:
            times[row:] += 0.21  # silent
        else:
            positions[row] = 1e9
    efforts = random.standard_normal(positions.shape)
    arrivals = times + 0.001 * random.random(times.size)
    if seed % 3 == 2:
        arrivals[400:] += 0.04  # a clock that is set
    table = SampleTable(times=times, positions=positions, efforts=efforts)
    return table, arrivals


def one_by_one(table, arrivals):
    """Return the reports, with plans that come 0.2 s before they start."""
    monitor, plans, reports = VibrationMonitor(SETTINGS), motions(), []
    for row, arrival in enumerate(arrivals.tolist()):
        while plans and plans[0].start - 0.2 <= arrival:
            reports += monitor.watch(plans.pop(0), arrival)
        sample = table.sample(row)
        monitor.hear(sample.time, arrival)
        reports += monitor.add(sample)
    return reports, monitor.dropped


def in_tables(table, arrivals):
    """Return the same by tables between the plans."""
    monitor, plans, reports = VibrationMonitor(SETTINGS), motions(), []
    while len(table):
        count = len(table)
        if plans:
            come = arrivals >= plans[0].start - 0.2
            count = int(come.argmax()) if come.any() else count
        if not count:
            reports += monitor.watch(plans.pop(0), float(arrivals[0]))
            continue
        taken, new = monitor.add_table(table.rows(slice(count)), arrivals[:count])
        reports += new
        table, arrivals = table.rows(slice(taken, None)), arrivals[taken:]
    return reports, monitor.dropped


@pytest.mark.parametrize('seed', range(6))
def test_a_table_of_samples_gives_the_reports_of_each_by_itself(seed):
    expected, found = one_by_one(*samples(seed)), in_tables(*samples(seed))
    assert len(expected[0]) >= 2
    assert [str(report) for report in found[0]] == [str(report) for report in expected[0]]
    assert found[1] == expected[1]
    assert (seed == 0) == (expected[1] == 0)


def test_a_record_is_extended_as_row_by_row():
    random = np.random.default_rng(1)
    by_rows, by_tables = Record(2), Record(2)
    times = np.arange(5.0 * RECORD_LIMIT)
    table = random.standard_normal((times.size, 2))
    for time, row in zip(times.tolist(), table, strict=True):
        by_rows.append(time, row)
    place = 0
    while place < times.size:
        part = slice(place, place + int(random.integers(1, 3000)))
        by_tables.extend(times[part], table[part])
        place = part.stop
    assert len(by_tables) < RECORD_LIMIT
    for found, expected in zip(
        by_tables.between(0.0, 1e9), by_rows.between(0.0, 1e9), strict=True
    ):
        np.testing.assert_array_equal(found, expected)


def test_turns_are_carried_on_in_tables():
    angle = np.linspace(0.0, 20.0, 2001)
    wrapped = np.stack((np.remainder(angle + np.pi, 2 * np.pi) - np.pi, 0.0 * angle), axis=1)
    table = SampleTable(times=1e-2 * np.arange(angle.size), positions=wrapped)
    table = replace(table, velocities=np.ones_like(wrapped))
    counter, found, row, alone = TurnCounter(), [], 0, 0
    while row < len(table):
        part = counter.unwrapped_table(table.rows(slice(row, row + 50)))
        if part is None:
            found.append(counter.unwrapped(table.sample(row)).positions[0])
            row, alone = row + 1, alone + 1
        else:
            found += part.positions[:, 0].tolist()
            row += len(part)
    np.testing.assert_allclose(found, angle, atol=1e-12)
    assert 0 < alone < 0.2 * len(table)
