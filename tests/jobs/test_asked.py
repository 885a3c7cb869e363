"""The command line that asks the same of a log again."""

from importlib import import_module

from roadeval.cli.app import main
from roadeval.jobs.asked import typed
from roadeval.jobs.options import ReplayOptions
from roadeval.jobs.provenance import selection


def test_what_was_not_asked_is_not_typed():
    assert list(typed(selection(ReplayOptions()))) == []


def test_every_option_is_typed_as_the_terminal_reads_it(monkeypatch):
    options = ReplayOptions(
        image_topic="/cam",
        truth_topic="/truth",
        shadow_topic="/shade",
        mask_topics={"net": "/net/mask"},
        road_labels=(3, 4),
        ignore_labels=(11,),
        start="1.5",
        end="9",
        every=2,
        max_frames=50,
        sync_tolerance_ms=12.5,
        keep_corrupt=True,
        resize_truth=True,
        scale=0.5,
    )
    seen = []

    def replay(drive, *, options, **rest):
        seen.append(options)
        raise KeyboardInterrupt

    monkeypatch.setattr(import_module("roadeval.jobs.replay"), "replay", replay)
    main(["replay", "d.mcap", *typed(selection(options))])
    assert [selection(each) for each in seen] == [selection(options)]
    # All that can be asked, but for colours, which do not go with labels.
    asked = {name for name, value in selection(options).items() if value not in (None, (), {})}
    assert asked | {"road_colors", "ignore_colors"} == set(selection(options))


def test_0_is_asked_for():
    asked = selection(ReplayOptions(sync_tolerance_ms=0.0))
    assert list(typed(asked)) == ["--sync-tolerance", "0.0"]


def test_colours_are_typed_with_commas():
    asked = {"road_colors": [[128, 64, 128]], "ignore_colors": [(0, 0, 0)]}
    words = ["--road-color", "128,64,128", "--ignore-color", "0,0,0"]
    assert list(typed(asked)) == words
