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

"""The page of the live view in a real browser, where there is one."""

import csv
from pathlib import Path
import re
import shutil
import signal

import pytest
from ros.conftest import TIMEOUT
from ros.live_view.viewer import start_demo, View

CHROMIUM = next(filter(None, map(shutil.which, ('chromium', 'chromium-browser'))), None)

JOINT = '#goal-joints [name=joint1]'

BROWSER_ARGUMENTS = [
    '--no-sandbox',
    '--disable-gpu',
    '--disable-quic',
    '--no-first-run',
    '--disable-background-networking',
    '--disable-component-update',
    '--disable-sync',
]


@pytest.mark.skipif(CHROMIUM is None, reason='no Chromium')
def test_a_goal_through_the_page_in_a_browser(graph, tmp_path):
    playwright = pytest.importorskip('playwright.sync_api')
    expect = playwright.expect
    # A busy machine needs time to plan.
    delays = ('replan.lookahead:=1.0', 'start_delay:=0.5')
    start_demo(graph, *(word for delay in delays for word in ('-p', f'flat_planner:{delay}')))
    view = View(graph)
    complaints: list[str] = []
    patience = 1000 * TIMEOUT
    with playwright.sync_playwright() as library:
        chromium = library.chromium.launch(executable_path=CHROMIUM, args=BROWSER_ARGUMENTS)
        page = chromium.new_page(viewport={'width': 1280, 'height': 900})
        page.on('pageerror', lambda error: complaints.append(str(error)))
        page.on('console', lambda message: complaints.append(message.text))
        page.goto(view.url)
        expect(page.locator('#connection')).to_have_text('live', timeout=patience)
        stiffness = page.locator('[name="mismatch.stiffness_scale"]')
        expect(stiffness).to_have_value('1', timeout=patience)
        stiffness.fill('1.1')
        page.click('[data-node=flat_plant] .main')
        expect(page.locator('[data-node=flat_plant] .answer')).to_have_text(
            'mismatch.stiffness_scale = 1.1', timeout=patience
        )
        # A goal starts where the arm is, and shows degrees beside radians.
        expect(page.locator(JOINT)).to_have_value('0', timeout=patience)
        page.fill(JOINT, '1.0')
        expect(page.locator('#goal-joints .degrees')).to_have_text('57.3°')
        page.fill('#duration', '0.5')
        page.click('#goal .main')
        expect(page.locator('#goal-answer')).to_contain_text('plan 1', timeout=patience)
        expect(page.locator('#goal-answer')).to_contain_text(re.compile('starts in 0'))
        expect(page.locator('#prediction')).to_contain_text('mrad', timeout=patience)
        expect(page.locator('#verdicts')).to_contain_text(
            re.compile('finished|failed'), timeout=patience
        )
        expect(page.locator('#report-level')).to_have_class(
            re.compile('warn|error'), timeout=patience
        )
        assert float(page.inner_text('#amplitude')) > 10.0  # mrad
        expect(page.locator('#report')).to_contain_text('predicted at worst')
        table, image = (_saved(page, kind, tmp_path) for kind in ('csv', 'png'))
        titles, *rows = csv.reader(table.read_text('utf-8').splitlines())
        angles = [float(row[titles.index('measured.position.joint1 [rad]')]) for row in rows]
        assert max(angles) > 0.9
        assert image.read_bytes().startswith(b'\x89PNG')
        _look_closely(page, expect)
        page.click('[data-service=reset]')
        expect(page.locator('#goal-answer')).to_contain_text('at rest at', timeout=patience)
        # What is no number is marked, and what follows it counts.
        for field, right in ((JOINT, '90°'), ('#duration', '4')):
            page.fill(field, 'nonsense')
            page.press(field, 'Enter')
            expect(page.locator(f'{field}:invalid')).to_have_count(1)
            page.fill(field, right)
            expect(page.locator(f'{field}:invalid')).to_have_count(0)
        page.click('#add-via')
        page.fill('.via [name=joint1]', '-0.2')
        page.press('#duration', 'Enter')
        expect(page.locator('#goal-answer')).to_contain_text('plan 2', timeout=patience)
        expect(page.locator('#report-level')).to_contain_text('earlier', timeout=patience)
        page.keyboard.press('Escape')
        expect(page.locator('#goal-answer')).to_contain_text('comes to rest', timeout=patience)
        # The last goal comes back with its via point; only what matters is shown.
        page.fill(JOINT, '0.1')
        page.click('.via button')
        page.click('#last-goal')
        expect(page.locator('.via [name=joint1]')).to_have_value('-0.2')
        expect(page.locator(JOINT)).to_have_value(re.compile(r'^1\.5707'))
        page.click('.via button')
        expect(page.locator('[name="insensitivity.weight"]')).to_be_hidden()
        page.select_option('[name=strategy]', 'insensitive')
        expect(page.locator('[name="insensitivity.weight"]')).to_be_visible()
        expect(page.locator('[name="weights.r"]')).to_be_hidden()
        # A slider moves the goal, by keys too.
        page.focus('#goal-joints [type=range]')
        page.keyboard.press('Home')
        expect(page.locator(JOINT)).to_have_value(re.compile(r'^-6\.28'))
        picture = page.screenshot(path=tmp_path / 'page.png')
        # A parameter that is not set may be looked at and left alone.
        weight = page.locator('[name="weights.r"]')
        page.select_option('[name=strategy]', 'mixed')
        weight.fill('1')
        weight.fill('')
        expect(page.locator('[name="weights.r"]:invalid')).to_have_count(0)
        page.click('[data-node=flat_planner] .buttons [type=button]')
        stiffness.fill('nonsense')
        stiffness.press('Enter')
        expect(page.locator('[name="mismatch.stiffness_scale"]:invalid')).to_have_count(1)
        stiffness.fill('1.2')
        stiffness.press('Enter')
        expect(page.locator('[data-node=flat_plant] .answer')).to_have_text(
            'mismatch.stiffness_scale = 1.2', timeout=patience
        )
        # A refusal stands beside the button.
        page.fill('#duration', '0.01')
        page.press('#duration', 'Enter')
        expect(page.locator('#goal-answer')).to_contain_text('rejected', timeout=patience)
        assert complaints == []
        # The server goes and comes back: so does the page.
        port = view.host.rpartition(':')[2]
        assert view.process.stop(signal.SIGINT) == 0
        expect(page.locator('#connection')).to_contain_text('not connected', timeout=patience)
        View(graph, '--port', port)
        expect(page.locator('#connection')).to_have_text('live', timeout=patience)
        chromium.close()
    assert picture.startswith(b'\x89PNG')


def _saved(page, kind: str, folder: Path) -> Path:
    """Return what the page lets the browser save."""
    with page.expect_download() as download:
        page.click(f'#save-{kind}')
    path = folder / download.value.suggested_filename
    download.value.save_as(path)
    return path


def _look_closely(page, expect) -> None:
    """Zoom and go back by pointer, keys and buttons; come back to the present."""
    box = page.locator('#q').bounding_box()
    middle = box['y'] + box['height'] / 2
    page.mouse.move(box['x'] + 200, middle)
    page.mouse.down()
    page.mouse.move(box['x'] + 260, middle)
    page.mouse.up()
    expect(page.locator('#pause')).to_have_text('Go on')
    expect(page.locator('#instant')).to_contain_text('from the start of the motion')
    page.click('#zoom-in')
    expect(page.locator('#span')).to_have_value('3')
    page.focus('#plots')
    page.keyboard.press('+')
    expect(page.locator('#span')).to_have_value('1.5')
    page.keyboard.press('End')
    expect(page.locator('#pause')).to_have_text('Pause')
    page.select_option('#span', '6')
    page.click('#spectrum-figure summary')
    expect(page.locator('#spectrum-legend')).to_contain_text('Hz')
