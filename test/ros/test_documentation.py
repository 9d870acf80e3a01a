"""The interface document tells the truth about names, defaults and codes."""

from pathlib import Path
import re

from flat_planner_ros.ros import (
    interfaces,
    monitor_parameters,
    planner_parameters,
    plant_parameters,
)
import pytest

TEXT = (Path(__file__).resolve().parents[2] / 'docs' / 'interfaces.md').read_text('utf-8')
ROWS = {
    row.name: row
    for module in (planner_parameters, plant_parameters, monitor_parameters)
    for row in module.ROWS
}
TOPICS = sorted(
    value
    for name, value in vars(interfaces).items()
    if name.isupper() and isinstance(value, str) and value.startswith(('~/', '/'))
)


def documented() -> dict[str, str]:
    """Return the default of every parameter in the tables."""
    start = TEXT.index('## Parameters')
    return dict(re.findall(r'^\| `([\w.]+)` \| `?([^`|]*?)`? \|', TEXT[start:], re.MULTILINE))


@pytest.mark.parametrize('name', sorted(ROWS))
def test_a_parameter_is_documented_with_its_default(name):
    default = ROWS[name].default
    if isinstance(default, bool):
        expected = str(default).lower()
    else:
        expected = str(default) if isinstance(default, str | float | int) else 'not set'
    assert documented()[name] == expected


def test_no_parameter_is_documented_that_does_not_exist():
    assert set(documented()) == set(ROWS)


@pytest.mark.parametrize('topic', TOPICS)
def test_a_topic_or_service_is_documented(topic):
    assert f'`{topic}`' in TEXT


@pytest.mark.parametrize('reason', interfaces.ERROR_CODES, ids=lambda reason: reason.name)
def test_an_error_code_is_documented(reason):
    assert f'| {interfaces.ERROR_CODES[reason]} | `{reason.value}` |' in TEXT
