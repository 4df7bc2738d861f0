"""Digests of every signal of every shipped scenario, variant and seed: two revisions are compared to the bit.

    python -m benchmarks.digests write FILE [SCENARIO ...]     runs scenarios (all by default), as the working copy is
    python -m benchmarks.digests compare FILE OTHER            prints signals that differ; the exit code is 1 if any do

A line of a file is `scenario, variant, seed, signal` and the SHA-256 of its values, as JSON; time is a signal too. A
scenario whose line is in FILE already is not run again, so that an interrupted command can be repeated.
`drive_faults` needs simulated drives, which run in real time, and is left out.
"""

from __future__ import annotations

import hashlib
import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from twin.run import RunOptions, run_scenario
from twin.scenario import load_scenario

ROOT = Path(__file__).parent.parent
SCENARIOS = sorted(path.stem for path in (ROOT / "scenarios").glob("*.yaml") if path.stem != "drive_faults")

Key = tuple[str, ...]


def digest(values: object) -> str:
    """SHA-256 of an array's type, shape and bytes."""
    array = np.ascontiguousarray(values)
    return hashlib.sha256(f"{array.dtype.str} {array.shape}".encode() + array.tobytes()).hexdigest()


def scenario_digests(name: str, build: Path) -> dict[Key, str]:
    """Run all variants and seeds of a scenario and return the digests of their signals, and of the run's status."""
    with tempfile.TemporaryDirectory() as folder:
        scenario = load_scenario(ROOT / "scenarios" / f"{name}.yaml", [])
        result = run_scenario(scenario, RunOptions(root=Path(folder), build=build, report=False))
        digests: dict[Key, str] = {(name, "", "", "status"): result.run.status}
        for (variant, seed), signals in result.tables.items():
            for signal, values in {"time": signals.time, **signals.values}.items():
                digests[name, variant, str(seed), signal] = digest(values)
    return digests


def read(path: Path) -> dict[Key, str]:
    """Read a file of digests; empty if there is none."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return {tuple(key): value for key, value in map(json.loads, lines)}


def write(path: Path, scenarios: list[str], build: Path) -> None:
    """Run the scenarios that the file lacks and append their digests."""
    present = {key[0] for key in read(path)}
    for name in scenarios or SCENARIOS:
        if name in present:
            continue
        begin = time.monotonic()
        digests = scenario_digests(name, build)
        with path.open("a", encoding="utf-8") as file:
            file.writelines(json.dumps(item) + "\n" for item in digests.items())
        print(f"digests_{name}: {len(digests) - 1} signals, {time.monotonic() - begin:.1f} s", flush=True)


def compare(first: dict[Key, str], second: dict[Key, str]) -> list[Key]:
    """Return the signals that differ, or that one of them lacks, of scenarios that both have."""
    common = {key[0] for key in first} & {key[0] for key in second}
    return [key for key in sorted({*first, *second}) if key[0] in common and first.get(key) != second.get(key)]


def main() -> None:
    """Write or compare."""
    command, *words = sys.argv[1:]
    if command == "write":
        write(Path(words[0]), words[1:], ROOT / "build")
        return
    digests = [read(Path(word)) for word in words]
    different = compare(*digests)
    for key in different:
        print(f"different: {', '.join(key)}")
    both = {key[0] for key in digests[0]} & {key[0] for key in digests[1]}
    compared = sum(key[0] in both for key in {*digests[0], *digests[1]})
    print(f"digests_compared: {compared} in {len(both)} scenarios")
    print(f"digests_different: {len(different)}")
    sys.exit(bool(different))


if __name__ == "__main__":
    main()
