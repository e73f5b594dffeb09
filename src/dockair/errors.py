"""What a person can do wrong, said in one line: where, what was expected, what was got, what exists."""

from collections.abc import Iterable


class DockairError(Exception):
    """Wrong input. The command line prints its one line and exits with 2.

    Args:
        where: the file, key, option or argument at fault, as its user would write it.
        expected: what would have been right.
        got: what was there instead.
        exists: the allowed names, if there is a list of them.
    """

    exit_code = 2

    def __init__(self, where: str, *, expected: str, got: object, exists: Iterable[str] = ()) -> None:
        self.where, self.expected, self.got, self.exists = where, expected, got, tuple(exists)
        text = f"{where}: expected {expected}, got {got!r}" if got is not None else f"{where}: expected {expected}"
        if self.exists:
            text += f"; exists: {', '.join(self.exists)}"
        super().__init__(text)


class MachineError(DockairError):
    """The machine lacks something (an OpenGL context, memory). The command line exits with 3."""

    exit_code = 3

    def __init__(self, where: str, *, expected: str, remedy: str) -> None:
        super().__init__(where, expected=expected, got=None)
        self.args = (f"{where}: expected {expected}; {remedy}",)
