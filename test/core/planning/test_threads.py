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

"""Plans made by several threads at once, whose caches they share."""

from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
import sys
from threading import Barrier

from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.motion_law.cost import Strategy
from flat_planner_ros.core.planning import motion_problem
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions
import numpy as np
import pytest

extremals = import_module('flat_planner_ros.core.motion_law.extremal')

THREADS = 4

ROUNDS = 100


def results(arm, options, duration):
    """Return everything about some plans that is computed or cached."""
    found = []
    for distance in (1.0, -0.3):
        request = MotionRequest(start=[0.1, 0.0], final=[0.1 + distance, 0.0], duration=duration)
        made = plan(request, arm, options)
        samples = made.sample(0.01 * duration)
        found += [samples.planned, samples.driving_effort, samples.positions, samples.flat]
        found += [made.rms_effort, made.peak_effort, made.cost_value, made.boundary_residual]
    return found


@pytest.fixture
def hasty_threads():
    """Let threads take turns as often as possible."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(usual)


@pytest.mark.usefixtures('hasty_threads')
def test_plans_of_several_threads_are_the_same_as_of_one():
    rng = np.random.default_rng(1)
    barrier = Barrier(THREADS)

    def together(arm, options, duration):
        barrier.wait(timeout=60.0)
        return results(arm, options, duration)

    strategies = [s for s in Strategy if s not in (Strategy.CUSTOM, Strategy.INSENSITIVE)]
    with ThreadPoolExecutor(THREADS) as pool:
        for _ in range(ROUNDS):
            arm = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
            options = PlanningOptions(strategy=rng.choice(strategies), r=rng.uniform(1.0, 200.0))
            duration = float(rng.uniform(0.5, 2.0))
            found = [pool.submit(together, arm, options, duration) for _ in range(THREADS)]
            # Alone, and nothing known.
            motion_problem.problem_of.cache_clear()
            extremals.kept_units.cache_clear()
            expected = results(arm, options, duration)
            for each in found:
                for ours, alone in zip(each.result(), expected, strict=True):
                    np.testing.assert_array_equal(ours, alone)
