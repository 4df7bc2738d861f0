"""`twin run SCENARIO`: all variants and seeds, metrics, report."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from twin.cli import completion
from twin.cli.options import (
    arm_option,
    backend_option,
    build_option,
    duration_option,
    hardware_option,
    no_report_option,
    option,
    overrides_option,
    runs_option,
    timeout_option,
    verbose_option,
)
from twin.cli.progress import ProgressBar
from twin.cli.terminal import LABELS, open_console, say, show_elapsed, show_error, show_outcome, show_text
from twin.errors import ScenarioError, TwinError
from twin.process import supervise

if TYPE_CHECKING:
    from collections.abc import Sequence

    from twin import clock
    from twin.process import SupervisorChannel
    from twin.run import Hardware, RunResult
    from twin.scenario import ScenarioSpec

NOTE, WARNING = LABELS
LONGER, WAIT = 1.2, 5.0  # factor and time [s] by which a command takes notably longer than the simulation


@dataclass(frozen=True, kw_only=True, slots=True)
class HardwareOptions:
    """Options of a run on drives: the hardware file, what is recorded or replayed, whether real drives may move."""

    hardware_file: Path | None = None
    trace: Path | None = None
    replay: str | None = None
    arm: bool = False
    dry_run: bool = False

    def check(self) -> None:
        """Refuse options that exclude each other."""
        without_file = self.hardware_file is None
        if self.dry_run and (self.replay or without_file):
            raise click.UsageError("--dry-run needs --hardware FILE, and excludes --replay.")
        if (self.trace or self.replay) and without_file:
            raise click.UsageError("--trace and --replay need --hardware FILE.")
        if self.trace and self.replay:
            raise click.UsageError("--trace and --replay exclude each other: a replay uses no bus. Drop one of them.")

    def load(self, build: Path) -> Hardware | None:
        """Read the hardware file, if one is given."""
        from twin.run import load_hardware

        file = self.hardware_file
        return load_hardware(file, self.arm, build, self.trace, self.replay, self.dry_run) if file is not None else None


@dataclass(frozen=True, kw_only=True, slots=True)
class RunArguments:
    """Arguments of `twin run` about the scenario and its results."""

    file: Path | None
    study_case: str
    overrides: tuple[str, ...]
    variants: tuple[str, ...]
    seeds: tuple[int, ...]
    backend: str
    runs: Path
    build: Path
    as_json: bool
    no_report: bool
    verbose: bool
    log_members: tuple[str, ...]
    step_refinement: bool
    timeout: float
    checkpoint: clock.Time
    publish: str | None

    def check(self, hardware: HardwareOptions) -> None:
        """Refuse options that exclude each other."""
        hardware.check()
        if self.step_refinement and hardware.hardware_file is not None:
            raise click.UsageError("--step-refinement repeats a run, which a bus of drives does not. Drop --hardware.")
        if self.checkpoint and hardware.hardware_file is not None:
            raise click.UsageError("--checkpoint saves what can be restored, which drives cannot. Drop --hardware.")
        if self.publish and (self.checkpoint or self.step_refinement):
            raise click.UsageError("--publish runs in real time. Drop --checkpoint and --step-refinement.")
        if (self.file is None) is not bool(self.study_case):
            raise click.UsageError("Name a SCENARIO, or a case of a study with --case.")
        if self.study_case and (self.variants or self.seeds):
            raise click.UsageError("--case sets variant and seed. Drop --variant and --seed.")


@click.command(name="run")
@click.argument(
    "file", type=click.Path(path_type=Path), metavar="[SCENARIO]", required=False, shell_complete=completion.scenarios
)
@click.option(
    "--case",
    "study_case",
    default="",
    metavar="STUDY:NUMBER",
    help="Repeat a case of a study, e.g. thousand_patients:713.",
)
@overrides_option
@click.option("--variant", "variants", multiple=True, metavar="NAME", help="Run this variant only. Repeatable.")
@click.option("--seed", "seeds", multiple=True, type=int, metavar="N", help="Run this random seed only. Repeatable.")
@backend_option
@runs_option
@build_option
@hardware_option
@click.option(
    "--trace",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="With --hardware: record the CAN traffic (.blf, .asc, .log).",
)
@click.option(
    "--replay", metavar="FILE[@S]", help="With --hardware: replay the drives from a trace, starting at S seconds."
)
@arm_option
@option(
    "--dry-run",
    former=("--dry",),
    is_flag=True,
    help="With --hardware: start the bus, but never enable power; simulated drives show the commands.",
)
@click.option("--json", "as_json", is_flag=True, help="Print summary.json, and nothing else, on stdout.")
@verbose_option
@no_report_option
@click.option(
    "--log",
    "log_members",
    multiple=True,
    is_flag=False,
    flag_value="*",
    metavar="[MEMBER]",
    help="Show and store FMU log messages of MEMBER (all members if omitted; then after SCENARIO).",
)
@option(
    "--step-refinement",
    former=("--half-step",),
    is_flag=True,
    help="Repeat each variant at half the step and report how the metrics change.",
)
@duration_option(
    "--checkpoint", "Write a checkpoint after each DURATION of simulated time, e.g. 10s (see twin resume)."
)
@click.option(
    "--publish",
    metavar="ADDRESS",
    help="Run in real time and send recorded signals as JSON messages to udp://HOST:PORT, mqtt://BROKER/TOPIC or zenoh://ROUTER/TOPIC (see twin follow --rig).",
)
@timeout_option("End a case when a step of a member takes longer [s].  [default: no limit]")
def command(
    hardware_file: Path | None, trace: Path | None, replay: str | None, arm: bool, dry_run: bool, **options: Any
) -> None:
    """Run a scenario: every variant with every seed, then metrics beside reference figures, and a report.

    Results go to runs/SCENARIO/TIME/: signals.parquet, summary.json, scenario.yaml, report.html.

    Exit code 0 if all requirements are met, 1 if one is not or a member failed, 130 after Ctrl-C. Recorded signals are
    kept in each case.

    \b
    twin run heart_wall_force
    twin run heart_wall_force --variant PI --seed 1 --set heart.rate="1.4 Hz"
    twin run heart_wall_force --hardware simulated_force
    """
    hardware = HardwareOptions(hardware_file=hardware_file, trace=trace, replay=replay, arm=arm, dry_run=dry_run)
    arguments = RunArguments(**options)
    arguments.check(hardware)
    begin = time.monotonic()
    link = supervise(arguments.timeout)  # moves to a process of its own before large packages are imported
    outcome = execute(arguments, hardware, link)
    took = time.monotonic() - begin
    report_outcome(outcome, arguments.as_json, not arguments.no_report, arguments.verbose, took)


def execute(options: RunArguments, hardware: HardwareOptions, link: SupervisorChannel) -> RunResult:
    """Run the scenario, or resume the run of a worker process that died."""
    study_case = None
    if options.study_case:
        from twin.study import resolve_case, single

        study_case = single(*resolve_case(options.study_case, options.runs))
        options = replace(
            options,
            file=study_case.file,
            overrides=(*study_case.options, *options.overrides),
            variants=(study_case.variant,),
            seeds=(study_case.seed,),
        )
    assert options.file is not None
    from twin.run import RunCallbacks, RunOptions, run_scenario
    from twin.scenario import Backend

    display = RunProgress(options.study_case or options.file.stem, enabled=not options.as_json)
    run_options = RunOptions(
        backend=Backend(options.backend),
        variants=options.variants,
        seeds=options.seeds,
        root=options.runs,
        build=options.build,
        report=not options.no_report,
        refine_steps=options.step_refinement,
        log_patterns=options.log_members,
        checkpoint_ns=options.checkpoint,
        study_case=study_case.about if study_case is not None else None,
    )
    callbacks = RunCallbacks(progress=display.update, on_log_line=display.show_line)
    if options.publish:
        from twin.follow import Publisher

        callbacks = replace(callbacks, run_case=Publisher(options.publish).run_case)
    if link.attempt:
        from twin.run import resume

        folder, run_remaining = Path(link.successor_values["resume"]), hardware.hardware_file is None
        with display:
            outcome = resume(folder, run_options, channel=link, callbacks=callbacks, run_remaining=run_remaining)
        if options.step_refinement:
            say("note: --step-refinement was left out, since the process that ran the scenario had died", err=True)
    else:
        recover_interrupted(options.runs)
        scenario = read(options.file, options.overrides, options.build)
        scenario = study_case.applied_to(scenario) if study_case is not None else scenario
        drives = hardware.load(options.build)
        display.title = scenario.title
        display.cases = [case.name for case in scenario.cases(options.variants, options.seeds)]
        with display:
            outcome = run_scenario(scenario, run_options, hardware=drives, channel=link, callbacks=callbacks)
    if study_case is not None:
        say(study_case.compared(outcome), err=True)
    return outcome


def read(file: Path, overrides: tuple[str, ...], build: Path) -> ScenarioSpec:
    """Read and check a scenario; FMUs of a package are unpacked below `build`."""
    from twin.scenario import load_scenario, ssp_reader

    ssp_reader.BUILD.set(build)
    try:
        with show_elapsed(f"checking {file}"):
            return load_scenario(file, overrides)
    except ScenarioError as error:
        from twin.cli.check import check_file

        problems, _ = check_file(str(file), overrides)  # also what stays unchecked in an invalid file
        if (more := len(problems) - len(error.problems)) > 0:
            raise ScenarioError([*error.problems, f"and {more} more: twin check {file}"]) from None
        raise


def report_outcome(
    outcome: RunResult, as_json: bool, report: bool, verbose: bool = False, duration: float = 0.0
) -> None:
    """Print the results and exit with the code of the outcome. `duration`: of the command, with checks, building and report [s]."""
    if as_json:
        click.echo((outcome.folder / "summary.json").read_text(), nl=False)
    else:
        show(outcome, report, verbose, duration)
    if outcome.run.status == "interrupted":
        sys.exit(130)
    if not outcome.passed:
        sys.exit(1)


def recover_interrupted(runs: Path) -> None:
    """Recover earlier runs whose processes were all killed; print a note for each."""
    from twin.results import find_unfinished_runs

    for folder in find_unfinished_runs(runs):
        from twin.run import recover

        try:
            outcome = recover(folder)
            show_error(f"{folder}: recovered; {describe_ending(outcome.run.status, outcome.run.reason)}", NOTE)
        except (TwinError, OSError) as error:  # e.g. another process recovers it at this moment
            show_error(str(error), NOTE)


class RunProgress(ProgressBar):
    """Progress of a run: a bar on a terminal, one line per variant elsewhere; both on stderr."""

    last = ""
    cases: Sequence[str] = ()  # names of all cases, where they are listed

    def update(self, case: str, fraction: float) -> None:
        """Show the progress of a case."""
        count = (
            f" (case {self.cases.index(case) + 1} of {len(self.cases)})"
            if len(self.cases) > 1 and case in self.cases
            else ""
        )
        self.show(case + count, fraction)
        is_phase = case.startswith(("building ", "writing "))
        name = case.split(maxsplit=1)[0] if is_phase else case.partition(": ")[0].partition(", seed ")[0]
        if self.bar is None and name != self.last:
            self.show_line(case if is_phase else f"running {name}{count}")
        self.last = name

    def show_line(self, line: str) -> None:
        """Print a line above the bar."""
        if self.bar is not None:
            self.bar.console.print(line)
        elif self.enabled:
            label = next(filter(line.startswith, (WARNING, NOTE)), "")
            try:
                show_error(line.removeprefix(label), label)
            except BrokenPipeError:  # the reader, such as head, has ended: the run and its results are what counts
                self.enabled = False


def show(outcome: RunResult, report: bool, verbose: bool = False, duration: float = 0.0) -> None:
    """Print the metrics, the expectations, notes, and the verdict with the path of the results."""
    from twin.results import group_lines
    from twin.run import results_table

    console = open_console()
    console.print(outcome.scenario.title, style="bold")
    if sentence := outcome.summary.get("sentence"):
        show_text(sentence)
    if settings := describe_settings(outcome):
        show_text(", ".join(settings), "set: ")
    console.print(results_table(outcome.evaluation, verbose))
    for note in group_lines(outcome.run.extra.get("notes", []), outcome.tables):
        show_text(note.replace(WARNING, "", 1), WARNING if WARNING in note else NOTE)
    for line in outcome.run.extra.get("hardware", {}).get("shown", []):
        console.print(line)
    for (variant, seed), ending in outcome.terminations.items():
        if ending.time_ns is not None or ending.unsafe:
            show_text(ending.text, f"{variant}, seed {seed}: ")
    if outcome.run.status == "failed" and outcome.terminations:
        for line in list(outcome.terminations.values())[-1].log:
            console.print(f"on the bus at {line}")
    if outcome.run.status != "completed":
        for line in group_lines(outcome.run.reason.splitlines(), outcome.tables):
            show_error(describe_ending(outcome.run.status, line), "")
    show_verdict(outcome, report, duration)


def describe_ending(status: str, reason: str) -> str:
    """Return how a run ended: `failed: PI, seed 1: ...`, `interrupted in PI, seed 1`."""
    return reason if reason.startswith(status) else f"{status}: {reason}"


def describe_settings(outcome: RunResult) -> list[str]:
    """Return the overrides of a run, bare numbers with their units, and the factors of a case of a study."""
    from twin.run import with_unit

    case = outcome.study_case
    own = [option for option in outcome.scenario.overrides if case is None or option not in case.options]
    texts = [with_unit(option, outcome.scenario, outcome.catalogs) for option in own]
    factors = [f"{name} = {value}" for name, value in case.factors.items()] if case is not None else []
    return [*factors, *(f"{text} ({', '.join(notes)})" if notes else text for text, notes in texts)]


def show_verdict(outcome: RunResult, report: bool, duration: float = 0.0) -> None:
    """Print the last line: the verdict, how many requirements are met, the computing time, and where to look."""
    from twin.results import describe_outcome

    run, summary = outcome.run, outcome.summary
    word, counts = describe_outcome(summary)
    factor = run.real_time_factor
    speed = f" ({factor:.{0 if factor >= 10 else 1}f}x real time)" if factor else ""
    ends = [float(table.time[-1]) for table in outcome.tables.values() if len(table.time)]
    simulated = run.simulated_time or max(ends, default=0.0)
    has_failed = counts and word != "PASS"
    counts, end = (
        (f"{counts}, " if has_failed else f"{counts} " * bool(counts)),
        ": " if has_failed or not simulated else " ",
    )
    folder = "latest" if outcome.folder.parent.parent == Path("runs") else str(outcome.folder)
    prefix = "DRY RUN, drives have not moved: " * bool(summary.get("hardware", {}).get("dry_run"))
    took = f"in {max(run.wall_time, 1e-3):.3g} s{speed}" if simulated else "nothing was simulated"
    if simulated and duration > max(LONGER * run.wall_time, run.wall_time + WAIT):
        speed = speed.strip(" ()")
        long = [f"{name} {seconds:.3g} s" for name, seconds in outcome.phases.items() if seconds > 0.1 * duration]
        parts = ", ".join(filter(None, (f"simulated in {run.wall_time:.3g} s", speed)))
        took = f"in {duration:.3g} s ({'; '.join(filter(None, (parts, ', '.join(long))))})"
    if simulated and not run.wall_time:  # of a recovered run: its processes were killed before they could tell
        took = f"after {simulated:.3g} s of simulated time"
    text, file = f"{counts}{took}.", "report.html" if report else "summary.json"
    show_outcome(word, text, outcome.folder / file, f"twin view {folder}" * bool(simulated), prefix=prefix, end=end)
