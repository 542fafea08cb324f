"""Each section of a study file is declared once, and all that read sections find it there."""

import dataclasses
import inspect

import pytest

import uqpen
from uqpen.core.lookup import resolve
from uqpen.study import SECTIONS, SectionArguments
from uqpen.study.study import ValidatedStudy

FIELDS = {each.name: each for each in dataclasses.fields(ValidatedStudy)}


def test_each_section_is_an_argument_of_the_same_name():
    named = set(inspect.signature(uqpen.Study).parameters) - {"name", "folder", "sections"}
    assert named.isdisjoint(SectionArguments.__annotations__)
    assert named | set(SectionArguments.__annotations__) == set(SECTIONS)


def test_an_unknown_argument_is_refused_as_python_refuses_it():
    with pytest.raises(TypeError, match="got an unexpected keyword argument 'surrogate'"):
        uqpen.Study(lambda a: {"y": a}, surrogate={})  # type: ignore[call-arg]


@pytest.mark.parametrize("key", SECTIONS)
def test_a_declaration_names_what_there_is(key):
    section = SECTIONS[key]
    for reference in filter(None, (section.settings, section.reader, section.lines)):
        assert callable(resolve(reference))
    assert bool(section.settings or section.reader or section.attribute) == bool(section.field)
    assert not section.field or section.field in FIELDS
    assert not section.fact or (section.attribute and "{value}" in section.fact)


@pytest.mark.parametrize("key", [key for key in SECTIONS if SECTIONS[key].settings])
def test_a_section_of_settings_has_a_default(key):
    field = FIELDS[SECTIONS[key].field]
    assert field.default is not dataclasses.MISSING
