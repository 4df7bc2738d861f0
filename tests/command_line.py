"""`twin` as a command without its start of a second: a process that has loaded the engine forks for each command."""

import json
import os
import subprocess
import sys
from pathlib import Path

SERVER = """
import json, os, sys
import matplotlib.pyplot, fmpy, pyarrow.parquet
import twin.fmi.importer, twin.run
from twin.cli import main

for line in sys.stdin:
    words, folder, output = json.loads(line)
    if os.fork():
        print(os.waitstatus_to_exitcode(os.wait()[1]), flush=True)
        continue
    os.chdir(folder)
    for number, name in enumerate((os.devnull, output + ".out", output + ".err")):
        os.dup2(os.open(name, os.O_RDWR | os.O_CREAT | os.O_TRUNC), number)
    sys.argv = ["twin", *words]
    sys.exit(main())
"""


class CommandLine:
    """Runs `twin` in a folder. The engine is loaded, no component is: these are the folder's own."""

    def __init__(self, root: Path, place: Path) -> None:
        self.output = str(place / "twin")
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-c", SERVER],
            env={**os.environ, "PYTHONPATH": str(root)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def run(self, words: list[str], folder: Path) -> subprocess.CompletedProcess:
        """One command; its status and what it printed."""
        assert self.process.stdin
        assert self.process.stdout
        self.process.stdin.write(json.dumps([words, str(folder), self.output]) + "\n")
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
