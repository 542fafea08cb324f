"""The answer: sentences that a decision can be quoted on, and what must be known with them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from uqpen.analyses.sample import sample_of_law
from uqpen.archive.read import group
from uqpen.evaluation import status_counts
from uqpen.figures.part import Part
from uqpen.figures.texts import plain
from uqpen.labels import MOMENTS, RUN, RUNS, STATUS_TEXT, SURROGATES, Sampling, Status
from uqpen.report.blocks import Block, Quote, Remarks, Text
from uqpen.report.sections.caveats import caveats
from uqpen.report.sections.evidence import leading
from uqpen.report.sections.quoted import Quantity, asked, name_of, others_of
from uqpen.report.sections.sentences import Said, sentences_on
from uqpen.summary.digits import grouped
from uqpen.summary.losses import Loss, losses

__all__ = ["answer"]

# Outputs that sentences are on, quantities that other designs are compared in, reasons told.
_MOST_OUTPUTS = 6
_MOST_COMPARED = 3
_MOST_REASONS = 3

_OTHERS = "What other designs estimate, by runs of their own (with their intervals further down)"


def answer(part: Part) -> Iterator[Block]:
    """Sentences on each output, where they come from, and what must be known with them."""
    design = leading(part)
    if design is None:
        yield from _without_sample(part)
        return
    outputs = _ordered(part, design)
    shown = [
        said
        for output in outputs[:_MOST_OUTPUTS]
        if (said := sentences_on(part, output, design)) is not None
    ]
    for said in shown:
        yield Quote(said.sentences)
    if left_out := _left_out(shown, len(outputs) - _MOST_OUTPUTS):
        yield Text(left_out)
    yield Text(_origin(part, design))
    if agreement := tuple(_agreement(shown, design)):
        yield Remarks(_OTHERS, agreement)
    notes = dict.fromkeys(note for said in shown for note in said.remarks)
    if lines := (*notes, *caveats(part, design)):
        yield Remarks("What to keep in mind", lines)


def _ordered(part: Part, design: str) -> list[str]:
    """All outputs, those first that the study asked something of."""
    numbers = sorted(part.numbers, key=lambda output: not asked(part, output, design))
    return [*numbers, *part.kinds]


def _left_out(shown: Sequence[Said], outputs: int) -> str:
    """What has no sentence, though the archive tells it."""
    figures = sum(said.left_out for said in shown)
    parts = []
    if figures:
        parts.append(f"{figures} more {'figure' if figures == 1 else 'figures'} of these outputs")
    if outputs > 0:
        parts.append(f"{outputs} more {'output' if outputs == 1 else 'outputs'}")
    return f"What the archive tells of {' and of '.join(parts)} stands below." if parts else ""


def _origin(part: Part, design: str) -> str:
    """Which runs the sentences come from, and why these."""
    runs = sample_of_law(group(part.tree, RUNS, design))
    back, every = status_counts(runs)[Status.OK], runs.sizes[RUN]
    known = [str(part.tree.attrs.get(name, "")) for name in ("model_name", "model_version")]
    model = plain(" ".join(filter(None, known)))
    some = "all" if back == every else grouped(back)
    returned = f"Of its {grouped(every)} runs of the model {model}, {some} came back."
    if every == 1:
        returned = f"It is a single run of the model {model}."
    return (
        f"This comes from {design}: {_reason(part, design)}. It was chosen by its place in the "
        f"study, not by what it says. {returned}"
    )


def _reason(part: Part, design: str) -> str:
    if not part.is_plain(design):
        return (
            "it was made for sensitivity indices, but two of its matrices are a sample of the "
            "inputs, and the study has no other sample of which any run came back"
        )
    earlier = [each for each in part.samples if part.is_plain(each)]
    came_back = "" if earlier[0] == design else " and of which any came back"
    taken = " taken for" if part.sampling(design) is Sampling.GIVEN else ""
    return f"the first design of the study whose runs are{taken} a sample of the inputs{came_back}"


def _agreement(shown: Sequence[Said], design: str) -> Iterator[str]:
    """How far other designs agree, in what was asked first."""
    for quantity in [each for said in shown for each in said.quantities][:_MOST_COMPARED]:
        others = others_of(quantity, design)
        own = quantity.estimate(design)
        if others and own is not None:
            values = [float(quantity.bounds(array)[0]) for array in others.values()]
            here, _, _, lowest, highest = quantity.texts(own, min(values), max(values))
            span = lowest if lowest == highest else f"{lowest} to {highest}"
            by = "1 other design" if len(others) == 1 else f"{len(others)} other designs"
            yield f"{quantity.heading}: {span} by {by}, {here} by {design}."


def _without_sample(part: Part) -> Iterator[Block]:
    """What is to be said where no run of a sample came back."""
    means = list(_means(part))
    lost = [each for design in part.designs for each in losses(part.tree, design)]
    if not any(_came_back(part, design) for design in part.designs):
        yield Text(_nothing_came_back(part, lost))
        return
    if part.samples:
        yield Text(
            f"No run of {', '.join(part.samples)} came back: nothing is told of how the outputs "
            f"are distributed. {_reasons(lost)}"
        )
    else:
        yield Text(
            "No design of this study is a sample of its inputs: nothing is told of how the outputs "
            "are distributed, and no probability. What its designs were made for stands below."
        )
    if means:
        yield Quote(tuple(means))
    if SURROGATES in part.tree.children:
        yield Text("What surrogates say has no interval of its own, so it is not quoted here.")


def _means(part: Part) -> Iterator[str]:
    """Means by integration rules, which have no interval."""
    rules = [each for each in part.designs if part.sampling(each) is Sampling.RULE]
    for output in part.numbers[:_MOST_OUTPUTS]:
        quantity = Quantity(part, output, MOMENTS)
        for design in rules:
            array = quantity.estimate(design)
            if array is not None:
                name = name_of(part, output)
                stated = f"{quantity.texts(array)[0]} {quantity.interval(array)}"
                yield f"By the integration rule {design}, the mean of {name} is {stated}."
                break


def _came_back(part: Part, design: str) -> bool:
    """Whether any run did, not of a sample alone."""
    return bool(status_counts(group(part.tree, RUNS, design))[Status.OK])


def _nothing_came_back(part: Part, lost: Sequence[Loss]) -> str:
    runs = sum(group(part.tree, RUNS, design).sizes[RUN] for design in part.designs)
    lost_all = "The only one was lost." if runs == 1 else f"All {grouped(runs)} were lost."
    return (
        f"No run came back: there is no answer. {lost_all} {_reasons(lost)} "
        "Once the model is mended, or its time limit raised, or the inputs are within what it "
        "allows, run the study again; the archive keeps the inputs of every lost run, so that one "
        "can be tried alone."
    )


def _reasons(lost: Sequence[Loss]) -> str:
    """What runs were lost to most often."""
    counts: Counter[tuple[Status, str]] = Counter()
    for each in lost:
        counts[each.status, each.reason] += each.runs
    told = [
        f"“{plain(reason, 160)}” ({STATUS_TEXT[status]}, {grouped(number)} "
        f"{'run' if number == 1 else 'runs'})"
        for (status, reason), number in counts.most_common(_MOST_REASONS)
    ]
    more = len(counts) - len(told)
    rest = f"; and {grouped(more)} other reasons" if more > 0 else ""
    head = "The reason" if len(counts) == 1 else "The most frequent reasons"
    return f"{head}: {'; '.join(told)}{rest}." if told else ""
