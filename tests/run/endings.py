"""An FMU that takes its process with it, or never comes back, in the step from 0.3 s: `mode` says how. And a clock."""

import os
import time
from pathlib import Path

from tests.fmi.third_party import NATIVE, NATIVE_XML, native_fmu
from twin.component import PythonComponent, output

MODES = {"crash": 101, "abort": 102, "exit": 103, "hang": 104}
DIE = """
    if (c->mode > 100 && t > 0.295) {
        fprintf(stderr, "native: the end is near\\n");
        c->log(c->environment, 1, "logStatus", "goes to the end");
        if (c->mode == 101) *(volatile int *)0 = 0;
        if (c->mode == 102) abort();
        if (c->mode == 103) exit(7);
        while (c->mode == 104) usleep(10000);
    }
    if (c->mode && c->mode < 100)"""
SOURCE = "#include <stdio.h>\n#include <unistd.h>\n" + NATIVE.replace("    if (c->mode)", DIE, 1)


def ending_fmu(folder: Path) -> Path:
    """The FMU, `Native.fmu` in a folder."""
    return native_fmu(folder, NATIVE_XML, SOURCE)


class WallClock(PythonComponent):
    """The time of the wall clock, every 2 ms."""

    period = 1e-3

    now = output("s", "time since 1970")

    def step(self, t, h):
        time.sleep(2e-3)
        self.now = time.time()


class Closes(PythonComponent):
    """Takes its process with it when it is closed."""

    y = output("s", "time")

    def step(self, t, h):
        self.y = t

    def close(self):
        os._exit(3)
