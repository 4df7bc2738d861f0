"""Every command, script and scenario in README.md and docs/ runs, page by page, in a copy of what a page needs.

A page is a sequence of fenced blocks:

- bash      each line runs; `# exit code 1` behind a line says that it fails. Lines that begin with `python3 -m venv`
            install: they are compared with .ci/run, and of them only a last `twin run` is executed.
- python    runs; on a page that says so, blocks are the cells of one notebook and run after the other blocks
- yaml      a scenario, or a patch of the force scenario: `twin check` must accept it
- csv       is only saved
- text      nothing

A block below a line that ends in "Save this as `path`:" is written to that path and otherwise left to the page.
"""

import csv
import importlib.util
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.every_case import every_case
from twin.cli.check import check_file

ROOT = Path(__file__).parent.parent
FOLDERS = [path for path in sorted((ROOT / "docs").rglob("*.md")) if "decisions" not in path.parts]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *FOLDERS]
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
RUNS = re.compile(r"^```(bash|python|yaml)$", re.MULTILINE)
SAVED = re.compile(r"Save this as\s+`([^`]+)`:\s*$")
LINK = re.compile(r"\]\(([^)#\s]*)[^)]*\)|src=\"([^\"]+)\"")
EXIT = re.compile(r"# exit code (\d+)")

NOTEBOOK = "<!-- the python blocks of this page are the cells of one notebook -->"

MAIN = "twin run scenarios/heart_wall_force.yaml"
TEST = (ROOT / ".ci" / "run").read_text().splitlines()[-1].replace("exec ", "")
RUN = TEST.replace("--no-compile -e '.[test]'", "-e .").replace(".venv/bin/python -m pytest", f".venv/bin/{MAIN}")


def named(path):
    return str(path.relative_to(ROOT))


def executed(page):
    """A page as a case of a test that runs what stands on it; slow where that are commands or scenarios."""
    return pytest.param(page, id=named(page), marks=pytest.mark.slow if RUNS.search(page.read_text()) else ())


def execute(words, folder, command_line):
    """A command as a person has it: `twin` does not see the current folder by itself, `python` does."""
    assert words[0] in ("twin", "python"), (
        f"{words[0]}: only twin and python run in bash blocks; use ```text for the rest"
    )
    if command_line:
        return command_line.run(words[1:], folder, words[0])
    start = {"python": [sys.executable], "twin": [sys.executable, "-P", "-c", "from twin.cli import main; main()"]}
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [*start[words[0]], *words[1:]], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def run_line(line, folder, command_line):
    """One line of a bash block."""
    wanted = int(found[1]) if (found := EXIT.search(line)) else 0
    if line.startswith("python3 -m venv"):
        assert line in (RUN, TEST)
        line = MAIN if line == RUN else ""
    words = shlex.split(line, comments=True)
    while words:
        end = words.index("&&") if "&&" in words else len(words)
        done = execute(words[:end], folder, command_line)
        assert done.returncode == wanted, f"{line}\n{done.stdout}\n{done.stderr}"
        words = words[end + 1 :]


def run_yaml(text, folder):
    """A scenario as it stands, or as a patch of the force scenario."""
    file = folder / "scenarios" / "block.yaml"
    whole = re.search(r"^(extends|stop_time):", text, re.MULTILINE)
    file.write_text(text if whole else f"extends: heart_wall_force.yaml\n{text}")
    problems, _ = check_file(str(file))
    assert not problems, "\n".join([text, *problems])


@pytest.fixture(scope="module")
def built(build, tmp_path_factory):
    """What was built before; what pages build is shared among them and then forgotten."""
    place = tmp_path_factory.mktemp("docs") / "build"
    if build.exists():
        shutil.copytree(build, place, copy_function=linked, ignore=shutil.ignore_patterns(".*"))  # being written
    place.mkdir(exist_ok=True)
    return place


def linked(source, target):
    """One more name of a file, for files there are replaced, never changed; a copy if it is on another file system."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def furnish(folder, built, *, short):
    """What a page finds in its current folder; short: the force experiment with 4 of its 10 s after settling."""
    for name in ("fmus", "scenarios", "hw_bridge/benches"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, folder / name, ignore=ignored, copy_function=shutil.copyfile)
    if short:
        force = folder / "scenarios/heart_wall_force.yaml"
        text = force.read_text()
        assert text.count("stop_time: 22 s") == 1
        force.write_text(text.replace("stop_time: 22 s", "stop_time: 16 s"))
    (folder / "build").symlink_to(built)


@pytest.mark.parametrize("page", list(map(executed, PAGES)))
def test_blocks_run(page, tmp_path, request, command_line):
    text, folder = page.read_text(), tmp_path
    if RUNS.search(text):
        built = request.getfixturevalue("built")  # copied only where something runs
        furnish(folder, built, short="```bash" in text and page.name != "README.md")
    command_line = None if page.name == "README.md" else command_line  # one page as it is, from the start
    cells = []
    for block in BLOCK.finditer(text):
        language, content = block.groups()
        saved = SAVED.search(text[: block.start()])
        assert language in ("bash", "python", "yaml", "csv", "text"), f"{named(page)}: ```{language}"
        if saved:
            (folder / saved[1]).write_text(content)
        elif language == "bash":
            for line in content.splitlines():
                run_line(line, folder, command_line)
        elif language == "python" and NOTEBOOK in text:
            cells.append(content)
        elif language == "python":
            (folder / "block.py").write_text(content)
            done = execute(["python", "block.py"], folder, command_line)
            assert done.returncode == 0, f"{content}\n{done.stderr}"
        elif language == "yaml":
            run_yaml(content, folder)
    if cells:
        (folder / "cells.json").write_text(json.dumps(cells))
        done = execute(["python", str(ROOT / "tests" / "notebook.py"), "cells.json"], folder, command_line)
        assert done.returncode == 0, done.stderr
        assert not done.stderr
    if page.name == "README.md":
        check_table(text, folder)


def check_table(text, folder):
    """The numbers in the README are what its command gives today, to the digits shown."""
    spec = importlib.util.spec_from_file_location("tables", ROOT / "docs" / "tables.py")
    tables = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tables)
    (summary,) = folder.glob("runs/heart_wall_force/2*/summary.json")
    table = tables.published(tables.table(json.loads(summary.read_text())))
    assert table in text, f"README.md is out of date: run `python docs/figures.py`\n{table}"


@every_case("page", PAGES, ids=named)
def test_links_lead_somewhere(page):
    for match in LINK.finditer(page.read_text()):
        target = match[1] or match[2] or ""
        assert not target or target.startswith("https://") or (page.parent / target).exists(), (
            f"{named(page)}: {target}"
        )


@pytest.mark.slow
def test_the_rooms_are_drawn_as_they_are():
    spec = importlib.util.spec_from_file_location("rooms", ROOT / "docs" / "rooms.py")
    rooms = importlib.util.module_from_spec(spec)
    sys.modules["rooms"] = rooms  # dataclasses look there
    spec.loader.exec_module(rooms)
    assert rooms.PICTURE.read_text() == rooms.draw(), "run `python docs/rooms.py`"


def test_figures_are_small():
    files = list((ROOT / "docs" / "figures").iterdir())
    assert files
    assert all(file.stat().st_size < 150_000 for file in files)


def test_files_that_answer_questions_exist():
    with (ROOT / "docs" / "data" / "where_to_change.csv").open(newline="") as file:
        missing = [row["file"] for row in csv.DictReader(file) if not (ROOT / row["file"]).is_file()]
    assert missing == []
