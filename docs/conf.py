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

"""Sphinx configuration: `make docs` builds the site into build/docs."""

from importlib.util import find_spec
import os
from pathlib import Path
import re
import subprocess
import sys

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / '_extensions'))

project = 'flat_planner_ros'
author = 'flat_planner_ros developers'
copyright = author  # noqa: A001  Sphinx reads this name.
version = re.search(r"version='([^']+)'", (HERE.parent / 'setup.py').read_text('utf-8')).group(1)
release = version

extensions = [
    'myst_parser',
    'sphinx.ext.autodoc',
    'numpydoc',
    'sphinx.ext.mathjax',
    'sphinx.ext.viewcode',
    'api_reference',
]

myst_enable_extensions = ['amsmath', 'dollarmath', 'colon_fence']
myst_heading_anchors = 3
numpydoc_show_class_members = False
autodoc_member_order = 'bysource'
autodoc_typehints = 'signature'
autodoc_preserve_defaults = True
python_display_short_literal_types = True

html_theme = 'furo'
html_title = f'flat_planner_ros {version}'
html_copy_source = False
exclude_patterns = ['_extensions']
nitpicky = False

# Formulas are rendered without a network where the package that ships the renderer is installed.
if find_spec('sphinx-mathjax-offline') is not None:
    extensions.append('sphinx-mathjax-offline')


def repository():
    """Return the address of the repository: REPOSITORY, or where this checkout comes from."""
    address = os.environ.get('REPOSITORY', '')
    if not address:
        try:
            asked = subprocess.run(
                ['git', '-C', HERE, 'remote', 'get-url', 'origin'], capture_output=True, text=True
            )
        except OSError:
            return ''
        address = asked.stdout.strip()
    # As a browser opens it, without what logs in.
    address = re.sub(r'^(?:ssh://)?git@([^:/]+)[:/]', r'https://\1/', address)
    address = re.sub(r'^(https?://)[^/@]*@', r'\1', address).removesuffix('.git')
    return address if re.match(r'https?://', address) else ''


if repository():
    html_theme_options = {
        'footer_icons': [
            {'name': 'Repository', 'url': repository(), 'html': 'Repository', 'class': ''}
        ]
    }

EXAMPLE = re.compile(r'^!\[[^]]*\]\(images/examples/(\w+)\.png\)$', re.MULTILINE)
"""Picture of an example, below which the site shows its source; a code host has the link above."""


def with_sources(_app, docname, source):
    """Put the source of each example below its picture; link the repository on the first page."""
    if docname == 'index' and repository():
        source[0] = source[0].replace(
            'the README of the repository', f'the README of the [repository]({repository()})'
        )
    if docname == 'examples':
        below = (
            r'\g<0>\n\n```{literalinclude} ../examples/\1.py\n:language: python\n:lines: 15-\n```'
        )
        source[0] = EXAMPLE.sub(below, source[0])


def setup(app):
    """Listen to the reading of pages."""
    app.connect('source-read', with_sources)
