"""Every page in a browser without a network: light and dark, wide and narrow, without an error, and with a robot that moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arm_recordings import hidden_parameters, recorded
from browser import Browser, installed
from robots import robot
from test_pages import PAGES, arm, postures
from test_pages import T as TIMES

from sysid_ros.identification import Choices, identify_recordings
from sysid_ros.pages.identification_page import write_report

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(installed() is None, reason="no Chromium or Chrome is installed to look at pages with"),
]


def identification(path: Path) -> None:
    model = robot("small_arm")
    bags = [recorded(model, hidden_parameters(model, 1), seed, seconds=12.0, torque_noise=0.05) for seed in (1, 2)]
    write_report(path, identify_recordings(model, bags, [], {}, Choices(prior_weight=1.0)), {}, model)


def fleet(path: Path) -> None:
    pytest.importorskip("pyarrow", reason="the extra fleet is not installed")
    from fleet_pages import write_fleet_page

    write_fleet_page(path)


MADE: dict[str, Callable[[Path], object]] = {**PAGES, "identification": identification, "fleet": fleet}
WITHOUT_ROBOT = ("refused", "figure alone", "fleet")


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    one = Browser(tmp_path_factory.mktemp("profile"))
    yield one
    one.close()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("pages")


@pytest.fixture(params=MADE)
def made(request: pytest.FixtureRequest, folder: Path) -> tuple[str, Path]:
    path = folder / f"{request.param.replace(' ', '_')}.html"
    MADE[request.param](path)
    return request.param, path


def darkness(browser: Browser) -> tuple[float, float]:
    """How bright paper and words are, 0 to 255."""
    found: list[float] = browser.ask(
        "['.seen, section, body', 'h1'].map((of, k) => getComputedStyle(document.querySelector(of))"
        "[k ? 'color' : 'backgroundColor'].match(/[0-9]+/g).slice(0, 3).reduce((a, b) => a + Number(b) / 3, 0))"
    )
    return found[0], found[1]


def test_a_page_is_whole_at_every_width_and_in_both_schemes(browser: Browser, made: tuple[str, Path]) -> None:
    name, path = made
    for width, scheme in ((1280, "light"), (400, "dark"), (1280, "dark"), (400, "light")):
        browser.said.clear()
        browser.fetched.clear()
        browser.open(path, width, scheme)
        assert browser.said == []
        assert browser.fetched == []
        # nothing sticks out at the side, and every figure has its curves
        assert browser.ask("document.documentElement.scrollWidth") <= width
        assert browser.ask("[...document.querySelectorAll('figure')].every((f) => f.querySelector('.main-svg'))")
        paper, words = darkness(browser)
        assert (paper < 60.0 < 180.0 < words) if scheme == "dark" else (words < 60.0 < 180.0 < paper)
        if name not in WITHOUT_ROBOT:
            moves(browser)


def moves(browser: Browser) -> None:
    """The robot at two times of the clock: two pictures, and cursors that went along."""
    pictures: list[Any] = []
    for part in (0.2, 0.45):
        browser.ask(f"clock.set(clock.from + {part} * (clock.to - clock.from))")
        shown = browser.ask("document.querySelector('.stage canvas').toDataURL()")
        cursors = browser.ask("[...document.querySelectorAll('.cursor')].map((c) => (c.hidden ? null : c.style.transform))")
        pictures.append((shown, cursors, browser.ask("document.querySelector('.clock output').textContent")))
    (first, before, early), (second, after, late) = pictures
    assert len(first) > 2000
    assert first != second
    assert early != late
    # where an axis ends before the clock does, its cursor is gone
    there = [(a, b) for a, b in zip(before, after, strict=True) if a is not None and b is not None]
    assert all(a != b for a, b in there)
    assert bool(there) == bool(before)


def test_the_joints_in_the_browser_stand_where_the_model_says(browser: Browser, folder: Path) -> None:
    path = folder / "kinematics.html"
    PAGES["payload"](path)
    browser.open(path, 1280, "light")
    for k in (0, 40, 150):
        # the page holds a posture every 0.05 s here: each is its own
        found = np.array(browser.ask(f"robotView.placements({float(TIMES[k])!r})")).reshape(3, 4, 4)
        for placement, body in zip(found, arm().body_names, strict=True):
            rotation, origin = arm().frame_placement(postures()[k], body)
            np.testing.assert_allclose(placement[:3, :3], rotation, atol=1e-3)
            np.testing.assert_allclose(placement[:3, 3], origin, atol=1e-3)
        np.testing.assert_allclose(found[:, 3], np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)))


def test_the_reader_switches_what_is_coloured_and_plays(browser: Browser, folder: Path) -> None:
    path = folder / "diagnosis.html"
    PAGES["diagnosis"](path)
    browser.open(path, 1280, "light")
    browser.ask("document.querySelectorAll('.choice button')[1].click()")
    assert browser.ask("[...document.querySelectorAll('.scale')].map((one) => one.hidden)") == [True, False]
    browser.ask("document.querySelector('.play').click()")
    browser.wait("clock.t > clock.from + 0.3")
    browser.ask("document.querySelector('.play').click()")
    stopped = browser.ask("clock.t")
    assert browser.ask("new Promise((done) => setTimeout(() => done(clock.t), 300))") == stopped


def test_a_click_on_a_robot_of_a_fleet_leads_to_its_joints_and_bags(browser: Browser, folder: Path) -> None:
    path = folder / "of_a_fleet.html"
    fleet(path)
    for width in (1280, 400):
        browser.open(path, width, "light")
        robots = browser.ask("[...document.querySelectorAll('a.lane')].map((a) => a.querySelector('b').textContent)")
        browser.ask("document.querySelectorAll('a.lane')[1].click()")
        browser.wait(f"document.querySelector('#chosen h2').textContent === {robots[1]!r}")
        browser.ask("document.querySelectorAll('.sparks button')[3].click()")
        browser.ask("document.querySelector('.chart .bag').dispatchEvent(new MouseEvent('click', { bubbles: true }))")
        assert "sysid diagnose" in browser.ask("[...document.querySelectorAll('#chosen pre')].pop().textContent")
        assert browser.ask("document.documentElement.scrollWidth") <= width
        assert browser.ask("document.querySelector('a.lane[aria-current] b').textContent") == robots[1]
    assert browser.said == []


def test_what_is_shown_of_a_fleet_stays_when_the_window_changes(browser: Browser, folder: Path) -> None:
    path = folder / "resized.html"
    fleet(path)
    browser.open(path, 1280, "light")
    shown = "document.querySelector('#chosen:not([hidden]) h3').textContent"
    browser.ask("document.querySelectorAll('.sparks button')[5].click()")
    before = browser.ask(shown)
    browser.ask("window.dispatchEvent(new Event('resize'))")
    assert browser.ask(shown) == before
