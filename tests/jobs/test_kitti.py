"""KITTI's road benchmark: a folder becomes a log, and gets the rates of the development kit.

The kit's rule is written here a second time, from its definition. Two calibrations are KITTI's own
numbers; images, truth and results are made up.
"""

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

import roadeval
from roadeval import RoadevalError
from roadeval.logs.log import open_log
from roadeval.report.sections.ground import kitti_table
from roadeval.results.facts import Facts
from tests.fixtures.logged import frames_in
from tests.jobs.making import settings

P2 = (721.5377, 0, 609.5593, 44.85728, 0, 721.5377, 172.854, 0.2163791, 0, 0, 1, 0.002745884)
R0 = (
    *(0.9999239, 0.00983776, -0.007445048, -0.009869795, 0.9999421, -0.004278459),
    *(0.007402527, 0.004351614, 0.9999631),
)
ROADS = (
    (
        *(0.9999570839814, -0.005508724949246, -0.007452906591504, 0.009610489538319),
        *(0.005425697507328, 0.9999234779341, -0.01111504746388, -1.597134401910),
        *(0.007513565886504, 0.01107413060494, 0.9999104059534, 0.2788606298060),
    ),
    (
        *(0.9999044710077, -0.01170165577363, -0.007360826724365, 0.01911984983337),
        *(0.01160251828357, 0.9998432738993, -0.01336987011872, -1.562198078590),
        *(0.007516122576373, 0.01328318612284, 0.9998834806284, 0.27527298918),
    ),
)
NAMES = {"um_000000": (1242, 375), "umm_000003": (1226, 370), "uu_000007": (1241, 376)}
NAMES |= {"uu_000010": (1238, 374)}
THRESHOLDS = np.arange(256) / 255
Array = npt.NDArray[np.generic]


def calibration(place: int) -> str:
    matrices = {"P0": P2, "P2": P2, "R0_rect": R0, "Tr_cam_to_road": ROADS[place % 2]}
    return "".join(f"{n}: {' '.join(map(str, m))}\n" for n, m in matrices.items())


def write(path: Path, image: Array) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), image)


@pytest.fixture(scope="module")
def kitti(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder as KITTI unpacks it, with a method's masks and another's confidences."""
    base, rng = tmp_path_factory.mktemp("kitti"), np.random.default_rng(4)
    for place, (name, (width, height)) in enumerate(NAMES.items()):
        rows, columns = np.mgrid[:height, :width]
        aside = np.abs(columns - width / 2 - 30 * np.sin(rows / 40 + place))
        road = (rows > 190) & (aside < 2.2 * (rows - 170))
        evaluated = (rows > 150) & (np.abs(columns - 400) > 30)
        truth = np.zeros((height, width, 3), np.uint8)
        truth[..., 2], truth[..., 0] = 255 * evaluated, 255 * (road & evaluated)
        noise = cv2.resize(rng.normal(0, 0.3, (height // 16, width // 16)), (width, height))
        score = np.clip(cv2.blur(road.astype(float), (31, 31)) + noise, 0, 1)
        kind, number = name.split("_")
        training = base / "training"
        write(training / f"image_2/{name}.png", np.full((height, width, 3), 90, np.uint8))
        write(training / f"gt_image_2/{kind}_road_{number}.png", truth)
        write(base / f"masks/{kind}_road_{number}.png", 255 * (score > 0.5).astype(np.uint8))
        write(base / f"levels/{kind}_road_{number}.png", (255 * score).astype(np.uint8))
        (training / "calib").mkdir(exist_ok=True)
        (training / f"calib/{name}.txt").write_text(calibration(place))
    write(training / "gt_image_2/um_lane_000000.png", np.zeros((375, 1242, 3), np.uint8))
    return base


def from_above(image: Array, place: int) -> Array:
    """Sample an image at 800 x 400 cells as the kit does; zeros where it sees nothing."""
    to_road = np.vstack([np.reshape(ROADS[place % 2], (3, 4)), [0, 0, 0, 1]])
    rectify = np.eye(4)
    rectify[:3, :3] = np.reshape(R0, (3, 3))
    projection = np.reshape(P2, (3, 4)) @ rectify @ np.linalg.inv(to_road)
    z, x = np.meshgrid(46 - 0.05 * (np.arange(800) + 0.5), 0.05 * (np.arange(400) + 0.5) - 10)
    u, v, w = projection @ np.stack([x, 0 * x, z, 0 * x + 1]).reshape(4, -1)
    u, v = u / w, v / w  # of pixels that count from 1
    height, width = image.shape[:2]
    seen = np.zeros((u.size, *image.shape[2:]), image.dtype)
    inside = (u >= 1) & (v >= 1) & (u <= width) & (v <= height)
    seen[inside] = image[v[inside].astype(int) - 1, u[inside].astype(int) - 1]
    return seen


def rates_of(base: Path, results: str, kinds: tuple[str, ...]) -> dict[str, float]:
    """Add up errors at each threshold over the frames of some categories."""
    missed, false, road, other = np.zeros(256), np.zeros(256), 0, 0
    for place, name in enumerate(NAMES):
        kind, number = name.split("_")
        if kind in kinds:
            file = f"{kind}_road_{number}.png"
            truth = from_above(cv2.imread(str(base / "training/gt_image_2" / file)), place)
            level = from_above(cv2.imread(str(base / results / file), 0), place) / 255
            is_road = (truth[:, 0] > 0) & (truth[:, 2] > 0)
            is_other = (truth[:, 0] == 0) & (truth[:, 2] > 0)
            missed += (level[is_road, None] < THRESHOLDS).sum(axis=0)
            false += (level[is_other, None] >= THRESHOLDS).sum(axis=0)
            road, other = road + is_road.sum(), other + is_other.sum()
    recall = (road - missed) / road
    precision = (road - missed) / (road - missed + false + 1e-10)
    f = 2 * precision * recall / (precision + recall + 1e-10)
    best = int(f.argmax())
    return {
        "MaxF": f[best],
        "AP11": np.mean([precision[recall >= k].max() for k in np.linspace(0, 1, 11)]),
        "precision": precision[best],
        "recall": recall[best],
        "FPR": false[best] / other,
        "FNR": missed[best] / road,
    }


@pytest.fixture(scope="module")
def outcome(kitti: Path) -> roadeval.Outcome:
    roadeval.pack(kitti / "training", kitti / "kitti.mcap")
    masks = {name: {"path": str(kitti / name)} for name in ("masks", "levels")}
    config = settings(record="none", jobs=1).override({"masks": masks, "only": [*masks]})
    config = config.override({"output": {"figures": False}})
    return roadeval.replay(kitti / "kitti.mcap", config, reports=kitti / "reports")


def test_a_folder_becomes_a_log_with_a_calibration_a_frame(kitti: Path, outcome: object) -> None:
    frames = frames_in(kitti / "kitti.mcap")
    assert {frame.name: frame.image.shape[1::-1] for frame in frames} == NAMES
    truth = cv2.imread(str(kitti / "training/gt_image_2/uu_road_000007.png"))
    expected = np.where(truth[..., 2] > 0, truth[..., 0] > 0, 255)
    assert np.array_equal(frames[2].truth, expected)
    lens = frames[1].calibration
    assert lens is not None
    assert lens.mounting is not None
    assert (lens.width, lens.height, lens.matrix[2]) == (1226, 370, 609.5593)
    assert lens.mounting.translation[2] == pytest.approx(1.56, abs=0.01)


def test_an_excerpt_keeps_the_names_of_its_images(kitti: Path, tmp_path: Path) -> None:
    roadeval.pack(kitti / "training", tmp_path / "slow.mcap", rate_hz=0.4)
    with open_log(tmp_path / "slow.mcap", every_topic=True) as log:
        frames = [*log.frames(log.select())]
        log.write_excerpt("/camera/image", 2, 3, tmp_path / "part.mcap")
    with open_log(tmp_path / "part.mcap") as log:
        part = [*log.frames(log.select())]
    assert [frame.decode().name for frame in part] == [*NAMES][2:]
    assert [frame.calibration for frame in part] == [frame.calibration for frame in frames[2:]]


@pytest.mark.parametrize("name", ["masks", "levels"])
@pytest.mark.parametrize("category", ["UM", "UMM", "UU", "URBAN"])
def test_the_rates_are_those_of_the_kit(
    kitti: Path, outcome: roadeval.Outcome, name: str, category: str
) -> None:
    kinds = ("um", "umm", "uu") if category == "URBAN" else (category.lower(),)
    rates = dict(outcome.summary["kitti"][name][category])
    assert rates.pop("frames") == {"UU": 2, "URBAN": 4}.get(category, 1)
    assert rates == pytest.approx(rates_of(kitti, name, kinds), abs=1e-5)  # of 1, not of 100


def test_the_table_is_that_of_the_kit(outcome: roadeval.Outcome) -> None:
    table = kitti_table(Facts.read(Path(str(outcome.reports)) / "summary.json"))
    assert [line[1] for line in table.rows] == 2 * ["UM", "UMM", "UU", "URBAN"]
    rate = outcome.summary["kitti"]["levels"]["UU"]["MaxF"]
    assert dict(zip(table.columns, table.rows[6], strict=True))["MaxF"] == f"{100 * rate:.2f}"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (None, "No such file"),
        (calibration(0)[:-90], "it has no line Tr_cam_to_road of 12 numbers"),
        (calibration(0).replace("R0_rect: 0.9", "R0_rect: 0.5"), "of R0_rect fit no camera"),
        (calibration(0).replace("721.5377", "0"), "of P2 fit no camera"),
    ],
)
def test_a_broken_calibration_is_refused(kitti: Path, text: str | None, reason: str) -> None:
    file = kitti / "training/calib/umm_000003.txt"
    whole = file.read_text()
    file.unlink() if text is None else file.write_text(text)
    try:
        with pytest.raises(RoadevalError, match=rf"umm_000003\.txt: .*{reason}"):
            roadeval.pack(kitti / "training", kitti / "broken.mcap")
    finally:
        file.write_text(whole)
