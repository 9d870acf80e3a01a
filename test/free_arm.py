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

"""An arm of two joints with any spring, integrated by SciPy: no formula of the package in it."""

from dataclasses import replace

from flat_planner_ros.core.arm import COULOMB_VELOCITY
from flat_planner_ros.core.model_fit import Measurements
import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline


def simulated(effort, times, *, both, last, spring, viscous=0.0, start=(0.0, 0.0, 0.0, 0.0)):
    """
    Return the angles of both joints, shape (m, 2) [rad].

    The arm starts at the angles and rates given, the effort is a function of time [s], the spring
    one of angle and rate of the passive joint.
    """

    def rates(t, x):
        # Of the two equations the second is taken from the first: two numbers need no solver.
        pull = spring(x[1], x[3])
        inner = (effort(t) - viscous * x[2] + pull) / (both - last)
        return [x[2], x[3], inner, -pull / last - inner]

    tolerances = {'rtol': 1e-9, 'atol': 1e-10}
    found = solve_ivp(rates, (0.0, times[-1]), start, t_eval=times, method='DOP853', **tolerances)
    return found.y[:2].T


def measured(effort, times, *, noise=0.0, seed=0, **arm):
    """Return what sensors show of the arm, with white noise [rad]."""
    angles = simulated(effort, times, **arm)
    angles = angles + noise * np.random.default_rng(seed).standard_normal(angles.shape)
    return Measurements(times=times, positions=angles, efforts=effort(times)[:, None])


def carried(seen, arm, *, spring, coupling=0.0):
    """
    Return the recording of a longer arm with other last two links on the same moving base.

    The spring is a function of angle and rate of the passive joint, the coupling of both links
    l_(n-1) s_n [kg m^2]. What their friction does to the base, which others move, is left out.
    """
    times, efforts = seen.times, seen.efforts[:, -1]
    base = CubicSpline(times, seen.positions[:, :-2].sum(axis=1))
    velocity = base.derivative()
    both, last = arm.inertia_star
    viscous, coulomb = float(arm.viscous_friction[-1]), float(arm.coulomb_friction[-1])

    def rates(t, x):
        deflection, slide = x[1] - x[0], x[2] - velocity(t)
        pull = spring(deflection, x[3] - x[2])
        turned = coupling * np.sin(deflection)
        braked = viscous * slide + coulomb * np.tanh(slide / COULOMB_VELOCITY)
        forces = np.interp(t, times, efforts) - braked + pull, -pull
        mass = coupling * np.cos(deflection)
        inner, outer = np.linalg.solve(
            [[both - last, mass], [mass, last]],
            [forces[0] + turned * x[3] ** 2, forces[1] - turned * x[2] ** 2],
        )
        return [x[2], x[3], inner, outer]

    tolerances = {'rtol': 1e-7, 'atol': 1e-9, 'max_step': 5e-3}
    start = [base(0.0), base(0.0), velocity(0.0), velocity(0.0)]
    found = solve_ivp(rates, (0.0, times[-1]), start, t_eval=times, method='RK45', **tolerances)
    positions = seen.positions.copy()
    positions[:, -2] = found.y[0] - base(times)
    positions[:, -1] = found.y[1] - found.y[0]
    return replace(seen, positions=positions)


def pushes(t):
    """Return smooth pushes back and forth of up to 10 mN m over six seconds [N m]."""
    inside = np.clip(np.mod(t, 1.5), 0.0, 1.0)
    sign = np.where(np.mod(t, 3.0) < 1.5, 1.0, -1.0)
    return 0.01 * sign * np.sin(2 * np.pi * inside) * np.sin(np.pi * inside) ** 2
