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
YAML as the nodes read it.

What a plain word means differs between YAML 1.1 (PyYAML), YAML 1.2 and rcl, which reads parameter
files for the nodes: 2.31e6 is text, a number, a number; inf is text, text, a number; yes is true,
text, true; 1:30 is 90, text, text; 010 is 8, 10, 8. PyYAML's syntax is taken, and rcl's meaning
(rcl_yaml_param_parser, get_value).
"""

from math import isinf
import re
from typing import Any

from flat_planner_ros.ros.parameters.row import InvalidParameter
import yaml

TRUE = 'y|Y|yes|Yes|YES|true|True|TRUE|on|On|ON'
FALSE = 'n|N|no|No|NO|false|False|FALSE|off|Off|OFF'

INTEGER = r'[-+]?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)'
"""What C's strtol takes as a whole, with any base."""

DECIMAL = r'[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?'
HEXADECIMAL = r'[-+]?0[xX]([0-9a-fA-F]+\.?[0-9a-fA-F]*|\.[0-9a-fA-F]+)([pP][-+]?[0-9]+)?'
WORD = r'[-+]?([iI][nN][fF]([iI][nN][iI][tT][yY])?|[nN][aA][nN])'
DOTTED = r'[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)'
"""What C's strtod takes as a whole, and YAML's own words for no numbers."""

LARGEST = 2**63 - 1
"""Integers beyond are read as floating-point numbers."""


class _Loader(yaml.SafeLoader):  # type: ignore[misc]  # yaml has no types
    """Takes plain words as rcl does, and everything in quotes as text."""

    yaml_implicit_resolvers: dict[str, Any] = {}


def _number(loader: _Loader, node: Any) -> int | float | str:
    """Return what rcl makes of a word that looks like a number."""
    text = loader.construct_scalar(node)
    if re.fullmatch(INTEGER, text):
        digits = text.lstrip('+-').lower()
        is_octal = len(digits) > 1 and digits.startswith('0') and not digits.startswith('0x')
        value = int(text, 8 if is_octal else 0)
        if -LARGEST - 1 <= value <= LARGEST:
            return value
    if re.fullmatch(f'{WORD}|{DOTTED}', text):
        return float(text.replace('.', ''))
    number = float.fromhex(text) if 'x' in text.lower() else float(text)
    return text if isinf(number) else number  # out of range


_Loader.add_implicit_resolver('bool', re.compile(f'^({TRUE}|{FALSE})$'), list('yYnNtTfFoO'))
_Loader.add_implicit_resolver(
    'number',
    re.compile(f'^({INTEGER}|{DECIMAL}|{HEXADECIMAL}|{WORD}|{DOTTED})$'),
    list('-+.0123456789iInN'),
)
_Loader.add_constructor(
    'bool', lambda loader, node: loader.construct_scalar(node) in TRUE.split('|')
)
_Loader.add_constructor('number', _number)


def parsed(text: str, source: str) -> Any:
    """
    Return YAML as Python values.

    Parameters
    ----------
    text
        The document.
    source
        Where it is from, for the complaint.

    Raises
    ------
    InvalidParameter
        It is no YAML.

    """
    try:
        return yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        reason = ' '.join(str(error).replace('in "<unicode string>", ', 'in ').split())
        raise InvalidParameter(f'{source} is not valid YAML: {reason}') from error
