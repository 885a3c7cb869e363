"""Training on several drives whose truths have values of their own."""

import pytest

import roadeval
from roadeval import RoadevalError
from tests.jobs.making import settings, write_log

CODES = "labels = { road = [3] }"


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """Two drives with the same frames: one truth is a 0/255 mask, one holds class ids."""
    folder = tmp_path_factory.mktemp("drives")
    mask = write_log(folder / "mask.mcap")
    return mask, write_log(folder / "ids.mcap", codes=(5, 3))


def train(paths, folder, **options):
    made = settings(train_frames=3, **options)
    return roadeval.train(paths, folder / "m.model", made)


def described(drive, tables):
    """Write a manifest of a drive beside it."""
    path = drive.with_suffix(".toml")
    path.write_text(f'[[drives]]\npath = "{drive.name}"\n{tables}\n')
    return path


def test_a_drive_may_have_labels_of_its_own(drives, tmp_path):
    model = train([drives[0], described(drives[1], CODES)], tmp_path)
    assert model.warnings == ()
    # Road and non-road are the same pixels in both, so either drive alone gives the same prior.
    assert (model.prior == train(drives[:1], tmp_path).prior).all()


def test_labels_of_its_own_that_do_not_occur_are_refused(drives, tmp_path):
    wrong = described(drives[0], "labels = { road = [4] }")
    with pytest.raises(RoadevalError, match=r"4 does not occur .*0 255$") as refused:
        train([wrong, drives[1]], tmp_path, road=[3])
    assert (refused.value.where, refused.value.setting) == ("mask.mcap", "labels.road")


def test_what_is_lost_of_a_log_is_told(tmp_path):
    split = tmp_path / "split"
    split.mkdir()
    write_log(split / "split_0.mcap")
    (split / "split_1.mcap").write_bytes(b"no log")
    (split / "metadata.yaml").write_text("rosbag2_bagfile_information:\n  version: 9\n")
    losses = train([split], tmp_path).losses
    assert [loss.partition(": ")[0] for loss in losses] == [
        "split_1.mcap",
        "/camera/image",
        "/truth/road",
    ]


def test_a_drive_of_which_no_training_frame_can_be_decoded_is_refused(tmp_path):
    broken = write_log(tmp_path / "broken.mcap", broken=0)
    with pytest.raises(RoadevalError, match=r"broken.mcap: no training frame .*: frame 0: 8 bytes"):
        train([broken], tmp_path, max_frames=1)
