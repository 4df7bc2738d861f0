"""Commands without their start of a second: a process that has loaded the engine forks for each of them."""

import json
import os
import subprocess
import sys
from pathlib import Path

SERVER = """
import atexit, gc, json, os, runpy, sys, threading, traceback
import matplotlib.pyplot, fmpy, pandas, pint, pyarrow.parquet, scipy.optimize, scipy.stats, xarray
import twin.face, twin.fmi.importing.fmu_member, twin.results.plotting, twin.run
from twin.cli import main


def run(program, *words):
    sys.argv = ["twin", *words] if program == "twin" else list(words)
    if program == "twin":
        main()
    elif words[0] == "-m":
        sys.path.insert(0, os.getcwd())
        sys.argv[:2] = words[1:2]
        runpy.run_module(words[1], run_name="__main__", alter_sys=True)
    else:
        sys.path.insert(0, os.path.dirname(os.path.abspath(words[0])))
        runpy.run_path(words[0], run_name="__main__")


def status(program, *words):
    try:
        run(program, *words)
    except SystemExit as end:
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
        return end.code if isinstance(end.code, int) else bool(end.code)
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


gc.collect()
gc.freeze()  # else a collection copies what is shared
for line in sys.stdin:
    words, folder, output = json.loads(line)
    if os.fork():
        print(os.waitstatus_to_exitcode(os.wait()[1]), flush=True)
        continue
    os.chdir(folder)
    for number, name in enumerate((os.devnull, output + ".out", output + ".err")):
        os.dup2(os.open(name, os.O_RDWR | os.O_CREAT | os.O_TRUNC), number)
    ended = status(*words)
    threading._shutdown()
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(ended)  # to take everything apart would first copy it
"""


class CommandLine:
    """Runs `twin` and `python` in a folder. The engine is loaded, no component is: these are the folder's own."""

    def __init__(self, root: Path, place: Path) -> None:
        self.output = str(place / "twin")
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-c", SERVER],
            env={**os.environ, "PYTHONPATH": str(root)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def run(self, words: list[str], folder: Path, program: str = "twin") -> subprocess.CompletedProcess:
        """One command; its status and what it printed."""
        assert self.process.stdin
        assert self.process.stdout
        self.process.stdin.write(json.dumps([[program, *words], str(folder), self.output]) + "\n")
        self.process.stdin.flush()
        status = int(self.process.stdout.readline())
        printed = (Path(f"{self.output}.{name}").read_text() for name in ("out", "err"))
        return subprocess.CompletedProcess(words, status, *printed)

    def close(self) -> None:
        """End the process."""
        assert self.process.stdin
        assert self.process.stdout
        self.process.stdin.close()
        self.process.wait()
        self.process.stdout.close()
