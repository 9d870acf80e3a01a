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

"""What is planned and what carries it out, one motion or many that differ in numbers alone."""

from dataclasses import dataclass, field, replace

from flat_planner_ros.core.arm import Drive, FloatArray, locked, PlanarArm
from flat_planner_ros.core.plant import DriveSettings
from flat_planner_ros.core.session import SessionSettings
from flat_planner_ros.core.tracking import TrackerSettings
import numpy as np
from numpy.typing import NDArray

LAST_LINKS = 4
"""Numbers of an arm's last two links: I*_{n-1}, I*_n, stiffness and damping."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Waypoint:
    """
    Pose to pass on the way.

    Attributes
    ----------
    time
        From the start [s]; 0 for the planner to choose.
    position
        Angles of all joints, shape (n,) [rad].

    """

    time: float
    position: tuple[float, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """
    One motion from rest to rest and the arm that carries it out.

    Attributes
    ----------
    settings
        Of the planner: nominal arm, strategy, limits, uncertainty, spacing of the command.
    true
        The arm that carries it out, which the planner does not know.
    start, final
        Joint angles, shape (n,) [rad].
    duration
        Of the motion [s]; 0 for the planner to choose.
    via
        Poses to pass.
    drives
        What moves the arm.
    step
        Longest integration step [s].
    tracker
        Feedback that carries the motion out; None where the command is played as it is.
    plays
        Whether the motion is simulated.

    """

    settings: SessionSettings
    true: PlanarArm
    start: tuple[float, ...]
    final: tuple[float, ...]
    duration: float = 0.0
    via: tuple[Waypoint, ...] = ()
    drives: DriveSettings = field(default_factory=DriveSettings)
    step: float = 1e-3
    tracker: TrackerSettings | None = None
    plays: bool = True

    @property
    def drive(self) -> Drive:
        """Return what moves joint n-1."""
        return self.drives.drive


@dataclass(frozen=True, kw_only=True, eq=False)
class Batch:
    """
    Cases that are one case with other numbers.

    Attributes
    ----------
    template
        The case.
    places
        Which rows of a chunk they are, shape (m,).
    starts, finals
        In place of the template's, shape (m, n) [rad].
    durations
        The same, shape (m,) [s].
    model, true
        The last two links of nominal and true arm: I*_{n-1}, I*_n [kg m^2], stiffness [N m/rad]
        and damping [N m s/rad], shape (m, 4); None where all are the template's.

    """

    template: Case
    places: NDArray[np.intp]
    starts: FloatArray
    finals: FloatArray
    durations: FloatArray
    model: FloatArray | None = None
    true: FloatArray | None = None

    def __post_init__(self) -> None:
        """Lock the arrays."""
        for name in ('places', 'starts', 'finals', 'durations'):
            locked(getattr(self, name))

    def __len__(self) -> int:
        """Return the number m of cases."""
        return len(self.places)

    def case(self, place: int) -> Case:
        """
        Return one of the cases.

        Raises
        ------
        InvalidModel
            Its numbers are no physical arm's.

        """
        template, settings = self.template, self.template.settings
        if self.model is not None:
            arm = with_last_links(settings.arm, self.model[place])
            settings = replace(settings, arm=arm)
        true = template.true
        if self.true is not None:
            true = with_last_links(true, self.true[place])
        return replace(
            template,
            settings=settings,
            true=true,
            start=tuple(self.starts[place].tolist()),
            final=tuple(self.finals[place].tolist()),
            duration=float(self.durations[place]),
        )


def with_last_links(arm: PlanarArm, numbers: FloatArray) -> PlanarArm:
    """Return an arm with other last links, shape (4,); friction stays."""
    both, last, stiffness, damping = numbers.tolist()
    return arm.with_last_links(
        inertia_star=(both, last),
        stiffness=stiffness,
        damping=damping,
        viscous=float(arm.viscous_friction[-1]),
        coulomb=float(arm.coulomb_friction[-1]),
    )


def last_links_of(arm: PlanarArm) -> FloatArray:
    """Return the numbers of an arm's last two links, shape (4,)."""
    return np.array([*arm.inertia_star, arm.stiffness, arm.damping])
