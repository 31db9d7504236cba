"""Follow the lines of whiskers from frame to frame, not knowing which is which.

Every line that leaves the face and is strong enough gets a track of its own, with a number that
no other track ever has; where a line is lost, its track ends. Which tracks are which whisker's is
decided when the whole video has been seen (`pipeline.identity`).
"""

import itertools

import numpy as np

from pipeline.detection import detect, line_choice, neighbours
from pipeline.detection.frame import Frame
from pipeline.detection.image_model import ImageModel, lines_in_background
from pipeline.detection.line import Line, Workspace
from pipeline.detection.refinement import refine_held
from pipeline.detection.static_scene import StaticScene
from pipeline.detection.tracing_options import TracingOptions
from pipeline.numerics import polyline
from pipeline.session.quantities import frames_in, pixels_in
from pipeline.tracking import close_tracks, row_rotation
from pipeline.tracking.following import Follower
from pipeline.tracking.matching import Ruler
from pipeline.tracking.registry import WhiskerTemplate, usual_absorbance
from pipeline.tracking.row_prediction import FEWEST_IN_ROW, Rows
from pipeline.tracking.track_state import Track, moved_on, predicted

RELIT = 0.3  # change of the light from one frame to the next: what was too dark may be seen


class Tracker:
    """Follow all lines through consecutive frames of one static scene.

    Attributes
    ----------
    tracks : `Track`s of the lines that are seen
    first_frames : of a video, for `settle_in`
    looks_back : frames through which new tracks are followed back in time
    """

    def __init__(
        self, scene: StaticScene, templates: list[WhiskerTemplate], options: TracingOptions
    ):
        self.options, self.params = options, options.params.tracking
        self.tracks, self.number = [], itertools.count()
        self.workspace = Workspace.for_picture(scene.background.shape, options.spacing_px)
        samples = [line for template in templates for line in template.samples]
        self.absorbed = usual_absorbance(samples)
        strengths = [line_choice.usual_strength(template.samples) for template in templates]
        self.faintest = self.params.faint_share * min(strengths, default=np.inf)
        self.change_scene(scene)
        self.follower = Follower(options)
        self.rows = Rows(templates, Ruler.of(scene.face_side, options).along, options)
        self._set_limits(options, len(templates))
        self.gain, self.frame_number = 1.0, -1
        self.unchanged = 0  # frames since a track began or ended

    def _set_limits(self, options, count):
        """The room's parameters in pixels and frames, for so many whiskers."""
        params, scale, rate = self.params, options.pixels_per_m, options.frames_per_second
        self.neighbour_px = pixels_in(params.neighbour_mm, scale)
        self.shared_px = pixels_in(params.shared_pixels_mm, scale)
        self.same_px = pixels_in(params.same_line_mm, scale)
        self.established = max(frames_in(params.established_s, rate), 1)
        self.rest = max(frames_in(params.rest_s, rate), 1)
        self.whiskers = count
        self.to_miss_one = max(frames_in(params.search_every_s, rate), 1)
        self.to_miss_none = max(frames_in(params.search_beside_all_s, rate), 1)
        self.first_frames = frames_in(params.first_frames_s, rate)
        self.looks_back = frames_in(params.look_back_s, rate)

    def change_scene(self, scene: StaticScene) -> None:
        """Go on with another background: something large has moved."""
        params = self.options.params.detection
        self.model = ImageModel.from_scene(scene, params, absorbed=self.absorbed)
        self.near_face = detect.near_face(self.model, self.options)

    def step(self, image) -> list[Track]:
        """Advance by one frame; return the tracks of all lines that are seen."""
        self.frame_number += 1
        frame, relit = self._lit(image)
        before = len(self.tracks)
        with lines_in_background(self.model):
            self._follow_all(frame)
            given_up = [t for t in self.tracks if t.line is None and t.given_up is not None]
            self.tracks = close_tracks.seen(self.tracks)
            self.unchanged = 0 if relit or len(self.tracks) != before else self.unchanged + 1
            if self.unchanged < self.rest or self.unchanged % self._search_every() == 0:
                self._search(frame, given_up)
            close_tracks.merge(self.tracks, self.shared_px, frame, self.follower)
            self.tracks = close_tracks.seen(self.tracks)
        return self.tracks

    def settle_in(self, frames) -> None:
        """Learn how the lines move in the first frames, there and back, before these are tracked.

        A row that is seen in one frame alone fits the next one nearly as well when it has moved
        on by a whisker.
        """
        for image in (*frames, *frames[-2:0:-1]):
            self.step(image)
        second = {t.number: t.line.copy() for t in self.tracks}
        self.step(frames[0])
        lines = [t.line for t in self.tracks]
        turn = [
            row_rotation.turned(second[t.number], t.line) if t.number in second else np.nan
            for t in self.tracks
        ]
        turn = self.rows.even_turns(lines, np.array(turn))
        for track, angle in zip(self.tracks, turn, strict=True):
            track.line, track.before = (
                self.rows.turned_back(track.line, k * angle) for k in (1, 2)
            )
        self.frame_number, self.unchanged = -1, 0

    def frame_of(self, image, gain) -> Frame:
        """An image, `gain` times as bright as the background, as a frame of the present scene."""
        return Frame(image, self.model, gain, self.options, self.workspace)

    def found_before(self, line, turn, frame, beside) -> Line | None:
        """A line of one frame in the frame before it, `beside` others; None where it is not seen.

        turn : by how much it is likely to have turned [rad]
        """
        track = Track(line, turn=(float(turn), self.rows.pivot))
        with lines_in_background(self.model, beside):
            self.follower.follow(track, predicted(track, False), frame)
        return track.line

    def _lit(self, image) -> tuple[Frame, bool]:
        """The `Frame` of an image, and whether the light has just changed."""
        gain, before = self.model.gain(image), self.gain
        self.gain = gain
        return self.frame_of(image, gain), abs(gain - before) > RELIT * max(gain, before)

    def _follow_all(self, frame) -> None:
        """Follow every line, each against a background that holds its neighbours.

        Afterwards it still holds them.
        """
        tracks = self.tracks
        self.rows.predict(tracks, frame.picture)
        lines = [predicted(track, True) for track in tracks]
        beside = polyline.near_pairs(lines, self.neighbour_px).any(axis=1)
        held = self.model.held
        held.hold([lines[k] for k in np.flatnonzero(beside)])
        for k, track in enumerate(tracks):
            if beside[k]:
                held.take_out(lines[k])
            self.follower.follow(track, lines[k], frame)
            lines[k] = track.line or moved_on(track.before, None)
            if beside[k]:
                held.put_in(lines[k])
        # again beside those whose lines are known now, where their pixels are shared
        sharing = polyline.near_pairs(lines, self.shared_px, polyline.FINE)
        if sharing.any():
            for k in np.flatnonzero(sharing.any(axis=1)):
                held.put_in(lines[k])
            neighbours.fit_together(lines, sharing, lambda k: self._fit_again(tracks[k], frame))
            close_tracks.drop_doubles(tracks, sharing, self.same_px, self.follower)
            close_tracks.uncross(tracks, frame, self.follower)
        close_tracks.drop_ghosts(tracks, self.established, self.options.params.detection)

    def _fit_again(self, track, frame) -> None:
        """Fit a track's line beside the others, which are held in the background, too."""
        if track.line is not None:
            refine_held(frame, track.line)
            self.follower.give_up_if_poor(track, frame)

    def _search_every(self) -> int:
        """Frames between two searches for new lines while none begins or ends."""
        if self.whiskers >= FEWEST_IN_ROW:  # they hide each other
            return self.rest
        missing = len(self.tracks) < self.whiskers
        return self.to_miss_one if missing else self.to_miss_none

    def _search(self, frame, given_up) -> None:
        """Begin a track for every line that has none, or go on with one that was just given up."""
        lines = [t.line for t in self.tracks]
        self.model.held.hold(lines)
        wanted = detect.Wanted(least=self.faintest, part=self.near_face)
        for line in detect.detect_crowded(frame, lines, wanted):
            track = close_tracks.on_line(given_up, line, self.same_px)
            track = track or Track(number=next(self.number))
            track.take(line)
            self.tracks.append(track)
            self.unchanged = 0
