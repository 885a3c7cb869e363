"""Another method's masks that lie beside the log, as frames read them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from roadeval.logs.topics.confidence import Confidence
from roadeval.logs.topics.label_reader import Clocks, LabelPictures, LabelReader
from roadeval.logs.topics.labels import Meaning
from roadeval.logs.topics.reader import TopicReader


@dataclass(frozen=True, slots=True, eq=False)
class MaskPairing:
    """By what masks are paired with images.

    Parameters
    ----------
    clocks
        The images' numbers or times, and the masks'.
    tolerance
        How far a pair may be apart.
    unused
        Masks that belong to no frame of the log, as far as that is known beforehand.
    unsure
        Frames without a mask for want of a number that is sure: an unknown number of images, or of
        the other log's masks, is lost before them.
    """

    clocks: Clocks
    tolerance: int
    unused: int
    unsure: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class MaskSource:
    """Another method's masks, beside the log.

    Parameters
    ----------
    where
        The folder, or topic and log, for a person.
    pictures
        The masks.
    meaning
        How they are read.
    pairing
        By what they are paired with images.
    why
        That in words.
    digest
        Computes the SHA-256 of their files, in hexadecimal.
    """

    where: str
    pictures: LabelPictures
    meaning: Meaning
    pairing: MaskPairing
    why: str
    digest: Callable[[], str]

    @property
    def is_confidence(self) -> bool:
        """Whether they are thresholds on how probable road is."""
        return isinstance(self.meaning, Confidence)

    def reader(self, images: TopicReader) -> LabelReader:
        """Return what finds the mask of each image."""
        pairing = self.pairing
        return LabelReader(self.pictures, self.meaning, images, pairing.clocks, pairing.tolerance)
