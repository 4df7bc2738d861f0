"""Runs to be looked at: one that was really run, and folders with signals that a test chooses."""

import json
from pathlib import Path

import numpy as np

from twin.face import open_run
from twin.results.recording.run_folder import RecordedVariable, SignalFile
from twin.results.recording.signals import Signals
from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, load_scenario
from twin.viewer import RunCollection

BUILD = Path(__file__).parents[2] / "build"
BEATS = """
title: Two hearts
stop_time: 2 s
step: 5 ms
seeds: [1, 2]
members:
  heart: {component: heart, parameters: {blend_in: 0 s}}
variants:
  slow: {title: 60 beats a minute}
  fast: {title: 90 beats a minute, members: {heart: {parameters: {rate: 1.5 Hz}}}}
events:
  - {at: 1 s, set: {heart.scale: 0.5}}
expect:
  - {name: it stays near, signal: heart.position, at_most: 4 mm, from: 0.5 s}
  - {name: it never stops, signal: heart.beats, at_least: 0}
metrics:
  mean_speed: {description: speed of the wall, signal: heart.velocity, reduce: rms, from: 0.5 s, unit: mm/s, reference: {slow: 20 mm/s}, tolerance: 90 %}
plots:
  - {title: Motion, signals: [heart.position], unit: mm, band: [-5 mm, 4 mm]}
"""


def beats(folder, text=BEATS):
    """The folder of a run of two hearts, two variants and two seeds."""
    (folder / "beats.yaml").write_text(text)
    return run_scenario(
        load_scenario(folder / "beats.yaml"), RunOptions(backend=Backend.compiled, root=folder / "runs", build=BUILD)
    ).folder


def folder_of(place, cases, columns, *, together=False):
    """The folder of a run with these signals, `cases`: (variant, seed) -> (time, {name: values})."""
    place.mkdir()
    units = {one.name: one.unit for one in columns}
    with SignalFile(place / "signals.parquet", columns, {"scenario": place.name}) as file:
        for (variant, seed), (time, values) in cases.items():
            file.write(variant, seed, Signals(time, values, units))
    if together:  # all cases in one row group, as other writers do
        from pyarrow import parquet

        parquet.write_table(parquet.read_table(place / "signals.parquet"), place / "signals.parquet")
    told = [
        {"variant": variant, "seed": seed, "complete": True, "samples": len(time)}
        for (variant, seed), (time, _) in cases.items()
    ]
    about = {"name": place.name, "title": "", "description": "", "source": "", "path": ""}
    summary = {"scenario": about, "status": "completed", "passed": True, "reason": "", "overrides": [], "cases": told}
    summary |= {"metrics": {}, "expectations": [], "started": "2026-11-22T21:00:00+00:00"}
    (place / "summary.json").write_text(json.dumps(summary))
    (place / "scenario.yaml").write_text(f"title: {place.name}\nstop_time: 1 s\nstep: 1 ms\nmembers: {{}}\n")
    return place


def runs(*folders):
    """These runs, opened."""
    return RunCollection([open_run(one) for one in folders])


def wave(rate, seconds, frequency=3.0, amplitude=2.0):
    """Times and a sine."""
    time = np.arange(round(seconds * rate)) / rate
    return time, amplitude * np.sin(2 * np.pi * frequency * time)


FORCE = RecordedVariable("sensor.force", unit="N", description="contact <force>")
PLACE = RecordedVariable("tip.position", unit="m", display_unit="mm")
SHAPE = RecordedVariable("tip.shape", shape=(2,), unit="m")
TOUCH = RecordedVariable("tip.touches", dtype=np.dtype(bool))
COUNT = RecordedVariable("tip.count", dtype=np.dtype(np.int64))
