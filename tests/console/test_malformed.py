"""Messages that no page of ours sends: nothing is printed for them, and the console goes on."""

import subprocess
import sys

import pytest
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from tests.console.served import CARRIAGE, ROOT, Served

MESSAGES = (
    "", "40{", "42", "42[", "42{}", "42[]", '42["event"]', '42["event",{}]', '42["event",null]', '42["handshake",{}]',
    '42["ack",{"client_id":"x","next_message_id":"y"}]', '42["javascript_response",{}]', "43[]", "44", "45", "4x", "\x00", "b",
    '451-["event",{"_placeholder":true,"num":0}]', "42" + "[" * 3000, f'42["{"x" * 60000}"]', "4" + "9" * 400 + "[1]",
    '42["event",{"client_id":"CLIENT","id":4,"listener_id":1,"args":1}]', b"", b"\x00\xff", b"4",
)  # fmt: skip


@pytest.mark.slow
def test_nothing_is_printed_of_a_malformed_message(build, tmp_path):
    words = ["console", str(CARRIAGE), "--no-open", "--runs", str(tmp_path), "--build", str(build)]
    with (tmp_path / "errors.txt").open("w+") as errors:
        line = [sys.executable, "-c", "from twin.cli import main; main()", *words]
        process = subprocess.Popen(line, cwd=ROOT, stdout=subprocess.PIPE, stderr=errors, text=True)
        try:
            served = Served(process.stdout.readline().strip(), process)
            client = served.client()
            query = f"EIO=4&transport=websocket&token={served.token}&client_id={client}"
            for message in MESSAGES:
                text = message.replace("CLIENT", client) if isinstance(message, str) else message
                try:
                    with connect(f"ws://{served.host}/_nicegui_ws/socket.io/?{query}", close_timeout=0.2) as socket:
                        socket.send("40")
                        socket.recv(timeout=20)
                        socket.send(text)
                except WebSocketException:  # it may close what sends such
                    continue
            assert served.get()[0] == 200
        finally:
            process.terminate()
            process.communicate(timeout=20)
        assert process.returncode == 0
        errors.seek(0)
        assert errors.read() == ""
