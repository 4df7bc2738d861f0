"""The fingerprint changes whenever the C changes, however a value is reached; it is the same in every process.

`test_edits.py` makes such edits in whole runs, in processes of their own; here they are many and quick.
"""

import importlib
import os
import subprocess
import sys
import textwrap

import pytest

from twin import compiler
from twin.compiler.fingerprint import fingerprint

READ = "float(pathlib.Path(__file__).with_name('third.py').read_text())"
THIRD = {"third": "A = 1.0\nG = 1.25\n"}
# how it is reached: imports and other top-level lines, the expression in `initialize`, that in `step`, other modules, the edited one
DETOURS = {
    "a package in two functions": (
        "import package.third", "package.third.A", "package.third.G", {"package/__init__": "", "package/third": THIRD["third"]},
        "package/third",
    ),
    "a class that holds a module": (
        "import third\nclass Holder:\n    module = third", "Holder.module.A", "Holder.module.G", THIRD, "third",
    ),
    "an object that holds a module": (
        "import third, types\nholder = types.SimpleNamespace(module=third)", "holder.module.A", "holder.module.G", THIRD, "third",
    ),
    "a class in a class": (
        "import helper", "helper.Outer.Inner.A", "helper.Outer.Inner.module.G",
        {"helper": "import third\nclass Outer:\n    class Inner:\n        A = 1.0\n        module = third\n", **THIRD}, "third",
    ),
    "a metaclass that computes attributes": (
        "import helper", "helper.Any.A", "helper.Any.G",
        {"helper": "import third\nclass Meta(type):\n    def __getattr__(cls, name):\n        return getattr(third, name)\n"
         "class Any(metaclass=Meta):\n    pass\n", **THIRD}, "third",
    ),
    "an object that computes attributes": (
        "import helper", "helper.any.A", "helper.any.G",
        {"helper": "import third\nclass Any:\n    def __getattr__(self, name):\n        return getattr(third, name)\nany = Any()\n",
         **THIRD}, "third",
    ),
    "a property of a metaclass": (
        "import helper", "0.0", "helper.Any.G",
        {"helper": "import third\nclass Meta(type):\n    @property\n    def G(cls):\n        return third.G\n"
         "class Any(metaclass=Meta):\n    pass\n", **THIRD}, "third",
    ),
    "a descriptor": (
        "import helper", "0.0", "helper.Any.G",
        {"helper": "import third\nclass Computed:\n    def __get__(self, owner, kind=None):\n        return third.G\n"
         "class Any:\n    G = Computed()\n", **THIRD}, "third",
    ),
    "a function of an installed package": (
        "from mylib.helper import gain", "0.0", "gain(t)",
        {"site-packages/mylib/__init__": "",
         "site-packages/mylib/helper": "from mylib.third import G\ndef gain(t: float) -> float:\n    return G\n",
         "site-packages/mylib/third": THIRD["third"]}, "site-packages/mylib/third",
    ),
    "a class of an installed package": (
        "from mylib.helper import Gains", "0.0", "Gains.G",
        {"site-packages/mylib/__init__": "", "site-packages/mylib/helper": "from mylib import third\nclass Gains:\n    G = third.G\n",
         "site-packages/mylib/third": THIRD["third"]}, "site-packages/mylib/third",
    ),
    "a file with the name of a standard module": (
        "import colorsys", "0.0", "colorsys.G", {"colorsys": THIRD["third"]}, "colorsys",
    ),
    "relative and star imports": (
        "from package.first import gain", "0.0", "gain(t)",
        {"package/__init__": "", "package/first": "from . import (\n    second,\n)\ndef gain(t: float) -> float:\n    return second.G\n",
         "package/second": "from .third import *\n", "package/third": THIRD["third"]}, "package/third",
    ),
    "an import in a function": (
        "from helper import gain", "0.0", "gain(t)",
        {"helper": "def make():\n    import third\n    def gain(t: float) -> float:\n        return third.G\n    return gain\ngain = make()\n",
         **THIRD}, "third",
    ),
    "a decorator": (
        "from helper import gain", "0.0", "gain(t)",
        {"helper": "import third\ndef other(function):\n    return third.gain\n@other\ndef gain(t: float) -> float:\n    return 0.0\n",
         "third": "def gain(t: float) -> float:\n    return 1.25\n"}, "third",
    ),
    "a function that exec makes": (
        "import helper", "0.0", "helper.gain(t)",
        {"helper": "import pathlib\npath = pathlib.Path(__file__).with_name('third.py')\nmade = {}\n"
         "exec(compile(path.read_text(), str(path), 'exec'), made)\ngain = made['gain']\n",
         "third": "G = 1.25\ndef gain(t: float) -> float:\n    return G\n"}, "third",
    ),
    "a module that is loaded by its path": (
        "import helper", "0.0", "helper.third.gain(t)",
        {"helper": "import importlib.util, pathlib\npath = pathlib.Path(__file__).with_name('third.py')\n"
         "spec = importlib.util.spec_from_file_location('by_path', path)\n"
         "third = importlib.util.module_from_spec(spec)\nspec.loader.exec_module(third)\n",
         "third": "def gain(t: float) -> float:\n    return 1.25\n"}, "third",
    ),
    "a class that is loaded by its path": (
        "import helper", "0.0", "helper.Gains.G",
        {"helper": "import importlib.util, pathlib\ndef load(path):\n    spec = importlib.util.spec_from_file_location('by_path', path)\n"
         "    module = importlib.util.module_from_spec(spec)\n    spec.loader.exec_module(module)\n    return module\n"
         "Gains = load(pathlib.Path(__file__).with_name('third.py')).Gains\n", "third": "class Gains:\n    G = 1.25\n"}, "third",
    ),
    "a comment behind a constant": ("from helper import G", "0.0", "G", {"helper": "from third import G\n", "third": "G = 2.0  # 1.25\n"}, "third"),
    **{f"a file, by {name}": ("import helper", "0.0", f"helper.{expression}", {"helper": f"import pathlib\n{text}\n", "third": "1.25"}, "third")
       for name, text, expression in (
           ("a name in a module of Python", f"import math\nmath.of_a_test = {READ}", "math.of_a_test"),
           ("a builtin name", f"import builtins\nbuiltins.of_a_test = {READ}", "builtins.of_a_test"),
           ("a property", f"class Gains:\n    @property\n    def G(self):\n        return {READ}\ngains = Gains()", "gains.G"),
           ("a number of C", f"import ctypes\nnumber = ctypes.c_double({READ})", "number.value"),
           ("an array", f"import numpy as np\ntable = np.array([{READ}])", "table[0]"),
           ("a class made at run time", f"Gains = type('Gains', (), {{'G': {READ}}})", "Gains.G"),
           ("a name that the engine uses in components", f"composition = {READ}", "composition"),
           ("a class of a module that replaces its own",
            f"import sys, types\nclass Lazy(types.ModuleType):\n    G = property(lambda _: {READ})\nsys.modules[__name__].__class__ = Lazy", "G"),
           ("items that a dict computes",
            f"class Table(dict):\n    def __missing__(self, key):\n        return {READ}\ntable = Table()", "table['G']"),
           ("a number that hides", f"class Number(float):\n    def __repr__(self):\n        return 'one'\nnumber = Number({READ})", "number"),
       )},
}  # fmt: skip
PART = '''
from twin.component import Component, output
{imports}


class Part(Component):
    """Shows a number."""

    period = 0.01
    y = output("", "the number")

    def initialize(self):
        self.y = {first}

    def step(self, t, h):
        self.y = {then}
'''


def made(folder, modules):
    """C and fingerprint of the component in these files."""
    for name, text in modules.items():
        path = folder / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    importlib.invalidate_caches()
    before = set(sys.modules)
    shadowed = {name: sys.modules.pop(name) for name in ("colorsys",) if name in sys.modules}
    try:
        cls = importlib.import_module("detour_part").Part
        return compiler.translate(cls, "Part").source, fingerprint(cls)
    finally:
        for name in set(sys.modules) - before:
            del sys.modules[name]
        sys.modules.update(shadowed)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("detour", DETOURS)
def test_an_edit_that_changes_the_c_changes_the_fingerprint(detour, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # of installed packages, Python's own is used
    imports, first, then, modules, edited = DETOURS[detour]
    monkeypatch.syspath_prepend(str(tmp_path / "site-packages"))
    monkeypatch.syspath_prepend(str(tmp_path))
    modules = {"detour_part": PART.format(imports=imports, first=first, then=then), **modules}
    before, key = made(tmp_path, modules)
    assert made(tmp_path, modules) == (before, key)
    after, other = made(tmp_path, modules | {edited: modules[edited].replace("1.25", "2.75")})
    assert after != before
    assert other is None or other != key


def test_a_module_that_a_function_imports_when_it_runs_counts(tmp_path, monkeypatch):
    """A Python-side component may do so: a study that was interrupted goes on with the same model only."""
    part = PART.replace("{imports}", "").replace("{first}", "0.0").replace("Component", "PythonComponent")
    part = part.replace("self.y = {then}", "from third import G\n        self.y = G")
    monkeypatch.syspath_prepend(str(tmp_path))
    keys = set()
    for value in ("1.25", "2.75"):
        (tmp_path / "third.py").write_text("from fourth import G\n")
        (tmp_path / "fourth.py").write_text(f"G = {value}\n")
        (tmp_path / "detour_part.py").write_text(part)
        importlib.invalidate_caches()
        keys.add(fingerprint(importlib.import_module("detour_part").Part))
        del sys.modules["detour_part"]
    assert len(keys) == 2
    assert None not in keys


def test_values_and_functions_that_change_in_memory_are_read_anew(tmp_path, monkeypatch):
    """As in a notebook, which also reloads functions by giving them other code."""
    monkeypatch.syspath_prepend(str(tmp_path))
    imports = "def make(g):\n    def gain(t: float) -> float:\n        return g\n    return gain\ngain = make(1.25)"
    text = PART.format(imports=imports, first="0.0", then="gain(t)")
    file = tmp_path / "detour_part.py"
    file.write_text(text)
    importlib.invalidate_caches()
    module = importlib.import_module("detour_part")
    try:
        assert "1.25" in compiler.translate(module.Part, "Part").source
        module.gain.__closure__[0].cell_contents = 2.75
        assert "2.75" in compiler.translate(module.Part, "Part").source
        file.write_text(text.replace("= gain(t)", "= gain(t) + 7.5"))
        names = {}
        exec(compile(file.read_text(), str(file), "exec"), names)
        module.Part.step.__code__ = names["Part"].step.__code__
        assert "7.5" in compiler.translate(module.Part, "Part").source
    finally:
        del sys.modules["detour_part"]


ALL = textwrap.dedent("""
    import random, sys
    from twin import compiler
    from twin.component import PythonComponent, catalog
    names = list(catalog.names())
    random.Random(int(sys.argv[1])).shuffle(names)
    classes = {name: catalog.component(name) for name in names}
    for name in sorted(names):
        if not issubclass(classes[name], PythonComponent):
            print(name, compiler.component_fingerprint(classes[name]))
""")


@pytest.mark.slow
def test_fingerprints_are_the_same_in_every_process():
    """Whatever else is imported, in which order, and however strings are hashed."""
    found = set()
    for seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        line = [sys.executable, "-c", ALL, seed]
        found.add(subprocess.run(line, capture_output=True, text=True, check=True, env=environment).stdout)
    assert len(found) == 1
    assert "None" not in found.pop()  # none of ours is translated at every start
