"""What the gallery has in the site beside its Markdown: thumbnails that lead to the examples, and below each
example its code to download. `conf.py` adds them when the site is built.
"""

from __future__ import annotations

import re
from base64 import b64encode

EXAMPLE = re.compile(
    r"^### (?P<title>.+)\n(?:(?!^#).*\n)*?"
    r'<div class="example">\n\n(?:<!-- .+? -->\n)?```python\n(?P<code>(?:.*\n)*?)```\n\n'
    r"!\[(?P<alt>.+?)\]\((?P<picture>pictures/gallery-(?P<name>\w+)\.\w+)\)\n",
    re.M,
)
FIRST = re.compile(r"^## ", re.M)


def with_thumbnails(text: str) -> str:
    """The page with a grid of its pictures before the first section, and a link below each example."""
    rows = ['<nav class="thumbnails">', ""]
    for found in EXAMPLE.finditer(text):
        rows += [f"[![{found['alt']}]({found['picture']}) {found['title']}](#{slug(found['title'])})", ""]
    grid = "\n".join([*rows, "</nav>", "", ""])
    text = EXAMPLE.sub(lambda found: f"{found[0]}\n{download(found['name'], found['code'])}\n", text)
    first = FIRST.search(text)
    return text if first is None else text[: first.start()] + grid + text[first.start() :]


def download(name: str, code: str) -> str:
    """A link that saves the code as a file."""
    coded = b64encode(code.encode()).decode()
    address = f"data:text/x-python;base64,{coded}"
    return f'<p class="download"><a download="{name}.py" href="{address}">Download {name}.py</a></p>'


def slug(title: str) -> str:
    """The anchor of a heading, as MyST and GitHub make it.

    >>> slug("A whole fingertip, and its whorl from below")
    'a-whole-fingertip-and-its-whorl-from-below'
    """
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
