"""Pages whose python blocks are the cells of one notebook: executed, with what their cells give below them.

`docs/pages.py` puts them into the site; each page is there as a notebook, too. A cell that fails ends it.
"""

from __future__ import annotations

import base64
import html
import re
import shutil
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
MARK = "<!-- the python blocks of this page are the cells of one notebook -->\n"
BLOCK = re.compile(r"^```python\n(.*?)^```$\n?", re.MULTILINE | re.DOTALL)
PATIENCE = 600  # for a cell [s]
DRAWN = (("image/svg+xml", "svg"), ("image/png", "png"))  # what is a file of its own, the better first


def is_notebook(text: str) -> bool:
    """Whether a page says that its blocks are cells."""
    return MARK in text


def cells_of(text: str) -> Any:
    """The page as a notebook without outputs."""
    import nbformat.v4 as made

    cells, at = [], 0
    for block in BLOCK.finditer(text):
        cells += [made.new_markdown_cell(text[at : block.start()].replace(MARK, "").strip())]
        cells += [made.new_code_cell(block[1].rstrip())]
        at = block.end()
    cells.append(made.new_markdown_cell(text[at:].strip()))
    for number, cell in enumerate(cells):
        cell.id = f"cell-{number}"  # the same for the same page
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return made.new_notebook(cells=[one for one in cells if one.source], metadata={"kernelspec": kernel})


def executed(text: str) -> Any:
    """The notebook with its outputs, run in a folder that has the project's scenarios."""
    from nbclient import NotebookClient

    notebook = cells_of(text)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(ROOT / "scenarios", folder / "scenarios", ignore=shutil.ignore_patterns("build"))
        (folder / "build").symlink_to(ROOT / "build")
        quiet = ["--IPKernelApp.log_level=ERROR"]  # it warns of listening on this machine without encryption
        where = {"metadata": {"path": name}}
        NotebookClient(notebook, timeout=PATIENCE, resources=where, extra_arguments=quiet).execute()
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)  # when it ran
    return notebook


def page(notebook: Any, place: Path) -> str:
    """The notebook as Markdown; pictures, and the notebook itself, are files beside `place`."""
    import nbformat

    nbformat.write(notebook, place.with_suffix(".ipynb"))
    parts = []
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source)
            continue
        parts.append(f"```python\n{cell.source}\n```")
        parts += [told for one in cell.outputs if (told := output(one, place, len(parts)))]
    parts.insert(1, f"*Executed when this site was built. [As a notebook]({place.stem}.ipynb).*")
    return "\n\n".join(parts) + "\n"


def output(one: Any, place: Path, number: int) -> str:
    """What a cell gave: text, a table or a picture."""
    if one.output_type == "stream":
        return printed(one.text) if one.name == "stdout" else ""
    for kind, suffix in DRAWN:
        if kind in one.data:
            path = place.with_name(f"{place.stem}-{number}.{suffix}")
            data = one.data[kind]
            path.write_bytes(data.encode() if suffix == "svg" else base64.b64decode(data))
            return f"![output of the cell above]({path.name}){{ .output }}"
    if "text/html" in one.data:
        lines = [line.strip() for line in one.data["text/html"].splitlines() if line.strip()]
        return "\n".join(['<div class="output" markdown="0">', *lines, "</div>"])
    return printed(one.data["text/plain"])


def printed(text: str) -> str:
    """Text as it was printed; lines of their own even where they are empty."""
    lines = [html.escape(line) or "&nbsp;" for line in text.rstrip().splitlines()]
    return "\n".join(['<div class="output" markdown="0">', f"<pre>{chr(10).join(lines)}</pre>", "</div>"])
