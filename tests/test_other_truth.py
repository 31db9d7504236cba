"""`run` against pictures and forces that neither `synthetic` nor `whiskermodel` has made."""

import numpy as np
import plain_video as plain
import pytest
import tifffile

from pipeline import cli, tables
from pipeline.records import CONTACT_COLUMNS

SCALE = 25.0  # px/mm
SHAPE = 380, 460  # px
FOLLICLE = np.array([30.0, 200.0])  # px
HIDDEN_MM = 1.2
FRAMES = 120
TOUCHED_AT = 10e-3  # m from the follicle
FORCE = 0.015  # relative, of the peak force and moment
MEDIAN_PX = 0.02  # of a point's distance from the true centreline
MOST_PX = 0.08  # of 95 in 100 points
ARC_MM = 0.06  # of the place of touch

SESSION = """[recording]
frames_per_second = 1000.0
pixels_per_mm = {scale}
face = "{side}"

[[whisker]]
name = "C2"
length_mm = {length}
cone_length_mm = {cone}
base_radius_um = {radius}
youngs_modulus_GPa = {young}
density_kg_per_m3 = 1000.0
damping_per_s = 215.0
hidden_length_mm = {hidden}

[pole]
diameter_mm = 0.5
"""


def light_with_face():
    """Even light, and a dark face with a soft edge that hides HIDDEN_MM of the whisker."""
    columns = np.indices(SHAPE)[1]
    edge = FOLLICLE[0] + HIDDEN_MM * SCALE
    return 200 * (0.1 + 0.9 / (1 + np.exp(-(columns - edge) / 1.5)))


class Filmed:
    """A whisker that sweeps into a pole and back, three times, and what `run` makes of it."""

    def __init__(self, folder, side, light, hidden_mm):
        angles = -0.1 + 0.16 * np.cos(2 * np.pi * np.arange(FRAMES) / 40)
        self.pole = plain.pole_beside(-0.15, TOUCHED_AT)
        contact_angle = plain.touching_angle(self.pole, -0.3, 0.1)
        self.points, self.touches = plain.shapes(angles, self.pole, contact_angle)
        self.points_px = FOLLICLE + 1e3 * SCALE * self.points
        pole_px = FOLLICLE + 1e3 * SCALE * self.pole
        video = np.array(list(plain.pictures(self.points_px, pole_px, SCALE, light)))
        if side == "bottom":
            video = video.transpose(0, 2, 1)[:, ::-1]
            self.points_px = np.stack(
                [self.points_px[..., 1], SHAPE[1] - 1 - self.points_px[..., 0]], axis=-1
            )
        tifffile.imwrite(folder / "whisker.tif", video)
        (folder / "session.toml").write_text(
            SESSION.format(
                scale=SCALE, side=side, hidden=hidden_mm, length=1e3 * plain.LENGTH,
                cone=1e3 * plain.CONE, radius=1e6 * plain.BASE_RADIUS, young=1e-9 * plain.YOUNG,
            )
        )  # fmt: skip
        with pytest.raises(SystemExit) as caught:
            cli.main(["run", str(folder), "--out", str(folder / "out"), "--jobs", "1"])
        assert not caught.value.code
        self.out = folder / "out"

    def true_contacts(self):
        """First and last frame and peak touch of every contact."""
        touching = np.array([touch is not None for touch in self.touches])
        starts = np.flatnonzero(np.diff(touching.astype(int), prepend=0) > 0)
        stops = np.flatnonzero(np.diff(touching.astype(int), append=0) < 0) + 1
        for a, b in zip(starts, stops, strict=True):
            yield a, b, max(self.touches[a:b], key=lambda touch: touch.force)


@pytest.fixture(scope="module", params=["face on the left", "no face, from the bottom"])
def filmed(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("plain")
    if "no face" in request.param:
        return Filmed(folder, "bottom", np.full(SHAPE, 200.0), 0.0)
    return Filmed(folder, "left", light_with_face(), HIDDEN_MM)


def test_contacts_and_forces(filmed):
    found = tables.read_csv(filmed.out / "contacts.csv", CONTACT_COLUMNS)
    true = list(filmed.true_contacts())
    assert len(true) == len(found) == 3
    for (onset, offset, peak), (_, row) in zip(true, found.iterrows(), strict=True):
        assert abs(row["onset_frame"] - onset) <= 1
        assert abs(row["offset_frame"] - offset) <= 1
        assert row["peak_force_uN"] == pytest.approx(1e6 * peak.force, rel=FORCE)
        assert abs(row["peak_base_moment_nN_m"]) == pytest.approx(1e9 * peak.moment, rel=FORCE)
        assert row["contact_arc_length_mm"] == pytest.approx(1e3 * peak.arc, abs=ARC_MM)


def test_centrelines(filmed):
    (path,) = filmed.out.glob("*/centrelines.parquet")
    lines = tables.read_centrelines(path)
    assert len(lines) == FRAMES
    off = []
    for frame, x, y in zip(lines.frame, *_each(lines), strict=True):
        off.append(_distance(np.column_stack([x, y]), filmed.points_px[frame]))
    off = np.concatenate(off)
    assert np.median(off) < MEDIAN_PX
    assert np.quantile(off, 0.95) < MOST_PX


def _each(lines):
    cuts = lines.offsets[1:-1]
    return np.split(lines.x_px, cuts), np.split(lines.y_px, cuts)


def _distance(points, line):
    """Distances (n,) of points from the pieces of a finely sampled line."""
    k = np.hypot(*(points[:, None] - line[None]).transpose(2, 0, 1)).argmin(axis=1)
    k = np.clip(k, 1, len(line) - 2)
    along = line[k + 1] - line[k - 1]
    away = points - line[k]
    return np.abs(away[:, 0] * along[:, 1] - away[:, 1] * along[:, 0]) / np.hypot(*along.T)
