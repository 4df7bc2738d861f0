"""What a worker elsewhere needs of a study, as one archive: the scenario with all files that it names, and what is built.

The package itself has to be installed there, in the same version.
"""

from __future__ import annotations

import hashlib
import io
import re
import zipfile
from dataclasses import replace
from pathlib import Path

from twin.errors import ScenarioError
from twin.scenario import load_scenario
from twin.store import LOCK
from twin.study.execution.case_engine import Engine, Job

HERE = "@HERE@"  # in texts: the folder that the archive is unpacked in
SCENARIO, BUILD = "scenario.yaml", "build"
NAMED = re.compile(r"(?P<path>(?:/|[A-Za-z]:[\\/])[^\s'\"#,{}\[\]]+\.(?:ya?ml|fmu|csv))")


def pack(job: Job, variants: tuple[str, ...]) -> bytes:
    """The archive. What is built for it is kept in a build folder of its own, since others hold far more."""
    files: dict[str, bytes] = {}
    text = job.scenario.read_text(encoding="utf-8")
    files[SCENARIO] = relative(text, files).encode()
    build = job.build / "studies" / hashlib.sha256(files[SCENARIO]).hexdigest()[:16]
    engine = Engine(replace(job, build=build))
    try:
        for variant in variants:
            engine.cell(variant)
    finally:
        engine.close()
    for path in sorted(build.rglob("*")):
        if path.is_file() and path.name != LOCK:
            files[f"{BUILD}/{path.relative_to(build).as_posix()}"] = path.read_bytes()
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)  # no times: the same every time
    return out.getvalue()


def relative(text: str, files: dict[str, bytes]) -> str:
    """A frozen scenario's text with the files that it names in the archive, and theirs."""

    def taken(match: re.Match[str]) -> str:
        path = Path(match["path"])
        if not path.is_file():
            return match["path"]
        is_scenario = path.suffix in (".yaml", ".yml")
        data = load_scenario(path).frozen().encode() if is_scenario else path.read_bytes()
        name = f"files/{hashlib.sha256(str(path).encode()).hexdigest()[:12]}/{path.name}"  # its name is a component's
        if name not in files:
            files[name] = b""
            files[name] = relative(data.decode(), files).encode() if is_scenario else data
        return f"{HERE}/{name}"

    return NAMED.sub(taken, text)


def unpack(data: bytes, folder: Path, job: Job) -> Job:
    """The job as it is in `folder`, where the archive is now."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        for name in archive.namelist():
            path = (folder / name).resolve()
            if not path.is_relative_to(folder.resolve()):
                raise ScenarioError(f"{name}: would be unpacked outside of {folder}.")
            path.parent.mkdir(parents=True, exist_ok=True)
            content = archive.read(name)
            if path.suffix in (".yaml", ".yml"):
                content = content.replace(HERE.encode(), folder.resolve().as_posix().encode())
            path.write_bytes(content)
    return replace(job, scenario=(folder / SCENARIO).resolve(), build=(folder / BUILD).resolve())
