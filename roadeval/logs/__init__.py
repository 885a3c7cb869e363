"""Camera logs (MCAP) in and out. No other room knows MCAP.

A log goes from bytes to frames through its sub-rooms: ``container`` (records, chunks, damage),
``messages`` (pictures, whatever their encoding), ``topics`` (what there is, and which to replay)
and ``truth`` (labels wherever they lie: what they mean, which image each belongs to); `Log.frames`
puts them together. ``writing`` writes logs.

Names are imported when they are first used: a command that reads settings needs little else.
"""

from typing import TYPE_CHECKING

from roadeval.runtime.imports import on_demand

if TYPE_CHECKING:
    from roadeval.logs.container.file import Damage
    from roadeval.logs.errors import FrameError, LogError
    from roadeval.logs.files import METADATA, files_of, natural
    from roadeval.logs.frames import Accounting, FrameStream, LoggedFrame, Selection, in_step
    from roadeval.logs.log import Log, LogDescription, RemoteLog, describe, open_log
    from roadeval.logs.messages.encoding import TopicKind
    from roadeval.logs.settings import (
        CameraSettings,
        FrameSettings,
        LabelPlace,
        LabelSettings,
        LogConfig,
        MaskSettings,
        TopicSettings,
        parse_time,
    )
    from roadeval.logs.topics.reader import TopicInfo
    from roadeval.logs.truth.drawn import Proposal
    from roadeval.logs.truth.formats.coco import as_coco
    from roadeval.logs.truth.labels import LabelSource, label_files
    from roadeval.logs.truth.pairing import NamedLabels
    from roadeval.logs.truth.picks import PICK, Picked, Picks, Why, digest_of
    from roadeval.logs.writing.writer import LogWriter, NoSidecar, PackResult, SidecarWriter, pack

if not TYPE_CHECKING:  # there every name is known
    __getattr__ = on_demand(__name__)
