"""Public names of packages."""

import ast


def public_names(package):
    """Names that a package imports from its own modules (`__init__.pyi`, else `__init__.py`)."""
    stub, name = package / "__init__.pyi", ".".join(package.parts[-2:])
    tree = ast.parse((stub if stub.exists() else package / "__init__.py").read_text())
    return {
        alias.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and (node.level or node.module.startswith(name))
        for alias in node.names
    }
