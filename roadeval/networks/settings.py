"""Settings of a network, from the camera image to the road mask."""

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
    """Settings of a network. Missing values are read from the file, and listed in ``run.toml``.

    file: The network: an ONNX file, or a folder of Hugging Face with ``model.onnx``,
        ``config.json`` and ``preprocessor_config.json``.
    sha256: Expected SHA-256, in hexadecimal, of the network's bytes, followed by its weight files
        and the JSON files of its folder. A network with another one is an error.
    size: Width and height of the input in pixels. Default: as the file states.
    resize: Way to resize an image to the input, with linear interpolation. ``stretch``, the
        default: each side by itself. ``letterbox``, as for Ultralytics' networks: both sides by one
        factor, so that the image fits into the middle of a grey area.
    stride: Step of a letterbox's sides in pixels, for a network that takes any size: the sides are
        the least multiples that hold the image. Default: all letterboxes have ``size``.
    antialias: Whether a pixel of a reduced image is a mean of all pixels that it covers, as with
        Pillow's bilinear filter; ``bicubic`` uses that filter. Default: yes for a folder of Hugging
        Face, else no.
    layout: Order of the input's dimensions: N images, C channels, H rows, W columns.
    channels: Order of the input's channels, by default ``rgb``. ``grey``: a single channel.
    scale: Factor of the grey levels 0..255. Default: 1/255, or 1 if the network takes integers.
    mean: Number to subtract after that: one for each channel in the order of ``channels``, or one
        for all. Default: 0.
    deviation: Divisor of the difference: one for each channel in the order of ``channels``, or one
        for all. Default: 1.
    outputs: Names of the outputs that show road. A pixel is road if one of them calls it road.
    road: Numbers of the classes that are road, from 0.
    activation: Way to make probabilities of an output: ``softmax`` over its classes, ``sigmoid`` of
        each, or ``none`` if it holds probabilities, the default if test images give only numbers
        from 0 to 1. ``classes``: the output holds numbers of classes, the default for integers.
    decide: Rule for road: a class of ``road`` beats all others (``argmax``), or the probability of
        road is above ``threshold``.
    threshold: Number from 0 to 1, by default 0.5; if it is set, ``decide`` is ``threshold`` by
        default. With ``argmax`` the best class of road is compared with the best other class: the
        threshold is the least share of road in the two.
    seconds: Longest time for an image, in seconds. A network that takes longer fails.
    megabytes: Greatest memory of the input or an output, in MiB. All arrays of an image together
        may take eight times that.
    """

    file: str = ""
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")] | None = None
    size: tuple[Side, Side] | None = None
    resize: Literal["stretch", "letterbox"] | None = None
    stride: Side | None = None
    antialias: bool | Literal["bicubic"] | None = None
    layout: Literal["NCHW", "NHWC"] | None = None
    channels: Literal["rgb", "bgr", "grey"] | None = None
    scale: Positive | None = None
    mean: Annotated[tuple[Number, ...], OfChannels] | None = None
    deviation: Annotated[tuple[Positive, ...], OfChannels] | None = None
    outputs: tuple[str, ...] | None = None
    road: Annotated[tuple[Class, ...], Field(max_length=64)] | None = None
    activation: Literal["softmax", "sigmoid", "none", "classes"] | None = None
    decide: Literal["argmax", "threshold"] | None = None
    threshold: Annotated[float, Field(ge=0, le=1)] | None = None
    seconds: Positive = 30.0
    megabytes: Annotated[int, Field(ge=1, le=65536)] = 512

    @property
    def channel_count(self) -> int:
        """Number of channels of the input."""
        return 1 if self.channels == "grey" else 3

    @property
    def input_shape(self) -> tuple[int, int, int, int]:
        """Shape of the input; the settings are complete."""
        assert self.size is not None
        width, height = self.size
        if self.layout == "NCHW":
            return 1, self.channel_count, height, width
        return 1, height, width, self.channel_count

    @field_validator("outputs", "road")
    @classmethod
    def _check_names(cls, names: tuple[object, ...] | None) -> tuple[object, ...] | None:
        if names is not None and (not names or len(set(names)) < len(names)):
            raise ValueError("must name at least one, and each once")
        return names
