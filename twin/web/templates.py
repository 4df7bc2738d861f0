"""Templates of reports and pages that are written to files."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import jinja2


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


def report_templates(*packages: str) -> jinja2.Environment:
    """Return templates of reports: `style` and `dark` are their look, `matrix_script` sorts and filters their tables.

    `copy_script` is the code of buttons that copy a command.
    """
    from twin.web.embedding import read_static

    environment = page_templates(*packages)
    environment.globals |= {
        "style": read_static("style.css") + read_static("report.css"),
        "dark": read_static("dark.js"),
        "matrix_script": read_static("matrix.js"),
        "copy_script": read_static("copy.js"),
    }
    return environment
