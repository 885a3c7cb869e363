"""The paper's figures of a result, as files for a text."""

import pytest

import roadeval
from roadeval import RoadevalError
from tests.fixtures.figures import drawn
from tests.jobs.making import settings, write_log
from tests.results.fleet.making import fleet_of

RATES = ["fig3a_error_rate.pdf", "fig3a_error_rate.svg", "fig3b_fp_fn_rate.pdf"]
RATES += ["fig3b_fp_fn_rate.svg"]


def test_figures_of_a_recording_have_pictures_and_those_of_its_folder_have_rates(tmp_path):
    drive = write_log(tmp_path / "small.mcap")
    made = roadeval.replay(
        drive, settings(max_frames=14), save=tmp_path / "a.rrd", reports=tmp_path / "a"
    )
    with drawn():
        of_recording = roadeval.write_figures(made.recording, tmp_path / "one", width="8.5cm")
        of_folder = roadeval.write_figures(made.reports, tmp_path / "other", title="none")
    assert [path.name for path in of_recording] == ["fig2_masks.pdf", "fig2_masks.svg", *RATES]
    assert [path.name for path in of_folder] == RATES
    assert "on small</text>" in of_recording[3].read_text()
    assert "on small" not in of_folder[1].read_text()


def test_a_fleet_has_no_figures(tmp_path):
    with pytest.raises(RoadevalError) as caught:
        roadeval.write_figures(fleet_of(tmp_path / "f", 2), tmp_path / "figures")
    assert caught.value.problem == "figures are of one drive"
    assert not (tmp_path / "figures").exists()


@pytest.mark.parametrize("width", ["8.5", "cm", "3cm", "9km", "nanmm", "1e9in"])
def test_a_width_without_sense_is_refused_before_anything_is_read(width, tmp_path):
    with pytest.raises(RoadevalError, match=f"^{width} is not a width of a figure; write it as"):
        roadeval.write_figures("not there", tmp_path, width=width)
