"""Compiled kernels call none of another file, and use its constants only where the cache of machine code sees edits."""

import ast
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOLDERS = {"nav": "dockair.nav", "sim": "dockair.sim", "scenarios": "dockair.scenarios"}


def modules() -> dict[str, ast.Module]:
    """All modules of the package by name, as trees."""
    files = {f"dockair.{path.stem}": path for path in (ROOT / "src" / "dockair").glob("*.py")}
    for folder, package in FOLDERS.items():
        for path in (ROOT / folder).rglob("*.py"):
            files[".".join([package, *path.relative_to(ROOT / folder).with_suffix("").parts])] = path
    return {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in files.items()}


def kernels(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    """The compiled functions of a module."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and any("njit" in ast.unparse(mark) for mark in node.decorator_list):
            yield node


def imported(tree: ast.Module) -> dict[str, str]:
    """Name -> what it is, with its module's name, of all that a module imports from others."""
    return {
        alias.asname or alias.name: f"{node.module}.{alias.name}"
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def calls_abroad(trees: Mapping[str, ast.Module]) -> set[tuple[str, str]]:
    """(kernel, kernel of another module that it uses), with their modules' names."""
    known = {f"{name}.{kernel.name}" for name, tree in trees.items() for kernel in kernels(tree)}
    found = set()
    for name, tree in trees.items():
        known_as = imported(tree)
        for kernel in kernels(tree):
            for used in ast.walk(kernel):
                if isinstance(used, ast.Name | ast.Attribute):
                    first, dot, rest = ast.unparse(used).partition(".")
                    target = known_as.get(first, "") + dot + rest
                    if target in known:
                        found.add((f"{name}.{kernel.name}", target))
    return found


def unseen_constants(trees: Mapping[str, ast.Module]) -> set[tuple[str, str]]:
    """(kernel, what of another module its constants are made of) where the cache does not see that change.

    numba's own `njit` sees none, that of `dockair.kernels` all but what is behind a module's name.
    """
    found = set()
    for name, tree in trees.items():
        known_as = imported(tree)
        seen_by_cache = known_as.get("njit") == "dockair.kernels.njit"
        foreign = {known: target for known, target in known_as.items() if target.partition(".")[0] == "dockair"}
        own: dict[str, set[str]] = {}
        for node in tree.body:
            if isinstance(node, ast.Assign | ast.AnnAssign | ast.FunctionDef):
                defined = [node.name] if isinstance(node, ast.FunctionDef) else names(node, ast.Store)
                own |= {known: own.get(known, set()) | names(node, ast.Load) for known in defined}
        for kernel in kernels(tree):
            pending, seen = [kernel.name], set[str]()
            while pending:
                used = pending.pop()
                if used in foreign:
                    if not seen_by_cache or foreign[used] in trees:
                        found.add((f"{name}.{kernel.name}", foreign[used]))
                elif used not in seen:
                    seen.add(used)
                    pending.extend(own.get(used, ()))
    return found


def names(statement: ast.stmt, context: type[ast.expr_context]) -> set[str]:
    """The names that a statement assigns or uses; not those in annotations, nor a function's marks."""
    parts: list[ast.AST] = list(statement.body) if isinstance(statement, ast.FunctionDef) else [statement]
    found = set()
    while parts:
        part = parts.pop()
        if isinstance(part, ast.Name) and isinstance(part.ctx, context):
            found.add(part.id)
        skipped = part.annotation if isinstance(part, ast.AnnAssign) else None
        parts.extend(child for child in ast.iter_child_nodes(part) if child is not skipped)
    return found


def test_no_kernel_calls_a_kernel_of_another_file():
    trees = modules()
    assert sum(1 for tree in trees.values() for _ in kernels(tree)) > 100
    assert calls_abroad(trees) == set()


def test_a_call_abroad_is_found_however_it_is_imported():
    one = ast.parse("@njit(cache=True)\ndef turn(a): ...\ndef slow(a): ...")
    other = ast.parse(
        "from p import one\nfrom p.one import slow, turn as t\n"
        "@njit(cache=True)\ndef a(x): return t(x)\n"
        "@njit(cache=True)\ndef b(x): return one.turn(x) + slow(x)\n"
        "def c(x): return t(x)\n"
    )
    assert calls_abroad({"p.one": one, "p.two": other}) == {("p.two.a", "p.one.turn"), ("p.two.b", "p.one.turn")}


def test_no_kernel_keeps_a_constant_of_another_file_that_has_changed():
    assert unseen_constants(modules()) == set()


def test_a_constant_from_abroad_is_found_behind_one_made_of_it_behind_another_kernel_and_behind_a_module():
    code = (
        "import numpy as np\nfrom dockair import codes\nfrom dockair.codes import BALL, SIDE, Array, unused as u\n"
        "from {njit} import njit\n"
        "_AREA: Array = np.full(3, SIDE)\n_LEVELS = _levels()\ndef _levels(): return BALL\n"
        "@njit(cache=True)\ndef a(x: Array): return _AREA * x\n"
        "@njit(cache=True)\ndef b(x):\n    y: Array = a(x)\n    return y\n"
        "@njit(cache=True)\ndef c(x): return x + _LEVELS\n"
        "@njit(cache=True)\ndef d(x): return np.pi * x\n"
        "@njit(cache=True)\ndef e(x): return codes.BALL + x\n"
    )
    side, ball, behind = "dockair.codes.SIDE", "dockair.codes.BALL", ("dockair.p.e", "dockair.codes")
    trees = {"dockair.codes": ast.parse(""), "dockair.p": ast.parse(code.format(njit="numba"))}
    assert unseen_constants(trees) == {("dockair.p.a", side), ("dockair.p.b", side), ("dockair.p.c", ball), behind}
    trees["dockair.p"] = ast.parse(code.format(njit="dockair.kernels"))
    assert unseen_constants(trees) == {behind}
