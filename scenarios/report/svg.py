"""A figure as SVG text that stands inside the page; the same rows make the same bytes."""

import io
import re
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

#: Of `matplotlib.rc_context` while a figure is drawn.
STYLE: dict[Any, Any] = {
    "svg.hashsalt": "dockair",
    "svg.fonttype": "none",
    "text.parse_math": False,  # a label may hold anything, dollars too
    "font.size": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
}
_TAG = re.compile(r"<[^<>]+>")  # in texts and values both are escaped
_ID = re.compile(r' id="|href="#|url\(#')


def as_svg(figure: Figure, name: str) -> str:
    """Return the picture with its name before every id: one page has many, and ids are the page's."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    text = buffer.getvalue()
    return _TAG.sub(lambda tag: _ID.sub(rf"\g<0>{name}-", tag[0]), text[text.index("<svg") :])


def say(ax: Axes, text: str) -> None:
    """Put a text in place of a panel that has nothing to show."""
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", color="grey")
    ax.set_axis_off()
