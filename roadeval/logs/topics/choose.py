"""The choice of topics to replay: those that the user names, else those with a clear role."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from typing import Final, NamedTuple

from roadeval.logs.errors import LogError
from roadeval.logs.settings import LabelSettings
from roadeval.logs.topics.reader import TopicInfo
from roadeval.runtime.sentence import Sentence, Setting
from roadeval.runtime.text import likely


def _set(text: str) -> frozenset[str]:
    return frozenset(text.split())


LABEL_WORDS: Final = _set(
    "label labels truth gt groundtruth annotation annotations semantic semantics seg segmentation"
)
MASK_WORDS: Final = _set("mask masks")
ROAD_WORDS: Final = _set("road roads drivable driveable freespace lane lanes")
SHADOW_WORDS: Final = _set("shadow shadows")
NO_TRUTH_WORDS: Final = _set(
    "pred preds prediction predictions predicted net network nn cnn dnn model inference "
    "detection detections detected output result results estimate estimated overlay overlays "
    "blend blended vis viz visual visualization visualisation debug colored"
)
"""Words for a network's output, and for pictures of labels."""
TRANSPORT_WORDS: Final = _set("image img images raw compressed png mono rect color")
TRANSPORTS: Final = _set("compressed compressedDepth theora zstd ffmpeg h264 h265 hevc av1")
"""Last parts of topics that image_transport adds to the topic of an image."""
SIDES: Final = _set("front rear left right side top bottom center")
PLAIN_WORDS: Final = TRANSPORT_WORDS | _set("camera cam front left right rear")
SAME_WORDS: Final = {
    "cam": "camera",
    "back": "rear",
    "backward": "rear",
    "forward": "front",
    "centre": "center",
    "middle": "center",
}
"""Words that replace their synonyms in cameras' names, by the synonym."""


class Choice(NamedTuple):
    """A topic, or None, and why it was chosen."""

    topic: TopicInfo | None
    why: str


def words(name: str) -> frozenset[str]:
    """Split a topic's name into its words, in lower case."""
    spaced = re.sub(r"([a-z0-9])([A-Z])", r"\1 \2", name)
    parts = frozenset(re.findall(r"[a-z]+", spaced.lower()))
    return parts | {"groundtruth"} if {"ground", "truth"} <= parts else parts


def choose_image(
    topics: Sequence[TopicInfo], setting: str | None, others: Collection[str | None] = ()
) -> tuple[TopicInfo, str]:
    """Choose the camera's topic, which is none of ``others``; return it and why.

    A `LogError` if the named topic is missing or no image, or if none or several are candidates.
    """
    if setting is not None:
        return named(topics, setting, "topics.image"), "asked for"
    images = [topic for topic in topics if topic.is_image and topic.count]
    images = [topic for topic in images if topic.name not in others] or images
    candidates = [topic for topic in images if not _looks_like_label(topic)]
    colours = [
        topic
        for topic in candidates
        if "depth" not in topic.format.lower()
        and topic.format.lower() not in ("16uc1", "32fc1")
        and not words(topic.name) & {"depth", "disparity"}
    ] or candidates
    # If a camera has several transports, a readable one is taken, without loss if possible.
    best: dict[str, TopicInfo] = {}
    for topic in sorted(colours, key=lambda topic: (bool(topic.problem), bool(topic.lossy))):
        base, _, transport = topic.name.rpartition("/")
        best.setdefault(base if transport in TRANSPORTS else topic.name, topic)
    cameras = [topic for topic in colours if topic in best.values()]
    if len(cameras) == 1:
        why = "the only camera image" if len(images) > 1 else "the only image topic"
        return cameras[0], f"{why}, of {len(colours)} transports" if len(colours) > 1 else why
    if cameras:
        choose = "choose one with {topics.image}, or give it once for each of several"
        problem = f"{len(cameras)} image topics: {_names(cameras)}"
        raise LogError(problem, remedy=Sentence(choose))
    if images:
        choose = Sentence("choose the camera's with {topics.image}")
        raise LogError(f"only label images: {_names(images)}", remedy=choose)
    listed = ", ".join(f"{topic.name} ({topic.schema or 'no schema'})" for topic in topics[:8])
    more = ", ..." if len(topics) > 8 else ""
    raise LogError(f"no image topic; the log has: {listed or 'no topics at all'}{more}")


def choose_truth(
    topics: Sequence[TopicInfo],
    image: TopicInfo,
    setting: str | None,
    labels: LabelSettings,
    *,
    of_rig: bool = False,
) -> Choice:
    """Choose the topic of the road truth.

    An image of single values is preferred, unless the settings name colours. ``of_rig`` says that
    other cameras are replayed, too; their labels are left out. A `LogError` if the named topic is
    missing or no image; if several are candidates, or belong to another camera; or if the settings
    name values, and the only label images are compressed with loss.
    """
    if setting is not None:
        return _named_choice(topics, setting, "topics.truth")
    candidates = [t for t in _label_topics(topics, image) if not words(t.name) & SHADOW_WORDS]
    roads = [topic for topic in candidates if not topic.lossy]
    elsewhere = {t.name: why for t in roads if (why := other_camera(t, image, topics))}
    of_camera = [topic for topic in roads if topic.name not in elsewhere]
    colors = labels.by_color
    truth = _only(_clear_truths(of_camera, image, colors=colors), image, "label", "topics.truth")
    if truth is not None:
        by = "colours" if truth.channels == 3 else "single channel"
        return Choice(truth, f"the label image, by its name and its {by}")
    if others := _clear_truths(roads, image, colors=colors):
        name = others[0].name
        why = f"{name} belongs to another camera than {image.name}, by {elsewhere[name]}"
        if of_rig:
            return Choice(None, why)
        raise LogError(
            why,
            remedy=Sentence(
                "name it with {topics.truth} to use it nevertheless, or give an empty name there "
                "to continue without truth"
            ),
        )
    if roads:
        why = Sentence("no topic is clearly road truth; name one with {topics.truth}")
        return Choice(None, Sentence("{}: {}", why, _names(roads)))
    if not candidates:
        return Choice(None, "no label topic")
    why = lossy_labels(candidates[0].name, candidates[0].lossy)
    if labels != LabelSettings():
        raise LogError(why)
    return Choice(None, why)


def lossy_labels(name: str, format_: str) -> str:
    """Return the sentence about label images in a format that changes values."""
    return f"{name} is {format_}, which changes label values at every edge: log labels as PNG"


def _clear_truths(roads: Sequence[TopicInfo], image: TopicInfo, *, colors: bool) -> list[TopicInfo]:
    """Return the topics of the clearest kind that is present: by name, plain masks, by colour."""
    with_words = [(t, words(t.name)) for t in roads]
    by_name = [t for t, n in with_words if n & LABEL_WORDS or (n & MASK_WORDS and n & ROAD_WORDS)]
    coloured, single = ([t for t in by_name if t.channels == n] for n in (3, 1))
    # The name of such a mask has no word for anything but the road.
    plain_words = MASK_WORDS | PLAIN_WORDS | words(image.name)
    masks = [t for t in roads if t.channels == 1 and words(t.name) <= plain_words]
    return (coloured if colors else []) or single or masks or coloured


def choose_shadow(topics: Sequence[TopicInfo], image: TopicInfo, setting: str | None) -> Choice:
    """Choose the topic of the true shadow.

    A `LogError` if the named topic is missing or no image, or if several are candidates.
    """
    if setting is not None:
        return _named_choice(topics, setting, "topics.shadow")
    shadows = [
        topic
        for topic in _label_topics(topics, image)
        if topic.channels == 1
        and words(topic.name) & SHADOW_WORDS
        and not topic.lossy
        and not other_camera(topic, image, topics)
    ]
    shadow = _only(shadows, image, "shadow", "topics.shadow")
    why = "the shadow mask, by its name and its single channel" if shadow else "no shadow topic"
    return Choice(shadow, why)


def other_camera(label: TopicInfo, image: TopicInfo, topics: Sequence[TopicInfo]) -> str:
    """Return why a label topic belongs to another camera than the image's; empty if it does not.

    A topic's path and its header's ``frame_id`` name a camera by a side (front, rear, left ...), by
    a number (``cam1``), or by any word in the names of the log's cameras. Both must fit the image's
    camera. They may have fewer words (``/front/labels`` for ``/front/left/image``), unless another
    camera of the log fits better.
    """
    cameras = _other_cameras(topics, image)
    for what, theirs, ours, others in (
        ("its path", label.name, image.name, [camera.name for camera in cameras]),
        ("its frame_id", label.frame_id, image.frame_id, [camera.frame_id for camera in cameras]),
    ):
        if ours and _is_another(*_cameras(theirs, ours, *others)):
            return what if theirs == label.name else f"{what} ({theirs}, not {ours})"
    return ""


def _cameras(theirs: str, ours: str, *others: str) -> list[set[str]]:
    """Return the words of each name that distinguish a camera from others."""
    names = SIDES.union(*map(_camera_words, (ours, *others)))
    return [
        {word for word in _camera_words(text) if word in names or re.fullmatch(r"camera\d+", word)}
        for text in (theirs, ours, *others)
    ]


def _is_another(of_label: set[str], of_image: set[str], *of_others: set[str]) -> bool:
    is_another = bool(of_image - {"camera"}) and not of_label <= of_image
    is_nearer = any(len(of_label ^ other) < len(of_label ^ of_image) for other in of_others)
    return bool(of_label) and (is_another or is_nearer)


def check_names(names: Sequence[str], image: TopicInfo, topics: Sequence[TopicInfo]) -> None:
    """Raise a `LogError` if names of labels have the name of another camera, or of several.

    Numbers of frames, as in ``cam_0012.png``, are not part of a camera's name.
    """
    ours, *others = (
        f"{topic.name} {topic.frame_id}" for topic in (image, *_other_cameras(topics, image))
    )
    _, of_image, *of_others = _cameras("", ours, *others)
    texts = (re.sub(r"(?i)(?<![a-z\d])\d+(?=[^/]*$)", "", name) for name in names)
    of_labels = [_cameras(text, ours, *others)[0] for text in texts]
    numbered = {word for words in of_labels for word in words if word[-1].isdigit()}
    frames = numbered if len(numbered) == len(names) else set[str]()
    shown = {frozenset(words - frames): name for words, name in zip(of_labels, names, strict=True)}
    cameras = {words: name for words, name in shown.items() if words}
    theirs = [
        name for words, name in cameras.items() if _is_another({*words}, of_image, *of_others)
    ]
    if len(cameras) > 1:
        problem = f"labels of several cameras, as {' and '.join(sorted(cameras.values())[:3])}"
    elif theirs:
        problem = f"{theirs[0]} is of another camera than {image.name}, by its name"
    else:
        return
    pattern = re.sub(r"\d+[^/]*$", "*", min(cameras.values()))
    choose = Sentence("choose those that count by {truth.names}, as '{}'", pattern)
    raise LogError(problem, remedy=choose)


def _other_cameras(topics: Sequence[TopicInfo], image: TopicInfo) -> list[TopicInfo]:
    return [
        topic
        for topic in topics
        if topic.is_image
        and topic.count
        and topic.name != image.name
        and not _looks_like_label(topic)
    ]


def _camera_words(name: str) -> frozenset[str]:
    """Split a path or a ``frame_id`` into words and numbers that may distinguish cameras."""
    spaced = re.sub(r"([a-z0-9])([A-Z])", r"\1 \2", name).lower()
    numbered = re.sub(r"(?<![a-z])cam(?:era)?[ _]?(\d+)", r"camera\1", spaced)
    parts = re.findall(r"camera\d+|[a-z]+|\d+", numbered)
    common = frozenset(SAME_WORDS.get(word, word) for word in parts)
    return common - TRANSPORT_WORDS - LABEL_WORDS - MASK_WORDS - ROAD_WORDS


def _named_choice(topics: Sequence[TopicInfo], name: str, setting: str) -> Choice:
    """Return the topic of a name; an empty name means none."""
    topic = named(topics, name, setting) if name else None
    return Choice(topic, "asked for" if name else "asked to use none")


def named(topics: Sequence[TopicInfo], name: str, setting: str) -> TopicInfo:
    """Return the image topic that a setting names.

    A `LogError` if there is none, or it carries no images; it lists the valid ones.
    """
    for topic in topics:
        if topic.name == name and topic.is_image:
            if not topic.count:
                raise LogError(f"{name} holds no message", setting=setting)
            return topic
    images = [topic for topic in topics if topic.is_image]
    is_camera = setting == "topics.image"
    fitting = [topic for topic in images if _looks_like_label(topic) != is_camera]
    kind = "image" if not fitting else "camera" if is_camera else "label"
    names = _names(fitting or images) or "none"
    meant = likely(name, [topic.name for topic in fitting or images])
    there = any(topic.name == name for topic in topics)
    what = "carries no images" if there else "is not in the log"
    raise LogError(
        f"{name} {what}", setting=setting, remedy=f"{meant}its {kind} topics are: {names}"
    )


def _label_topics(topics: Sequence[TopicInfo], image: TopicInfo) -> list[TopicInfo]:
    """Return the topics that look like label images, but not like a network's output."""
    return [
        topic
        for topic in topics
        if topic.name != image.name
        and topic.count
        and _looks_like_label(topic)
        and not words(topic.name) & NO_TRUTH_WORDS
    ]


def _looks_like_label(topic: TopicInfo) -> bool:
    return topic.is_image and bool(words(topic.name) & (LABEL_WORDS | MASK_WORDS | SHADOW_WORDS))


def _only(
    topics: Sequence[TopicInfo], image: TopicInfo, what: str, setting: str
) -> TopicInfo | None:
    """Return the topic that shares most words with the image's name, then its ``frame_id``.

    None if there is no topic; a `LogError` if several share as much.
    """
    shared = [
        (len(words(topic.name) & words(image.name)), topic.frame_id == image.frame_id)
        for topic in topics
    ]
    best = [t for t, s in zip(topics, shared, strict=True) if s == max(shared)]
    if len(best) > 1:
        remedy = Sentence("choose one with {}", Setting(setting))
        raise LogError(f"{len(best)} {what} topics: {_names(best)}", remedy=remedy)
    return best[0] if best else None


def _names(topics: Iterable[TopicInfo]) -> str:
    return ", ".join(topic.name for topic in topics)
