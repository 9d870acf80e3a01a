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

"""Recordings of simulated arms: goals planned with one arm, played by another, seen by sensors."""

from functools import lru_cache
from math import pi

from flat_planner_ros.core.model_fit import Measurements
from flat_planner_ros.core.motion_law import Strategy
from flat_planner_ros.core.planning import MotionRequest, plan, PlanningOptions
from flat_planner_ros.core.plant import DriveSettings, EffortProfile, SimulatedArm
import numpy as np

GOALS = (pi, 0.0, 0.5 * pi, -0.5 * pi)
"""Four ordinary goals of joint n-1 [rad]; the joints before it go to a half and a third of it."""


def commanded(
    arm, goals=GOALS, spacing=1.5, duration=1.0, period=0.005, strategy=Strategy.POLYNOMIAL
):
    """Return the efforts that bring an arm from goal to goal, as one command."""
    shares = np.append(1.0 / np.arange(arm.n, 1, -1), 0.0)
    shares[-2] = 1.0
    times, rows, here = [], [], np.zeros(arm.n)
    for index, goal in enumerate(goals):
        there = goal * shares
        request = MotionRequest(start=here, final=there, duration=duration)
        samples = plan(request, arm, PlanningOptions(strategy=strategy)).sample(period)
        times.append(samples.times + index * spacing + 0.1)
        rows.append((samples.positions, samples.velocities, samples.efforts))
        here = there
    positions, velocities, efforts = (
        np.concatenate(column)[:, :-1] for column in zip(*rows, strict=True)
    )
    return EffortProfile(
        start=0.0,
        times=np.concatenate(times),
        efforts=efforts,
        positions=positions,
        velocities=velocities,
    )


def held(
    true, believed, *, rate=200.0, until=6.2, noise=0.0, seed=0, gains=(20.0, 0.5), **command
):
    """Return the same of an arm whose first joints are held to the plan, as gravity makes one."""
    p, d = (tuple([gain] * (true.n - 2) + [0.0]) for gain in gains)
    simulated = SimulatedArm(true, drives=DriveSettings(feedback_p=p, feedback_d=d))
    simulated.command(commanded(believed, **command), 0.0)
    times = np.arange(0.0, until, 1.0 / rate)
    positions, efforts = [], []
    for time in times:
        simulated.advance(time)
        positions.append(simulated.position)
        efforts.append(simulated.applied_effort[:-1])
    angles = np.array(positions)
    angles += noise * np.random.default_rng(seed).standard_normal(angles.shape)
    return Measurements(times=times, positions=angles, efforts=np.array(efforts))


def recorded(true, believed, *, rate=200.0, until=6.2, noise=0.0, step=0.0, seed=0, **command):
    """Return what the sensors show: angles with noise [rad], then rounded to steps [rad]."""
    times, positions, efforts = played(true, believed, rate, until, **command)
    angles = positions + noise * np.random.default_rng(seed).standard_normal(positions.shape)
    if step:
        angles = step * np.round(angles / step)
    return Measurements(times=times, positions=angles, efforts=efforts)


@lru_cache
def played(true, believed, rate, until, **command):
    """Return times, angles and efforts while a command for one arm plays on another."""
    profile = commanded(believed, **command)
    simulated = SimulatedArm(true)
    simulated.command(profile, 0.0)
    times = np.arange(0.0, until, 1.0 / rate)
    positions, efforts = [], []
    for time in times:
        simulated.advance(time)
        positions.append(simulated.position)
        efforts.append(profile.effort(time))
    return times, np.array(positions), np.array(efforts)
