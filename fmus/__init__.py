"""The components, a folder each: `model.py`, `README.md` and `expected.csv`; folders above them say what kind of part it is.

A component is known by its own name, which is unique: it is `fmus.servomotor` to Python, `servomotor` to scenarios, and
stays that if it changes its place. What several of a kind share stands beside them (`fmus.control`), what several kinds
share stands here. A person's own folder `fmus`, without `__init__.py`, is read beside this one.
"""

from pathlib import Path
from pkgutil import extend_path

__path__ = extend_path(__path__, __name__)
__path__ += sorted(str(kind.parent.parent) for root in __path__ for kind in Path(root).glob("*/*/model.py"))
__path__ = list(dict.fromkeys(__path__))
