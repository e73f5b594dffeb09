"""Compiled kernels stay within their files: the cache of their machine code does not see edits elsewhere."""

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


def calls_abroad(trees: Mapping[str, ast.Module]) -> set[tuple[str, str]]:
    """(kernel, kernel of another module that it uses), with their modules' names."""
    known = {f"{name}.{kernel.name}" for name, tree in trees.items() for kernel in kernels(tree)}
    found = set()
    for name, tree in trees.items():
        imported = {
            alias.asname or alias.name: f"{node.module}.{alias.name}"
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }
        for kernel in kernels(tree):
            for used in ast.walk(kernel):
                if isinstance(used, ast.Name | ast.Attribute):
                    first, dot, rest = ast.unparse(used).partition(".")
                    target = imported.get(first, "") + dot + rest
                    if target in known:
                        found.add((f"{name}.{kernel.name}", target))
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
