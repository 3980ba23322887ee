"""List the commands of this package by their source, without importing them."""

import ast
from collections.abc import Iterator
from pathlib import Path

import serpent_twin

ROOT = Path(serpent_twin.__path__[0])
_GUARD = 'if __name__ == "__main__":\n'


def verbs() -> dict[str, str]:
    """What each command's `--help` says first, by the module that is run within the package."""
    return {name: _first_paragraph(source) for name, source in sorted(_commands())}


def is_command(source: Path) -> bool:
    """Whether a file is that of a command: it guards what it does when it is run."""
    own = source == ROOT / "__main__.py"
    return source.is_file() and not own and _GUARD in source.read_text(encoding="utf-8")


def _commands() -> Iterator[tuple[str, Path]]:
    for source in ROOT.rglob("*.py"):
        if is_command(source):
            parts = source.relative_to(ROOT).with_suffix("").parts
            yield ".".join(part for part in parts if part != "__main__"), source


def _first_paragraph(source: Path) -> str:
    """The first paragraph of the docstring of a command's config, else of its function or module."""
    tree = _parsed(source)
    main = next((each for each in tree.body if _is_main(each)), None)
    text = ast.get_docstring(tree)
    if isinstance(main, ast.FunctionDef):
        text = _of_config(main, tree) or ast.get_docstring(main)
    return " ".join((text or "").partition("\n\n")[0].split())


def _is_main(node: ast.stmt) -> bool:
    return isinstance(node, ast.FunctionDef) and node.name == "main"


def _of_config(main: ast.FunctionDef, tree: ast.Module) -> str | None:
    """The docstring of the class of this package that a function takes as its one argument."""
    kinds = [each.annotation for each in main.args.args]
    if len(kinds) == 1 and isinstance(kinds[0], ast.Name):
        return _of_class(kinds[0].id, tree)
    return None


def _of_class(name: str, tree: ast.Module) -> str | None:
    """The docstring of a class that a module defines or imports from this package."""
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and node.name == name:
            return ast.get_docstring(node)
        if isinstance(node, ast.ImportFrom) and (source := _source(node.module or "")):
            found = next((a.name for a in node.names if name == (a.asname or a.name)), None)
            if found:
                return _of_class(found, _parsed(source))
    return None


def _source(module: str) -> Path | None:
    """The file of a module of this package."""
    package, *parts = module.split(".")
    place = ROOT.joinpath(*parts)
    files = (place.with_suffix(".py"), place / "__init__.py")
    return next(filter(Path.is_file, files), None) if package == ROOT.name else None


def _parsed(source: Path) -> ast.Module:
    return ast.parse(source.read_text(encoding="utf-8"))
