"""The report: one page for a person, made from an archive alone.

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
        "Main results",
        "Sentences to quote on the outputs of the study. Each estimate has its interval, or the "
        "reason why it has none. Below them: the design behind them, and what to keep in mind.",
        "uqpen.report.sections.answer:answer",
    ),
    "distributions": ReportSection(
        "How it is distributed",
        "The probability that an output is at most a value, with a band that is valid for all "
        "values at once. Move the threshold to read off a probability. Below it: the runs "
        "themselves and their quantiles.",
        "uqpen.report.sections.distributions:distributions",
        absence_note="completed runs that are a sample of the inputs",
    ),
    "methods": ReportSection(
        "All methods side by side",
        "The same statistics by all designs, surrogates and publications. Further charts compare "
        "the width of the intervals with the number of runs: further down and to the left is "
        "better.",
        "uqpen.report.sections.source_comparison:source_comparison",
    ),
    "models": ReportSection(
        "How the models differ",
        "The distribution function of each model at the same points. Below it: the differences "
        "run by run. They are often known better than either model alone.",
        "uqpen.report.sections.model_comparison:model_comparison",
        is_common=True,
    ),
    "convergence": ReportSection(
        "How it settles with more runs",
        "Estimates from growing parts of the runs. Each has the interval that it would have, had "
        "the study ended there.",
        "uqpen.report.sections.convergence:convergence",
    ),
    "sensitivity": ReportSection(
        "Where the uncertainty comes from",
        "The first-order index is the share of an output's variance that would vanish if one input "
        "were known. The "
        "total-order index adds its interactions with other inputs. Shapley effects divide the "
        "interactions evenly among their inputs. Elementary effects and responses measure how much "
        "the output changes with an input.",
        "uqpen.report.sections.sensitivity:sensitivity",
        absence_note="measures of the inputs' part",
    ),
    "scatter": ReportSection(
        "Outputs against inputs",
        "Each point is a run of the model. If the points follow a line or a bend, the output "
        "depends on that input. If they are a cloud without a shape, other inputs decide.",
        "uqpen.report.sections.scatter:scatter",
    ),
    "course": ReportSection(
        "Trajectory at the nominal inputs",
        "The states of the model within a single run, with all inputs at their nominal values.",
        "uqpen.report.sections.trajectory:trajectory",
        is_common=True,
        absence_note="trajectories of its models",
    ),
    "surrogates": ReportSection(
        "How good the surrogates are",
        "Predictions of a surrogate against the model's outputs in the same runs: the nearer to "
        "the line, the better. A good fit as a whole does not make every estimate right, so each "
        "is checked by itself.",
        "uqpen.report.sections.surrogates:surrogates",
        absence_note="surrogates",
    ),
    "losses": ReportSection(
        "Failed runs",
        "Runs without a result: the reasons, the probability of failure, and the inputs that are "
        "associated with it.",
        "uqpen.report.sections.failures:failures",
    ),
    "archive": ReportSection(
        "The study and its provenance",
        "The study as it was run, its inputs and designs, and all that is needed to check the "
        "archive or to repeat it.",
        "uqpen.report.sections.archive:archive",
        is_common=True,
    ),
}

# Likewise of an archive of a benchmark of methods; these take the archive itself.
BENCHMARK_SECTIONS = {
    "answer": ReportSection(
        "Which method is best",
        "Every method had the same numbers of runs, many times each. Its estimates are compared "
        "with a large reference. The best method is nearest to it, by more than the noise.",
        "uqpen.report.benchmark.answer:answer",
    ),
    "errors": ReportSection(
        "Error against the number of runs",
        "The root mean square of each method's errors over the repeats, relative to the reference, "
        "with 95 % intervals. Read across to compare the runs that methods need for the same "
        "error. Markers for the same number of runs stand side by side.",
        "uqpen.report.benchmark.error_charts:error_charts",
    ),
    "replicates": ReportSection(
        "The same in replicates",
        "The scatter of replicates gives the error of a design. This may cost accuracy, as each "
        "replicate has fewer points. Methods without replicates are the same as above.",
        "uqpen.report.benchmark.error_charts:replicate_error_charts",
    ),
    "rates": ReportSection(
        "How fast errors fall",
        "The slope of a straight line through the logarithms of errors over those of runs, with "
        "95 % intervals of the noise. Further to the left, errors fall faster with more runs.",
        "uqpen.report.benchmark.convergence_rates:convergence_rates",
    ),
    "coverage": ReportSection(
        "Coverage of the methods' own intervals",
        "The share of the repeats in which the interval of an estimate contains the reference. "
        "Where the reference's own error is as large as the interval, it counts too.",
        "uqpen.report.benchmark.coverage:coverage",
    ),
    "cost": ReportSection(
        "Cost",
        "The cost of a method is its number of runs of the model. For a surrogate these are its "
        "training and validation runs; the time of its fit is not counted.",
        "uqpen.report.benchmark.reference:cost",
    ),
    "reference": ReportSection(
        "The reference",
        "One large design of the study's own model: scrambled Sobol' points in replicates. Its "
        "estimates replace the true values, so an error below its own cannot be distinguished "
        "from 0.",
        "uqpen.report.benchmark.reference:reference",
    ),
    "tables": ReportSection(
        "All tables", "As the command line shows them.", "uqpen.report.benchmark.reference:tables"
    ),
    "archive": ReportSection(
        "The study and its provenance",
        "The study as it was compared, and the versions of the software.",
        "uqpen.report.benchmark.reference:provenance",
    ),
}
