"""`twin run SCENARIO`: all variants and seeds, metrics, report."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from twin import installed
from twin.cli import completion
from twin.cli.terminal import bar, paper, say, working
from twin.errors import DeclarationError, TwinError
from twin.process import supervise

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.progress import Progress

    from twin.run import Hardware, RunResult
    from twin.scenario import Scenario

ENGINE = Path(__file__).parents[1]
FORMS = ("fmu", "compiled", "interpreted")


@click.command(name="run")
@click.argument(
    "file", type=click.Path(path_type=Path), metavar="SCENARIO", required=False, shell_complete=completion.scenarios
)
@click.option(
    "--case",
    "of_study",
    default="",
    metavar="STUDY:NUMBER",
    help="A case of a study again, such as thousand_patients:713.",
)
@click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="PATH=VALUE",
    help='Override a value of the file, such as heart.rate="1.4 Hz", stop_time="5 s" or seeds="[1, 2]".',
)
@click.option("--variant", "variants", multiple=True, metavar="NAME", help="Run this variant only; may be repeated.")
@click.option("--seed", "seeds", multiple=True, type=int, help="Run this seed only; may be repeated.")
@click.option(
    "--as",
    "form",
    type=click.Choice(FORMS),
    default="fmu",
    show_default=True,
    help="How the project's own components run; the results are the same to the bit.",
)
@click.option(
    "--runs",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("runs"),
    show_default=True,
    help="Folder of results.",
)
@click.option(
    "--build",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("build"),
    show_default=True,
    help="Folder of FMUs and compiled code.",
)
@click.option(
    "--hardware",
    "hardware_file",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Drives on a bus, simulated or real, for members of the scenario.",
)
@click.option(
    "--trace",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="With --hardware: record the bus (.blf, .asc, .log).",
)
@click.option(
    "--replay", metavar="FILE", help="With --hardware: its drives as recorded there, from FILE@SECONDS on if named."
)
@click.option("--arm", is_flag=True, help="Real drives may move.")
@click.option("--dry", is_flag=True, help="With --hardware: bring the bus up but never enable power; simulated drives show "
              "what would have been sent.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print summary.json to stdout, and nothing else there.")
@click.option("--no-report", is_flag=True, help="Write no report.html.")
@click.option("--log", "logged", multiple=True, is_flag=False, flag_value="*", metavar="[MEMBER]",
              help="Show and keep what FMUs log, of MEMBER or of all; behind SCENARIO if no member is named.")  # fmt: skip
@click.option("--half-step", is_flag=True, help="Also run each variant at half the step, and state what that changes.")
@click.option("--timeout", type=click.FloatRange(0.0), default=0.0, metavar="S",
              help="End a case where one step of a member takes longer [s]. [default: never]")  # fmt: skip
def command(
    file: Path | None,
    of_study: str,
    overrides: tuple[str, ...],
    variants: tuple[str, ...],
    seeds: tuple[int, ...],
    form: str,
    runs: Path,
    build: Path,
    hardware_file: Path | None,
    trace: Path | None,
    replay: str | None,
    arm: bool,
    dry: bool,
    as_json: bool,
    no_report: bool,
    logged: tuple[str, ...],
    half_step: bool,
    timeout: float,
) -> None:
    """Run a scenario: every variant with every seed, then metrics beside the paper's figures, and a report.

    Results go to runs/<scenario>/<time>/: signals.parquet, summary.json, scenario.yaml, report.html.
    Exit code 1 if an expectation does not hold or a member failed, 130 after Ctrl-C; what was recorded is kept.

    \b
    twin run heart_wall_force
    twin run heart_wall_force --variant PI --seed 1 --set heart.rate="1.4 Hz"
    twin run heart_wall_force --hardware simulated_force
    """
    refuse_together(hardware_file is not None, trace is not None, replay is not None, half_step, dry)
    if (file is None) is not bool(of_study):
        raise click.UsageError("Name a SCENARIO, or a case of a study with --case.")
    if of_study and (variants or seeds):
        raise click.UsageError("--case has a variant and a seed of its own: drop --variant and --seed.")
    link = supervise(timeout)  # from here on in a process of its own, before anything heavy is imported
    again = None
    if of_study:
        from twin.study import resolve_case, single

        again = single(*resolve_case(of_study, runs))
        file, overrides, variants, seeds = again.file, (*again.options, *overrides), (again.variant,), (again.seed,)
    assert file is not None
    from twin.run import resume, run_scenario
    from twin.scenario import Backend

    display = progress_display(of_study or file.stem, not as_json)
    options: dict[str, Any] = {
        "build": build, "report": not no_report, "channel": link, "log_patterns": logged, "on_log_line": display.hear,
    }  # fmt: skip
    if link.attempt:
        with display as progress:
            outcome = resume(
                Path(link.successor_values["resume"]),
                Backend(form),
                progress=progress,
                run_remaining=hardware_file is None,
                **options,
            )
        if half_step:
            say("note: --half-step was left out, since the process that ran the scenario had died", err=True)
    else:
        finish_others(runs)
        scenario = read(file, overrides, build)
        hardware = load_hardware(hardware_file, arm, build, trace, replay, dry) if hardware_file is not None else None
        display.title = scenario.title
        with display as progress:
            outcome = run_scenario(
                scenario,
                Backend(form),
                variants=variants,
                seeds=seeds,
                root=runs,
                progress=progress,
                hardware=hardware,
                refine_steps=half_step,
                **options,
            )
    if again is not None:
        say(again.compared(outcome), err=True)
    told(outcome, as_json, not no_report)


def read(file: Path, overrides: tuple[str, ...], build: Path) -> Scenario:
    """Read and check a scenario; FMUs of a package are unpacked below `build`."""
    from twin.scenario import load_scenario, ssp_reader

    ssp_reader.BUILD.set(build)
    with working(f"checking {file}"):
        return load_scenario(file, overrides)


def refuse_together(on_drives: bool, trace: bool, replay: bool, half_step: bool, dry: bool = False) -> None:
    """Options that mean nothing together."""
    if dry and (replay or not on_drives):
        raise click.UsageError("--dry is of a bus: name it with --hardware, and no --replay.")
    if (trace or replay) and not on_drives:
        raise click.UsageError("--trace and --replay are of a bus: name it with --hardware.")
    if trace and replay:
        raise click.UsageError("Use --trace or --replay: what was recorded is not recorded again.")
    if half_step and on_drives:
        raise click.UsageError("--half-step repeats a run, which drives on a bus do not. Drop one of them.")


def told(outcome: RunResult, as_json: bool, report: bool) -> None:
    """Print what came out, and leave with the exit code that says it."""
    if as_json:
        click.echo((outcome.folder / "summary.json").read_text(), nl=False)
    else:
        show(outcome, report)
    if outcome.run.status == "interrupted":
        sys.exit(130)
    if not outcome.passed:
        sys.exit(1)


def finish_others(runs: Path) -> None:
    """Finish what earlier runs left whose processes were all killed; what cannot be finished is only told."""
    from twin.results import find_unfinished_runs

    for folder in find_unfinished_runs(runs):
        from twin.run import recover

        try:
            outcome = recover(folder)
            say(f"note: {folder}: finished now; {outcome.run.status}: {outcome.run.reason}", err=True)
        except (TwinError, OSError) as error:  # such as: another run does it at this moment
            say(f"note: {error}", err=True)


def load_hardware(
    file: Path, arm: bool, build: Path, trace: Path | None = None, replay: str | None = None, dry: bool = False
) -> Hardware:
    """Read a hardware file with the package that knows about drives: an entry point of the group `twin.hardware`."""
    points = list(installed.entry_points("twin.hardware").values())
    if not points:
        raise DeclarationError("--hardware: no installed package knows about drives. Run `pip install -e .` again.")
    hardware: Hardware = points[0].load()(file, arm, build, trace, replay, dry)
    return hardware


class progress_display:  # noqa: N801 - used like a function
    """A progress bar on a terminal, one plain line per case elsewhere; both on stderr."""

    def __init__(self, title: str, shown: bool) -> None:
        self.title, self.shown = title, shown
        self.case = ""
        self.bar: Progress | None = None

    def __enter__(self) -> Callable[[str, float], None]:
        if self.shown and sys.stderr.isatty():
            self.bar = bar(err=True)
            self.bar.start()
            self.task = self.bar.add_task(self.title, total=1.0)
        return self.update

    def update(self, case: str, part: float) -> None:
        """Show how far a case is."""
        if self.bar is not None:
            self.bar.update(self.task, description=case, completed=part)
        elif self.shown and case != self.case:
            say(case if case.startswith("building ") else f"running {case}", err=True)
        self.case = case

    def hear(self, line: str) -> None:
        """Show a line above the bar."""
        if self.bar is not None:
            self.bar.console.print(line)
        elif self.shown:
            say(line, err=True)

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.stop()


def show(outcome: RunResult, report: bool) -> None:
    """The table of metrics, then where everything lies."""
    from twin.run import results_table

    console = paper()
    console.print(outcome.scenario.title, style="bold")
    if outcome.scenario.overrides:
        console.print(f"set: {', '.join(outcome.scenario.overrides)}")
    console.print(results_table(outcome.evaluation))
    for note in outcome.run.extra.get("notes", []):
        console.print(f"note: {note}")
    for line in outcome.run.extra.get("hardware", {}).get("shown", []):
        console.print(line)
    for (variant, seed), ending in outcome.terminations.items():
        if ending.time_ns is not None or ending.unsafe:
            console.print(f"{variant}, seed {seed}: {ending.text}")
    if outcome.run.status == "failed" and outcome.terminations:
        for line in list(outcome.terminations.values())[-1].log:
            console.print(f"on the bus at {line}")
    factor = outcome.run.real_time_factor
    if factor:
        console.print(
            f"{outcome.run.simulated_time:g} s simulated in {outcome.run.wall_time:.2f} s, {factor:.0f} times real time"
        )
    if outcome.run.status != "completed":
        for line in outcome.run.reason.splitlines():
            say(f"{outcome.run.status}: {line}", err=True)
    console.print(f"{outcome.folder / ('report.html' if report else 'summary.json')}", soft_wrap=True)
