"""Starts the command line: `dockair …` and `python -m dockair …`.

It lies outside the linked folders, so that it can still say what is wrong when a zip tool has made text of the links.
"""

import os
import sys
from pathlib import Path


def main() -> None:
    """Run the command line, or say in one line that the package is not whole."""
    _open_closed_streams()
    here = Path(__file__).parent
    text = [name for name in ("sim", "nav", "scenarios", "assets") if not (here / name).is_dir()]
    if text:
        print(f"dockair: links not restored ({', '.join(text)}): clone with git", file=sys.stderr)
        sys.exit(3)
    try:
        from dockair.scenarios.cli import main as command_line
    except KeyboardInterrupt:  # while it is imported: later the command line takes it
        print("dockair: stopped", file=sys.stderr)
        sys.exit(130)
    command_line()


def _open_closed_streams() -> None:
    """Lead closed descriptors nowhere: the next file to be opened would get their numbers, and what is printed.

    Before anything is imported, for a library may keep such a file open.
    """
    while (file := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(file)


if __name__ == "__main__":
    main()
