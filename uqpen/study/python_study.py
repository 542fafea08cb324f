"""Study made from Python objects."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Unpack

import tomli_w

from uqpen.core.errors import Problem, StudyError
from uqpen.study import SECTIONS, SectionArguments
from uqpen.study.document import ArgumentsDocument, parse_document
from uqpen.study.load import load_study as read_file
from uqpen.study.load import read_study
from uqpen.study.python_objects import StudyContent
from uqpen.study.study import ValidatedStudy
from uqpen.study.summary import study_html

__all__ = ["Study", "load_study"]


class Study(ValidatedStudy):
    """Study of the uncertainty of a model's outputs.

    It is checked when it is made, as a study file is when it is read.

    Parameters
    ----------
    model : callable, PythonModel, Model or str
        A function, possibly defined in a notebook, takes its inputs and returns its outputs in the
        units in which the study states them; a `PythonModel` states its own. A `Model` is a
        built-in one, or an instance of a class of your own. A text is the name of a built-in model.
        A reference such as ``"my_model.py:function"`` stands in a `dict`, as in a study file.
    inputs : mapping
        For each input a distribution such as ``uqpen.Normal("2.5 g/cm^3", "0.05 g/cm^3")``, a text
        such as ``"(2.5 ± 0.05) g/cm^3"``, or one value such as ``"30 cm"``. For a tuple of inputs
        a joint distribution of chaospy, such as ``{("a", "b"): chaospy.MvNormal(…)}``.
    outputs : mapping, optional
        For each output its unit, or an `OutputSpec`.
    designs : mapping, optional
        The designs of the runs by name, such as ``{"mc": uqpen.MonteCarlo(runs=1000)}``. A `budget`
        may take their place.
    seed : int
        Seed of all random numbers.
    title : str, optional
        Title for display.
    name : str
        Name of the study.
    models : mapping, optional
        Several models by name, in place of `model`.
    joint, joint_probabilities, surrogates, published, failures, dependence : optional
        As the tables of these names in a study file.
    constraints : sequence of str
        Conditions that every point meets, such as ``"a > 2 * b"``.
    analyses : sequence of str
        References to functions that compute further statistics.
    confidence_level : float, optional
        Confidence level of all intervals; 0.95 by default.
    budget : int, optional
        Number of runs in place of designs and surrogates, which are planned.
    sensitivity, convergence : bool
        False leaves these statistics out, which are most of the work of a fast model's study.
    folder : Path
        Folder to which the paths of files are relative.

    Raises
    ------
    StudyError
        Listing every mistake with its argument, what was found and what is expected.

    Examples
    --------
    >>> import uqpen
    >>> study = uqpen.Study(
    ...     model=lambda length, width: {"area": length * width},
    ...     inputs={"length": uqpen.Normal("2 m", "0.1 m"), "width": "3 m"},
    ...     outputs={"area": "m2"},
    ...     designs={"mc": uqpen.MonteCarlo(runs=100)},
    ...     seed=1,
    ... )
    >>> tree = uqpen.run(study)
    >>> tree["statistics/mc/area"]["mean"].attrs["units"]
    'm2'
    """

    def __init__(
        self,
        model: Callable[..., Mapping[str, Any]] | object | None = None,
        inputs: Mapping[str, object] | None = None,
        outputs: Mapping[str, object] | None = None,
        designs: Mapping[str, object] | None = None,
        *,
        seed: int | None = None,
        title: str | None = None,
        name: str = "study",
        models: Mapping[str, object] | None = None,
        constraints: Sequence[str] = (),
        analyses: Sequence[str] = (),
        confidence_level: float | None = None,
        budget: int | None = None,
        sensitivity: bool = True,
        convergence: bool = True,
        folder: str | Path = ".",
        **sections: Unpack[SectionArguments],
    ) -> None:
        for key in sections.keys() - SECTIONS:
            raise TypeError(f"Study.__init__() got an unexpected keyword argument '{key}'")
        made = StudyContent(
            {
                "title": title,
                "seed": seed,
                "confidence_level": confidence_level,
                "budget": budget,
                "sensitivity": None if sensitivity is True else sensitivity,
                "convergence": None if convergence is True else convergence,
                "model": {"use": model} if isinstance(model, str) else model,
                "models": models,
                "inputs": inputs,
                "outputs": outputs,
                "designs": designs,
                "constraints": {"keep": list(constraints)} if constraints else None,
                "analyses": list(analyses) or None,
                **sections,
            },
            Path(folder).absolute(),
        )
        self._copy(_read(made, name))

    @classmethod
    def of(cls, validated: ValidatedStudy) -> Study:
        """Return a validated study with the methods of this class."""
        study = cls.__new__(cls)
        study._copy(validated)
        return study

    def to_toml(self) -> str:
        """Return the text of the study, which its archive keeps.

        A function that is a Python object stands in it by its name and source, for reading only.
        """
        return self.text

    def __repr__(self) -> str:
        designs = ", ".join(self.designs)
        return f"<uqpen.Study {self.title!r}: {self.model.name}; designs {designs}>"

    def _repr_html_(self) -> str:
        return study_html(self)

    def _copy(self, study: ValidatedStudy) -> None:
        for field in dataclasses.fields(ValidatedStudy):
            object.__setattr__(self, field.name, getattr(study, field.name))


def _read(made: StudyContent, name: str) -> ValidatedStudy:
    """Read the content of a study as its text is read."""
    document = parse_document(_text(made.content), "uqpen.Study", made.objects, ArgumentsDocument)
    try:
        study = read_study(document, name, made.folder, trust=True)
    except StudyError as error:
        further = [each for each in error.problems if not _is_within(each, made.problems)]
        raise document.error([*made.problems, *further]) from None
    if made.problems:
        raise document.error(made.problems)
    return study


def _text(content: Mapping[str, Any]) -> str:
    """Return the text of a study, its tables in a fixed order."""
    ordered = {key: content[key] for key in SECTIONS if key in content}
    text = tomli_w.dumps(ordered, multiline_strings=True)
    # A multi-line text loses carriage returns.
    return text if tomllib.loads(text) == ordered else tomli_w.dumps(ordered)


def load_study(path: str | Path) -> Study:
    """Read a study file.

    Parameters
    ----------
    path : str or Path
        A TOML file. The files that it names are beside it.

    Raises
    ------
    StudyError
        Listing every mistake with its line, what was found and what is expected.
    """
    return Study.of(read_file(path))


def _is_within(problem: Problem, others: Sequence[Problem]) -> bool:
    """Check for a consequence of another problem: its path is that of the other, or within it."""
    return any(problem.path[: len(other.path)] == other.path for other in others)
