"""A page as a browser takes it: what it fetches, what it leaves open, what it says."""

from __future__ import annotations

import re
from html.parser import HTMLParser

from sysid_ros.pages.page import library

_VOID = ("meta", "br", "link", "img", "input")


class Elements(HTMLParser):
    """Tags left open, everything that a browser would fetch, words, and the data of figures."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.fetched: list[str] = []
        self.wrong: list[str] = []
        self.text: list[str] = []
        self.scripts: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.fetched += [str(v) for k, v in attrs if k in ("src", "href") and v]
        self.tags.append(tag)
        if tag not in _VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.wrong.append(tag)

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "script":
            self.scripts.append(data)
        elif self.open and self.open[-1] != "style":
            self.text.append(data)


def elements(page: str) -> Elements:
    """The page without the drawing libraries that it holds."""
    found = Elements()
    found.feed(_own(page))
    return found


def alone(page: str) -> bool:
    """Whether a browser needs nothing else for the page."""
    return not elements(page).fetched and not re.search(r"@import|url\(|https?:|//cdn", _own(page))


def _own(page: str) -> str:
    for name in ("plotly", "three"):
        page = page.replace(library(name), "")
    return page
