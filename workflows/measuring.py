"""One rendered video, processed as by `whiskerforce run`, compared with its truth."""

import os
import secrets
import zlib
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.contacts import ContactOptions, find_contacts
from pipeline.run import analyse
from pipeline.runtime.workers import THREADS, end_with_parent
from pipeline.session.session_file import read_session
from pipeline.tables.centrelines import Centrelines, read_centrelines
from pipeline.tables.columns import CONTACT_COLUMNS
from pipeline.tables.files import read_csv, read_frames
from pipeline.tables.whole_files import read_json
from synthetic.scene import Camera, Hair
from synthetic.scoring import cramer_rao, line_scoring, table_scoring
from whiskermodel.whisker import Whisker

NOISE_FLOOR_AT_M = 10e-3
NOISE_FLOOR_M = (7.5e-3, 13e-3)  # where the pole is nearest in the free frames that count
BESIDE_POLE_PX = 12.0  # from the pole's edge
LIGHT = 176.0  # grey levels above black, where a picture's noise is measured
ONE_THREAD = (*THREADS, "NUMBA_NUM_THREADS")


def limit_threads() -> None:
    """One thread per process, for this one's children too; call it before numpy computes."""
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))


def of_each(function, jobs: int, *arguments):
    """Yield `function` of each set of arguments, as `map` does; by several processes if `jobs`."""
    if jobs == 1:
        yield from map(function, *arguments)
        return
    with ProcessPoolExecutor(jobs, get_context("spawn"), end_with_parent) as pool:
        yield from pool.map(function, *arguments)


def add_seed(parser, of: str) -> None:
    """Add `--seed` to a program's arguments; where none is given, a new one is drawn."""
    parser.add_argument(
        "--seed", type=int, default=secrets.randbits(31), help=f"{of} (default: a new one)"
    )


def video_seeds(preset: str, seed: int, videos: int) -> list[int]:
    """A seed for each of some videos of a preset, drawn from one `seed` for all presets."""
    drawn = np.random.SeedSequence([seed, zlib.crc32(preset.encode())])
    return [int(each) for each in drawn.generate_state(videos) >> 1]


# Truth ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class RenderedVideo:
    """A video of `synthetic.session.render_session` with its session's truth folder."""

    path: Path
    folder: Path

    @classmethod
    def of(cls, path, session):
        """The video at `path` in the rendered session `session`."""
        return cls(Path(path), Path(session) / "truth" / Path(path).stem)

    @property
    def scene(self) -> dict:
        """The scene as synthetic.truth wrote it."""
        return read_json(self.folder / "scene.json")

    @property
    def camera(self) -> Camera:
        """The scene's camera."""
        return Camera(**self.scene["camera"])

    @property
    def hairs(self) -> dict[str, Hair]:
        """The scene's whiskers by name."""
        hairs = {}
        for each in self.scene["hairs"]:
            whisker = Whisker(**each["whisker"])
            bend = tuple(each["intrinsic_curvature"])
            hairs[whisker.name] = Hair(**{**each, "whisker": whisker, "intrinsic_curvature": bend})
        return hairs

    @property
    def settings(self):
        """The session.toml beside the video."""
        return read_session(self.path.parent / "session.toml")

    @property
    def noise_sd(self) -> float:
        """Noise of the bright background [grey levels]."""
        camera = self.camera
        return float(np.sqrt(camera.read_noise**2 + camera.noise_gain * LIGHT))

    def frames(self) -> pd.DataFrame:
        """True frames table."""
        return read_frames(self.folder / "frames.parquet")

    def contacts(self) -> pd.DataFrame:
        """True contacts."""
        return read_csv(self.folder / "contacts.csv", CONTACT_COLUMNS)

    def visibility(self) -> pd.DataFrame:
        """What can be seen of every whisker."""
        return pd.read_parquet(self.folder / "visibility.parquet")

    def lines(self) -> line_scoring.Truth:
        """True centrelines and which of their points can be seen."""
        lines = read_centrelines(self.folder / "centrelines.parquet")
        scale = self.camera.pixels_per_mm
        return line_scoring.visible_truth(lines, self.visibility(), scale, self.noise_sd)


def _bounds(video: RenderedVideo, name, at, last=None) -> dict[str, float]:
    """Bounds on the SD of one whisker's curvature [1/m], by model.

    It touches a pole at `last` [m]; empty where it is too short.
    """
    hair, camera, visibility = video.hairs[name], video.camera, video.visibility()
    own = visibility[visibility["whisker"] == name]
    first = 1e-3 * float(own["first_visible_mm"].median())
    contrast = np.stack(own["contrast"].iloc[:: max(len(own) // 50, 1)].to_list())
    place = round(at / hair.whisker.length * (contrast.shape[1] - 1))
    seen = contrast[:, place][contrast[:, place] > 0]
    if hair.whisker.length < at + 3e-3 or not len(seen):
        return {}
    radius = hair.whisker.radius(at) * camera.pixels_per_m
    peak = cramer_rao.line_profile(radius, camera.blur_px)[1].max()
    light = float(np.median(seen)) / (hair.opacity * peak)
    return cramer_rao.curvature_bounds(hair, light, camera, at, first, last)


def add_least_sd(joined, video: RenderedVideo, at: float) -> pd.DataFrame:
    """Add the bound of every frame; of one in contact, the bound up to the contact.

    `least_sd` and `least_sd_knots` [1/m] are the quadratic's over ±2 mm and the one with knots
    3 mm apart; NaN where the contact leaves less than 0.75 mm beyond `at`.
    """
    joined = joined.copy()
    models = {"least_sd": "quadratic ±2 mm", "least_sd_knots": "knots 3 mm"}
    joined[list(models)] = np.nan
    ends = at + np.array([0.75e-3, 1e-3, 1.5e-3, 2e-3, 2.5e-3, 3e-3, 4e-3])
    contact = 1e-3 * joined["true_contact_arc_length_mm"].to_numpy(float)
    contact = np.where(np.isfinite(contact), contact, np.inf)
    for name in video.hairs:
        free = _bounds(video, name, at)
        if not free:
            continue
        own = (joined["whisker"] == name).to_numpy()
        near = [
            _bounds(video, name, at, end) if end < video.hairs[name].whisker.length else free
            for end in (ends if np.isfinite(contact[own]).any() else ())
        ]
        for column, model in models.items():
            table = [each[model] for each in near] or [free[model]] * len(ends)
            value = np.interp(contact[own], ends, table, left=np.nan, right=free[model])
            joined.loc[own, column] = value
    return joined


# Results -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Measured:
    """One video's results beside its truth.

    Attributes
    ----------
    preset, video, pixels_per_mm : which one, and its scale
    n_frames, messages, seconds : as in pipeline.run.Analysis
    scores : of the centrelines
    lines : a row per traced line, scores.rows with `confidence` and `angle_error_deg`
    beside_pole : bool, aligned with scores.distance_px
    shape, point : the two force estimates, as `Forces`
    """

    preset: str
    video: str
    pixels_per_mm: float
    n_frames: int
    messages: tuple[str, ...]
    seconds: dict
    scores: line_scoring.LineScores
    lines: pd.DataFrame
    beside_pole: np.ndarray
    shape: "Forces"
    point: "Forces"


@dataclass(frozen=True)
class Forces:
    """One force estimate: frames beside the truth's, contacts, and force of free frames [µN].

    `joined` also has `least_sd` and `least_sd_knots` [1/m], the bounds on the curvature's SD for
    a quadratic over ±2 mm and for any shape with knots 3 mm apart.
    """

    joined: pd.DataFrame
    contacts: pd.DataFrame
    true_contacts: pd.DataFrame
    free_force: np.ndarray = field(default_factory=lambda: np.empty(0))


def measure(preset: str, path, session, settings=None) -> Measured:
    """Process one rendered video, by its own or other settings, beside the truth."""
    video = RenderedVideo.of(path, session)
    settings, chunks = settings or video.settings, []
    at = settings.analysis.curvature_at
    analysis = analyse(path, settings, keep=chunks.append)
    truth = video.lines()
    traced = join_chunks(chunks)
    scores = line_scoring.score_lines(traced, truth)
    true_frames, true_contacts = video.frames(), video.contacts()
    stem = Path(path).stem
    found = {}
    for method in ("shape", "point"):
        frames, contacts = _by_method(method, analysis, settings, stem)
        joined = add_least_sd(table_scoring.join_frames(frames, true_frames), video, at)
        found[method] = Forces(
            joined.assign(preset=preset, video=stem),
            contacts.assign(video=stem),
            true_contacts,
            free_force(analysis.evidence, true_frames, method, at),
        )
    return Measured(
        preset=preset,
        video=stem,
        pixels_per_mm=settings.recording.pixels_per_mm,
        n_frames=analysis.n_frames,
        messages=analysis.messages,
        seconds=dict(analysis.seconds),
        scores=scores,
        lines=line_table(scores, traced, analysis.frames, true_frames),
        beside_pole=beside_pole(scores, truth, video),
        **found,
    )


def _by_method(method, analysis, settings, stem):
    """Frames and contacts by one of the force estimates; those of `analysis` are by "shape"."""
    if method == "shape":
        return analysis.frames, analysis.contacts
    whiskers = {w.name: w.si() for w in settings.whisker}
    at = settings.analysis.curvature_at
    tables = find_contacts(
        analysis.frames, analysis.evidence, settings.recording.si(), whiskers,
        ContactOptions(at, method, video=stem, params=settings.advanced),
    )  # fmt: skip
    return tables.frames, tables.contacts


def line_table(scores, traced: Centrelines, frames, true_frames) -> pd.DataFrame:
    """`scores.rows` with each line's `confidence`, base angle and its error, −180 to 180.

    The base angle is compared with that of the whisker that the line lies on, whatever it is
    called; NaN where the line lies on none or has no base angle.
    """
    columns = ["frame", "whisker", "base_angle_deg"]
    measured = _plain(frames[[*columns, "base_angle_se_deg"]])
    rows = scores.rows.assign(confidence=traced.confidence)
    rows = rows.merge(measured, on=["frame", "whisker"], how="left")
    true = _plain(true_frames[columns]).rename(
        columns={"whisker": "nearest", "base_angle_deg": "true_angle_deg"}
    )
    rows = rows.merge(true, on=["frame", "nearest"], how="left")
    error = rows["base_angle_deg"] - rows["true_angle_deg"]
    return rows.assign(angle_error_deg=(error.astype(float) + 180) % 360 - 180)


def _plain(angles):
    """Frames and whiskers as plain integers and text, so that tables can be joined."""
    measured = angles.columns.difference(["frame", "whisker"])
    return angles.astype({"frame": int, "whisker": object} | dict.fromkeys(measured, float))


def join_chunks(chunks: list[Centrelines]) -> Centrelines:
    """One `Centrelines` out of consecutive ones of the same whiskers."""
    if not chunks:
        empty = np.empty(0, np.float32)
        none = np.empty(0, np.int32)
        return Centrelines((), none, none, np.zeros(1, np.int64), empty, empty, empty, empty)
    sizes = np.concatenate([np.diff(c.offsets) for c in chunks])

    def joined(name):
        return np.concatenate([getattr(c, name) for c in chunks])

    return Centrelines(
        names=chunks[0].names,
        offsets=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        **{name: joined(name) for name in ("frame", "whisker", "x_px", "y_px")},
        **{name: joined(name) for name in ("se_px", "confidence")},
    )


def beside_pole(scores, truth: line_scoring.Truth, video: RenderedVideo) -> np.ndarray:
    """Which of the scored points lie within BESIDE_POLE_PX of the edge of a pole at rest."""
    pole, scale = video.scene["pole"], video.camera.pixels_per_m
    if pole is None:
        return np.zeros(len(scores.node), bool)
    x, y = truth.lines.x_px[scores.node], truth.lines.y_px[scores.node]
    distance = np.hypot(x - pole["x"] * scale, y + pole["y"] * scale)
    return distance < pole["radius"] * scale + BESIDE_POLE_PX


def free_force(evidence, true_frames, method, curvature_at) -> np.ndarray:
    """What the force would be [µN] in truly free frames, as if the pole were at 10 mm.

    A force follows from the moment behind it, so that its noise falls with the lever: each is
    multiplied by (c − s_p) / (10 mm − s_p) with c the place nearest to the pole.
    """
    column = f"{method}_force_N"
    if column not in evidence:
        return np.empty(0)
    free = true_frames.loc[~true_frames["in_contact"].astype(bool), ["frame", "whisker"]]
    part = evidence.merge(free, on=["frame", "whisker"])
    part = part[part["nearest_m"].between(*NOISE_FLOOR_M)]
    lever = (part["nearest_m"] - curvature_at) / (NOISE_FLOOR_AT_M - curvature_at)
    force = 1e6 * (part[column] * lever).to_numpy(float)
    return force[np.isfinite(force)]
