"""A console as a person has it: the command in a process of its own, and a client of its socket without a browser."""

import json
import re
import signal
import subprocess
import sys
import time
import urllib.request
from contextlib import contextmanager
from http.cookiejar import CookieJar
from pathlib import Path

from websockets.sync.client import connect

ROOT = Path(__file__).parents[2]
CARRIAGE = ROOT / "tests/live/carriage.yaml"
READY = 60.0  # FMUs may be built first [s]


@contextmanager
def console(*arguments, runs, build, path=""):
    """The address of a console that runs; it is ended as by Ctrl-C. `.process` and `.ending` of what is given."""
    command = [sys.executable, "-c", "from twin.cli import main; main()", "console", *map(str, arguments)]
    command += ["--no-open", "--runs", str(runs), "--build", str(build)]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        address = process.stdout.readline().strip()
        assert address.startswith("http://127.0.0.1:"), process.communicate(timeout=5)
        yield Served(address, process, path)
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


class Served:
    """A console that runs."""

    def __init__(self, address, process, path=""):
        self.address, self.process = address, process
        self.host, self.token = re.match(rf"http://([^/]+)/{path}\?token=(.+)", address).groups()

    def get(self, path="/", token=True, **headers):
        """Status and text of a request."""
        separator = "&" if "?" in path else "?"
        url = f"http://{self.host}{path}" + f"{separator}token={self.token}" * token
        opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(CookieJar()))
        try:
            with opener.open(urllib.request.Request(url, headers=headers), timeout=20) as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()

    def client(self):
        """The name of a page that was just made."""
        text = self.get()[1]
        return re.search(r"client_id\D{1,8}([0-9a-f-]{36})", text).group(1)

    @contextmanager
    def wire(self, client=None):
        """A page's socket, without a page."""
        address = f"ws://{self.host}/wire?client={client or self.client()}&token={self.token}"
        with connect(address, open_timeout=20, close_timeout=1) as socket:
            yield Wire(socket)


class Wire:
    """What a page says and hears."""

    def __init__(self, socket):
        self.socket = socket

    def say(self, **message):
        """Send a message."""
        self.socket.send(json.dumps(message))

    def hear(self, wanted=lambda _told: True, timeout=READY):
        """The next message that is wanted."""
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0:
            told = json.loads(self.socket.recv(timeout=left))
            if wanted(told):
                return told
        raise AssertionError("the console has not said what was waited for")

    def refused(self):
        """What it was told off for."""
        return self.hear(lambda told: "refused" in told, 10)["refused"]

    def ready(self):
        """The first tick of a session that is ready."""
        return self.hear(lambda told: told.get("phase") in ("paused", "running"))
