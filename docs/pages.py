"""Build the site of all documents: `python docs/pages.py`, then open build/site/index.html. Needs the extra `docs`.

Pages of docs/ as they are; one for each component, from its declaration, its README and its reference trajectory; one for
each scenario, from its file and from a run, kept until something changes that decides it (outcomes.py; --run: of these alone,
--no-run: of none). Pages that are notebooks are executed, unless --no-notebooks. A link that leads nowhere ends it.
A page's links to docs/data/NAME.csv lead to its appendix, data/PAGE.html, which shows these tables. A line that ends with
"Keys: [`SECTION`, `SECTION`](../data/NAME.csv)." (or "Names: ...") is followed by the tables of these sections.
"""

from __future__ import annotations

import argparse
import csv
import logging
import re
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import notebooks
import numpy as np
from matplotlib.figure import Figure
from outcomes import PAGE, outcomes, table

from twin.cli import describe
from twin.component import catalog
from twin.results import figure_files, si_conversion
from twin.scenario import load_scenario, scenario_paths

if TYPE_CHECKING:
    from twin.component import Component

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "build" / "pages"
FOLDERS = ("tutorial", "how-to", "reference", "explanation", "decisions", "figures")
ELSEWHERE = (  # where links lead in the checkout, and in the site
    (re.compile(r"(?:\.\./)+fmus/\w+/(\w+)/README\.md"), r"../components/\1.md"),
    (re.compile(r"\.\./(\w+)/README\.md"), r"\1.md"),
    (re.compile(r"(?:\.\./)+docs/"), "../"),
    (re.compile(r"(?:\.\./)+README\.md"), "../index.md"),
    (re.compile(r"(?:\.\./)+benchmarks/results/"), "../results/"),
    (re.compile(r"(?<=\()docs/decisions(?=\))"), "decisions/index.md"),
    (re.compile(r"(?<=\()CONTRIBUTING\.md"), "contributing.md"),
    (re.compile(r"(?<=\()CHANGELOG\.md"), "changelog.md"),
    (re.compile(r"(?<=\()LICENSE(?=\))"), "license.md"),
    (re.compile(r"(?<=\()CITATION\.cff(?=\))"), "citation.md"),
    (re.compile(r"(?<=[(\"])docs/"), ""),
)
DATA = re.compile(r"\]\(\.\./data/(\w+)\.csv\)")  # a link to a complete table
# sections of a table at the end of a line, and what the line says before
KEYS = re.compile(r"^(.*?)(?:(?:Keys|Names): )?\[(`[\w`, ]+`)\]\(\.\./data/(\w+)\.csv\)\.$", re.MULTILINE)
API = ("twin", "twin.component", "twin.fmi", "twin.coupling", "twin.results", "twin.scenario", "twin.run")
DRAWN = 6  # curves of a panel at most


def main() -> None:
    """Put the pages together and build the site."""
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument(
        "--run", nargs="+", metavar="SCENARIO", help="show plots and verdicts of these alone [default: of all]"
    )
    reader.add_argument("--no-run", dest="run", action="store_const", const=[], help="show no plots and no verdicts")
    reader.add_argument("--no-notebooks", action="store_true", help="leave the cells of notebooks as they are")
    asked = reader.parse_args()
    shutil.rmtree(SOURCE, ignore_errors=True)
    documents(execute=not asked.no_notebooks)
    for name in catalog.names():
        write(f"components/{name}.md", component_page(name))
    write("components/index.md", index("Components", {n: catalog.summary(n) for n in catalog.names()}))
    own = {name: path for name, path in scenario_paths.scenarios().items() if path.resolve().is_relative_to(ROOT)}
    came_out = outcomes({name: path for name, path in own.items() if asked.run is None or name in asked.run})
    for name, path in own.items():
        write(f"scenarios/{name}.md", scenario_page(path, came_out.get(name)))
    write("scenarios/index.md", index("Scenarios", {n: scenario_paths.title(path) for n, path in own.items()}))
    write("reference/api.md", "# API\n\nFrom the docstrings.\n\n" + "\n".join(f"::: {name}\n" for name in API))
    build()


def build() -> None:
    """Build the site; a warning is an error."""
    from mkdocs.commands.build import build as built
    from mkdocs.config import load_config

    logging.basicConfig(level=logging.WARNING, format="%(message)s")
    config = load_config(str(ROOT / "docs" / "pages.yml"))
    config.nav = [expanded(one) for one in config.nav]
    built(config)
    print(f"{Path(config.site_dir).relative_to(ROOT)}/index.html")


def expanded(entry: dict[str, object]) -> dict[str, object]:
    """An entry of the navigation; a folder stands for its pages, its index first."""
    ((title, place),) = entry.items()
    if not isinstance(place, str) or place.endswith(".md"):
        return entry
    pages = sorted((SOURCE / place).glob("*.md"), key=lambda page: (page.stem != "index", page.stem))
    return {title: [page.relative_to(SOURCE).as_posix() for page in pages]}


def write(place: str, text: str) -> None:
    """Write a page."""
    path = SOURCE / place
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def documents(*, execute: bool) -> None:
    """Pages that people wrote, with their links as they are in the site; `execute`: those that are notebooks."""
    for folder in FOLDERS:
        for path in sorted((ROOT / "docs" / folder).iterdir()):
            if path.suffix == ".md":
                text, place = path.read_text(), SOURCE / folder / path.name
                if execute and notebooks.is_notebook(path):
                    place.parent.mkdir(parents=True, exist_ok=True)
                    text = notebooks.page(notebooks.executed(path), place)
                write(f"{folder}/{path.name}", with_appendix(path, with_keys(moved(text))))
            elif path.suffix in (".svg", ".csv"):
                write(f"{folder}/{path.name}", path.read_text())
            elif path.suffix == ".png":
                (SOURCE / folder).mkdir(parents=True, exist_ok=True)
                shutil.copyfile(path, SOURCE / folder / path.name)
    titles = {
        path.stem: path.read_text().partition("\n")[0].lstrip("# ") for path in (SOURCE / "decisions").glob("*.md")
    }
    write("decisions/index.md", index("Decisions", titles))
    shutil.copytree(ROOT / "benchmarks" / "results", SOURCE / "results")
    write("index.md", moved((ROOT / "README.md").read_text()))
    write("contributing.md", moved((ROOT / "CONTRIBUTING.md").read_text()))
    write("changelog.md", moved((ROOT / "CHANGELOG.md").read_text()))
    write("notebooks.css", (ROOT / "docs" / "notebooks.css").read_text())
    for name, path in (("license", "LICENSE"), ("citation", "CITATION.cff")):
        write(f"{name}.md", f"# {path}\n\n```text\n{(ROOT / path).read_text()}```\n")


def with_keys(text: str) -> str:
    """A page with the table of each section of keys or names that it links to, with a title where there are several."""

    def tables(match: re.Match[str]) -> str:
        before, sections, name = match[1].rstrip(), re.findall(r"`([^`]+)`", match[2]), match[3]
        with (ROOT / "docs" / "data" / f"{name}.csv").open(newline="") as file:
            head, *rows = csv.reader(file)
        parts = [before] * bool(before)
        for section in sections:
            parts += [f"**{section}**"] * (len(sections) > 1)
            own_rows = [(f"`{key}`", *rest) for own, key, *rest in rows if own == section]
            if head[-1] == "example":
                own_rows = [(*rest, f"`{example}`") for *rest, example in own_rows]
            parts.append(table(head[1:], own_rows))
        return "\n\n".join(parts)

    return KEYS.sub(tables, text)


def with_appendix(path: Path, text: str) -> str:
    """A page whose links to files of docs/data lead to their tables in its appendix, data/PAGE.md, which is written here."""
    names = dict.fromkeys(DATA.findall(text))
    if not names:
        return text
    title = text.partition("\n")[0].lstrip("# ")
    parts = [f"# Tables of: {title}\n\nComplete tables of [the page](../{path.parent.name}/{path.name}).\n"]
    for name in names:
        source = ROOT / "docs" / "data" / f"{name}.csv"
        write(f"data/{name}.csv", source.read_text())
        with source.open(newline="") as file:
            head, *rows = csv.reader(file)
        heading = f"## {name.replace('_', ' ').capitalize()} {{ #{name} }}\n"
        parts.append(f"{heading}\n{table(head, rows)}\n[{name}.csv]({name}.csv)\n")
    write(f"data/{path.stem}.md", "\n".join(parts))
    return DATA.sub(rf"](../data/{path.stem}.md#\1)", text)


def moved(text: str) -> str:
    """A page whose links lead where things are in the site."""
    for pattern, place in ELSEWHERE:
        text = pattern.sub(place, text)
    return text


def index(title: str, lines: dict[str, str]) -> str:
    """A page that lists others of its folder."""
    rows = "\n".join(f"| [{name}]({name}.md) | {line} |" for name, line in sorted(lines.items()))
    return f"# {title}\n\n| | |\n|---|---|\n{rows}\n"


def component_page(name: str) -> str:
    """What a component is, with its variables, and what it does in its reference trajectory."""
    cls = catalog.component(name)
    place = Path(str(catalog.component_folder(name)))
    readme = moved((place / "README.md").read_text()) if (place / "README.md").exists() else f"# {name}\n"
    heading, _, rest = readme.partition("\n")
    parts = [heading, f"`{name}`: {describe.kind(cls)}.\n", rest, "## Variables\n", variables(cls)]
    if (place / "expected.csv").exists():
        write(f"components/{name}.svg", trajectory(place / "expected.csv", cls))
        parts.append(f"## What it does\n\nIts reference trajectory.\n\n![trajectory of {name}]({name}.svg)\n")
    return "\n".join(parts)


def variables(cls: type[Component]) -> str:
    """Variables of a component that one sets or connects, as a table."""
    rows = [
        (
            f"`{describe.name_with_shape(one)}`",
            str(one.role),
            describe.start(one),
            describe.bounds(one),
            one.description,
            one.source,
        )
        for one in cls.variables
        if one.role not in describe.HIDDEN
    ]
    return table(("name", "role", "start", "bounds", "what it is", "source"), rows)


def trajectory(path: Path, cls: type[Component]) -> str:
    """The curves of a reference trajectory, one panel for each unit of inputs and of outputs; those at rest only if all are."""
    with path.open(newline="") as file:
        names, *rows = csv.reader(file)
    values = np.array(rows, float)
    declared = {one.name: one for one in cls.variables}
    panels: dict[tuple[str, str], list[int]] = {}
    for column, name in enumerate(names[1:], 1):
        one = declared[name.partition("[")[0]]
        panels.setdefault((str(one.role), describe.unit(one)), []).append(column)
    figure = Figure(figsize=(8.0, 0.8 + 1.3 * len(panels)), layout="constrained")
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for ax, ((role, unit), columns) in zip(axes, panels.items(), strict=True):
        factor, offset = si_conversion(unit)
        moving = [column for column in columns if np.ptp(values[:, column]) > 0]
        for column in (moving or columns)[:DRAWN]:
            ax.plot(values[:, 0], (values[:, column] - offset) / factor, label=names[column])
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8)
        ax.set_ylabel(f"{role} [{unit or '-'}]", fontsize=8)
    axes[-1].set_xlabel("time [s]")
    return figure_files.figure_to_svg(figure)


def scenario_page(path: Path, came_out: Path | None) -> str:
    """What a scenario couples and asks, and what came out, if that is kept in a folder."""
    scenario = load_scenario(path)
    parts = [f"# {scenario.title}\n", f"`twin run {path.stem}`\n", scenario.description]
    if scenario.source:
        parts.append(f"From: {scenario.source}.\n")
    made = {name: of for name, of in describe.member_components(scenario).items() if of}
    linked = [(f"`{name}`", ", ".join(map(component_link, of.split(" or ")))) for name, of in made.items()]
    parts += ["## Members\n", table(("member", "made of"), linked)]
    parts += [
        "## Variants\n",
        table(("variant", "what it is"), [(case.variant, case.title) for case in scenario.variants]),
    ]
    asked = [(one.name, describe.limits(one)) for one in scenario.expectations]
    parts += ["## What is expected\n", table(("expectation", "limits"), asked)] if asked else []
    if came_out is not None:
        parts.append((came_out / PAGE).read_text())
        for picture in came_out.glob("*.svg"):
            write(f"scenarios/{picture.name}", picture.read_text())
    return "\n".join([*parts, "## The file\n", f"```yaml\n{path.read_text()}```\n"])


def component_link(name: str) -> str:
    """A component with a link to its page, if it has one."""
    return f"[{name}](../components/{name}.md)" if name in catalog.names() else f"`{name}`"


if __name__ == "__main__":
    main()
