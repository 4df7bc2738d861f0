"""Print the lowest versions that pyproject.toml allows, as constraints of pip: `name==version`, a line each."""

import re
import sys
import tomllib
from pathlib import Path

# a name with its extras, a lower bound, and what else is said of it
BOUND = re.compile(r"(?P<name>[\w.-]+)(\[[\w,-]+\])?>=(?P<version>[\d.]+)(?:,[^;]*)?(?P<marker>;.*)?")


def main() -> int:
    """Print them; whatever has no lower bound is not constrained."""
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    every = [*project["dependencies"], *(one for group in project["optional-dependencies"].values() for one in group)]
    for match in filter(None, map(BOUND.fullmatch, every)):
        print(f"{match['name']}=={match['version']}{match['marker'] or ''}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
