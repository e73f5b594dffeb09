"""Labels after the first and after the second pass of two-pass labelling.

As the text has it a pixel takes over the label of a neighbour that was scanned before it, and the same is done once
more. That is not enough: two arms that meet at their lower end keep two labels, whatever is done in the same order.
The table of equivalences, which the text leaves out, is what makes two passes enough; both are shown, on a grid of our
own with what labelling can go wrong at: arms that meet, a hole, corners that touch.
"""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dockair.nav.image.labelling import Labels, first_pass, label_contour_tracing, label_two_pass
from dockair.scenarios.reproduce.image.grid import draw_grid, mask_from_text
from dockair.scenarios.reproduce.reference import picture_name

ID = "image/fig8"
TITLE = "labels after pass 1 and pass 2, with and without the table of equivalences"
_SOURCE = "[Yoon 2018, figs 6-8]; reference: cv2.connectedComponents"
_SIZE_IN, _DPI = (12.0, 5.4), 110

GRID = mask_from_text("""
    ..................
    .#..#..#....####..
    .#..#..#...#....#.
    .#..#..#...#....#.
    .#######...#....#.
    ............####..
    ...##.............
    ...##....#.#.#....
    .....##...#.#.....
    .....##...........
    ..................
""")


def reproduce(out: Path | None) -> dict[str, Any]:
    """Label the grid with both connectivities; the grids in `out`."""
    rows, pictures = [], []
    for connectivity in (8, 4):
        provisional, parent = first_pass(GRID, connectivity)
        final, count = label_two_pass(GRID, connectivity)
        printed = _second_pass_as_printed(provisional, connectivity)
        reference_count, reference = cv2.connectedComponents(GRID.astype(np.uint8), connectivity=connectivity)
        ours = {
            "labels_after_pass_1": len(parent) - 1,
            "labels_after_pass_2": count,
            "labels_by_contour_tracing": label_contour_tracing(GRID, connectivity)[1],
            "labels_after_pass_2_without_table": len(np.unique(printed)) - 1,
            "same_partition": bool(_same_partition(final, np.asarray(reference))),
        }
        reference_row = {"labels_after_pass_2": reference_count - 1, "same_partition": True}
        rows.append({"case": f"{connectivity}-connected", "ours": ours, "reference": reference_row})
        pictures.append((connectivity, provisional, printed, final))
    if out is not None:
        _draw(pictures, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _second_pass_as_printed(labels: Labels, connectivity: int) -> Labels:
    """Each pixel in raster order takes the smallest label of the pixels around it that were scanned before, once."""
    result = np.pad(labels, 1)
    steps = ((0, -1), (-1, 0)) if connectivity == 4 else ((0, -1), (-1, -1), (-1, 0), (-1, 1))
    for i, j in np.argwhere(result > 0):
        around = [int(result[i + a, j + b]) for a, b in steps]
        result[i, j] = min([label for label in around if label > 0], default=result[i, j])
    return result[1:-1, 1:-1]


def _same_partition(a: NDArray[Any], b: NDArray[Any]) -> bool:
    """Whether each label of one image is one label of the other."""
    pairs = np.unique(np.column_stack([a.ravel(), b.ravel()]), axis=0)
    return len(pairs) == len(np.unique(a)) == len(np.unique(b))


def _draw(pictures: list[tuple[int, Labels, Labels, Labels]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    for line, (connectivity, provisional, printed, final) in zip(figure.subplots(2, 4), pictures, strict=True):
        draw_grid(line[0], GRID, f"(a) original, {connectivity}-connected")
        draw_grid(line[1], provisional, "(b) after pass 1", numbers=True)
        draw_grid(line[2], printed, "after pass 2 as printed, no table", numbers=True)
        draw_grid(line[3], final, "(c) after pass 2", numbers=True)
    figure.savefig(path)
