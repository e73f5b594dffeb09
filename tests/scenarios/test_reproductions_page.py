"""The page of reproductions is what is registered, with the pages that speak of each."""

from pathlib import Path

from dockair.scenarios.reproduce.registry import titles
from dockair.scenarios.reproductions_page import reproductions_page

DOCS = Path(__file__).parents[2] / "docs"


def _rows(page: str) -> dict[str, list[str]]:
    cells = [line.strip("| ").split("|") for line in page.splitlines() if line.startswith("| `")]
    return {row[0].strip(" `"): [cell.strip() for cell in row[1:]] for row in cells}


def test_the_committed_page_is_what_is_registered() -> None:
    assert (DOCS / "reproductions.md").read_text(encoding="utf-8") == reproductions_page(DOCS)


def test_every_reproduction_has_one_row_with_what_it_shows() -> None:
    rows = _rows(reproductions_page(DOCS))
    assert {wanted: row[0] for wanted, row in rows.items()} == titles()


def test_a_page_speaks_of_an_id_and_not_of_a_path_or_a_longer_id(tmp_path: Path) -> None:
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "hose.md").write_text("    dockair reproduce world/static --out x\n", encoding="utf-8")
    (tmp_path / "tests.md").write_text("reproduce/world/static.py, world/static-load, dop/fig50", encoding="utf-8")
    rows = _rows(reproductions_page(tmp_path))
    assert rows["world/static"][1:] == ["[models/hose](models/hose.md)"]
    assert rows["dop/fig5"][1:] == []
