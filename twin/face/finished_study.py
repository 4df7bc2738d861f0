"""A study in Python: run it or open it; its cases as a table, its answers, and the run of any case."""

from __future__ import annotations

import json
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin.errors import ScenarioError, TwinError, UnknownNameError, nearest
from twin.face import arrays, notebook
from twin.face.conversions import check_file, choice, plain, python_option_names
from twin.face.finished_run import Run
from twin.face.progress import progress_callback
from twin.installed import import_optional
from twin.results import display_units, find_results, readable_recording, si_conversion
from twin.study import is_complete, latest, load_study, percent, progress_text, repeat, run_study, stored_cases

if TYPE_CHECKING:
    import pandas as pd

    from twin.face.progress import Progress

CASES = "cases.parquet"
MARGIN = "margin: "  # before the name of a requirement
SHOWN = "SI, shown in "  # before the unit of a metric in cases.parquet


def study(
    file: str | Path,
    *,
    progress: Progress = None,
    workers: int = 0,
    resume: bool = False,
    out: str | Path = "runs",
    build: str | Path = "build",
) -> StudyResult:
    """Run a study file, by its path or the name of a shipped one, as `twin study`; ScenarioError with all `problems`.

        study = twin.study("few_patients.yaml", progress=True)
        study.cases; study.requirements; study.worst.plot()

    `progress`: as of `twin.run`; a callback gets a text and the completed fraction. `workers`: processes, by default one per
    core. `resume`: continue the newest run of the study. After Ctrl-C the `status` is `interrupted`, and finished cases are kept.
    """
    check_file(file, "study", (".yaml", ".yml"), ScenarioError)
    checked = load_study(file)
    folder = latest(Path(out), checked.name) if resume else None
    if folder is not None and is_complete(checked, folder):
        return StudyResult(folder)
    with python_option_names(), progress_callback(progress, checked.title) as report_progress:
        outcome = run_study(
            checked,
            root=Path(out),
            build=Path(build),
            workers=workers,
            resume=folder,
            listen=lambda now: report_progress(progress_text(now), now.fraction),
            command="twin.study",
        )
    if not outcome.cases.rows:
        raise TwinError(f"{outcome.folder}: {outcome.status} before a case was done. Run the study again.")
    return StudyResult(outcome.folder)


def open_study(path: str | Path) -> StudyResult:
    """Open a study that has run: by its folder, the last one as `runs/STUDY/latest` or by the study's name in runs/.

        study = twin.open_study("thousand_patients")
        study.cases; study.metrics; study.case(study.worst_case("force_error_std", "PI")).plot()

    TwinError if there is none, with similar names.
    """
    return StudyResult(find_results(Path(path), CASES, "study", "thousand_patients"))


class StudyResult:
    """Results of a study: `cases`, `metrics`, `requirements`, `sentences`; `worst` and `case(number)` as a `Run`.

    `manifest`: content of manifest.json.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.manifest: dict[str, Any] = self._read("manifest.json")

    def _read(self, name: str) -> dict[str, Any]:
        path = self.folder / name
        try:
            content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise TwinError(f"{path}: cannot be read ({error}). Run the study again.") from None
        return content

    @property
    def title(self) -> str:
        """Title."""
        return str(self.manifest["title"])

    @property
    def status(self) -> str:
        """`completed`, `interrupted`, or `running`."""
        return str(self.manifest["status"])

    @property
    def sentences(self) -> list[str]:
        """The answers in words, as at the top of the report."""
        return [str(sentence["text"]) for sentence in self.answers.get("sentences", ())]

    @property
    def worst(self) -> Run:
        """The worst case as a run with all signals: the first one that the sentences name."""
        numbers = [sentence["case"] for sentence in self.answers.get("sentences", ()) if sentence["case"] is not None]
        if not numbers:
            raise TwinError(f"{self.folder}: no case is worse by a requirement. Use `case(worst_case(METRIC))`.")
        return self.case(numbers[0], out=self.folder.parents[1])

    @property
    def report(self) -> Path:
        """report.html."""
        return self.folder / "report.html"

    @cached_property
    def cases(self) -> pd.DataFrame:
        """A row for each case: factors and metrics in the units of the report, `holds: REQUIREMENT`, status; units in `.attrs["units"]`.

        `margin: REQUIREMENT`: distance to its nearest limit; negative if violated.
        """
        import_optional("pandas", "python", "a DataFrame")
        from pyarrow import parquet

        with readable_recording(self.folder / CASES):
            table = parquet.read_table(self.folder / CASES)
        frame: pd.DataFrame = table.to_pandas()
        units = {field.name: ((field.metadata or {}).get(b"unit") or b"").decode() for field in table.schema}
        shown = {name: unit.removeprefix(SHOWN) for name, unit in units.items() if unit.startswith(SHOWN)}
        margins = {name: unit for name, unit in shown.items() if name.startswith(MARGIN)}
        metrics = display_units({name: unit for name, unit in shown.items() if name not in margins})
        for name, unit in {**metrics, **margins}.items():
            units[name] = unit
            factor, offset = si_conversion(unit)
            frame[name] = (frame[name].astype(float) - (0.0 if name in margins else offset)) / factor
        for factor in self.manifest.get("factors", ()):  # in the variables' units
            name, unit = factor["name"], factor.get("display_unit")
            if unit and name in frame and not factor["scales"]:
                (scale, offset), (own, own_offset) = si_conversion(units[name]), si_conversion(unit)
                frame[name] = (frame[name] * scale + offset - own_offset) / own
                units[name] = unit
        frame.attrs["units"] = units
        return frame

    @cached_property
    def answers(self) -> dict[str, Any]:
        """Content of answers.json, metrics in SI: distributions, pass rates, clusters of failures, sensitivities, pairs."""
        return self._read("answers.json")

    @property
    def metrics(self) -> pd.DataFrame:
        """A row for each metric and variant: unit, count, mean, deviation, quantiles, largest magnitude and its case."""
        rows = []
        for spread in self.answers["metrics"]:
            unit = self.cases.attrs["units"][spread["metric"]]
            factor, offset = si_conversion(unit)
            row = {"metric": spread["metric"], "variant": spread["variant"], "unit": unit, "count": spread["count"]}
            row |= {"mean": spread["mean"], **{f"{100 * q['part']:g} %": q["value"] for q in spread["quantiles"]}}
            row = {key: (value - offset) / factor if isinstance(value, float) else value for key, value in row.items()}
            deviation = spread["deviation"]
            row["deviation"] = None if deviation is None else deviation / factor
            row["worst case"] = max(spread["least"], spread["most"], key=lambda end: abs(end[1]))[0]
            rows.append(row)
        return arrays.table(rows)

    @property
    def requirements(self) -> pd.DataFrame:
        """A row for each requirement and variant: met and judged cases, pass rate with its confidence interval, failing cases."""
        names = {"name": "name", "variant": "variant", "met_count": "met", "count": "count", "part": "pass rate"}
        names |= {"low": "low", "high": "high", "failing": "failing cases"}
        rows = [{names[key]: share[key] for key in names} for share in self.answers["expectations"]]
        return arrays.table(rows, list(names.values()))

    def worst_case(self, metric: str, variant: str | None = None) -> int:
        """Return the number of the case with the largest magnitude of a metric, of the samples of a variant or of all."""
        metrics = [name for name in self.cases if name in {spread["metric"] for spread in self.answers["metrics"]}]
        if metric not in metrics:
            raise UnknownNameError(f"{self.folder}: has no metric {metric!r}. {nearest(metric, metrics)}")
        cases = self.cases[self.cases.part == "sample"]
        if variant is not None:
            cases = cases[cases.variant == choice(variant, list(cases.variant.unique()), "variant")]
        values = cases[metric].abs()
        if values.isna().all():
            raise TwinError(f"{self.folder}: no case has a value of {metric}. See `cases.why`.")
        return int(cases.loc[values.idxmax(), "case"])

    def case(self, number: int, *, out: str | Path = "runs", build: str | Path = "build") -> Run:
        """Return a case as a run, with all signals: as the study has stored it, else run again, to the same bits."""
        number = plain(number)
        if not isinstance(number, int):
            raise TwinError(f"case: {number!r} is not the number of a case. Give one of `study.cases.case`, such as 1.")
        folder = stored_cases(self.folder).get(number)
        if folder is None:  # for type checkers `repeat` is also a module
            folder = repeat(self.folder, number, root=Path(out), build=Path(build)).folder  # type: ignore[operator]
        return Run(folder)

    def __repr__(self) -> str:
        return f"<StudyResult {self.folder}: {self.title}; {self._state}>"

    @property
    def _state(self) -> str:
        return "{status}, {done} cases, {failed} did not finish".format(**self.manifest)

    def _repr_html_(self) -> str:
        rates = [
            [
                f"{rate['name']}, {rate['variant']}",
                percent(rate["part"]),
                f"{rate['met_count']} of {rate['count']}",
            ]
            for rate in sorted(self.answers["expectations"], key=lambda rate: rate["part"])
        ]
        table = notebook.table({"requirement": "text", "pass rate": "number", "cases": "number"}, rates)
        return notebook.page(
            notebook.heading(self.title),
            notebook.paragraph(self._state),
            notebook.links(self.folder, ""),
            *map(notebook.paragraph, self.sentences),
            table,
        )
