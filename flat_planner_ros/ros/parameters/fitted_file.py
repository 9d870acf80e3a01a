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

"""A parameter file with the model that was fitted, as the nodes read it."""

from collections.abc import Iterator
from pathlib import Path
import re
from typing import Any

from flat_planner_ros.core.arm import FlatPlannerError, placed_masses, PlanarArm
from flat_planner_ros.core.model_fit import ModelFit
from flat_planner_ros.ros.parameters.arm_model import changed_link_inertia
from flat_planner_ros.ros.parameters.yaml_reader import parsed
import numpy as np
import yaml

DIGITS = 8
"""Significant digits of a written number."""

MATCHES = 'The scales of mismatch are 1.0 now: the model is what the simulated arm was.'


class UnwritableModel(FlatPlannerError):
    """A model that the form of the parameter file cannot say; the message names the remedy."""


def write_fitted(source: Path, fit: ModelFit, before: PlanarArm, target: Path) -> None:
    """
    Write a parameter file anew with another model, everything else as it was.

    But for the mismatch of a simulated arm, if there was one: what was found holds it already.

    Parameters
    ----------
    source
        File with the model from which the fit started.
    fit
        What was found; stands in the comment at the head.
    before
        The arm of the source.
    target
        File to write.

    Raises
    ------
    UnwritableModel
        The file has no model, or its form cannot say what was found.
    OSError
        The file cannot be written.

    """
    tree = parsed(source.read_text('utf-8'), str(source))
    blocks = list(_with_model(tree))
    if not blocks:
        raise UnwritableModel(f'{source} has no block with model: to be changed')
    for block in blocks:
        _change(block, fit.arm, before)
    remarks = [MATCHES] if _end_mismatch(tree) else []
    lines = ('The model was fitted:', *fit.text.splitlines(), *remarks)
    head = ''.join(f'# {line}\n' for line in lines)
    body = yaml.safe_dump(tree, sort_keys=False, default_flow_style=None, width=100)
    target.write_text(head + '\n' + body, 'utf-8')


def _with_model(tree: Any) -> Iterator[dict[str, Any]]:
    """Return the blocks that hold a model."""
    if isinstance(tree, dict):
        if isinstance(tree.get('model'), dict):
            yield tree
        for value in tree.values():
            yield from _with_model(value)


def _end_mismatch(tree: Any, group: str = '') -> bool:
    """Let a simulated arm be its model; return whether it was another one."""
    if not isinstance(tree, dict):
        return False
    changed = False
    for key, value in tree.items():
        name = f'{group}.{key}' if group == 'mismatch' else str(key)
        if re.fullmatch(r'mismatch\.\w+_scale', name):
            changed |= value != 1.0
            tree[key] = 1.0
        else:
            changed |= _end_mismatch(value, name)
    return changed


def _change(block: dict[str, Any], arm: PlanarArm, before: PlanarArm) -> None:
    """Put the values of an arm into a block."""
    model = block['model']
    model['stiffness'], model['damping'] = _rounded([arm.stiffness, arm.damping])
    block['friction'] = {
        'viscous': _rounded(arm.viscous_friction),
        'coulomb': _rounded(arm.coulomb_friction),
    }
    if 'inertia_star' in model:
        model['inertia_star'] = _rounded(arm.inertia_star)
        if _has_other_first_links(arm, before):
            _change_first_links(model, arm, model.get('tip_mass', 0.0))
        return
    if _has_other_first_links(arm, before):
        _change_first_links(model, arm, float(arm.carried_mass[-2]))
    inertia = changed_link_inertia(model['link_inertia'], arm, before)
    if min(inertia) < 0.0:
        raise UnwritableModel(
            f'link_inertia would be {inertia} kg m^2: the masses or centres of mass of '
            'the last two links are too large; give them by model.inertia_star instead'
        )
    model['link_inertia'] = _rounded(inertia)


def _has_other_first_links(arm: PlanarArm, before: PlanarArm) -> bool:
    """Tell whether inertias or static moments of the first links were fitted."""
    first = slice(arm.n - 2)
    return not (
        np.array_equal(np.diag(arm.inertia)[first], np.diag(before.inertia)[first])
        and np.array_equal(arm.static_moment[first], before.static_moment[first])
    )


def _change_first_links(model: dict[str, Any], arm: PlanarArm, tip_mass: float) -> None:
    """Put the first links' constants into a model; masses, which no motion tells, stay."""
    count = arm.n - 2
    length, mass = (
        np.array(model[name][:count], dtype=float) for name in ('link_length', 'link_mass')
    )
    com, inertia = placed_masses(
        length, mass, tip_mass, np.diag(arm.inertia)[:count], arm.static_moment[:count]
    )
    if inertia.min() < 0.0:
        raise UnwritableModel(
            f'link_inertia of the first links would be {inertia} kg m^2: with the masses in the '
            'file, which no motion in the plane tells, the links cannot have the inertias and '
            'static moments that were found; correct link_mass or tip_mass'
        )
    for name, found in (('link_com', com), ('link_inertia', inertia)):
        model[name] = [*_rounded(found), *model[name][count:]]


def _rounded(values: Any) -> list[float]:
    """Return numbers with the digits that are written."""
    return [float(f'{value:.{DIGITS}g}') for value in values]
