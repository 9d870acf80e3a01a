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

"""Sensors add what they are told to, repeatably, and leave the true motion alone."""

from flat_planner_ros.core.arm.errors import InvalidModel
from flat_planner_ros.core.plant.settings import Sensing, Sensor
from flat_planner_ros.core.plant.states import ArmState
import numpy as np
import pytest


def state(*angles):
    """Return a state whose velocity and effort can be told from its position."""
    position = np.array(angles)
    return ArmState(1.5, position, 10.0 * position + 1.0, 20.0 * position + 2.0)


def angles_of(sensing, count=20_000):
    """Return what a sensor shows of an arm of two joints at rest, shape (count, 2)."""
    sensor = Sensor(sensing)
    return np.array([sensor.measure(state(0.3, -0.2)).position for _ in range(count)])


def test_ideal_sensors_show_the_truth():
    true = state(0.123456789, -2.0)
    shown = Sensor(Sensing()).measure(true)
    assert all(np.array_equal(a, b) for a, b in zip(shown, true, strict=True))


def test_noise_is_white_unbiased_and_as_strong_as_asked():
    std = 1e-3
    error = (angles_of(Sensing(position_std=std)) - [0.3, -0.2]) / std
    count = len(error)
    assert error.std(axis=0) == pytest.approx(1.0, abs=5.0 / np.sqrt(2 * count))
    assert error.mean(axis=0) == pytest.approx(0.0, abs=5.0 / np.sqrt(count))
    assert (error[1:] * error[:-1]).mean() == pytest.approx(0.0, abs=5.0 / np.sqrt(2 * count))
    assert (error[:, 0] * error[:, 1]).mean() == pytest.approx(0.0, abs=5.0 / np.sqrt(count))


def test_the_seed_decides_about_the_noise():
    same, again, other = (angles_of(Sensing(position_std=1.0, seed=s), 10) for s in (3, 3, 4))
    assert np.array_equal(same, again)
    assert not np.isclose(same, other).any()


@pytest.mark.parametrize('resolution', [2 * np.pi / 4096, 0.1])
def test_encoders_show_whole_steps_next_to_the_truth(resolution):
    true = np.random.default_rng(1).uniform(-7.0, 7.0, 1000)
    shown = Sensor(Sensing(resolution=resolution)).measure(state(*true)).position
    assert np.abs(shown - true).max() <= 0.5 * resolution * (1 + 1e-9)
    assert shown / resolution == pytest.approx(np.round(shown / resolution), abs=1e-9)
    assert np.unique(shown).size < 1000


def test_noise_comes_before_the_encoder():
    shown = angles_of(Sensing(position_std=0.05, resolution=0.1), 200)
    assert len(np.unique(np.round(shown / 0.1))) > 3
    assert shown / 0.1 == pytest.approx(np.round(shown / 0.1), abs=1e-9)


def test_velocity_effort_and_time_are_the_true_ones():
    true = state(0.3, -0.2)
    before = true.position.copy()
    shown = Sensor(Sensing(position_std=1.0, resolution=0.1)).measure(true)
    assert shown.time == true.time
    assert np.array_equal(shown.velocity, true.velocity)
    assert np.array_equal(shown.effort, true.effort)
    assert np.array_equal(true.position, before)


@pytest.mark.parametrize(
    'fields',
    [
        {'position_std': -1e-3},
        {'position_std': np.nan},
        {'resolution': -1.0},
        {'resolution': np.inf},
        {'seed': -1},
    ],
)
def test_what_no_sensor_does_is_refused(fields):
    with pytest.raises(InvalidModel, match=next(iter(fields))):
        Sensing(**fields)
