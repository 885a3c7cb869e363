"""The images and masks of disturbed frames: their paths, and their tab in the viewer."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
import rerun.blueprint as rrb

from roadeval.data import VariantLayout, mask_spec
from roadeval.recording.codecs import codecs_of
from roadeval.recording.layout import Layout, RecordingError
from roadeval.recording.views import arrange

POST = mask_spec("post", "Road mask")
VARIANTS = tuple(VariantLayout(name, "", ("post",), (POST,)) for name in ("net", "masks"))
LAYOUT = Layout("d", 64, 48, VARIANTS, ("ERR",), disturbed={"fog-2": ("net",)})
PATHS = [f"/disturbed/fog-2/{name}" for name in ("camera", "net/post", "net/errors")]


def views_in(part: Any) -> Iterator[Any]:
    if isinstance(part, rrb.View):
        yield part
    else:
        for inner in part.contents:
            yield from views_in(inner)


def test_only_variants_that_run_on_disturbed_images_have_masks_there():
    assert sorted(p for p in codecs_of(LAYOUT) if "disturbed" in p) == sorted(PATHS)
    assert Layout.from_json(LAYOUT.to_json()) == LAYOUT


@pytest.mark.parametrize("prefix", ["", "/front"])
def test_the_tab_shows_errors_over_the_disturbed_image(prefix):
    shown = [view.contents for view in views_in(arrange({prefix: LAYOUT}).root_container)]
    assert [prefix + PATHS[0], prefix + PATHS[2]] in shown
    plain = arrange({prefix: replace(LAYOUT, disturbed={})}).root_container
    assert not any("disturbed" in str(view.contents) for view in views_in(plain))


def test_no_variant_has_the_name_of_their_path():
    variant = replace(VARIANTS[0], name="disturbed")
    with pytest.raises(RecordingError, match="cannot be named 'disturbed'"):
        replace(LAYOUT, variants=(variant,), disturbed={})
