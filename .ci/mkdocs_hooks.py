"""Docstrings name classes with a role and announce equations with two colons, for Sphinx; the site shows the plain words."""

import re
from typing import Any

_ROLE = re.compile(r":(?:class|func|meth|attr|mod|data):<code>[~.]?(?:[\w.]*\.)?(\w+)</code>")


def on_page_content(html: str, **_: Any) -> str:
    """The HTML of a page without roles and double colons."""
    return _ROLE.sub(r"<code>\1</code>", html).replace("::</p>", ":</p>")
