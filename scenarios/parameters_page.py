"""The page of all physical numbers, docs/parameters.md, from the parameter sheets.

python -m dockair.scenarios.parameters_page > docs/parameters.md
"""

import sys
from importlib.resources import files
from typing import Any

import numpy as np

from dockair.parameters import Parameter, read_sheet, sheet_names

_LONGEST_INLINE = 4  # numbers of a vector that are written out; a table says its size and span instead

_HEAD = """\
# Parameters

The physical numbers of the simulator, each with its range and where it comes from. This page is made from the sheets in
[assets/parameters](../assets/parameters) and not edited by hand:

    python -m dockair.scenarios.parameters_page > docs/parameters.md

A scenario may put another value in place of a sheet's, inside the range given here:

    dockair fly --set parameters.hose.length_m=14

or `length_m = 14` under `[parameters.hose]` in its file. A value outside is refused with the range. Values are shown to
six digits and tables by their size and span; the sheet has them whole. Not here: the camera's and the ring's nominal
geometry ([assets/calibration](../assets/calibration)), and the constants of the standards that `sim/air` implements.

| status | the number is |
|---|---|
| measured | measured here |
| published | printed in the source named |
| derived | computed from published numbers, as the source says |
| assumed | a choice inside what is plausible; the source says why |
"""


def parameters_page() -> str:
    """Return the whole page as Markdown, sheets in alphabetical order."""
    names = sheet_names()
    index = " · ".join(f"[{name}](#{name})" for name in names)
    return "\n".join([_HEAD, index, *(_section(name) for name in names)]) + "\n"


def _section(sheet: str) -> str:
    rows = [_row(key, parameter) for key, parameter in read_sheet(sheet).items()]
    head = ["| key | value | unit | range | status | source |", "|---|---|---|---|---|---|"]
    return "\n".join(["", f"## {sheet}", "", _introduction(sheet), "", *head, *rows])


def _introduction(sheet: str) -> str:
    """The comment at the head of the sheet."""
    lines = files("dockair.assets").joinpath("parameters", f"{sheet}.toml").read_text(encoding="utf-8").splitlines()
    count = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    return "\n".join(line.removeprefix("#").strip() for line in lines[:count])


def _row(key: str, parameter: Parameter) -> str:
    value, span = in_words(parameter)
    cells = (f"`{key}`", value, parameter.unit, span, parameter.status, parameter.source)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def in_words(parameter: Parameter) -> tuple[str, str]:
    """Return a parameter's value and its range."""
    return _value(parameter.value), f"{_number(parameter.low)} to {_number(parameter.high)}"


def _value(value: Any) -> str:
    array = np.asarray(value, dtype=float)
    if array.size > _LONGEST_INLINE:
        size = " x ".join(str(n) for n in array.shape)
        return f"{size} numbers, {_number(array.min())} to {_number(array.max())}"
    return ", ".join(_number(number) for number in array.ravel())


def _number(number: Any) -> str:
    return format(float(number), ".6g")


if __name__ == "__main__":
    sys.stdout.write(parameters_page())
