"""The pages of docs/reference that are made from the sources and kept in the repository, to be read there.

python docs/tools/reference.py    writes them anew
"""

from __future__ import annotations

from pathlib import Path

import api_pages
import cli_page
import yaml_page

DOCS = Path(__file__).parents[1]


def pages() -> dict[Path, str]:
    """File -> Markdown."""
    return {
        DOCS / "reference" / "yaml.md": yaml_page.page(),
        DOCS / "reference" / "cli.md": cli_page.page(),
        DOCS / "reference" / "api" / "index.md": api_pages.index(),
    }


if __name__ == "__main__":
    for path, text in pages().items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
