"""A page that shows other pages side by side, each in a frame of its own that can be played and opened."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from urllib.parse import quote

_STYLE = """
body { margin: 0; padding: clamp(.75rem, 4vw, 1.5rem); font: 16px/1.5 system-ui, sans-serif;
  color: #1b2430; background: #f4f6f9; }
main { display: grid; gap: 1.25rem; grid-template-columns: repeat(auto-fill, minmax(min(100%, 26rem), 1fr)); }
article { background: white; border: 1px solid #d5dbe3; border-radius: .6rem; overflow: hidden; }
iframe { width: 100%; height: 26rem; border: 0; border-bottom: 1px solid #d5dbe3; display: block; }
h2 { font-size: 1.05rem; margin: .8rem 1rem .2rem; }
p { margin: 0 1rem .6rem; }
code { background: #eef1f5; padding: .1rem .3rem; border-radius: .2rem; overflow-wrap: anywhere; }
a { color: #0072b2; }
"""


@dataclass(frozen=True)
class Exhibit:
    """One page of a gallery.

    Attributes:
        page: The name of the page's file, in the gallery's folder.
        title: Its title.
        result: What came out, in one sentence.
        command: The command that makes it.
        report: The name of the file of its report; "" where there is none.
    """

    page: str
    title: str
    result: str
    command: str
    report: str = ""


def gallery_html(title: str, exhibits: Sequence[Exhibit]) -> str:
    """The gallery as one HTML page; it refers to the pages in its folder. All texts are escaped."""
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{_STYLE}</style></head>"
        f"<body><h1>{escape(title)}</h1><main>{''.join(map(_exhibit_html, exhibits))}</main></body></html>\n"
    )


def _exhibit_html(exhibit: Exhibit) -> str:
    links = f'<a href="{quote(exhibit.page)}">Open</a>'
    if exhibit.report:
        links += f' · <a href="{quote(exhibit.report)}">Report</a>'
    return (
        f'<article><iframe src="{quote(exhibit.page)}" title="{escape(exhibit.title)}" loading="lazy"></iframe>'
        f"<h2>{escape(exhibit.title)}</h2><p>{escape(exhibit.result)}</p>"
        f"<p><code>{escape(exhibit.command)}</code></p><p>{links}</p></article>"
    )
