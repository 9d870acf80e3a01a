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
The motion that tells most of the least certain parameter, one after the other.

Greedy and of the kind of E-optimal designs (Fedorov, Theory of Optimal Experiments, 1972): among
the motions that are allowed, the one after which the largest standard error, relative to its
parameter's scale, is smallest. D-optimal motions would make what is certain more so.
"""

from math import inf, pi

from flat_planner_ros.core.arm import FlatPlannerError, FloatArray, InvalidRequest, PlanarArm
from flat_planner_ros.core.excitation.candidates import Bounds, Candidate, candidates, REFINEMENT
from flat_planner_ros.core.excitation.certainty import relative_errors
from flat_planner_ros.core.excitation.first_joints import FirstJoints
from flat_planner_ros.core.excitation.motions import Heard, joined, Proposal
from flat_planner_ros.core.excitation.settings import (
    ExcitationSettings,
    GROWTH,
    PLAUSIBLE,
    Room,
)
from flat_planner_ros.core.model_fit import (
    first_misprediction,
    fit_model,
    foresee,
    information,
    Measurements,
    misprediction,
    ModelFit,
    NAMES,
)
from flat_planner_ros.core.planning import JointLimits, PlanningOptions
import numpy as np

DELAY = NAMES.index('delay')
"""Place of the delay of the efforts in NAMES."""

SOUGHT = 6
"""Parameters that are to become certain, of NAMES; offset and delay only have to be known with."""

WIDE, NARROW = 0.5, 0.2
"""Margins of what is foreseen, before a motion was as predicted and after [-]."""

KEPT = 6
"""Motions, the last ones, to which the model is fitted on the way: earlier ones are smaller."""

STANDS = 20.0
"""Range of the angle of joint n-1, in terms of the noise, below which it has not moved [-]."""

MOVED = 0.03
"""Share of the planned distance that shows in which direction the arm moved [-]."""


class Excitation:
    """
    Chooses motions, learns from them, and grows only while they go as predicted.

    The first motion may use a share of the effort limit and of the range. Each motion is predicted
    by the model of all before it, from the efforts that acted; only one that went as predicted
    lets the next be larger. Of arms of three and more joints the last two links come first, by
    motions of joint n-1 alone: the rows of the others rest on its friction. Then all joints move,
    if the room has the first ones.

    Parameters
    ----------
    arm, options, limits
        Model, options and limits of the planner that plans the goals.
    room
        Where the arm may be.
    settings
        What to reach, and how carefully.

    """

    def __init__(
        self,
        arm: PlanarArm,
        options: PlanningOptions,
        limits: JointLimits,
        room: Room,
        settings: ExcitationSettings | None = None,
    ) -> None:
        """Know what the parameter file says, roughly."""
        self.settings = settings or ExcitationSettings()
        self._arm = arm
        self._options = options
        self._limits = limits
        self._room = room
        self._share = self.settings.first_share
        self._margin = WIDE
        self._attempts = 0
        self._estimate = arm
        self._noise = np.full(2, self.settings.noise)
        self._known = np.zeros((len(NAMES), len(NAMES)))
        self._reached = np.full(len(NAMES), inf)
        self._scales = np.zeros(len(NAMES))
        self._parts: list[Measurements] = []
        self._planned = self._delay = 0.0
        self._firsts: FirstJoints | None = None
        if room.firsts:
            self._firsts = FirstJoints(arm, options, limits, room, self.settings)
        self._parts_of_all = 0

    @property
    def estimate(self) -> PlanarArm:
        """Return the model so far."""
        return self._estimate

    @property
    def share(self) -> float:
        """Return the share of effort limit and range that joint n-1 alone may use next [-]."""
        return self._share

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of all parameters, in the order of their standard errors."""
        return NAMES if self._firsts is None else (*NAMES, *self._firsts.names)

    @property
    def untold(self) -> tuple[str, ...]:
        """Return what no motion that was looked at would tell of the first links."""
        return () if self._firsts is None else self._firsts.untold

    @property
    def measurements(self) -> Measurements:
        """Return all motions so far, with gaps between them."""
        return joined(self._parts)

    @property
    def record_time(self) -> float:
        """Return how long the arm is to be recorded after a motion [s]."""
        return self.settings.rest * 2 * pi / self._estimate.natural_mode().frequency

    @property
    def is_certain(self) -> bool:
        """Tell whether every parameter is as certain as wanted."""
        return self._are_last_certain and (self._firsts is None or self._firsts.is_certain)

    @property
    def is_done(self) -> bool:
        """Tell whether there is nothing more to be done: certain, and one prediction held."""
        has_held = self._margin == NARROW and (self._firsts is None or self._firsts.has_held)
        return (self.is_certain and has_held) or len(self._parts) >= self.settings.most_motions

    @property
    def _are_last_certain(self) -> bool:
        """Tell whether the last two links are as certain as wanted."""
        return bool((self._reached[:SOUGHT] <= self.settings.accuracy).all())

    @property
    def _moving_firsts(self) -> FirstJoints | None:
        """Return the first joints if they move next: the last two links are known by then."""
        return self._firsts if self._are_last_certain and self._margin == NARROW else None

    def propose(self, here: FloatArray) -> Proposal:
        """
        Return the motion that makes the least certain parameter most certain.

        Parameters
        ----------
        here
            Measured joint angles, shape (n,) [rad].

        Raises
        ------
        InvalidRequest
            No motion is allowed from here.

        """
        if self._moving_firsts is not None:
            return self._with_all_joints(self._moving_firsts, here)
        bounds = Bounds(
            limits=self._limits, room=self._room, share=self._share, margin=self._margin
        )
        found = [
            (candidate, *information(self._estimate, candidate.motion, self._noise, REFINEMENT))
            for candidate in candidates(
                here, self._arm, self._options, self._estimate, bounds, self.settings.rest
            )
        ]
        if not found:
            raise InvalidRequest(
                f'no motion from {here[-2]:.4g} rad stays within {self._share:.2g} of the effort '
                f'limit {self._room.effort:.4g} N m and between {self._room.low:.4g} and '
                f'{self._room.high:.4g} rad; raise the limits, or let the arm swing out'
            )
        self._scales = np.maximum(self._scales, np.max([scales for *_, scales in found], axis=0))
        after = [relative_errors(self._known + told, self._scales) for _, told, _ in found]
        best = min(range(len(found)), key=lambda index: after[index][:SOUGHT].max())
        before = relative_errors(self._known, self._scales)
        firsts = np.empty(0) if self._firsts is None else self._firsts.errors
        return self._proposal(
            found[best][0],
            here,
            NAMES[int(np.argmax(before[:SOUGHT]))],
            np.append(before, firsts),
            np.append(after[best], firsts),
        )

    def hear(self, measurements: Measurements) -> Heard:
        """
        Learn from a motion that was carried out.

        Parameters
        ----------
        measurements
            Of the motion and of the time after it.

        Raises
        ------
        InvalidRequest
            Motions of one size were mispredicted too often, or signs contradict each other: the
            arm is not what the model says.

        """
        if self._moving_firsts is not None:
            return self._heard_all(self._moving_firsts, measurements)
        self._check_signs(measurements)
        wrong = misprediction(self._estimate, measurements)
        holds = bool((wrong <= self.settings.agreement).all())
        self._parts.append(measurements)
        fit = self._fitted()
        if fit is not None:
            self._estimate = fit.arm
            self._noise = np.maximum(fit.residual_rms, 1e-9)
            stds = np.array([estimate.std for estimate in fit.estimates[: len(NAMES)]])
            self._reached = stds / self._scales
            self._delay = fit.estimates[DELAY].value
        self._known = self._known + self._told(measurements)
        self._grow(holds, wrong)
        return self._heard(wrong, holds, fit)

    def _heard_all(self, firsts: FirstJoints, measurements: Measurements) -> Heard:
        """Learn from a motion of all joints; the last two links are known by then."""
        firsts.check_signs(measurements)
        wrong = misprediction(self._estimate, measurements)
        of_links = first_misprediction(self._estimate, measurements, self._delay)
        self._parts.append(measurements)
        self._parts_of_all += 1
        last = joined(self._parts[-min(self._parts_of_all, KEPT) :])
        self._estimate = firsts.learn(last, measurements, self._estimate, self._delay)
        firsts.grow(np.append(of_links, wrong.max()))
        wrong = np.append(wrong, of_links)
        return self._heard(wrong, bool((wrong <= self.settings.agreement).all()), None)

    def _heard(self, wrong: FloatArray, holds: bool, fit: ModelFit | None) -> Heard:
        """Return what a motion has told, of all parameters."""
        reached = self._reached
        if self._firsts is not None:
            reached = np.append(reached, self._firsts.reached)
        return Heard(misprediction=wrong, holds=holds, fit=fit, reached=reached)

    def _with_all_joints(self, firsts: FirstJoints, here: FloatArray) -> Proposal:
        """Return the motion that makes the least certain of the first links most certain."""
        chosen = firsts.choose(here, self._estimate, float(self._noise[-1]))
        last = relative_errors(self._known, self._scales)
        return self._proposal(
            chosen.candidate.candidate,
            here,
            firsts.names[chosen.sought],
            np.append(last, chosen.before),
            np.append(last, chosen.after),
        )

    def _proposal(
        self,
        candidate: Candidate,
        here: FloatArray,
        sought: str,
        before: FloatArray,
        after: FloatArray,
    ) -> Proposal:
        """Return a motion with standard errors of all parameters."""
        self._planned = float(candidate.final[-2] - here[-2])
        scales = self._scales
        if self._firsts is not None:
            scales = np.append(scales, self._firsts.scales)
        return Proposal(
            candidate=candidate,
            sought=sought,
            names=self.names,
            before=before,
            after=after,
            scales=scales,
        )

    def _check_signs(self, measurements: Measurements) -> None:
        """Refuse an arm that moves the other way, or whose efforts would move it that way."""
        angles = measurements.positions[:, -2]
        travelled = float(angles[-1] - angles[0])
        if abs(travelled) < MOVED * abs(self._planned):
            return
        if travelled * self._planned < 0.0:
            raise InvalidRequest(
                f'joint n-1 turned by {travelled:.3g} rad where {self._planned:.3g} rad were '
                'planned: the sign of its effort or of its angle is wrong'
            )
        steps = np.gradient(measurements.times)
        momentum = np.cumsum(measurements.efforts[:, -1] * steps)
        if float(momentum @ steps) * travelled < 0.0:
            raise InvalidRequest(
                f'joint n-1 turned by {travelled:.3g} rad, its measured efforts would turn it the '
                'other way: their sign is wrong'
            )

    def _fitted(self) -> ModelFit | None:
        """Return the fit of the last motions, None if no plausible model explains them."""
        if np.ptp(self._parts[-1].positions[:, -2]) < STANDS * self.settings.noise:
            return None
        heard = joined(self._parts[-KEPT:])
        try:
            fit = fit_model(heard, self._arm)
        except (FlatPlannerError, np.linalg.LinAlgError):
            return None
        found, believed = (
            np.array([*arm.inertia_star, arm.stiffness]) for arm in (fit.arm, self._arm)
        )
        is_plausible = (np.maximum(found / believed, believed / found) < PLAUSIBLE).all()
        # An arm that sticks may tell of nothing, and the model as it was would move all the more.
        explains = (fit.residual_rms < heard.positions[:, -2:].std(axis=0)).all()
        return fit if is_plausible and explains else None

    def _told(self, measurements: Measurements) -> FloatArray:
        """Return the information of a motion by the present model and noise, shape (8, 8)."""
        count = round(float(np.ptp(measurements.times)) / measurements.period)
        times = np.linspace(0.0, count * measurements.period, count + 1)
        since = measurements.times - measurements.times[0]
        effort = np.interp(times, since, measurements.efforts[:, -1])
        told, _ = information(self._estimate, foresee(self._estimate, times, effort), self._noise)
        return told

    def _grow(self, holds: bool, wrong: FloatArray) -> None:
        """Allow more after a prediction that held, and give up after too many that did not."""
        if holds:
            self._share = min(GROWTH * self._share, 1.0)
            self._margin, self._attempts = NARROW, 0
            return
        self._attempts += 1
        if self._attempts >= self.settings.most_attempts:
            raise InvalidRequest(
                f'{self._attempts} motions of one size were mispredicted, the last by '
                f'{wrong[0]:.2g} of the motion of link n-1 and {wrong[1]:.2g} of that of the '
                'passive joint: are the units of the efforts right, is friction above '
                f'{self._share:.2g} of the effort limit, does something touch the arm?'
            )
