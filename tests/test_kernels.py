"""Compiled kernels use constants and kernels of another file only where the cache of machine code sees its edits."""

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


def intrinsics(trees: Mapping[str, ast.Module]) -> set[str]:
    """What numba makes of a function that writes machine code, with its module's name."""
    return {
        f"{name}.{known}"
        for name, tree in trees.items()
        for node in tree.body
        if isinstance(node, ast.Assign | ast.AnnAssign) and "intrinsic" in names(node, ast.Load)
        for known in names(node, ast.Store)
    }


def unseen(trees: Mapping[str, ast.Module]) -> set[tuple[str, str]]:
    """(kernel, what of another module it is made of) where the cache does not see that change.

    numba's own `njit` sees nothing, that of `dockair.kernels` all but what is behind a module's name, and intrinsics.
    """
    found, hidden = set(), trees.keys() | intrinsics(trees)
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
                    if not seen_by_cache or foreign[used] in hidden:
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


def test_no_kernel_keeps_a_constant_or_a_kernel_of_another_file_that_has_changed():
    trees = modules()
    assert sum(1 for tree in trees.values() for _ in kernels(tree)) > 100
    assert unseen(trees) == set()


def test_what_is_from_abroad_is_found_behind_what_is_made_of_it_behind_another_kernel_and_behind_a_module():
    code = (
        "import numpy as np\nfrom dockair import codes\n"
        "from dockair.codes import BALL, SIDE, Array, fma, turn, unused as u\n"
        "from {njit} import njit\n"
        "_AREA: Array = np.full(3, SIDE)\n_LEVELS = _levels()\ndef _levels(): return BALL\n"
        "@njit(cache=True)\ndef a(x: Array): return _AREA * x\n"
        "@njit(cache=True)\ndef b(x):\n    y: Array = a(x)\n    return y\n"
        "@njit(cache=True)\ndef c(x): return x + _LEVELS\n"
        "@njit(cache=True)\ndef d(x): return np.pi * x\n"
        "@njit(cache=True)\ndef e(x): return codes.BALL + x\n"
        "@njit(cache=True)\ndef f(x): return turn(x)\n"
        "@njit(cache=True)\ndef g(x): return fma(x, x, x)\n"
    )
    side, ball, behind = "dockair.codes.SIDE", "dockair.codes.BALL", ("dockair.p.e", "dockair.codes")
    written = "dockair.p.g", "dockair.codes.fma"
    called = "dockair.p.f", "dockair.codes.turn"
    codes = ast.parse("fma: Any = intrinsic(_fused)\n@njit(cache=True)\ndef turn(x): return -x\n")
    trees = {"dockair.codes": codes, "dockair.p": ast.parse(code.format(njit="numba"))}
    constants = {("dockair.p.a", side), ("dockair.p.b", side), ("dockair.p.c", ball)}
    assert unseen(trees) == {*constants, called, written, behind}
    trees["dockair.p"] = ast.parse(code.format(njit="dockair.kernels"))
    assert unseen(trees) == {written, behind}
