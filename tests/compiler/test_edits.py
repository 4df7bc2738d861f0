"""What runs is what the files say: after any edit, C, FMU and interpreted run give the new value.

Each edit is made in a project of its own, in the same folder and with the same names, so that everything that an earlier
process kept there is found again: bytecode of the same size and time, translated C, objects, FMUs.
"""

import json
import os
import subprocess
import sys

import pytest
from pyarrow import parquet

from tests.matrix import some
from twin.results.recording.run_folder import read_signals

COMPONENT = """
{imports}
from twin.component import Component, output, parameter

{before}

class Part({bases}Component):
    \"\"\"Shows a number.\"\"\"

    period = 0.01
    y = output("m", "the number")
    {own}

    def step(self, t, h):
        {lines}
"""
# kind: what of the component's file differs from the usual, other files, and the edit: file, old text, new text.
# The value is 1.25 before and 2.75 after; both have the same length.
HELPER = "G = 1.25\n"
KINDS = {
    "constant of the module": ({"before": "G = 1.25", "lines": "self.y = G"}, {}, "part.py"),
    "imported constant": ({"imports": "from helper import G", "lines": "self.y = G"}, {"helper.py": HELPER}, "helper.py"),
    "star import": ({"imports": "from helper import *", "lines": "self.y = G"}, {"helper.py": HELPER}, "helper.py"),
    "through a module": ({"imports": "import helper", "lines": "self.y = helper.G"}, {"helper.py": HELPER}, "helper.py"),
    "through a module under another name": (
        {"imports": "import helper as other", "lines": "self.y = other.G"}, {"helper.py": HELPER}, "helper.py",
    ),
    "through a package": (
        {"imports": "import pkg.helper", "lines": "self.y = pkg.helper.G"},
        {"pkg/__init__.py": "", "pkg/helper.py": HELPER}, "pkg/helper.py",
    ),
    "through a namespace package": (
        {"imports": "from pkg import helper", "lines": "self.y = helper.G"}, {"pkg/helper.py": HELPER}, "pkg/helper.py",
    ),
    "tuple of a module": (
        {"imports": "import helper", "lines": "self.y = helper.T[1]"}, {"helper.py": "T = (0.0, 1.25)\n"}, "helper.py",
    ),
    "function through a module": (
        {"imports": "import helper", "lines": "self.y = helper.gain(t)"},
        {"helper.py": "def gain(t: float) -> float:\n    return 1.25\n"}, "helper.py",
    ),
    "imported function": (
        {"imports": "from helper import gain", "lines": "self.y = gain(t)"},
        {"helper.py": "def gain(t: float) -> float:\n    return 1.25\n"}, "helper.py",
    ),
    "constant of a third module": (
        {"imports": "from helper import gain", "lines": "self.y = gain(t)"},
        {"helper.py": "from third import G\n\n\ndef gain(t: float) -> float:\n    return G\n", "third.py": HELPER}, "third.py",
    ),
    "third module through a module": (
        {"imports": "import helper", "lines": "self.y = helper.gain(t)"},
        {"helper.py": "import third\n\n\ndef gain(t: float) -> float:\n    return third.G\n", "third.py": HELPER}, "third.py",
    ),
    "function of a function": (
        {"imports": "import helper", "lines": "self.y = helper.gain(t)"},
        {"helper.py": "from third import inner\n\n\ndef gain(t: float) -> float:\n    return inner(t)\n",
         "third.py": "def inner(t: float) -> float:\n    return 1.25\n"}, "third.py",
    ),
    "default argument": (
        {"before": "def gain(t: float, g: float = 1.25) -> float:\n    return g\n", "lines": "self.y = gain(t)"},
        {}, "part.py",
    ),
    "closure": (
        {"imports": "from helper import gain", "lines": "self.y = gain(t)"},
        {"helper.py": "def make(g):\n    def gain(t: float) -> float:\n        return g\n\n    return gain\n\n\ngain = make(1.25)\n"},
        "helper.py",
    ),
    "value of an IntEnum": (
        {"imports": "from helper import Level", "lines": "self.y = 1.25 if Level.high == 7 else 2.75"},
        {"helper.py": "from enum import IntEnum\n\n\nclass Level(IntEnum):\n    high = 7\n"},
        ("helper.py", "high = 7", "high = 8"),
    ),
    "value of an enum through a module": (
        {"imports": "import helper", "lines": "self.y = 1.25 if helper.Level.high.value == 7 else 2.75"},
        {"helper.py": "from enum import Enum\n\n\nclass Level(Enum):\n    high = 7\n"},
        ("helper.py", "high = 7", "high = 8"),
    ),
    "attribute of a class": (
        {"before": "class Constants:\n    G = 1.25\n", "lines": "self.y = Constants.G"}, {}, "part.py",
    ),
    "attribute of an imported class": (
        {"imports": "from helper import Constants", "lines": "self.y = Constants.G"},
        {"helper.py": "class Constants:\n    G = 1.25\n"}, "helper.py",
    ),
    "class attribute in a condition": (
        {"imports": "import helper", "lines": "self.y = 1.25 if helper.Constants.FAST else 2.75"},
        {"helper.py": "class Constants:\n    FAST = 1\n"}, ("helper.py", "FAST = 1", "FAST = 0"),
    ),
    "tuple in a class": (
        {"imports": "from helper import Constants", "lines": "self.y = Constants.T[1]"},
        {"helper.py": "class Constants:\n    T = (0.0, 1.25)\n"}, "helper.py",
    ),
    "static method": (
        {"imports": "from helper import Constants", "lines": "self.y = Constants.gain(t)"},
        {"helper.py": "class Constants:\n    @staticmethod\n    def gain(t: float) -> float:\n        return 1.25\n"}, "helper.py",
    ),
    "base class in another file": (
        {"imports": "from helper import Base", "before": "class Constants(Base):\n    pass\n", "lines": "self.y = Constants.G"},
        {"helper.py": "class Base:\n    G = 1.25\n"}, "helper.py",
    ),
    "parameter of a base component in another file": (
        {"imports": "from helper import Base", "bases": "Base, ", "lines": "self.y = self.g"},
        {"helper.py": "from twin.component import Component, parameter\n\n\nclass Base(Component):\n"
         "    g = parameter(1.25, 'm', 'gain')\n"}, "helper.py",
    ),
    "start value of a parameter": ({"own": 'g = parameter(1.25, "m", "gain")', "lines": "self.y = self.g"}, {}, "part.py"),
    "start value from a module": (
        {"imports": "import helper", "own": 'g = parameter(helper.G, "m", "gain")', "lines": "self.y = self.g"},
        {"helper.py": HELPER}, "helper.py",
    ),
    "start value from a JSON file": (
        {"imports": "import json\nfrom pathlib import Path",
         "own": 'g = parameter(json.loads(Path("gain.json").read_text())["g"], "m", "gain")', "lines": "self.y = self.g"},
        {"gain.json": '{"g": 1.25}'}, "gain.json",
    ),
    "constant from a CSV file": (
        {"imports": "import numpy as np", "before": 'G = float(np.loadtxt("gain.csv"))', "lines": "self.y = G"},
        {"gain.csv": "1.25\n"}, "gain.csv",
    ),
    "array from a CSV file": (
        {"imports": "import numpy as np", "before": 'G = np.loadtxt("gain.csv", ndmin=1)', "lines": "self.y = G[0]"},
        {"gain.csv": "1.25\n2.75\n"}, ("gain.csv", "1.25\n2.75", "2.75\n1.25"),
    ),
    "tuple of arrays": (
        {"imports": "import numpy as np", "before": "T = (np.array([0.0, 1.25]), np.array([1.0, 1.0]))", "lines": "self.y = T[0][1]"},
        {}, "part.py",
    ),
    "an object that prints nothing": (
        {"imports": "from helper import C", "lines": "self.y = C.g"},
        {"helper.py": "class Box:\n    def __init__(self):\n        self.g = 1.25\n\n    def __repr__(self):\n        return 'box'\n\n\nC = Box()\n"},
        "helper.py",
    ),
    "a field without repr": (
        {"imports": "from helper import C", "lines": "self.y = C.g"},
        {"helper.py": "from dataclasses import dataclass, field\n\n\n@dataclass(frozen=True)\nclass Box:\n"
         "    g: float = field(default=1.25, repr=False)\n\n\nC = Box()\n"}, "helper.py",
    ),
    "slots": (
        {"imports": "from helper import C", "lines": "self.y = C.g"},
        {"helper.py": "class Box:\n    __slots__ = ('g',)\n\n    def __init__(self):\n        self.g = 1.25\n\n\nC = Box()\n"}, "helper.py",
    ),
    "property": (
        {"imports": "from helper import C", "lines": "self.y = C.g"},
        {"helper.py": "import third\n\n\nclass Box:\n    @property\n    def g(self):\n        return third.G\n\n\nC = Box()\n",
         "third.py": HELPER}, "third.py",
    ),
    "frozen dataclass in a tuple": (
        {"imports": "from helper import BOXES", "before": "BOX = BOXES[0]", "lines": "self.y = BOX.g"},
        {"helper.py": "from dataclasses import dataclass\n\n\n@dataclass(frozen=True)\nclass Box:\n    g: float\n\n\nBOXES = (Box(1.25),)\n"},
        "helper.py",
    ),
    "attribute that a module computes": (
        {"imports": "import helper", "lines": "self.y = helper.G"},
        {"helper.py": "VALUES = {'G': 1.25}\n\n\ndef __getattr__(name):\n    try:\n        return VALUES[name]\n"
         "    except KeyError:\n        raise AttributeError(name) from None\n"}, "helper.py",
    ),
    "last bit": (
        {"before": "G = float.fromhex('0x1.0000000000000p+0')", "lines": "self.y = 1.25 if G == 1.0 else 2.75"}, {},
        ("part.py", "0x1.0000000000000p+0", "0x1.0000000000001p+0"),
    ),
    "sign of zero": (
        {"imports": "from math import copysign", "before": "Z = +0.0", "lines": "self.y = 1.25 if copysign(1.0, Z) > 0.0 else 2.75"},
        {}, ("part.py", "Z = +0.0", "Z = -0.0"),
    ),
    "environment variable": (
        {"imports": "import os", "before": 'G = float(os.environ.get("GAIN", "1.25"))', "lines": "self.y = G"}, {}, "GAIN",
    ),
    "linked folder": (
        {"imports": "from pkg import helper", "lines": "self.y = helper.G"},
        {"first/helper.py": HELPER, "second/helper.py": HELPER.replace("1.25", "2.75")}, "link",
    ),
}  # fmt: skip

RUN = """
import json, os, sys
from pathlib import Path
os.environ.update(json.loads(sys.argv[2]))
from twin.component import catalog
from twin.run import build_simulation, noop, recorded_signals, resolve_catalogs, run_case
from twin.scenario import Backend, load_scenario, members
found = {}
for form in ("interpreted", "compiled", "fmu"):
    scenario = load_scenario(Path("one.yaml"))
    case = scenario.cases()[0]
    members.prebuild([members.component_of(one) for one in case.members.values()], Backend(form), Path(sys.argv[1]), noop)
    running = build_simulation(case, resolve_catalogs(scenario)[case.variant], Backend(form), Path(sys.argv[1]))
    run_case(case, running, noop)
    found[form] = float(recorded_signals(running, complete=True).values["part.y"][-1])
    running.terminate()
print(json.dumps(found))
"""
SCENARIO = "stop_time: 20 ms\nmembers: {part: {component: 'part:Part'}}\nrecord: {variables: [part.y]}\n"
TIME = 1_700_000_000  # s; of every file, before and after each edit


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    os.utime(path, (TIME, TIME))


def project(folder, kind):
    """The files of a kind; what its edit does."""
    parts, files, edit = KINDS[kind]
    usual = {"imports": "", "before": "", "bases": "", "own": "", "lines": ""}
    write(folder / "part.py", COMPONENT.format(**usual | parts))
    write(folder / "one.yaml", SCENARIO)
    for name, text in files.items():
        write(folder / name, text)
    environment = {}
    if edit == "link":
        (folder / "pkg").symlink_to("first")

    def change():
        if edit == "link":
            (folder / "pkg").unlink()
            (folder / "pkg").symlink_to("second")
        elif edit == "GAIN":
            environment["GAIN"] = "2.75"
        else:
            name, old, new = edit if isinstance(edit, tuple) else (edit, "1.25", "2.75")
            text = (folder / name).read_text()
            assert old in text
            assert len(old) == len(new)
            write(folder / name, text.replace(old, new))

    return change, environment


def values(folder, build, environment, command_line):
    """What the component shows in each form, in a process of its own, which has imported the engine but no component."""
    write(folder / "run.py", RUN)
    done = command_line.run(["run.py", str(build), json.dumps(environment)], folder, program="python")
    assert not done.returncode, done.stderr
    return json.loads(done.stdout)


EVERY = {"interpreted": 1.25, "compiled": 1.25, "fmu": 1.25}
QUICK = {"start value from a JSON file"}  # others in one process: tests/compiler/test_fingerprint.py


@pytest.mark.parametrize("kind", some(KINDS, QUICK))
def test_an_edit_is_seen(kind, tmp_path, build, command_line):
    change, environment = project(tmp_path, kind)
    assert values(tmp_path, build, environment, command_line) == EVERY
    change()
    assert values(tmp_path, build, environment, command_line) == dict.fromkeys(EVERY, 2.75)


def command(folder, environment, *words):
    """Run `twin` in a project's folder."""
    line = [sys.executable, "-c", "from twin.cli import main; main()", *map(str, words)]
    done = subprocess.run(
        line, cwd=folder, env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    assert not done.returncode, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
def test_exported_and_studied_is_what_the_files_say(tmp_path):
    """C, FMU and study of a component whose constant stands in another module."""
    change, environment = project(tmp_path, "through a module")
    with (tmp_path / "part.py").open("a") as file:
        file.write("\n\nassert Part\n")  # so that other kinds keep files of their own
    write(tmp_path / "metric.yaml", SCENARIO + "metrics: {reach: {signal: part.y, reduce: max, unit: m}}\n")
    write(
        tmp_path / "many.yaml",
        "scenario: metric.yaml\nmetrics: [reach]\nsamples: {method: random, count: 2, seeds: [1]}\n"
        "vary: {part.unused: {values: [1, 2], source: assumed}}\n",
    )
    text = (tmp_path / "part.py").read_text()
    write(
        tmp_path / "part.py", text.replace("    def step", '    unused = parameter(1.0, "", "varied")\n\n    def step')
    )
    for value in ("1.25", "2.75"):
        command(tmp_path, environment, "export", "part:Part", "--target", "c", "-o", f"c{value}")
        assert value in next((tmp_path / f"c{value}").glob("*.c")).read_text()
        command(tmp_path, environment, "study", "many.yaml", "--no-report", "--workers", "1")
        cases = parquet.read_table(max((tmp_path / "runs/many").iterdir()) / "cases.parquet").to_pylist()
        assert {case["reach"] for case in cases} == {float(value)}
        if value == "1.25":
            change()


LINKED = "stop_time: 20 ms\nmembers: {part: {component: plant.fmu}}\nrecord: {variables: [part.y]}\n"


@pytest.mark.slow
@pytest.mark.parametrize("what", ["fmu", "included scenario", "folder of a component"])
def test_a_link_is_followed(what, tmp_path):
    """A link that is set to another target of the same size and time."""
    change, environment = project(tmp_path, "constant of the module")
    names = {"fmu": "plant.fmu", "included scenario": "base.yaml", "folder of a component": "fmus/plant"}
    targets = []
    for value in ("1.25", "2.75"):
        if what == "fmu":
            command(tmp_path, environment, "export", "part:Part", "-o", f"plant_{value}.fmu")
            targets.append(f"plant_{value}.fmu")
        elif what == "included scenario":
            write(tmp_path / f"base_{value}.yaml", SCENARIO.replace("20 ms", f"{value} s"))
            targets.append(f"base_{value}.yaml")
        else:
            text = COMPONENT.format(imports="", before=f"G = {value}", bases="", own="", lines="self.y = G")
            write(tmp_path / f"models/v{value}/model.py", text)
            targets.append(f"../models/v{value}")
        if value == "1.25":
            change()
    write(
        tmp_path / "one.yaml",
        {"fmu": LINKED, "included scenario": "extends: base.yaml\n"}.get(
            what, SCENARIO.replace("'part:Part'", "plant")
        ),
    )
    link = tmp_path / names[what]
    link.parent.mkdir(exist_ok=True)
    found = []
    for target in targets:
        link.unlink(missing_ok=True)
        link.symlink_to(target)
        command(tmp_path, environment, "run", "one.yaml", "--no-report")
        signals = read_signals(max((tmp_path / "runs/one").glob("2*")) / "signals.parquet")[0]["base", 0]
        found.append(signals.time[-1] if what == "included scenario" else signals.values["part.y"][-1])
    assert found == [1.25, 2.75]
