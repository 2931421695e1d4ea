"""MkDocs calls this while it builds.

It adds the pages of the Python interface, pages that tutorials write, and files beside docs/, and links the public
names in all pages.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

import api_pages
import tutorial_pages
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[2]
# Files beside docs/ that pages link to: link targets of files, as the site has no page for them.
COPIED = {"changelog.md": "CHANGELOG.md", "contributing.md": "CONTRIBUTING.md", "license.md": "LICENSE"}


def on_files(files: Files, config: Any) -> Files:
    """Add the generated pages."""
    pages = api_pages.pages()
    for path, source in COPIED.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        pages[path] = f"# License\n\n```text\n{text}```\n" if source == "LICENSE" else _from_docs(text)
    run = [page for folder in ("tutorials", "theory") for page in sorted((ROOT / "docs" / folder).glob("*.md"))]
    pages.update(tutorial_pages.written(run))
    for path, text in pages.items():
        files.append(File.generated(config, path, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Let links to files beside docs/ and public names lead to their pages, and show the pages that tutorials write."""
    here = posixpath.dirname(page.file.src_uri)
    for path, source in COPIED.items():
        target = posixpath.relpath(f"../{source}", here or ".")
        markdown = markdown.replace(f"]({target})", f"]({posixpath.relpath(path, here or '.')})")
    return tutorial_pages.shown(api_pages.linked(markdown), Path(page.file.src_uri).stem)


def _from_docs(text: str) -> str:
    """A file of the root with its links as a page in docs/ has them."""
    text = re.sub(r"\]\(docs/", "](", text)
    for path, source in COPIED.items():
        text = text.replace(f"]({source})", f"]({path})")
    return text
