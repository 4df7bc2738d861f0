"""Templates of reports and pages that are written to files, and the scripts and styles that such a file includes."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import jinja2
    from markupsafe import Markup

STATIC = Path(__file__).parent / "static"
MODULE_SYNTAX = re.compile(r"^import .*$|^export ", re.MULTILINE)


def page_templates(*packages: str) -> jinja2.Environment:
    """Return the templates in the folders of packages; a name is looked up in the first one that has it."""
    import jinja2

    return jinja2.Environment(
        loader=jinja2.ChoiceLoader([jinja2.PackageLoader(package, "") for package in packages]),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )


def include_files(*files: Path) -> Markup:
    """Return style sheets or scripts as one text for a page; modules become one module, in the order of the files."""
    from markupsafe import Markup

    return Markup("\n").join(Markup(MODULE_SYNTAX.sub("", file.read_text(encoding="utf-8"))) for file in files)


def include_data(data: Any) -> Markup:
    """Return data as JSON for a script element, which they cannot close."""
    from markupsafe import Markup

    return Markup(json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"))
