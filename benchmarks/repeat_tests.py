"""Run tests many times, each time in another order, on a busy machine if wanted, and count the runs that failed.

    python -m benchmarks.repeat_tests [-r TIMES] [-l PROCESSES] [arguments of pytest]

`-l`: so many processes compute beside the tests. The seed of each order is printed; `-s SEED` begins with it. As a plugin of
pytest this module shuffles files, and tests within each file: fixtures of a module are made once. The environment variable
TEST_ORDER holds the seed.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import subprocess
import sys
import time

import pytest

BUSY = "import os; parent = os.getppid()\nwhile os.getppid() == parent: pass"  # whatever ends this process ends them


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Shuffle files, and tests within each file."""
    chance = random.Random(os.environ.get("TEST_ORDER", "0"))
    chance.shuffle(items)
    files = {item.nodeid.partition("::")[0]: chance.random() for item in items}
    items.sort(key=lambda item: files[item.nodeid.partition("::")[0]])


def main() -> int:
    """Repeat the tests; 1 if any run failed."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.repeat_tests", description="Repeat tests in other orders."
    )
    parser.add_argument("-r", "--runs", type=int, default=20, help="number of runs (20)")
    parser.add_argument("-l", "--load", type=int, default=0, help="processes that compute meanwhile (0)")
    parser.add_argument("-s", "--seed", type=int, default=1, help="seed of the first order (1)")
    known, words = parser.parse_known_args()
    failed = 0
    with contextlib.ExitStack() as stack:
        for _ in range(known.load):
            busy = stack.enter_context(subprocess.Popen([sys.executable, "-c", BUSY]))
            stack.callback(busy.kill)
        for seed in range(known.seed, known.seed + known.runs):
            begin = time.monotonic()
            done = subprocess.run(
                [sys.executable, "-m", "pytest", "-q", "-p", "benchmarks.repeat_tests", *words],
                env={**os.environ, "TEST_ORDER": str(seed)},
                capture_output=True,
                text=True,
                check=False,
            )
            lines = done.stdout.splitlines() or done.stderr.splitlines()
            print(
                f"seed {seed}, {time.monotonic() - begin:.0f} s: {lines[-1] if lines else done.returncode}", flush=True
            )
            if done.returncode:
                failed += 1
                print(done.stdout, done.stderr, sep="\n", flush=True)
    print(f"failed_runs: {failed} of {known.runs}")
    return min(failed, 1)


if __name__ == "__main__":
    sys.exit(main())
