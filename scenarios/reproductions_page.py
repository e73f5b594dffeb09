"""The page of all reproductions, docs/reproductions.md, from what is registered.

python -m dockair.scenarios.reproductions_page > docs/reproductions.md
"""

import re
import sys
from pathlib import Path

from dockair.scenarios.reproduce.registry import titles

_PAGES = Path(__file__).resolve().parents[1] / "docs"
_HEAD = """\
# Reproductions

What can be made again beside what was published or is claimed: figures and tables of the sources that the algorithms
come from ([notation](notation.md#sources)), published measurements of hoses, wakes and aircraft, and the pictures and
tables of these pages. Each puts ours beside the reference, case by case, and with `--out` draws the picture:

    dockair reproduce                       # this list
    dockair reproduce world/static          # its figures
    dockair reproduce world/static --out out/reproduce

The last column has the pages that speak of it. This page is made from what is there, and not edited by hand:

    python -m dockair.scenarios.reproductions_page > docs/reproductions.md

| id | shows | pages |
|---|---|---|
"""


def reproductions_page(pages: Path = _PAGES) -> str:
    """Return the whole page as Markdown, ids in alphabetical order.

    Args:
        pages: folder of the documentation, which is searched for the ids.
    """
    texts = {
        path.relative_to(pages).as_posix(): path.read_text(encoding="utf-8")
        for path in sorted(pages.rglob("*.md"))
        if path.name != "reproductions.md"
    }
    return _HEAD + "".join(_row(wanted, title, texts) for wanted, title in titles().items())


def _row(wanted: str, title: str, texts: dict[str, str]) -> str:
    named = re.compile(rf"(?<![\w/.-]){re.escape(wanted)}(?![\w/-])")  # not as a part of a path or of another id
    naming = (f"[{page.removesuffix('.md')}]({page})" for page, text in texts.items() if named.search(text))
    return f"| `{wanted}` | {title} | {', '.join(naming)} |\n"


if __name__ == "__main__":
    sys.stdout.write(reproductions_page())
