"""Pages that are notebooks: executed, with what their cells give below them.

The cells are the python blocks of a page that says so; of a page of a task, also its commands, as `!twin run ...`, and the
files that it saves, as `%%writefile NAME`. `docs/pages.py` puts them into the site; each page is there as a notebook, too.
A cell that fails ends it; the exit codes of commands are compared by tests/test_docs.py.
"""

from __future__ import annotations

import base64
import html
import os
import re
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
MARK = "<!-- the python blocks of this page are the cells of one notebook -->\n"
TASKS = (
    "tutorial/first_component.md",
    "how-to/own_controller.md",
    "how-to/import_fmus.md",
    "how-to/export.md",
    "how-to/calibrate.md",
    "how-to/identify.md",
    "how-to/hardware.md",
    "how-to/follow.md",
)
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$\n?", re.MULTILINE | re.DOTALL)
SAVED = re.compile(r"Save this as\s+`([^`]+)`:\s*$")
SAVE = "%%writefile "
# a line that a terminal would not show any more, such as a bar
REMOVED = re.compile(r"[^\n]*(?:\n(?:\x1b\[\?25[hl])?\r?\x1b\[1A|\r)\x1b\[2K")
CODES = re.compile(r"\x1b\[[?\d;]*[A-Za-z]")  # of a terminal: colors
PATIENCE = 600  # for a cell [s]
DRAWN = (("image/svg+xml", "svg"), ("image/png", "png"))  # what is a file of its own, the better first


def is_task(path: Path) -> bool:
    """Whether commands and saved files of a page are cells, too."""
    return path.relative_to(ROOT / "docs").as_posix() in TASKS


def is_notebook(path: Path) -> bool:
    """Whether blocks of a page are cells."""
    return is_task(path) or MARK in path.read_text()


def code_of(block: re.Match[str], text: str, *, all_kinds: bool) -> str:
    """The code of the cell that a block of a page is; nothing if it is none."""
    kind, content = block.groups()
    if all_kinds and (saved := SAVED.search(text[: block.start()])):
        return f"{SAVE}{saved[1]}\n{content.rstrip()}"
    if all_kinds and kind == "bash":
        return "\n".join(f"!{line}" for line in content.splitlines())
    return content.rstrip() if kind == "python" else ""


def cells_of(path: Path) -> Any:
    """The page as a notebook without outputs; a cell's metadata have its block of the page."""
    import nbformat.v4 as made

    text, cells, at = path.read_text(), [], 0
    for block in BLOCK.finditer(text):
        if code := code_of(block, text, all_kinds=is_task(path)):
            cells += [made.new_markdown_cell(text[at : block.start()].replace(MARK, "").strip())]
            cells += [made.new_code_cell(code, metadata={"block": block[0].rstrip()})]
            at = block.end()
    cells.append(made.new_markdown_cell(text[at:].strip()))
    for number, cell in enumerate(cells):
        cell.id = f"cell-{number}"  # the same for the same page
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return made.new_notebook(cells=[one for one in cells if one.source], metadata={"kernelspec": kernel})


def executed(path: Path) -> Any:
    """The notebook with its outputs, run in a folder that has the project's scenarios, and for a task its components."""
    from nbclient import NotebookClient

    notebook = cells_of(path)
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"  # where `twin` is
    os.environ["COLUMNS"] = "100"  # of the terminal that commands have in cells
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for part in ("scenarios", *(("fmus", "hw_bridge/benches") if is_task(path) else ())):
            shutil.copytree(ROOT / part, folder / part, ignore=shutil.ignore_patterns("build", "__pycache__"))
        (folder / "build").symlink_to(ROOT / "build")
        quiet = ["--IPKernelApp.log_level=ERROR"]  # it warns of listening on this machine without encryption
        where = {"metadata": {"path": name}}
        options = {"timeout": PATIENCE, "resources": where, "extra_arguments": quiet, "coalesce_streams": True}
        NotebookClient(notebook, **options).execute()
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)  # when it ran
    return notebook


def page(notebook: Any, place: Path) -> str:
    """The notebook as Markdown; pictures, and the notebook itself, are files beside `place`."""
    import nbformat

    blocks = [cell.metadata.pop("block", "") for cell in notebook.cells]
    nbformat.write(notebook, place.with_suffix(".ipynb"))
    parts: list[str] = []
    for cell, block in zip(notebook.cells, blocks, strict=True):
        if cell.cell_type == "markdown":
            parts.append(cell.source)
            continue
        parts.append(block)
        if cell.source.startswith(SAVE):
            continue
        parts += [told for one in cell.outputs if (told := output(one, place, len(parts)))]
    parts.insert(1, f"*Executed when this site was built. [Download as a notebook]({place.stem}.ipynb).*")
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
    """Text as it was printed; lines of their own even where they are empty; nothing if all are, as after a line of progress."""
    shown = CODES.sub("", REMOVED.sub("", text.replace("\r\n", "\n"))).rstrip().split("\n")
    lines = [html.escape(line.rpartition("\r")[2]) or "&nbsp;" for line in shown]
    if not any(line.rpartition("\r")[2].strip() for line in shown):
        return ""
    return "\n".join(['<div class="output" markdown="0">', f"<pre>{chr(10).join(lines)}</pre>", "</div>"])
