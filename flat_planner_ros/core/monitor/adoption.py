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

"""Rules by which a planner takes over an estimate of its arm's stiffness and damping."""

from dataclasses import dataclass, replace

from flat_planner_ros.core.arm import check_number, FlatPlannerError, InvalidRequest, PlanarArm
from flat_planner_ros.core.monitor.identification import ActuatedJoints, oscillating_inertia

INERTIA_TOLERANCE = 1e-6
"""Largest difference of an estimate's nominal inertia from the planner's, relative [-]."""

AGREEMENT = 3.0
"""Standard errors within which an estimate confirms the present values [-]."""

REFINEMENT = 1e-5
"""Change relative to the present value below which nothing is gained [-]."""

SAME_START = 1e-6
"""Largest distance of the starts of one motion, from rounding to microseconds [s]."""


class AdoptionRefused(FlatPlannerError):
    """There is no estimate to adopt, or it does not fit; the message says why."""


@dataclass(frozen=True, kw_only=True)
class ReportedEstimate:
    """
    Trustworthy estimate as a monitor reports it.

    Attributes
    ----------
    start_time
        Start of the motion that it follows [s].
    joint
        Name of the passive joint.
    stiffness, stiffness_std
        Estimate and standard error [N m/rad].
    damping, damping_std
        Estimate and standard error [N m s/rad].
    case
        Whether joint n-1 was free or held.
    inertia
        Nominal inertia on which the values rest [kg m^2].

    """

    start_time: float
    joint: str
    stiffness: float
    stiffness_std: float
    damping: float
    damping_std: float
    case: ActuatedJoints
    inertia: float

    def __post_init__(self) -> None:
        """Refuse numbers without meaning."""
        check_number('start_time', self.start_time, 's', error=InvalidRequest)
        for name, unit in {'stiffness': 'N m/rad', 'inertia': 'kg m^2'}.items():
            check_number(name, getattr(self, name), unit, above=0.0, error=InvalidRequest)
        for name in ('stiffness_std', 'damping', 'damping_std'):
            unit = 'N m/rad' if name == 'stiffness_std' else 'N m s/rad'
            check_number(name, getattr(self, name), unit, lower=0.0, error=InvalidRequest)

    def is_of_motion(self, start: float) -> bool:
        """Return whether the estimate follows the motion with a start [s]."""
        return abs(self.start_time - start) <= SAME_START

    def agrees_with(self, arm: PlanarArm) -> bool:
        """Return whether the arm has these values but for the standard errors."""
        return all(
            abs(new - old) <= AGREEMENT * std + REFINEMENT * old
            for new, old, std in (
                (self.stiffness, arm.stiffness, self.stiffness_std),
                (self.damping, arm.damping, self.damping_std),
            )
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Adoption:
    """
    Change of the nominal model to an estimate.

    Attributes
    ----------
    estimate
        Where the new values come from.
    former, arm
        The model before and after.

    """

    estimate: ReportedEstimate
    former: PlanarArm
    arm: PlanarArm


class ModelTuner:
    """
    Keeps the last trustworthy estimate and decides whether it may be adopted.

    A report without an estimate changes nothing: stiffness and damping belong to the arm, not to
    a motion, so an earlier estimate stays valid until it has been adopted.
    """

    def __init__(self) -> None:
        """Wait for an estimate."""
        self._estimate: ReportedEstimate | None = None
        self._adopted: ReportedEstimate | None = None

    @property
    def estimate(self) -> ReportedEstimate | None:
        """Return the last trustworthy estimate."""
        return self._estimate

    def hear(self, estimate: ReportedEstimate) -> None:
        """Take a trustworthy estimate."""
        self._estimate = estimate

    def propose(self, arm: PlanarArm, joint: str) -> Adoption:
        """
        Return the change that the last estimate asks for; `mark_adopted` it once it is made.

        Parameters
        ----------
        arm
            Nominal model of the planner.
        joint
            Name of its passive joint.

        Raises
        ------
        AdoptionRefused
            There is none, it was adopted before, it rests on another model, or it confirms the
            present values.

        """
        estimate = self._estimate
        if estimate is None:
            raise AdoptionRefused('no trustworthy estimate has been reported yet')
        if estimate == self._adopted:
            raise AdoptionRefused(
                f'the estimate from the motion that started at {estimate.start_time:.3f} s has '
                f'been adopted already'
            )
        if estimate.joint != joint:
            raise AdoptionRefused(f'the estimate is of {estimate.joint}, not of {joint}')
        inertia = oscillating_inertia(arm, estimate.case)
        if abs(estimate.inertia - inertia) > INERTIA_TOLERANCE * inertia:
            raise AdoptionRefused(
                f'the estimate rests on a nominal inertia of {estimate.inertia:.6g} kg m^2, the '
                f'model here has {inertia:.6g} kg m^2: give both nodes the same model'
            )
        if estimate.agrees_with(arm):
            raise AdoptionRefused(
                f'nothing to adopt: the estimate confirms the present stiffness '
                f'{arm.stiffness:.6g} N m/rad and damping {arm.damping:.6g} N m s/rad'
            )
        tuned = replace(arm, stiffness=estimate.stiffness, damping=estimate.damping)
        return Adoption(estimate=estimate, former=arm, arm=tuned)

    def mark_adopted(self, adoption: Adoption) -> None:
        """Remember that an adoption has been made, so that it is not made again."""
        self._adopted = adoption.estimate
