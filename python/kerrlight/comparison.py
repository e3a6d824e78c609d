"""Comparisons: many fits that differ in named factors, as ``kerrlight compare`` runs them."""

from __future__ import annotations

import json
import tempfile
import time
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Mapping, Union

from kerrlight import _program
from kerrlight._program import FitError
from kerrlight.fit import Fit
from kerrlight._settings import Settings, overrides_of, text_of
from kerrlight.report import Report

__all__ = ["Comparison", "compare"]


class Comparison:
    """The cases of a comparison with their results."""

    def __init__(self, folder: Union[str, PathLike[str]]) -> None:
        self.folder = Path(folder)
        """Path of its folder."""
        path = self.folder / "results.json"
        if not path.is_file():
            raise FileNotFoundError(f"{folder} holds no results of a comparison")
        results = json.loads(path.read_text(encoding="utf-8"))
        self.title: str = results["title"]
        self.is_quick: bool = results["quick"]
        """True if it was a look at whether it runs, and no measurement."""
        self.cases: list[dict[str, Any]] = results["cases"]
        """Cases, each with ``levels``, ``seed``, ``status``, ``settings`` and ``results``."""

    def rows(self) -> list[dict[str, Any]]:
        """A row for each case: its levels, its seed, its status, its verdict, and every result that is a single
        number. A factor with the name of a result, such as ``steps``, takes the place of that."""
        return [_row(case) for case in self.cases]

    def table(self) -> Any:
        """:meth:`rows` as a ``pandas.DataFrame``; needs pandas."""
        import pandas

        return pandas.DataFrame(self.rows())

    def fit(self, k: int) -> Fit:
        """The fit of a case."""
        return Fit.open(self.folder / self.cases[k]["folder"])

    def report(self) -> Report:
        """The page: ranking, tables, figures, all cases."""
        return Report(self.folder / "report.html")

    def __len__(self) -> int:
        return len(self.cases)

    def __repr__(self) -> str:
        return f"<Comparison of {len(self)} cases in {self.folder}: {self.title}>"


def _row(case: Mapping[str, Any]) -> dict[str, Any]:
    results = case.get("results") or {}
    row = {**case["levels"], "seed": case["seed"], "status": case["status"]}
    verdict = results.get("verdict")
    if isinstance(verdict, Mapping):
        row["verdict"] = verdict["outcome"]
    for name, value in results.items():
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            row.setdefault(name, value)
    return row


def compare(
    experiment: Settings,
    folder: Union[None, str, PathLike[str]] = None,
    *,
    only: Mapping[str, Any] | None = None,
    set: Mapping[str, Any] | None = None,
    seeds: int | None = None,
    quick: bool = False,
    progress: bool = True,
    threads: int | None = None,
    memory: str | None = None,
    client: Any = None,
) -> Comparison:
    """Runs a comparison, or continues the one in its folder.

    :param experiment: the name of a built-in experiment, or an experiment file as a dictionary, TOML text or path.
        ``representation.kind`` may name a class of yours, ``"module:Class"`` (:class:`kerrlight.Representation`).
    :param folder: of the results; by default the name of the experiment, or ``comparison``.
    :param only: levels of factors: the cases that have them.
    :param set: changes of the settings of all fits, with dotted keys.
    :param seeds: seeds of every case.
    :param quick: few steps and cases, to see whether it runs.
    :param progress: whether to show a bar, if tqdm is installed.
    :param threads: threads of each fit.
    :param memory: limit of each fit, such as ``"4GiB"``.
    :param client: a ``dask.distributed.Client`` whose workers run the cases, each by itself; they see the same files.
    :raises ValueError: for what the program refuses, with its words.
    :raises kerrlight.FitError: if cases failed; the others are whole.

    Ctrl-C stops it after the step that is under way, and the next call continues. ::

        mine = kerrlight.compare("representations", only={"scene": 1})
        mine.table().sort_values("psnr_db")
    """
    file, words = None, _words(only, set, seeds, quick)
    if isinstance(experiment, str) and "\n" not in experiment and "=" not in experiment:
        name = experiment
    elif isinstance(experiment, PathLike):
        name = fspath(experiment)
    else:
        text, base = text_of(experiment, None)
        file = tempfile.NamedTemporaryFile(
            "w", dir=base, prefix=".kerrlight-", suffix=".toml", encoding="utf-8"
        )
        file.write(text or "")
        file.flush()
        name = file.name
    place = Path(folder) if folder is not None else _folder(name, file)
    if client is not None:
        name = str(Path(name).absolute()) if Path(name).suffix == ".toml" else name
        place = place.absolute()
    words = [name, *words, "-o", str(place)]
    options = _program.limits(threads, memory)
    try:
        if client is None:
            with _program.Listener("fit", progress) as listener:
                _program.call(["compare", *words, "--resume", *options], listener)
        else:
            _run_on(client, [*words, *options])
    except (ValueError, FitError) as error:
        raise type(error)(str(error).replace(f"{name}: ", "") if file is not None else str(error)) from None
    finally:
        if file is not None:
            file.close()
    return Comparison(place)


def _folder(name: str, file: Any) -> Path:
    return Path("comparison") if file is not None else Path(Path(name).stem)


def _words(
    only: Mapping[str, Any] | None, set: Mapping[str, Any] | None, seeds: int | None, quick: bool
) -> list[str]:
    words = [word for name, level in (only or {}).items() for word in ("--only", f"{name}={level}")]
    words += [word for change in overrides_of(set) for word in ("--set", change)]
    words += ["--seeds", str(seeds)] if seeds is not None else []
    return [*words, "--quick"] if quick else words


def run_case(words: list[str]) -> None:
    """Runs one case, on a worker of Dask.

    :param words: what follows ``kerrlight compare``.
    :raises kerrlight.FitError: if it failed.
    """
    while True:
        try:
            _program.call(["compare", *words])
        except _program.Busy:
            # What a worker that was killed has left behind ends in a moment.
            time.sleep(1.0)
        else:
            return


def _run_on(client: Any, words: list[str]) -> None:
    """Runs all cases on the workers of a client, those that take long first, and writes the report."""
    cases = _program.call(["compare", *words, "--list"])[1]["cases"]
    cases.sort(key=lambda case: -case["cost"])
    tasks = client.map(run_case, [[*words, "--case", case["id"]] for case in cases], pure=False, retries=3)
    errors = []
    for task in tasks:
        try:
            task.result()
        except FitError as error:
            errors.append(str(error))
    _program.call(["compare", *words, "--collect"])
    if errors:
        raise FitError("; ".join(errors))
