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

"""
Other libraries on the paper's problem.

A peer is a function that prepares what does not depend on the numbers of one motion and returns
the solver proper, which alone is timed: from the problem's numbers to 1001 samples.
"""

from collections.abc import Callable
from math import comb
from typing import NamedTuple

from flat_planner_ros.core.arm import flat_map
from flat_planner_ros.core.motion_law import strategy_cost
import legendre
import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray
import problem

FloatArray = NDArray[np.float64]
Solver = Callable[[], problem.Answer]

STATES = 6
"""y to y^(5), the state of every formulation in time."""

INTERVALS = 50
"""Intervals of the collocation."""

DEGREE = 3
"""Degree of its polynomials, with Legendre points."""

BEZIER = 18
"""Functions in the basis that point_to_point is given; fourteen of them the ends take up."""

BEZIER_TIMES = 25
"""Times at which it adds up the cost."""


MAX_NODES = 200_000
"""Most nodes of the mesh of `solve_bvp`."""


class Peer(NamedTuple):
    """
    A library and how it is used.

    Attributes
    ----------
    name, module
        What is printed, and what must be installed.
    prepare
        Makes the solver.
    error
        Largest error with which its answer still counts as one [-].

    """

    name: str
    module: str
    prepare: Callable[[], Solver]
    error: float


def scales() -> FloatArray:
    """Return the size of y to y^(6) along the polynomial law, by which unknowns are divided."""
    return np.abs(polynomial_jet(problem.TIMES)).max(axis=1)


def polynomial_jet(times: FloatArray) -> FloatArray:
    """Return the polynomial of degree 11 that meets the ends, and its derivatives."""
    density = [(-1.0) ** k * comb(5, k) for k in range(6)]
    law = polynomial.polyint([0.0] * 5 + density)
    law *= problem.DISTANCE / polynomial.polyval(1.0, law)
    x = times / problem.DURATION
    jet = [polynomial.polyval(x, polynomial.polyder(law, k)) for k in range(problem.ORDERS)]
    return np.array(jet) / problem.DURATION ** np.arange(problem.ORDERS)[:, None]


def weights() -> tuple[FloatArray, FloatArray]:
    """Return rows whose squared products with scaled (y, ..., y^(6)) add up to the cost."""
    sixth = np.eye(problem.ORDERS)[-1]
    torque = np.zeros(problem.ORDERS)
    torque[:STATES] = problem.EFFORT_ROW * scales()[:STATES] / scales()[-1]
    return sixth, problem.WEIGHT**4 * torque


def boundary_value(
    tolerance: float, *, plain: bool = False, is_scaled: bool = True
) -> Callable[[], Solver]:
    """
    Return SciPy's solver on the Euler-Lagrange equation.

    Parameters
    ----------
    tolerance
        Its relative residual [-].
    plain
        Without guess and Jacobians.
    is_scaled
        Whether time is scaled; otherwise the equation stands as it is stated, in seconds.

    """

    def prepare() -> Solver:
        from scipy.integrate import solve_bvp

        mapping = flat_map(problem.arm(), problem.MODEL)
        cost = strategy_cost(problem.OPTIONS.strategy, mapping, r=problem.WEIGHT)
        a = cost.characteristic()
        # Time in units of the fastest even rate, so that all twelve unknowns are of one size.
        unit = np.abs(a[2]) ** -0.125 if is_scaled else 1.0
        system = np.eye(12, k=1)
        system[-1, ::2] = -a[:6] * unit ** (12.0 - 2.0 * np.arange(6))
        end = problem.DURATION / unit
        target = np.array([problem.DISTANCE, *np.zeros(5)])
        mesh = np.linspace(0.0, end, 41)
        guess = np.zeros((12, len(mesh)))
        orders = np.arange(problem.ORDERS)[:, None]
        if not plain:
            guess[: problem.ORDERS] = polynomial_jet(mesh * unit) * unit**orders
        jacobian_start, jacobian_end = np.zeros((2, 12, 12))
        jacobian_start[:6, :6] = jacobian_end[6:, :6] = np.eye(6)

        jacobians = (
            {}
            if plain
            else {
                'fun_jac': lambda x, _: np.repeat(system[:, :, None], len(x), axis=2),
                'bc_jac': lambda *_: (jacobian_start, jacobian_end),
            }
        )

        def solve() -> problem.Answer:
            found = solve_bvp(
                lambda _, y: system @ y,
                lambda start, stop: np.concatenate([start[:6], stop[:6] - target]),
                mesh,
                guess,
                **jacobians,
                tol=tolerance,
                max_nodes=MAX_NODES,
            )
            jet = found.sol(problem.TIMES / unit)[: problem.ORDERS] / unit**orders
            return problem.Answer(jet, problem.effort(jet))

        return solve

    return prepare


def casadi_programme() -> Solver:
    """Return CasADi's active-set solver on the quadratic programme."""
    import casadi

    posed = legendre.programme()
    options = {'print_iter': False, 'print_header': False, 'print_info': False}
    solver = casadi.conic(
        'solver',
        'qrqp',
        {
            'h': casadi.Sparsity.dense(*posed.hessian.shape),
            'a': casadi.Sparsity.dense(*posed.conditions.shape),
        },
        options,
    )
    h, a = casadi.DM(posed.hessian), casadi.DM(posed.conditions)
    b = casadi.DM(posed.values)

    def solve() -> problem.Answer:
        found = solver(h=h, a=a, lba=b, uba=b)
        return posed.answer(found['x'].full().ravel())

    return solve


def drake_programme() -> Solver:
    """Return Drake's solver for quadratic programmes with equations."""
    from pydrake.solvers import MathematicalProgram, Solve

    posed = legendre.programme()
    program = MathematicalProgram()
    unknown = program.NewContinuousVariables(len(posed.hessian))
    program.AddQuadraticCost(2.0 * posed.hessian, np.zeros(len(unknown)), unknown, True)
    program.AddLinearEqualityConstraint(posed.conditions, posed.values, unknown)

    def solve() -> problem.Answer:
        return posed.answer(Solve(program).GetSolution(unknown))

    return solve


def casadi_collocation() -> Solver:
    """Return direct collocation of six integrators with Legendre points, solved by IPOPT."""
    import casadi

    tau = [0.0, *casadi.collocation_points(DEGREE, 'legendre')]
    slopes, continuity, _ = casadi.collocation_coeff(tau[1:])
    step = problem.DURATION / INTERVALS
    size = scales()
    chain = np.diag(size[1:STATES] / size[: STATES - 1], 1)
    drive = np.eye(STATES)[-1] * size[STATES] / size[STATES - 1]
    _, torque = weights()

    nodes = casadi.SX.sym('x', STATES, INTERVALS * (DEGREE + 1) + 1)
    control = casadi.SX.sym('u', 1, INTERVALS * DEGREE)
    quadrature = casadi.collocation_coeff(tau[1:])[2]
    cost, conditions = 0, [nodes[:, 0]]
    for k in range(INTERVALS):
        first = k * (DEGREE + 1)
        start, inner = nodes[:, first], nodes[:, first + 1 : first + 1 + DEGREE]
        u = control[:, k * DEGREE : (k + 1) * DEGREE]
        every = casadi.horzcat(start, inner)
        rate = casadi.mtimes(casadi.DM(chain), inner) + casadi.mtimes(casadi.DM(drive), u)
        conditions.append(casadi.vec(casadi.mtimes(every, slopes) - step * rate))
        conditions.append(casadi.mtimes(every, continuity) - nodes[:, first + DEGREE + 1])
        effort = casadi.mtimes(casadi.DM(torque[:STATES]).T, inner)
        cost += step * casadi.mtimes(u**2 + effort**2, quadrature)
    conditions.append(nodes[:, -1] - casadi.DM([problem.DISTANCE / size[0]] + [0.0] * 5))
    posed = {
        'x': casadi.veccat(nodes, control),
        'f': cost,
        'g': casadi.vertcat(*conditions),
    }
    options = {
        'print_time': False,
        'ipopt': {
            'print_level': 0,
            'sb': 'yes',
            'hessian_constant': 'yes',
            'jac_c_constant': 'yes',
            'linear_solver': 'mumps',
            'tol': 1e-10,
        },
    }
    solver = casadi.nlpsol('solver', 'ipopt', posed, options)

    # The 20 samples of an interval from its nodes: those of the state, and of the control.
    per = (problem.SAMPLES - 1) // INTERVALS
    x = np.arange(per) / per
    states, controls = _lagrange(tau, x), _lagrange(tau[1:], x)
    last = _lagrange(tau[1:], np.ones(1))

    def solve() -> problem.Answer:
        found = solver(x0=0.0, lbg=0.0, ubg=0.0)['x'].full().ravel()
        split = STATES * (INTERVALS * (DEGREE + 1) + 1)
        y = found[:split].reshape(-1, STATES)
        u = found[split:].reshape(INTERVALS, DEGREE)
        y_inner = y[:-1].reshape(INTERVALS, DEGREE + 1, STATES)
        jet = np.empty((problem.ORDERS, problem.SAMPLES))
        jet[:STATES, :-1] = np.einsum('pi,kis->skp', states, y_inner).reshape(STATES, -1)
        jet[STATES, :-1] = np.einsum('pi,ki->kp', controls, u).ravel()
        jet[:STATES, -1], jet[STATES, -1] = y[-1], (last @ u[-1])[0]
        jet *= size[:, None]
        return problem.Answer(jet, problem.effort(jet))

    return solve


def python_control() -> Solver:
    """
    Return python-control's `point_to_point` with cost.

    It prescribes the input y^(6) at the ends, too; given the optimum's values there, it has to
    find the same law.
    """
    from control import flatsys

    def forward(state: FloatArray, inlet: FloatArray, _: object = None) -> list[FloatArray]:
        return [np.concatenate([state, inlet])]

    def reverse(flag: list[FloatArray], _: object = None) -> tuple[FloatArray, FloatArray]:
        return flag[0][:STATES], flag[0][STATES:]

    chain = flatsys.FlatSystem(forward, reverse, inputs=1, states=STATES)
    size = scales()
    sixth, torque = (row / size for row in weights())
    times = np.linspace(0.0, problem.DURATION, BEZIER_TIMES)
    target = np.array([problem.DISTANCE, *np.zeros(STATES - 1)])
    ends = _optimum().jet[STATES, [0, -1]]

    def cost(state: FloatArray, inlet: FloatArray) -> float:
        return float((sixth[-1] * inlet[0]) ** 2 + (torque[:STATES] @ state) ** 2)

    def solve() -> problem.Answer:
        found = flatsys.point_to_point(
            chain,
            times,
            x0=np.zeros(STATES),
            u0=ends[:1],
            xf=target,
            uf=ends[1:],
            cost=cost,
            basis=flatsys.BezierFamily(BEZIER, problem.DURATION),
        )
        jet = np.vstack(found.eval(problem.TIMES))
        return problem.Answer(jet, problem.effort(jet))

    return solve


def _optimum() -> problem.Answer:
    """Return the optimum, where a peer cannot do without its ends."""
    posed = legendre.programme()
    count = len(posed.values)
    matrix = np.block(
        [[2.0 * posed.hessian, posed.conditions.T], [posed.conditions, np.zeros((count, count))]]
    )
    right = np.concatenate([np.zeros(len(posed.hessian)), posed.values])
    return posed.answer(np.linalg.solve(matrix, right)[: len(posed.hessian)])


def _lagrange(nodes: list[float], at: FloatArray) -> FloatArray:
    """Return the matrix from values at nodes to values of their polynomial elsewhere."""
    vandermonde = np.vander(nodes, increasing=True)
    return np.vander(at, len(nodes), increasing=True) @ np.linalg.inv(vandermonde)


PEERS = (
    Peer('Drake, quadratic programme', 'pydrake', drake_programme, 1e-3),
    Peer('CasADi, quadratic programme (qrqp)', 'casadi', casadi_programme, 1e-3),
    Peer('CasADi, collocation (IPOPT)', 'casadi', casadi_collocation, 0.1),
    Peer('SciPy solve_bvp, 1e-3, scaled and tuned', 'scipy', boundary_value(1e-3), 0.1),
    Peer('SciPy solve_bvp, 1e-6, scaled and tuned', 'scipy', boundary_value(1e-6), 0.1),
    Peer('SciPy solve_bvp, 1e-3, scaled', 'scipy', boundary_value(1e-3, plain=True), 0.1),
    Peer('SciPy solve_bvp, 1e-6, scaled', 'scipy', boundary_value(1e-6, plain=True), 0.1),
    Peer(
        'SciPy solve_bvp, 1e-3, in seconds',
        'scipy',
        boundary_value(1e-3, plain=True, is_scaled=False),
        0.1,
    ),
    Peer(
        'SciPy solve_bvp, 1e-6, in seconds',
        'scipy',
        boundary_value(1e-6, plain=True, is_scaled=False),
        0.1,
    ),
    Peer('python-control point_to_point', 'control', python_control, 1.0),
)
"""All peers, from fast to slow."""
