"""The record of one video's results."""

import pytest

from pipeline.tables.run_record import found_video


@pytest.mark.parametrize("recorded", ["/lab/videos/a.avi", r"C:\lab\videos\a.avi", "a.avi"])
@pytest.mark.parametrize("place", [".", ".."])
def test_a_video_is_found_beside_results_that_come_from_another_computer(
    tmp_path, recorded, place
):
    folder = tmp_path / "results" / "a"
    folder.mkdir(parents=True)
    assert str(found_video(folder, recorded)) == recorded
    there = (folder.parent / place).resolve() / "a.avi"
    there.touch()
    assert found_video(folder, recorded) == there
    assert str(found_video(folder, "/lab/images/a")) == "/lab/images/a"  # not the results
