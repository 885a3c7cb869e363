"""The meaning of settings, as help texts and documented configurations show it."""

from dataclasses import dataclass

from roadeval.runtime.settings import meanings


@dataclass
class Base:
    """Settings of a base.

    least: The least
        number.
    note: This is no field, and so no setting.
    """

    least: int = 1


@dataclass
class More(Base):
    """More settings.

    greatest: A number: ``least`` or more.
    """

    greatest: int = 2
    undescribed: int = 3


def test_the_docstring_of_a_class_and_of_its_bases_describes_their_fields():
    assert meanings(More) == {
        "least": "The least number.",
        "greatest": "A number: ``least`` or more.",
    }


def test_a_class_whose_source_is_nowhere_has_the_same_meanings():
    made = type(
        "Made",
        (More,),
        {"__doc__": "Made.\n\n    seed: A seed.\n", "__annotations__": {"seed": int}},
    )
    assert meanings(made) == {**meanings(More), "seed": "A seed."}
