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

"""Message types by name: their classes, and their definitions as recordings state them."""

from importlib import import_module
from pathlib import Path
import re
from typing import Any

from flat_planner_ros.core.arm import FlatPlannerError

SEPARATOR = '=' * 80
"""Between the definitions of a type and of those it is made of, as the MCAP registry asks."""

NESTED = re.compile(r'(\w+)/(\w+)')
"""A message type in the type of a field, e.g. in `sequence<std_msgs/Header>`."""


class UnknownType(FlatPlannerError):
    """A message type that is not installed here."""


def message_class(name: str) -> Any:
    """
    Return the class of a message type.

    Parameters
    ----------
    name
        Name with its package, e.g. ``sensor_msgs/msg/JointState``.

    Raises
    ------
    UnknownType
        The package is not installed, or has no such type.

    """
    package, _, kind = _parts(name)
    try:
        return getattr(import_module(f'{package}.msg'), kind)
    except (ImportError, AttributeError) as error:
        raise UnknownType(f'the message type {name} is not installed') from error


def definition(name: str) -> str:
    """
    Return the definition of a message type followed by those of all types in it.

    Parameters
    ----------
    name
        Name with its package, e.g. ``sensor_msgs/msg/JointState``.

    Raises
    ------
    UnknownType
        A type is not installed with its definition.

    """
    package, _, kind = _parts(name)
    wanted, texts = [f'{package}/{kind}'], []
    for nested in wanted:  # grows while it is walked
        package, kind = nested.split('/')
        message = message_class(f'{package}/msg/{kind}')
        texts.append(_definition_file(package, kind).read_text('utf-8'))
        for field in message.get_fields_and_field_types().values():
            found = NESTED.search(field)
            if found and found[0] not in wanted:
                wanted.append(found[0])
    others = (
        f'{SEPARATOR}\nMSG: {nested}\n{text}'
        for nested, text in zip(wanted[1:], texts[1:], strict=True)
    )
    return '\n'.join((texts[0], *others))


def _parts(name: str) -> tuple[str, str, str]:
    """Return package, kind of interface and name of a type."""
    parts = tuple(name.split('/'))
    if len(parts) != 3 or parts[1] != 'msg':
        raise UnknownType(f'{name} is no message type; they read package/msg/Name')
    return parts


def _definition_file(package: str, kind: str) -> Path:
    """Return the installed definition, beside the installed Python package."""
    module = import_module(package)
    for prefix in Path(str(module.__file__)).parents:
        path = prefix / 'share' / package / 'msg' / f'{kind}.msg'
        if path.is_file():
            return path
    raise UnknownType(f'the definition of {package}/msg/{kind} is not installed')
