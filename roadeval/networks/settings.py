"""Every choice between a camera image and a network's road mask."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import ConfigDict, Field, field_validator
from pydantic.dataclasses import dataclass as validated

from roadeval.errors import RoadevalError

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
OfChannels = Field(min_length=1, max_length=3)
Side = Annotated[int, Field(ge=1, le=16384)]
Class = Annotated[int, Field(ge=0, le=65535)]
MIB: Final = 1 << 20


class NetworkError(RoadevalError):
    """A network that cannot be used."""


@validated(frozen=True, config=ConfigDict(extra="forbid"))
class NetSettings:
    """Settings of a network. Missing values are read from the file, and listed in ``run.toml``."""

    file: str = ""
    """The network, an ONNX file."""
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")] | None = None
    """SHA-256 of that file, in hexadecimal: any other file is refused. Where weights lie in files
    beside it, of all of them, one after the other."""
    size: tuple[Side, Side] | None = None
    """Width and height of its input, in pixels; by default those that the file names."""
    resize: Literal["stretch", "letterbox"] | None = None
    """How an image gets that size, interpolated linearly. ``stretch``, the default: each side by
    itself. ``letterbox``, that of Ultralytics' networks: reduced as a whole until it fits, in the
    middle of a grey area."""
    antialias: bool = False
    """Whether a pixel of a reduced image is a mean of all that it covers, as Pillow's bilinear
    filter has it."""
    layout: Literal["NCHW", "NHWC"] | None = None
    """The order of its input's dimensions: N images, C channels, H rows, W columns."""
    channels: Literal["rgb", "bgr", "grey"] | None = None
    """The order of its channels, by default ``rgb``. ``grey``: a single channel."""
    scale: Positive | None = None
    """A grey level of 0..255 is multiplied by this first; by default by 1/255, and by 1 where the
    network takes whole numbers."""
    mean: Annotated[tuple[Number, ...], OfChannels] | None = None
    """Subtracted from that: one number for each channel in the order of ``channels``, or one for
    all; by default 0."""
    deviation: Annotated[tuple[Positive, ...], OfChannels] | None = None
    """The difference is divided by this: one number for each channel in the order of ``channels``,
    or one for all; by default 1."""
    outputs: tuple[str, ...] | None = None
    """Names of the outputs that show road; where there are several, road is what one of them calls
    road."""
    road: Annotated[tuple[Class, ...], Field(max_length=64)] | None = None
    """The numbers of the classes that are road, from 0."""
    activation: Literal["softmax", "sigmoid", "none", "classes"] | None = None
    """How probabilities are made of an output: ``softmax`` over its classes, ``sigmoid`` of each,
    or ``none`` where it holds probabilities: by default where it never leaves 0 to 1 on images for
    testing. ``classes``: it holds numbers of classes, as whole numbers do."""
    decide: Literal["argmax", "threshold"] | None = None
    """Road is where a class of ``road`` beats all others (``argmax``), or where the probability of
    road is above ``threshold``."""
    threshold: Annotated[float, Field(ge=0, le=1)] | None = None
    """Between 0 and 1, by default 0.5; without ``decide`` it stands for ``decide = "threshold"``.
    With ``argmax`` it is held against the share of road's best class in the best two."""
    seconds: Positive = 30.0
    """A network that takes longer for an image is ended: a failure."""
    megabytes: Annotated[int, Field(ge=1, le=65536)] = 512
    """Memory that its input or an output may take, in MiB; all that it computes for an image may
    take eight times that."""

    @property
    def channel_count(self) -> int:
        """Channels of the input."""
        return 1 if self.channels == "grey" else 3

    @property
    def input_shape(self) -> tuple[int, int, int, int]:
        """Shape of the input, of complete settings."""
        assert self.size is not None
        width, height = self.size
        if self.layout == "NCHW":
            return 1, self.channel_count, height, width
        return 1, height, width, self.channel_count

    @field_validator("outputs", "road")
    @classmethod
    def _some(cls, named: tuple[object, ...] | None) -> tuple[object, ...] | None:
        if named is not None and (not named or len(set(named)) < len(named)):
            raise ValueError("must name at least one, and each once")
        return named
