"""A document as HTML, to be put on a page; everything that came from outside is escaped."""

from __future__ import annotations

import base64
from html import escape

from bellcrank.reports.document import Document, Facts, Picture, Table


def document_html(document: Document) -> tuple[str, str]:
    """What comes before the replay (kind, verdict, warnings) and what after it (the parts)."""
    word = "OK" if document.good else "Look here"
    lines = "".join(f"<p>{escape(line)}</p>" for line in document.verdict)
    warnings = "".join(f"<li>{escape(text)}</li>" for text in document.warnings)
    before = (
        f'<section class="verdict {"good" if document.good else "bad"}" aria-label="verdict">'
        f'<span class="word">{word}</span><div>{lines}</div></section>'
    )
    if warnings:
        before += f'<section class="warnings"><h2>Warnings</h2><ul>{warnings}</ul></section>'
    return before, "".join(map(_part, document.parts))


def _part(part: Facts | Table | Picture) -> str:
    if isinstance(part, Facts):
        rows = "".join(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in part.rows)
        body = f'<table class="facts">{rows}</table>'
    elif isinstance(part, Table):
        head = "".join(f"<th>{escape(text).replace(chr(10), '<br>')}</th>" for text in part.header)
        rows = "".join(
            "<tr>" + "".join(f"<{'th' if k == 0 else 'td'}>{escape(c)}</{'th' if k == 0 else 'td'}>"
                             for k, c in enumerate(row)) + "</tr>"
            for row in part.rows
        )  # fmt: skip
        note = f"<p>{escape(part.note)}</p>" if part.note else ""
        body = f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>{note}'
    else:
        data = base64.b64encode(part.png).decode()
        body = f'<img alt="{escape(part.title, quote=True)}" src="data:image/png;base64,{data}">'
    return f"<section><h2>{escape(part.title)}</h2>{body}</section>"
