"""Which frames train, which are left out, and which are evaluated."""

from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from roadeval.config.run import configure
from roadeval.data import Frame, Role
from roadeval.errors import RoadevalError
from roadeval.training import learning
from roadeval.training.learning import (
    Schedule,
    TrainingError,
    fit,
    from_drives,
    from_file,
    from_log,
)
from roadeval.training.model import save_model
from roadeval.training.settings import TrainingSettings
from tests.training.making import frame, pipelines

PIPELINES = {
    # A plane is fitted and tabulated in half the time, and no test asks what was learnt.
    name: replace(
        pipeline,
        settings={**pipeline.settings, "svm": replace(pipeline.settings["svm"], kernel="linear")},
    )
    for name, pipeline in pipelines().items()
}


@dataclass(eq=False)
class Logged:
    """A frame of a log, as `logs` would hand it out."""

    frame: Frame
    broken: bool = False

    @property
    def number(self) -> int:
        return self.frame.number

    @property
    def labelled(self) -> bool:
        return self.frame.truth is not None

    def decode(self) -> Frame:
        if self.broken:
            raise RoadevalError("cannot be decoded")
        return self.frame


def log(count: int, unlabelled: tuple[int, ...] = (), broken: tuple[int, ...] = ()):
    return [Logged(frame(n, labelled=n not in unlabelled), n in broken) for n in range(count)]


def roles(frames, schedule: Schedule) -> str:
    """Give the roles' first letters: t(raining), c(opy), g(ap), u(nlabelled), e(valuated)."""
    return "".join(schedule.role(f.frame)[0] for f in frames)


def learn(logged, *, labelled: bool = True, **settings):
    chosen = TrainingSettings(**settings)
    return from_log(
        lambda only=None, **_: logged, PIPELINES, chosen, lambda done: None, labelled=labelled
    )


def test_the_first_labelled_frames_train_and_the_rest_is_evaluated():
    frames = log(8, unlabelled=(0, 2))
    _, schedule = learn(frames, frames=2)
    assert roles(frames, schedule) == "ututeeee"


def test_a_frame_that_equals_one_that_trained_is_a_copy_and_was_not_trained_on():
    frames = log(6)
    same = frames[0].frame
    for place in (3, 5):
        frames[place] = Logged(replace(same, number=place))
    _, schedule = learn(frames, frames=2)
    assert roles(frames, schedule) == "ttecec"


def test_frames_spread_along_the_drive_train_and_none_beside_them_is_evaluated():
    frames = log(18, unlabelled=(1, 9))
    _, schedule = learn(frames, frames=2, placement="spread", gap=1)
    assert roles(frames, schedule) == "tugeeeeegutgeeeeee"
    assert schedule.first == 3


@pytest.mark.parametrize(("count", "expected"), [(4, "tgeegtgeegtgeegtgeee"), (1, "tggggg")])
def test_the_gap_beside_spread_frames_is_a_quarter_of_their_distance(count, expected):
    frames = log(20)
    _, schedule = learn(frames, frames=count, placement="spread")
    assert roles(frames, schedule) == expected.ljust(20, "e")


def test_spread_frames_that_leave_nothing_to_evaluate_are_an_error():
    with pytest.raises(TrainingError, match=r"6 labelled frames, .* take 3 of them and 3 more"):
        learn(log(6), frames=3, placement="spread", gap=1)


def test_a_frame_that_cannot_be_decoded_is_replaced_by_the_next():
    frames = log(6, broken=(1,))
    model, schedule = learn(frames, frames=2)
    assert model.digests == {frames[0].frame.digest(), frames[2].frame.digest()}
    assert schedule.first == 3


def test_where_the_truth_labels_nothing_in_the_range_the_first_frames_train():
    frames = log(5, unlabelled=tuple(range(5)))
    model, schedule = learn(frames, frames=2)
    assert model.source == "patch"
    assert roles(frames, schedule) == "ttuuu"
    assert "no frame that is read has road truth: the model learnt from" in model.warnings[0]


def test_who_insists_on_truth_is_not_given_the_patch():
    with pytest.raises(TrainingError, match="no truth to train on"):
        learn(log(5, unlabelled=tuple(range(5))), frames=2, source="truth")


def test_training_frames_are_bounded_in_memory(monkeypatch):
    # A frame of 24x32 takes three images of 2304 bytes, a truth of 768, and its payload of 2304.
    monkeypatch.setattr(learning, "GREATEST_MEMORY", 3 * 9984)
    assert not learn(log(6), frames=3)[0].warnings
    with pytest.raises(TrainingError, match=r"more than 3 of them would take .*`frames.scale`"):
        learn(log(6), frames=4)


@pytest.mark.parametrize(("frames", "gap"), [(4, 0), (2, 2), (9, 0)])
def test_leaving_no_frame_to_evaluate_is_an_error(frames, gap):
    with pytest.raises(TrainingError, match=r"none is left to evaluate; set `training\.frames`"):
        learn(log(4), frames=frames, gap=gap)


def test_an_image_that_trained_is_recognised_wherever_it_lies():
    frames = log(5)
    _, schedule = learn(frames, frames=2)
    elsewhere = replace(frames[1].frame, number=77, stamp_ns=5)
    assert schedule.role(elsewhere) is Role.COPY


LABELLED = [frame(n) for n in range(2)]
BARE = [frame(n, labelled=False) for n in range(2, 4)]


def of_drives(source: str, **frames):
    drives = {Path(name): drive for name, drive in frames.items()}
    return from_drives(drives, PIPELINES, TrainingSettings(source=source))


def test_drives_without_truth_train_by_the_patch_and_this_is_said():
    model = of_drives("auto", a=BARE)
    assert model.source == "patch"
    assert "no drive has road truth in the range: the model learnt from" in model.warnings[0]


@pytest.mark.parametrize(
    ("source", "frames"),
    [
        ("auto", {"a": LABELLED, "b": BARE}),
        ("auto", {"a": LABELLED, "b": []}),
        ("truth", {"b": BARE}),
    ],
)
def test_a_drive_without_truth_among_others_is_named(source, frames):
    with pytest.raises(TrainingError, match=r"^b: no road truth to train on in the range"):
        of_drives(source, **frames)


# --- On top of a model of other drives ------------------------------------------------------------


def adapt(logged, path, pipelines, **settings):
    base, _ = from_file(path, pipelines)
    chosen = TrainingSettings(model=str(path), adapt=True, **settings)
    model, schedule = from_log(
        lambda only=None, **_: logged,
        pipelines,
        chosen,
        lambda done: None,
        labelled=True,
        base=base,
    )
    return base, model, schedule


@pytest.fixture
def robust(tmp_path):
    """The preset's pipeline, and a model of it."""
    small = {"trees": 3, "width": 32, "features": ("place", "colour")}
    made = {"unfiltered": configure({"preset": "robust", "trees": small}).pipeline}
    path = tmp_path / "city.model"
    save_model(fit([frame(n) for n in (50, 51)], made, TrainingSettings()), path)
    return made, path


def test_an_adapted_model_has_learnt_from_both_and_says_so(robust):
    pipelines, path = robust
    base, model, schedule = adapt(log(8), path, pipelines, frames=2, gap=1)
    adapted = model.parameters["unfiltered"]["trees"]
    assert adapted.base is base.parameters["unfiltered"]["trees"]
    assert base.digests < model.digests
    assert len(model.digests) == 4
    assert roles(log(8), schedule) == "ttgeeeee"
    (warning,) = [text for text in model.warnings if "adapted to this drive" in text]
    assert "2 of its own labelled frames" in warning
    assert str(path) in warning


def test_frames_that_the_model_learnt_from_are_not_evaluated_after_adapting_either(robust):
    pipelines, path = robust
    _, _, schedule = adapt(log(8), path, pipelines, frames=2)
    assert schedule.role(frame(50)) is Role.TRAINING


def test_without_truth_the_patch_adapts_only_where_that_is_insisted_on(robust):
    pipelines, path = robust
    logged = log(4, unlabelled=tuple(range(4)))
    with pytest.raises(TrainingError, match="no frame of the range has road truth to adapt"):
        adapt(logged, path, pipelines, frames=2)
    _, model, _ = adapt(logged, path, pipelines, frames=2, source="patch")
    assert model.source == "patch"
    assert any("by the reference patch" in text for text in model.warnings)


def test_a_variant_that_cannot_learn_further_is_refused(tmp_path):
    path = tmp_path / "city.model"
    save_model(fit([frame(0)], PIPELINES, TrainingSettings()), path)
    with pytest.raises(
        TrainingError, match=r"no stage of it can learn further \(similarity, svm\)"
    ):
        adapt(log(4), path, PIPELINES, frames=2)
