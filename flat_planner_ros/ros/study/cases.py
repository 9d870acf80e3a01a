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

"""Cases of a study: what its names and values mean to planner, plant and tracker."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

from flat_planner_ros.core.arm import Drive, FlatPlannerError, FloatArray
from flat_planner_ros.core.planning import JointLimits
from flat_planner_ros.core.study import (
    Answer,
    Batch,
    Case,
    Column,
    InvalidStudy,
    last_links_of,
    refusal,
    Refused,
    Waypoint,
)
from flat_planner_ros.ros.parameters import planner, plant, tracker
from flat_planner_ros.ros.parameters.arm_model import model_defaults, MODEL_ROWS
from flat_planner_ros.ros.parameters.limits import LIMITS
from flat_planner_ros.ros.parameters.parameter_file import settings_of
from flat_planner_ros.ros.programs.command_line import pose_of, via_point
from flat_planner_ros.ros.study.spec import (
    ANGLE,
    DURATION,
    ELEMENT,
    PAYLOAD,
    ROWS,
    SIMULATE,
    Spec,
    TRACKER,
    VIA,
    VIA_ENTRY,
)
import numpy as np
from numpy.typing import NDArray

TEMPLATES_KEPT = 512
"""Combinations of all but numbers that a process remembers."""

SHARED = frozenset(row.name for row in MODEL_ROWS)
"""Parameters of the model, which planner, plant and tracker have alike."""

MODEL_NUMBERS = {
    'model.inertia_star[1]': 0,
    'model.inertia_star[2]': 1,
    'model.stiffness': 2,
    'model.damping': 3,
}
"""Names of the numbers of the last two links, with their places in a `Batch`."""

SCALES = {
    'plant.mismatch.inertia_scale': (0, 1),
    'plant.mismatch.stiffness_scale': (2,),
    'plant.mismatch.damping_scale': (3,),
}
"""Names of factors on these numbers of the true arm."""


class _Template(NamedTuple):
    """
    A case and its numbers.

    Attributes
    ----------
    case
        The case.
    model, plant
        The last links of its nominal arm, and of the true one before any mismatch, shape (4,).
    scales
        Factors on the latter, and the payload, by their names.

    """

    case: Case
    model: FloatArray
    plant: FloatArray
    scales: Mapping[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Cases:
    """
    Makes the cases of a study; survives pickling.

    Attributes
    ----------
    spec
        What the study is asked for.

    """

    spec: Spec

    def __eq__(self, other: object) -> bool:
        """Tell whether another one makes the same cases."""
        return isinstance(other, Cases) and self._mark == other._mark

    def __hash__(self) -> int:
        """Return a number that equal ones share."""
        return hash(self._mark)

    @cached_property
    def _mark(self) -> str:
        return self.spec.fingerprint

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """Return the names of the joints, which no row changes."""
        given = self.given('', self.spec.fixed)
        return tuple(given.get('joints', ()))

    def __call__(self, columns: Mapping[str, Column]) -> list[Batch | Refused]:
        """Return the cases of some rows, batch by batch."""
        numbers = {name: columns[name] for name in columns if self._is_number(name, columns[name])}
        count = len(next(iter(columns.values()))) if columns else 1
        found: list[Batch | Refused] = []
        wrong = np.zeros(count, dtype=bool)
        for places, said in _out_of_range(numbers):
            found.append(Refused(places, said))
            wrong[places] = True
        for key, places in _groups({n: c for n, c in columns.items() if n not in numbers}, count):
            right = places[~wrong[places]]
            if not right.size:
                continue
            template = _template(self, key)
            if isinstance(template, Answer):
                found.append(Refused(right, template))
                continue
            here = {name: values[right] for name, values in numbers.items()}
            try:
                found.append(self._batch(template, right, here))
            except FlatPlannerError as error:
                found.append(Refused(right, refusal(error)))
        return found

    def given(self, prefix: str, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return what a node is given in a row, by the names of its parameters."""
        own = dict(self.spec.given[prefix])
        own.update({n: v for n, v in model_defaults(own).items() if n not in own})
        base = dict(self.spec.given[''])
        plain = {n: v for n, v in values.items() if _parameter(n) in SHARED or not prefix}
        for name, value in plain.items():
            parameter = _parameter(name)
            if parameter not in ROWS or name.startswith(('plant.', 'tracker.')):
                continue
            # A node whose file gives it another model keeps it.
            if prefix == '' or own.get(parameter) == base.get(parameter, own.get(parameter)):
                _enter(own, name, value)
        for name, value in values.items():
            if prefix and name.startswith(prefix) and _parameter(name) in ROWS:
                _enter(own, name.removeprefix(prefix), value)
        return {name: list(v) if isinstance(v, tuple) else v for name, v in own.items()}

    def template(self, values: Mapping[str, Any]) -> _Template:
        """
        Return the case of some values, with its numbers.

        Raises
        ------
        FlatPlannerError
            No node would start with them, or they contradict each other.

        """
        settings = settings_of(self.given('', values), planner.ROWS, planner.build).session
        true = self._plant(values)
        simulation = true.simulation
        start, via, final = poses_of(values, settings.joints)
        is_tracked = bool(values.get(TRACKER, False))
        if is_tracked and simulation.drives.drive is Drive.POSITION:
            raise InvalidStudy('a tracker gives efforts, and servos take positions')
        loop = None
        if is_tracked:
            given = self.given('tracker.', values)
            loop = settings_of(given, tracker.ROWS, tracker.build).tracker
        case = Case(
            settings=settings,
            true=simulation.arm,
            start=start,
            final=final,
            duration=float(values.get(DURATION, 0.0)),
            via=via,
            drives=simulation.drives,
            step=simulation.step,
            tracker=loop,
            plays=bool(values.get(SIMULATE, True)),
        )
        if not self._has_numbers:
            return _Template(case, np.empty(0), np.empty(0), {})
        plain = {**values, **dict.fromkeys(SCALES, 1.0)}
        given = self.given('plant.', values)
        scales = {name: float(given.get(name.removeprefix('plant.'), 1.0)) for name in SCALES}
        return _Template(
            case,
            last_links_of(settings.arm),
            last_links_of(self._plant(plain).simulation.arm),
            {**scales, PAYLOAD: float(values.get(PAYLOAD, 0.0))},
        )

    def _plant(self, values: Mapping[str, Any]) -> plant.PlantSettings:
        """Return the settings of the plant."""
        return settings_of(self.given('plant.', values), plant.ROWS, plant.build)

    @cached_property
    def _is_even(self) -> bool:
        """Whether every arm is balanced, so that its last two links are told by numbers."""
        names = {*self.spec.names, *self.spec.given[''], *self.spec.given['plant.']}
        return not any('imbalance' in name for name in names)

    @cached_property
    def _has_numbers(self) -> bool:
        """Whether numbers of the last two links vary, or may."""
        wanted = {*MODEL_NUMBERS, *SCALES, PAYLOAD}
        return self._is_even and bool(wanted & {*self.spec.axes.names, *self.spec.fixed})

    def _is_number(self, name: str, values: Column) -> bool:
        """Tell whether a column is one of numbers that a batch takes as they are."""
        if values.dtype != np.float64:
            return False
        if name == DURATION:
            return True
        if ANGLE.fullmatch(name):
            return not any(n == VIA or VIA_ENTRY.fullmatch(n) for n in self.spec.names)
        if name == 'plant.mismatch.inertia_scale' and len(self.joints) > 2:
            return False
        if name in MODEL_NUMBERS and f'plant.{name}' in self.spec.names:
            return False
        return self._is_even and (name in MODEL_NUMBERS or name in SCALES or name == PAYLOAD)

    def _batch(
        self, template: _Template, places: NDArray[np.intp], numbers: Mapping[str, Column]
    ) -> Batch:
        """Return a template with other numbers."""
        case, count, joints = template.case, len(places), self.joints
        starts, changes = np.tile(case.start, (count, 1)), {}
        for name in numbers:
            if match := ANGLE.fullmatch(name):
                if match['joint'] not in joints:
                    raise InvalidStudy(f'{name}: the arm has {", ".join(joints)}')
                changes[name] = joints.index(match['joint'])
        for name, joint in changes.items():
            if name.startswith('start.'):
                starts[:, joint] = numbers[name]
        # Joints whose goal is not named stay where they start.
        named = [n.removeprefix('goal.') for n in self.spec.names if n.startswith('goal.')]
        finals = starts.copy()
        for joint, name in enumerate(joints):
            if name in named:
                finals[:, joint] = numbers.get(f'goal.{name}', case.final[joint])
        if case.via:
            finals = np.tile(case.final, (count, 1))
        model, true = self._links(template, count, numbers)
        return Batch(
            template=case,
            places=places,
            starts=starts,
            finals=finals,
            durations=np.array(numbers.get(DURATION, np.full(count, case.duration))),
            model=model,
            true=true,
        )

    def _links(
        self, template: _Template, count: int, numbers: Mapping[str, Column]
    ) -> tuple[FloatArray | None, FloatArray | None]:
        """Return the last links of nominal and true arms, shape (m, 4) each, None if as given."""
        if not self._has_numbers:
            return None, None
        scales = template.scales
        model, true = (np.tile(links, (count, 1)) for links in (template.model, template.plant))
        for name, place in MODEL_NUMBERS.items():
            if name in numbers:
                model[:, place] = numbers[name]
                true[:, place] = numbers[name]
        for name, affected in SCALES.items():
            for place in affected:
                true[:, place] *= numbers.get(name, scales[name])
        payload = true[:, 1] * numbers.get(PAYLOAD, scales[PAYLOAD])
        true[:, :2] += payload[:, None]
        varies = any(name in MODEL_NUMBERS for name in numbers)
        return model if varies else None, true


@lru_cache(maxsize=TEMPLATES_KEPT)
def _template(cases: Cases, key: tuple[tuple[str, Any], ...]) -> _Template | Answer:
    """Return the template of what is no number, or why there is none."""
    values = {**cases.spec.fixed, **{name: v for name, v in key if v is not None}}
    try:
        return cases.template(values)
    except FlatPlannerError as error:
        return refusal(error)


def poses_of(
    values: Mapping[str, Any], joints: Sequence[str]
) -> tuple[tuple[float, ...], tuple[Waypoint, ...], tuple[float, ...]]:
    """Return start, via points and goal of a row; joints without a name stay where they are."""
    named: dict[str, dict[str, float]] = {'start': {}, 'goal': {}}
    via = [via_point(text) for text in values.get(VIA, ())]
    for name, value in values.items():
        if match := ANGLE.fullmatch(name):
            named[match[1]][match['joint']] = value
        elif match := VIA_ENTRY.fullmatch(name):
            number = int(match['number'])
            via += [({}, 0.0)] * (number - len(via))
            pose, time = via[number - 1]
            is_time = match['what'] == 'time'
            changed = pose if is_time else {**pose, match['what']: value}
            via[number - 1] = (changed, value if is_time else time)
    pose = dict(zip(joints, pose_of(named['start'], joints, 'start').tolist(), strict=True))
    poses = [tuple(pose.values())]
    for what, changes in [*(('via', point) for point, _ in via), ('goal', named['goal'])]:
        pose_of(changes, joints, what)
        pose.update(changes)
        poses.append(tuple(pose.values()))
    waypoints = (
        Waypoint(time=time, position=position)
        for (_, time), position in zip(via, poses[1:-1], strict=True)
    )
    return poses[0], tuple(waypoints), poses[-1]


def _parameter(name: str) -> str:
    """Return the name of the parameter that a name is of, without a number of a list."""
    element = ELEMENT.fullmatch(name)
    return element['name'] if element else name


def _enter(given: dict[str, Any], name: str, value: Any) -> None:
    """Set a parameter, or one number of a list."""
    element = ELEMENT.fullmatch(name)
    if element is None:
        given[name] = value
        return
    parameter, place = element['name'], int(element['number']) - 1
    numbers = list(given.get(parameter, ())) or _no_limits(given, parameter)
    if place >= len(numbers):
        raise InvalidStudy(f'{name}: {parameter} has {len(numbers)} numbers')
    numbers[place] = value
    given[parameter] = numbers


def _no_limits(given: Mapping[str, Any], parameter: str) -> list[float]:
    """Return the numbers of a limit of joints that is not set; none for other parameters."""
    unlimited = JointLimits.of(len(given.get('joints', ())))
    limits = {f'limits.{name}': getattr(unlimited, name) for name in LIMITS}
    return list(limits[parameter].tolist()) if parameter in limits else []


def _out_of_range(numbers: Mapping[str, Column]) -> Iterator[tuple[NDArray[np.intp], Answer]]:
    """Return rows with a number that no node would take, and what it would say."""
    taken: set[int] = set()
    for name, values in numbers.items():
        row = ROWS.get(_parameter(name))
        if row is None:
            continue
        bad = np.flatnonzero(
            ~(np.isfinite(values) & (values >= row.lower) & (values <= row.upper))
        )
        new = np.array([place for place in bad.tolist() if place not in taken], dtype=np.intp)
        taken.update(new.tolist())
        if new.size:
            try:
                row.check(float(values[new[0]]))
            except FlatPlannerError as error:
                yield new, refusal(error)


def _groups(
    columns: Mapping[str, Column], count: int
) -> Iterator[tuple[tuple[tuple[str, Any], ...], NDArray[np.intp]]]:
    """Return rows that are equal but for numbers, by what they share."""
    if not columns:
        yield (), np.arange(count)
        return
    found: dict[tuple[Any, ...], list[int]] = {}
    for place, key in enumerate(zip(*(c.tolist() for c in columns.values()), strict=True)):
        found.setdefault(key, []).append(place)
    for key, places in found.items():
        yield tuple(zip(columns, key, strict=True)), np.array(places)


def with_values(cases: Cases, number: int) -> dict[str, Any]:
    """Return all that is set in a row, by name."""
    drawn = cases.spec.axes.columns(number, number + 1)
    row = {name: values.tolist()[0] for name, values in drawn.items()}
    return {**cases.spec.fixed, **{name: v for name, v in row.items() if v is not None}}
