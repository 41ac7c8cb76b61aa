"""The page of a reproduction: every table and figure of the papers, ours beside theirs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from matplotlib.figure import Figure

from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.ngsim.sites import site
from merge_cosim.ngsim.surrogate.surrogate import surrogate_folder
from merge_cosim.report import belief_figures, case_figures, model_figures
from merge_cosim.report.chapters import SOURCES
from merge_cosim.report.columns import Table
from merge_cosim.report.export import write_tables
from merge_cosim.report.html import Picture, render
from merge_cosim.report.methods import Look, looks
from merge_cosim.report.page import write_report
from merge_cosim.report.published import FG_GMM_PAPER, PGM_PAPER
from merge_cosim.studies.papers import cases, claims, figures, tables
from merge_cosim.studies.papers.evidence import Evidence, gather
from merge_cosim.studies.reproduction import PAIRS, Say, Study

PAGE = "report.html"
ABOUT_CLAIMS = (
    "Each claim of the papers, judged by the results of this chapter alone. A verdict is about these pairs, these "
    "controllers and these rules; counts, intervals and tests on the same cases are in the tables below."
)
ABOUT_TESTS = (
    "Failures are overlaps of the two bodies in the lane. D is the distance between the fronts when the host is at the "
    "merging point. In Designed Test II always-brake never fails and never arrives: failures alone say little. Grey "
    "rows are references, no rivals."
)
ABOUT_BOUNDS = (
    "Exact bounds against the log, whatever a host decides: full braking or full throttle avoids the overlap, or "
    "neither; and the smallest delay with which a host can pass without one."
)
ABOUT_VALIDITY = (
    f"The first {tables.VALIDITY_PAIRS} pairs of each test by name, or all that there are; the paper took 100 pairs of "
    "one period of each site. Pairs that could not be scored to the end are left out of the rate."
)
ABOUT_BELIEFS = (
    "Closed loop: what each estimator believed when the merging car first was this far from the merging point, against "
    "the label of the case. Rules without doubt have an accuracy only."
)
LEARNED: dict[Callable[[IntentionModel], Figure], str] = {
    model_figures.transition_figure: "Speed transitions at given speeds for both intentions (PGM, transition "
    "probabilities).",
    model_figures.arrival_figure: "Times to arrival of both cars for both intentions (PGM, time model), and the "
    "log-odds that follow.",
    model_figures.mixture_figure: "V(t-1) × V(t) for both intentions (FG-GMM, Fig. 5), with the components of the "
    "mixture at 1 and 2 sigma.",
}
"""Figures of what a model learned, and their captions."""
AT_WORK: dict[Callable[[IntentionModel], Figure], str] = {
    belief_figures.clouds_figure: "Particles before, between and after one update: a driver that has begun to "
    "accelerate.",
    belief_figures.belief_figure: "The belief over 12 s: a driver that stays behind, and one that pulls ahead from 5 s "
    "on.",
    belief_figures.candidates_figure: "What iPCB's planner weighs for a merging car that is behind but accelerates "
    "(PGM, Fig. 3).",
}
"""Figures of an estimator and a planner at work, and their captions."""


@dataclass(frozen=True)
class Part:
    """A heading of the page with what stands below it.

    Attributes:
        title: Heading.
        about: Sentences below it.
        tables: Tables by the names of their files.
        pictures: Figures.
    """

    title: str
    about: str = ""
    tables: Mapping[str, Table] = field(default_factory=dict)
    pictures: Sequence[Picture] = ()


@dataclass(frozen=True)
class Chapter:
    """All that rests on one source of pairs; nothing of another source is in it.

    Attributes:
        source: `surrogate` or `ngsim`.
        source_name: The source in words.
        parts: What the chapter shows.
    """

    source: str
    source_name: str
    parts: Sequence[Part]


def write_reproduction(studies: Sequence[Study], out: Path, say: Say) -> Path:
    """Write `report.html` and `tables/` into the folder of a reproduction, and the report of each study.

    Returns:
        The page.
    """
    pages = {}
    for number, study in enumerate(studies):
        say(number, len(studies), f"report of {study.name}")
        pages[study.name] = write_report(out / study.name).relative_to(out).as_posix()
    say(len(studies), len(studies), "tables and figures of the papers")
    by_source = {study.source: study for study in studies if study.kind == PAIRS}
    chapters = [_chapter(evidence, by_source[evidence.source]) for evidence in gather(studies, out)]
    filter_part = _particle_filter()
    tables_of = {
        f"{chapter.source}-{name}": table
        for chapter in chapters
        for part in chapter.parts
        for name, table in part.tables.items()
    }
    write_tables(out, tables_of)
    file = out / PAGE
    text = render(
        "reproduction.html",
        chapters=chapters,
        no_data=filter_part,
        pages=pages,
        papers=(PGM_PAPER, FG_GMM_PAPER),
        seed=studies[0].request.seed,
    )
    file.write_text(text, encoding="utf-8")
    return file


def _chapter(evidence: Evidence, study: Study) -> Chapter:
    drawn = looks([*evidence.results["method"], *cases.LOGGED_METHODS, *cases.BEHIND_METHODS])
    data = study.request.data if evidence.source == "ngsim" else None
    parts = [
        Part("The papers' claims", ABOUT_CLAIMS, {"claims": claims.claims_table(evidence)}),
        Part("Data sets (PGM, Table I)", tables={"data-sets": tables.data_sets(evidence.source, data)}),
        Part("All methods in all tests (PGM, Table II; FG-GMM, Table III)", ABOUT_TESTS, tables.outcomes(evidence)),
        Part("Bounds", ABOUT_BOUNDS, {"bounds": tables.bounds(study)}),
        Part("Validity of FG and GMM (FG-GMM, Table II)", ABOUT_VALIDITY, {"validity": tables.validity(evidence)}),
        _nodes(evidence, drawn),
        Part("Beliefs by distance", ABOUT_BELIEFS, tables.beliefs(evidence)),
        _learned(IntentionModel.load(str(study.request.model))),
        _published_case(study, drawn),
        _behind(study, drawn),
        _on_camera(data),
    ]
    return Chapter(evidence.source, SOURCES[evidence.source], parts)


def _nodes(evidence: Evidence, drawn: Mapping[str, Look]) -> Part:
    about = "us101-replay under pgm with `pgm.nodes` varied; one node leaves the time term and the prior alone."
    caption = "Failures of PGM by its number of speed nodes; shaded: Wilson 95 %."
    picture = Picture.of(figures.node_figure(evidence, drawn), caption)
    return Part("Number of speed nodes (PGM)", about, {"nodes": tables.nodes(evidence)}, [picture])


def _learned(model: IntentionModel) -> Part:
    about = (
        f"Model {model.name}, trained on {int(model.pairs.sum())} pairs of {len(model.trained_on)} merging cars, none "
        f"of which is tested."
    )
    return Part(
        "What was learned (PGM, speed and time model; FG-GMM, Table I and Fig. 5)",
        about,
        {"mixture": tables.mixture(model)},
        _drawn(LEARNED, model),
    )


def _published_case(study: Study, drawn: Mapping[str, Look]) -> Part:
    case = cases.published_case(study)
    wanted = "host -170 m at 9.9 m/s, merging car -100 m at 10.4 m/s"
    about = (
        f"Case {case.name}: {case.start}. It is within 20 m and 2 m/s of the published start ({wanted})."
        if case.found
        else f"The published start ({wanted}) was not found: no pair is within 20 m and 2 m/s of it. Shown is the "
        f"nearest, case {case.name}: {case.start}."
    )
    return Part("One replayed case (PGM, station and speed over time)", about, pictures=_paths(case, drawn))


def _behind(study: Study, drawn: Mapping[str, Look]) -> Part:
    case = cases.behind_but_accelerating(study)
    about = (
        f"Case {case.name} of Designed Test II: {case.start}. The paper says that iPCB slows the host down here "
        f"regardless of distance and speed, and that PGM drives on. Lowest acceleration before the merging point: "
        f"{', '.join(f'{method} {value:.1f} m/s²' for method, value in case.lowest_acceleration().items())}."
    )
    return Part("Merging car behind but accelerating (PGM, Fig. 3)", about, pictures=_paths(case, drawn))


def _paths(case: cases.NamedCase, drawn: Mapping[str, Look]) -> list[Picture]:
    stations, speeds = case_figures.path_figures(case.traces, case.failed, drawn)
    return [
        Picture.of(stations, "Fronts over time; dashed at 0 the merging point, × a failure."),
        Picture.of(speeds, "Speeds over time."),
    ]


def _on_camera(data: Path | None) -> Part:
    us101 = site("us101")
    figure = figures.overlap_figure(data or surrogate_folder(us101), us101)
    caption = "Time on camera of a host, the car ahead of it, and the merging cars that change lane near it."
    return Part("Which cars are on camera when (FG-GMM, Fig. 4)", pictures=[Picture.of(figure, caption)])


def _particle_filter() -> Part:
    model = IntentionModel.load("us101-ngsim")
    about = f"Designed approaches, no data; the driver's desired speed is that of model {model.name}."
    return Part("The particle filter (DBN-PF) and iPCB at work", about, pictures=_drawn(AT_WORK, model))


def _drawn(figures: Mapping[Callable[[IntentionModel], Figure], str], model: IntentionModel) -> list[Picture]:
    return [Picture.of(draw(model), caption, wide=True) for draw, caption in figures.items()]
