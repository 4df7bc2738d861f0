"""Scenarios and studies found by their names: those of the folder where one works, then those that came with the project."""

from __future__ import annotations

from pathlib import Path

from twin.errors import ScenarioError, nearest

FOLDERS = {"scenario": "scenarios", "study": "scenarios/studies"}
SHARE = "share/catheter-twin"  # where the wheel puts what is no code, below the prefix


def folders(kind: str) -> list[Path]:
    """Folders of one of `FOLDERS`: of the current directory, of the checkout this code is in, of the installed wheel."""
    import sysconfig

    roots = (Path(), Path(__file__).parents[2], Path(sysconfig.get_path("data"), SHARE))
    return [folder for root in roots if (folder := root / FOLDERS[kind]).is_dir()]


def scenarios(kind: str = "scenario") -> dict[str, Path]:
    """Path of each scenario, or study, by its name, sorted; the first folder counts."""
    paths: dict[str, Path] = {}
    for folder in folders(kind):
        for path in sorted(folder.glob("*.yaml")):
            paths.setdefault(path.stem, path)
    return dict(sorted(paths.items()))


def title(path: Path) -> str:
    """What a scenario calls itself, or that it cannot be read; what it extends is not looked at."""
    from twin.scenario import yaml_reader

    try:
        entries = yaml_reader.read(path, path.name).entries
    except ScenarioError as error:
        return error.problems[0]
    return str(next((entries[key].value for key in ("title", "description") if key in entries), ""))


def located(name_or_path: str | Path, kind: str = "scenario") -> Path:
    """A path as it is; a bare name that is no file here stands for the scenario or study of this name.

    ScenarioError for an unknown name, and for a file that is not there where its name is known.
    """
    path = Path(name_or_path)
    if path.suffix and not path.exists() and path.stem in scenarios(kind):
        raise ScenarioError(
            f"{path}: is not there. There is a {kind} of this name elsewhere: give the name alone, {path.stem}."
        )
    if path.suffix or len(path.parts) != 1 or path.is_file():
        return path
    named_paths = scenarios(kind)
    if path.name not in named_paths and path.exists():  # a folder, or what is no file: whoever reads it says so
        return path
    if path.name not in named_paths:
        raise ScenarioError(
            f"There is no {kind} {path.name!r}, and no file of this name. {nearest(path.name, named_paths)}"
        )
    return named_paths[path.name]
