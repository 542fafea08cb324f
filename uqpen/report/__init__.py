"""The report: one page for a person, made of an archive alone.

A page is made of sections. Each is a family member: it takes a part of an archive, and yields the
blocks that this part has content for. The sections of a study are in `sections`, those of a
benchmark of methods in `benchmark`. The template sets how a block looks. The page's script sets
what a chart does under a pointer. The chart itself is data.
"""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["BENCHMARK_SECTIONS", "SECTIONS", "ReportSection"]


class ReportSection(NamedTuple):
    """Entry of the page's contents."""

    title: str
    introduction: str  # what the section shows, and how to read it
    # Reference to the function that yields its blocks. It takes an `ArchiveView`, or the archive
    # itself where that is a benchmark of methods.
    function: str
    is_common: bool = False  # stated once, for all models of an archive together
    absence_note: str = ""  # what an archive lacks without content, where some is expected


# In the order of the page, by the names that links have.
SECTIONS = {
    "answer": ReportSection(
        "The answer",
        "What the study says of its outputs, in sentences that stand by themselves, each figure "
        "with its interval, or why it has none. Below them: where they come from, and what to keep "
        "in mind.",
        "uqpen.report.sections.answer:answer",
    ),
    "distributions": ReportSection(
        "How it is distributed",
        "How likely each output is to be at most a value, with a band that holds for all values at "
        "once; move the threshold to read it off. Below it, the runs themselves and their "
        "quantiles.",
        "uqpen.report.sections.distributions:distributions",
        absence_note="runs that are a sample of the inputs and came back",
    ),
    "methods": ReportSection(
        "What each method says, and what it costs",
        "The same statistics by all designs, surrogates and publications. Where several have "
        "intervals, how wide these are for the runs that they took: further down and to the left "
        "is better.",
        "uqpen.report.sections.source_comparison:source_comparison",
    ),
    "models": ReportSection(
        "How the models differ",
        "Each model's distribution function over the same points, and below it the differences "
        "run by run, which are often known better than either model alone.",
        "uqpen.report.sections.model_comparison:model_comparison",
        is_common=True,
    ),
    "convergence": ReportSection(
        "How it settles with more runs",
        "Estimates from growing parts of the runs, each with the interval that it would have, had "
        "the study ended there.",
        "uqpen.report.sections.convergence:convergence",
    ),
    "sensitivity": ReportSection(
        "Where the uncertainty comes from",
        "First order is the share of an output's variance that an input makes by itself; total "
        "order adds all that it makes together with others; Shapley effects share that out evenly "
        "among them. Elementary effects and responses say how much the output moves.",
        "uqpen.report.sections.sensitivity:sensitivity",
        absence_note="measures of the inputs' part",
    ),
    "scatter": ReportSection(
        "Outputs against inputs",
        "Each point is a run of the model. Where the points follow a line or a bend, the output "
        "follows that input; a cloud without a shape tells that others decide it.",
        "uqpen.report.sections.scatter:scatter",
    ),
    "course": ReportSection(
        "The model's course at the nominal inputs",
        "What happens within a single run, whose inputs have their nominal values.",
        "uqpen.report.sections.trajectory:trajectory",
        is_common=True,
        absence_note="courses of its models",
    ),
    "surrogates": ReportSection(
        "How good the surrogates are",
        "What a surrogate says of runs against what the model said: the nearer to the line, the "
        "better. A good fit as a whole says little of one figure, so each is judged by itself.",
        "uqpen.report.sections.surrogates:surrogates",
        absence_note="surrogates",
    ),
    "losses": ReportSection(
        "Runs that were lost",
        "Runs that gave no result: what they were lost to, how likely that is, and whether some "
        "inputs go with it.",
        "uqpen.report.sections.failures:failures",
    ),
    "archive": ReportSection(
        "The study, and what made this archive",
        "The study as it was run, its inputs and designs, and all that it takes to check the "
        "archive or to make it once more.",
        "uqpen.report.sections.archive:archive",
        is_common=True,
    ),
}

# Likewise of an archive of methods head to head; these take the archive itself.
BENCHMARK_SECTIONS = {
    "answer": ReportSection(
        "Which method wins",
        "Every method was given the same numbers of runs, many times each, and its estimates were "
        "held to a large reference: who is nearest to it, and whether by more than the noise.",
        "uqpen.report.benchmark.answer:answer",
    ),
    "errors": ReportSection(
        "Error against the number of runs",
        "The root mean square of each method's errors over the repeats, relative to the reference, "
        "with 95 % intervals. Read across: how many runs each takes for the same error. Markers of "
        "the same number of runs stand side by side.",
        "uqpen.report.benchmark.error_charts:error_charts",
    ),
    "replicates": ReportSection(
        "The same in replicates",
        "A design that is made in replicates tells its own error by their scatter, and may pay for "
        "it, as each has fewer points. Methods without replicates stand here as above.",
        "uqpen.report.benchmark.error_charts:replicate_error_charts",
    ),
    "rates": ReportSection(
        "How fast errors fall",
        "The slope of a straight line through the logarithms of errors over those of runs, with "
        "95 % intervals of the noise: the further to the left, the more each further run brings.",
        "uqpen.report.benchmark.convergence_rates:convergence_rates",
    ),
    "coverage": ReportSection(
        "How often the methods' own intervals held",
        "An estimate comes with an interval; in what share of the repeats did it hold the "
        "reference? Where the reference's own error is as large as the interval, it counts too.",
        "uqpen.report.benchmark.coverage:coverage",
    ),
    "cost": ReportSection(
        "What it cost",
        "Cost is counted in runs of the model. A surrogate is charged its training and its check; "
        "the time that its fit takes is not counted.",
        "uqpen.report.benchmark.reference:cost",
    ),
    "reference": ReportSection(
        "The reference, and how it was made",
        "One large run of the study's own model, on scrambled Sobol' points in replicates. What it "
        "says is taken for the truth, so no error below its own is told apart from 0.",
        "uqpen.report.benchmark.reference:reference",
    ),
    "tables": ReportSection(
        "All tables", "As the command line shows them.", "uqpen.report.benchmark.reference:tables"
    ),
    "archive": ReportSection(
        "The study, and what made this archive",
        "The study as it was compared, and the versions that its numbers were made with.",
        "uqpen.report.benchmark.reference:provenance",
    ),
}
