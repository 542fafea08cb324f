"""The report: one page for a person, made from an archive alone.

A page is made of sections. Each is a family member: it takes a part of an archive, and yields the
blocks that this part has content for. The template sets how a block looks. The page's script sets
what a chart does under a pointer. The chart itself is data.
"""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["SECTIONS", "ReportSection"]


class ReportSection(NamedTuple):
    """Part of a page."""

    title: str
    introduction: str  # what the section shows, and how to read it
    function: str  # reference to what yields its blocks; it takes an `ArchiveView`
    of: str = "study"  # the archives that it serves: of a study, a benchmark of methods, or any
    is_common: bool = False  # stated once, for all models of an archive together
    is_folded: bool = False  # for a statistician: opened by its line, or by a link to it
    is_printed: bool = True  # unless it is folded; otherwise to be explored on a screen
    absence_note: str = ""  # what an archive lacks without content, where some is expected
    contents: str = ""  # its entry in the contents, a word of the field; its title without one


# In the order of the page, by the names that links have.
SECTIONS = {
    "answer": ReportSection(
        "Main results",
        "",
        "uqpen.report.sections.answer:answer",
        is_common=True,
        contents="Results",
    ),
    "models": ReportSection(
        "How the models differ",
        "The distribution function of each model at the same points, and the differences run by "
        "run. Differences are often known better than either model alone.",
        "uqpen.report.sections.comparisons:model_comparison",
        is_common=True,
        contents="Models",
    ),
    "distributions": ReportSection(
        "How it is distributed",
        "Move the threshold to read off a probability.",
        "uqpen.report.sections.outputs:distributions",
        absence_note="completed runs that are a sample of the inputs",
        contents="Distributions",
    ),
    "measurements": ReportSection(
        "The model and the measurements",
        "Each point is a measured value. On the line, model and measurement are equal; errors of "
        "the model beyond two of their uncertainties are rare where it is right.",
        "uqpen.report.sections.comparisons:measurements",
        contents="Measurements",
    ),
    "curves": ReportSection(
        "Curves and fields",
        "Outputs along dimensions. Move the place of a curve to read off its estimates, its runs "
        "and what drives it there.",
        "uqpen.report.sections.fields:curves",
        contents="Curves",
    ),
    "sensitivity": ReportSection(
        "What drives it",
        "First order: the part of the variance that an input causes by itself. Total order: with "
        "its interactions. Shapley effects divide interactions evenly. Where inputs depend on each "
        "other, first orders include what they share, and may add up to more than 1.",
        "uqpen.report.sections.outputs:sensitivity",
        absence_note="measures of the inputs' part",
        contents="Sensitivity",
    ),
    "noise": ReportSection(
        "Noise of the model",
        "Runs at the same inputs differ. Where the standard deviation of their noise changes along "
        "an input, the scatter of the output hangs on it, beside its mean.",
        "uqpen.report.sections.outputs:noise",
        contents="Noise",
    ),
    "scatter": ReportSection(
        "Outputs against inputs",
        "Each point is a run. Points along a line or a bend: the output depends on that input. A "
        "cloud without a shape: other inputs decide.",
        "uqpen.report.sections.outputs:scatter",
        is_printed=False,
        contents="Runs",
    ),
    "losses": ReportSection(
        "Failed runs",
        "Runs without a result: how many, why, and for which inputs.",
        "uqpen.report.sections.failures:failures",
    ),
    "methods": ReportSection(
        "Do the methods agree",
        "The same statistics by all designs, surrogates and publications.",
        "uqpen.report.sections.comparisons:source_comparison",
        contents="Methods",
    ),
    "convergence": ReportSection(
        "How it settles with more runs",
        "Estimates from growing parts of the runs. Each has the interval that it would have, had "
        "the study ended there.",
        "uqpen.report.sections.comparisons:convergence",
        is_folded=True,
        contents="Convergence",
    ),
    "course": ReportSection(
        "Trajectory at the nominal inputs",
        "The states of the model within a single run, with all inputs at their nominal values.",
        "uqpen.report.sections.comparisons:trajectory",
        is_common=True,
        is_folded=True,
        absence_note="trajectories of its models",
        contents="Trajectory",
    ),
    "surrogates": ReportSection(
        "How good the surrogates are",
        "Predictions of a surrogate against the model's outputs in the same runs: the nearer to "
        "the line, the better. A good fit as a whole does not make every estimate right, so each "
        "is checked by itself.",
        "uqpen.report.sections.comparisons:surrogates",
        is_folded=True,
        absence_note="surrogates",
        contents="Surrogates",
    ),
    # Of a benchmark of methods.
    "leaders": ReportSection(
        "Which method is best",
        "Every method had the same numbers of runs, many times each. Its estimates are compared "
        "with a large reference. The best method is nearest to it, by more than the noise.",
        "uqpen.report.sections.benchmark:leaders",
        of="benchmark",
        contents="Best method",
    ),
    "errors": ReportSection(
        "Error against the number of runs",
        "The root mean square of each method's errors over the repeats, relative to the reference, "
        "with 95 % intervals. Read across to compare the runs that methods need for the same "
        "error. Markers for the same number of runs stand side by side.",
        "uqpen.report.sections.benchmark:errors",
        of="benchmark",
        contents="Errors",
    ),
    "replicates": ReportSection(
        "The same in replicates",
        "The scatter of replicates gives the error of a design. This may cost accuracy, as each "
        "replicate has fewer points. Methods without replicates are the same as above.",
        "uqpen.report.sections.benchmark:replicates",
        of="benchmark",
        is_folded=True,
        contents="Replicates",
    ),
    "rates": ReportSection(
        "How fast errors fall",
        "The slope of a straight line through the logarithms of errors over those of runs, with "
        "95 % intervals of the noise. Further to the left, errors fall faster with more runs.",
        "uqpen.report.sections.benchmark:rates",
        of="benchmark",
        is_folded=True,
        contents="Rates",
    ),
    "coverage": ReportSection(
        "Coverage of the methods' own intervals",
        "The share of the repeats in which the interval of an estimate contains the reference. "
        "Where the reference's own error is as large as the interval, it counts too.",
        "uqpen.report.sections.benchmark:coverage",
        of="benchmark",
        contents="Coverage",
    ),
    "cost": ReportSection(
        "Cost",
        "The cost of a method is its number of runs of the model. For a surrogate these are its "
        "training and validation runs; the time of its fit is not counted.",
        "uqpen.report.sections.benchmark:cost",
        of="benchmark",
        is_folded=True,
    ),
    "reference": ReportSection(
        "The reference",
        "One large design of the study's own model: scrambled Sobol' points in replicates. Its "
        "estimates replace the true values, so an error below its own cannot be distinguished "
        "from 0.",
        "uqpen.report.sections.benchmark:reference",
        of="benchmark",
        is_folded=True,
        contents="Reference",
    ),
    "tables": ReportSection(
        "All tables",
        "As the command line shows them.",
        "uqpen.report.sections.benchmark:tables",
        of="benchmark",
        is_folded=True,
        contents="Tables",
    ),
    "archive": ReportSection(
        "The study and its provenance",
        "The study as it was run, its inputs and designs, and all that is needed to check the "
        "archive or to repeat it.",
        "uqpen.report.sections.archive:archive",
        of="any",
        is_common=True,
        is_folded=True,
        contents="Study",
    ),
}
