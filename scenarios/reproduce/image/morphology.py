"""Dilation and erosion on a small grid, with opening and closing that are made of them, for two structuring elements.

The source's grids are pictures that its text does not repeat: the grid is ours, with what each operation is for, a gap
that dilation closes, a spur and a lone pixel that erosion takes away, an LED of four pixels. Beside each result stands
SciPy's, another program. Opening erases the small LED too; the rule that spares it is `nav.image.morphology`'s.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from dockair.nav.image.labelling import foreground_runs
from dockair.nav.image.morphology import close, dilate, erode, open_, open_components, structuring_element
from dockair.scenarios.reproduce.image.grid import draw_grid, mark_squares, mask_from_text
from dockair.scenarios.reproduce.reference import picture_name

ID = "image/fig4-5"
TITLE = "dilation, erosion, opening and closing on a small grid"
_SOURCE = "[Yoon 2018, figs 3-5]; reference: scipy.ndimage"
_SIZE_IN, _DPI = (11.0, 5.2), 110
_SPARE_BELOW_PX = 5  # the flying rule spares larger ones, see `DetectSettings`; here the LED of four pixels

GRID = mask_from_text("""
    ..............
    ..####.###....
    ..####.###....
    ..####.###....
    ..####.####...
    ......#.......
    ............#.
    ..............
    ..##......#...
    ..##..........
    ..............
""")
_ELEMENTS = ("cross", "square")
_OPERATIONS = {
    "dilation": (dilate, ndimage.binary_dilation),
    "erosion": (erode, ndimage.binary_erosion),
    "opening": (open_, ndimage.binary_opening),
    "closing": (close, ndimage.binary_closing),
}


def reproduce(out: Path | None) -> dict[str, Any]:
    """Apply all operations with both elements; the grids in `out`."""
    rows = []
    results = {}
    for shape in _ELEMENTS:
        element = structuring_element(shape, 3)
        for name, (ours, scipys) in _OPERATIONS.items():
            result, reference = ours(GRID, element), np.asarray(scipys(GRID, element))
            results[shape, name] = result
            rows.append(
                {
                    "case": f"{name}, {shape} 3 x 3",
                    "ours": {"pixels": int(result.sum()), "pixels_that_differ": int((result != reference).sum())},
                    "reference": {"pixels": int(reference.sum()), "pixels_that_differ": 0},
                }
            )
    spared = open_components(foreground_runs(GRID.astype(np.uint8), 0), structuring_element(), _SPARE_BELOW_PX)
    rows.append(
        {
            "case": f"opening, square 3 x 3, blobs under {_SPARE_BELOW_PX} px spared",
            "ours": {"blobs": spared.count, "pixels": int(spared.area_px.sum())},
            "reference": {},
        }
    )
    if out is not None:
        _draw(results, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _draw(results: dict[tuple[str, str], NDArray[np.bool_]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    for line, shape in zip(figure.subplots(2, 5), _ELEMENTS, strict=True):
        draw_grid(line[0], GRID, f"original; element: {shape} 3 x 3")
        for axes, name in zip(line[1:], _OPERATIONS, strict=True):
            result = results[shape, name]
            draw_grid(axes, result, f"{name}, {result.sum()} px")
            mark_squares(axes, result & ~GRID, "#f58518")
            mark_squares(axes, GRID & ~result, "#e45756")
    figure.suptitle("orange: added, red: taken away", fontsize=9)
    figure.savefig(path)
