"""``roadeval clip`` of the demo: five films, which a browser plays in their colours."""

import io
import json

import av
import numpy as np
import pytest
from PIL import Image

from tests.e2e.commands import here, roadeval
from tests.fixtures.browser import missing, wait_until


def test_the_demo_gives_five_clips_and_the_messages_of_each(demo, tmp_path):
    run = roadeval("clip", demo.recording, "--mcap", cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    names = [f"clips/demo-00{frame}" for frame in (80, 71, 13, 21, 32)]
    assert run.stdout == "".join(f"{name}.mp4, {name}.mcap\n" for name in names)
    assert "filming: 45 of 45 frames" in run.stderr
    assert len([*(tmp_path / "clips").iterdir()]) == 10
    about = json.loads(here("info", tmp_path / "clips" / "demo-0080.mcap", "--json").stdout)
    assert {topic["name"]: topic["count"] for topic in about["topics"]} == dict.fromkeys(
        ("/camera/image", "/truth/road", "/truth/shadow"), 13
    )


@pytest.mark.sweep
@pytest.mark.skipif(bool(missing()), reason=missing())
def test_a_clip_plays_in_a_browser_in_its_colours(demo, tmp_path, watched):
    run = here("clip", demo.recording, "-o", tmp_path / "film.mp4", "-q")
    assert run.returncode == 0, run.stderr
    with av.open(str(tmp_path / "film.mp4")) as video:
        pictures = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
    (tmp_path / "page.html").write_text(
        "<style>body { margin: 0 }</style><video src=film.mp4 muted></video>"
    )
    seen = watched((tmp_path / "page.html").as_uri())
    tab = seen.tab
    video = "document.querySelector('video')"
    wait_until(tab, f"{video}.readyState == 4")
    tab.evaluate(f"() => {{ {video}.currentTime = 2.25 }}")
    wait_until(tab, f"!{video}.seeking")
    shown = np.array(Image.open(io.BytesIO(tab.locator("video").screenshot())).convert("RGB"))
    assert shown.shape == pictures[4].shape
    assert np.abs(shown.astype(int) - pictures[4]).mean() < 2
    tab.evaluate(f"() => {video}.play()")
    wait_until(tab, f"{video}.ended")
    assert tab.evaluate(f"{video}.duration") == pytest.approx(len(pictures) / 2)
    assert seen.complaints == []
