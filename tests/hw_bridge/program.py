"""A command and the process in which it simulates, as one: what hits a machine hits both."""

import os
import subprocess


def begun(line, **options):
    """Start it, in a group of its own."""
    return subprocess.Popen(line, start_new_session=True, **options)


def send(process, number):
    """Send a signal to both."""
    os.killpg(process.pid, number)
