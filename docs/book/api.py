"""The page of the Python package, from the source of its public names: nothing needs to be built or installed."""

import ast
import re
from pathlib import Path

HEAD = """# The Python package, name by name

This page is made from the signatures and docstrings of the package whenever the book is built; `help(driftmesh)` shows
the same. [Your own solver](own-solver.md) and [Python](python.md) are the introductions.

"""


def public(package):
    """The public names of the package and the modules that define them, in the order in which it lists them."""
    tree = ast.parse((package / "__init__.py").read_text("utf-8"))
    homes = {
        alias.asname or alias.name: node.module
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }
    listed = next(node.value for node in tree.body if isinstance(node, ast.Assign) and _is_all(node))
    names = [name for name in ast.literal_eval(listed) if not name.startswith("__")]
    return [(name, homes[name]) for name in names]


def _is_all(node):
    return isinstance(node.targets[0], ast.Name) and node.targets[0].id == "__all__"


def signature(node, name=None):
    """A function as it is called, its results after an arrow."""
    arguments = ast.unparse(node.args).removeprefix("self, ").removeprefix("self").removeprefix("cls, ")
    returns = f" -> {ast.unparse(node.returns)}" if node.returns and not name else ""
    call = f"{name or node.name}({arguments}){returns}"
    if len(call) <= 100:
        return call
    parts = re.split(r", (?![^\[(]*[\])])", arguments)
    return f"{name or node.name}(\n" + "".join(f"    {part},\n" for part in parts) + f"){returns}"


def prose(doc):
    """A docstring in Markdown: its roles as code, its sections in bold, its examples in fences."""
    doc = re.sub(r":(?:class|func|meth|attr|mod):`[~.]?([^`]*)`", r"`\1`", doc).replace("``", "`").replace("$", "\\$")
    out, fenced, listed = [], False, False
    for line in doc.splitlines():
        is_code = line.lstrip().startswith((">>>", "..."))
        if is_code and not fenced:
            out, fenced = [*out, "", "```python"], True
        elif fenced and not line.strip():
            out, fenced = [*out, "```"], False
        if fenced:
            out.append(line.strip() if is_code and line.startswith("    ") else line)
            continue
        section = re.fullmatch(r"(Args|Returns|Raises|Attributes|Yields|Notes?|Examples?):", line.strip())
        if section:
            listed = True
            out += ["", f"**{section[1]}**", ""]
        elif listed and re.match(r"    \S", line):
            name, colon, rest = line.strip().partition(":")
            is_name = colon and re.fullmatch(r"[\w*, .]+", name)
            out.append(f"- `{name}`: {rest.strip()}" if is_name else f"- {name}{colon}{rest}")
        elif listed and line.startswith("        "):
            out.append(f"  {line.strip()}")
        else:
            listed = listed and not line.strip()
            out.append(line)
    return "\n".join([*out, "```"] if fenced else out).strip()


def described(node):
    """The lines on a class or function: how it is called, what it says of itself, and the public parts of a class."""
    if isinstance(node, ast.FunctionDef):
        return ["```python", signature(node), "```", "", prose(ast.get_docstring(node) or "")]
    methods = [part for part in node.body if isinstance(part, ast.FunctionDef)]
    start = next((method for method in methods if method.name == "__init__"), None)
    fields = [ast.unparse(part) for part in node.body if isinstance(part, ast.AnnAssign)]
    fields = [field for field in fields if not field.startswith("_")]
    call = signature(start, node.name) if start else f"{node.name}({', '.join(fields)})" if fields else node.name
    lines = ["```python", call, "```", "", prose(ast.get_docstring(node) or "")]
    for method in methods:
        doc = ast.get_docstring(method)
        if method.name.startswith("_") or not doc or _is(method, "overload"):
            continue
        is_value = _is(method, "property", "cached_property")
        title = f"`{node.name}.{method.name}{'' if is_value else '()'}`"
        call = [] if is_value else ["```python", signature(method), "```", ""]
        lines += ["", f"### {title}", "", *call, prose(doc)]
    return lines


def _is(node, *names):
    return any(ast.unparse(decorator).split(".")[-1] in names for decorator in node.decorator_list)


def page(package):
    """The page, with every public name of the package."""
    lines = []
    for name, module in public(Path(package)):
        tree = ast.parse((Path(package) / f"{module}.py").read_text("utf-8"))
        found = [node for node in tree.body if getattr(node, "name", "") == name and not _is(node, "overload")]
        if not found:
            raise SystemExit(f"error: {module}.py does not define {name}")
        lines += ["", f"## `{name}`", "", *described(found[-1])]
    errors = ast.parse((Path(package) / "errors.py").read_text("utf-8"))
    rows = [f"| `{node.name}` | {ast.get_docstring(node).splitlines()[0]} |" for node in errors.body if _is_error(node)]
    lines += ["", "## Exceptions", "", "| class of `driftmesh.errors` | meaning |", "|---|---|", *rows]
    return HEAD + "\n".join(lines) + "\n"


def _is_error(node):
    return isinstance(node, ast.ClassDef) and bool(ast.get_docstring(node))
