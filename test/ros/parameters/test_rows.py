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

"""What rows say, and that a node without parameters has the defaults of the core."""

from dataclasses import fields
from math import inf, isfinite, nan, pi, sqrt

from flat_planner_ros.core.arm import FlatModel
from flat_planner_ros.core.insensitive import Insensitivity
from flat_planner_ros.core.monitor import MonitorSettings
from flat_planner_ros.core.planning import JointLimits, PlanningOptions
from flat_planner_ros.core.plant import SimulationSettings
from flat_planner_ros.core.session import SessionSettings
from flat_planner_ros.core.tracking import TrackerSettings
from flat_planner_ros.ros.parameters import monitor, planner, plant, tracker
from flat_planner_ros.ros.parameters.parameter_file import read_settings
from flat_planner_ros.ros.parameters.row import DOUBLES, InvalidParameter, Row
import pytest
from rclpy.parameter import Parameter


def assert_equal_but_for(names, first, second):
    """Compare two settings of a class field by field."""
    assert type(first) is type(second)
    compared = {field.name for field in fields(first)} - set(names)
    assert len(compared) == len(fields(first)) - len(names)
    for name in compared:
        assert getattr(first, name) == getattr(second, name), name


def test_a_planner_without_parameters_has_the_defaults_of_the_core():
    session = read_settings(None, planner.ROWS, planner.build, node='flat_planner').session
    core = SessionSettings(joints=session.joints, arm=session.arm, options=session.options)
    assert_equal_but_for(['limits'], session, core)
    for limit in fields(JointLimits):
        assert not any(map(isfinite, getattr(session.limits, limit.name)))
    assert_equal_but_for([], session.options, PlanningOptions())
    assert session.options.insensitivity == Insensitivity()


def test_a_plant_without_parameters_has_the_defaults_of_the_core():
    simulation = read_settings(None, plant.ROWS, plant.build, node='flat_plant').simulation
    core = SimulationSettings(arm=simulation.arm, position=(0.0, 0.0))
    assert_equal_but_for([], simulation, core)


def test_a_monitor_without_parameters_has_the_defaults_of_the_core():
    settings = read_settings(None, monitor.ROWS, monitor.build, node='flat_monitor')
    of_the_arm = ['arm', 'expected_frequency', 'expected_damping_ratio']
    assert_equal_but_for(of_the_arm, settings, MonitorSettings())


def test_a_monitor_expects_the_resonance_of_the_drive():
    for drive in ('effort', 'position'):
        settings = read_settings(
            None,
            monitor.ROWS,
            monitor.build,
            node='flat_monitor',
            overrides=[f'drive:={drive}'],
        )
        inertia = 3.3e-5 if drive == 'position' else 3.3e-5 * (6.4e-4 - 3.3e-5) / 6.4e-4
        assert settings.expected_frequency == pytest.approx(
            sqrt(3.0e-3 / inertia * (1.0 - settings.expected_damping_ratio**2)) / (2.0 * pi)
        )


def test_a_tracker_without_parameters_has_the_defaults_of_the_core():
    settings = read_settings(None, tracker.ROWS, tracker.build, node='flat_tracker')
    assert_equal_but_for([], settings.tracker, TrackerSettings())


def test_a_choice_is_a_member_of_its_enumeration():
    row = Row('flat_model', FlatModel.EXACT, '', 'treatment of the damping')
    assert row.default == 'exact'
    assert row.choices == ('approximate', 'exact')
    assert row.type is Parameter.Type.STRING
    row.check('approximate')
    with pytest.raises(InvalidParameter, match='one of approximate, exact'):
        row.check('nearly')


def test_a_description_gives_the_unit_before_the_remark():
    row = Row('wait', 0.5, 's', 'time to wait', '0 = for ever')
    assert row.description == 'time to wait [s]; 0 = for ever'
    assert Row('seed', 0, '', 'seed of the noise').description == 'seed of the noise'


def test_every_number_of_an_array_is_within_the_range():
    row = Row('gains', DOUBLES, 'N m/rad', 'gains', lower=0.0, upper=2.0)
    assert row.default is row.type
    row.check([0.0, 2.0])
    for bad in (-0.1, 2.1, inf, nan):
        with pytest.raises(InvalidParameter, match=r'gains must be in \[0, 2\]'):
            row.check([1.0, bad])


def test_infinity_is_a_number_only_where_it_means_no_limit():
    free = Row('limit', DOUBLES, 'rad', 'limit', may_be_infinite=True)
    free.check([inf, -inf])
    with pytest.raises(InvalidParameter):
        free.check([nan])
    with pytest.raises(InvalidParameter, match='finite'):
        Row('limit', DOUBLES, 'rad', 'limit').check([inf])
