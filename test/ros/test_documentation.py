"""The interface document tells the truth about names, defaults and codes."""

from pathlib import Path
import subprocess
import sys

from flat_planner_ros.ros import interfaces
import pytest

DOCS = Path(__file__).resolve().parents[2] / 'docs'
TEXT = (DOCS / 'interfaces.md').read_text('utf-8')
TOPICS = sorted(
    value
    for name, value in vars(interfaces).items()
    if name.isupper() and isinstance(value, str) and value.startswith(('~/', '/'))
)


def test_the_tables_of_parameters_are_those_of_the_code():
    command = [sys.executable, str(DOCS / 'parameter_tables.py'), '--check']
    assert subprocess.run(command, check=False).returncode == 0, 'run docs/parameter_tables.py'


@pytest.mark.parametrize('topic', TOPICS)
def test_a_topic_or_service_is_documented(topic):
    assert f'`{topic}`' in TEXT


@pytest.mark.parametrize('reason', interfaces.ERROR_CODES, ids=lambda reason: reason.name)
def test_an_error_code_is_documented(reason):
    assert f'| {interfaces.ERROR_CODES[reason]} | `{reason.value}` |' in TEXT
