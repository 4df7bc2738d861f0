"""Writer of a tree as YAML text that reads back as the same tree."""

from __future__ import annotations

import re
from typing import Any

import yaml

from twin.scenario.yaml_files.yaml_node import Node
from twin.scenario.yaml_files.yaml_reader import FLOAT

Safe: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


class Dumper(Safe):  # type: ignore[misc]
    """YAML dumper for `yaml_reader`: text such as `1e-3`, a number in YAML 1.2, is quoted; aliases are not used."""

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002 - the base class's signature
        """Disable aliases."""
        return True


Dumper.add_implicit_resolver("tag:yaml.org,2002:float", re.compile(f"({FLOAT.pattern})$"), list("-+.0123456789"))


def text(tree: Node) -> str:
    """Return the tree as YAML text."""
    return str(yaml.dump(tree.plain(), Dumper=Dumper, sort_keys=False, allow_unicode=True, width=110))
