"""What became of one video: a row of videos.csv, and the record of how its results were made."""

from dataclasses import asdict, dataclass, field

from pipeline import __version__
from pipeline.curate.corrected import MADE_WITH, corrections_digest
from pipeline.errors import counted
from pipeline.tables.run_record import write_state
from pipeline.tables.video_messages import in_brief, missing_pole, sentences_of

BULLET = "  - "


@dataclass(frozen=True)
class Outcome:
    """What became of one video: a row of videos.csv, and for run.json how it was made.

    `status` is "done", "warning" or "failed"; `details` is the traceback of a fault. `frames` is
    0 where there are no results; where a video failed, those of before may be there.
    """

    video: str
    path: str
    status: str
    frames: int = 0
    frames_per_s: float = 0.0
    message: str = ""
    contacts: int = 0
    stages: dict = field(default_factory=dict)
    sha256: str = ""
    pole: dict | None = None
    details: str = ""

    def line(self) -> str:
        """The outcome in one line."""
        if self.status == "failed":
            return f"failed: {self.message}"
        message = f"; {self.message}" if self.message else ""
        return f"{self._state()}{message}"

    def lines(self, said: set) -> list[str]:
        """The outcome in a line, below it the messages that are not yet `said`; adds them to it.

        So a message that holds for all videos of a run is shown with the first one only. What to
        do about a missing pole is not known before all have ended (`missing_poles`).
        """
        if self.status == "failed":
            return [self.line()]
        return [self._state(), *_new_lines([*map(in_brief, sentences_of(self.message))], said)]

    def warning_lines(self, said: set) -> list[str]:
        """The messages alone, as of `lines`, where the outcome has been shown before.

        That no pole was found is left out: it is said of all videos together.
        """
        pole = missing_pole(self.message)
        sentences = [each for each in sentences_of(self.message) if each != pole]
        head, lines = f"warning: {self.video}:", _new_lines(sentences, said)
        if not lines:
            return []
        return [f"{head} {lines[0].removeprefix(BULLET)}"] if len(lines) == 1 else [head, *lines]

    def _state(self) -> str:
        return (
            f"{self.status}, {counted(self.frames, 'frame')}, {self.frames_per_s:.0f} frames/s, "
            f"{counted(self.contacts, 'contact')}"
        )


def _new_lines(sentences, said: set) -> list[str]:
    """A line for each sentence that is not `said` yet, and one that counts the others."""
    new = [each for each in sentences if each not in said]
    said.update(new)
    lines, before = [f"{BULLET}{each}" for each in new], len(sentences) - len(new)
    if before:
        lines.append(f"{BULLET}{'and ' if new else ''}{counted(before, 'message')} as above")
    return lines


def save_state(folder, outcome, corrections, known) -> None:
    """Write how the results in `folder` were made: with `corrections`, and what is `known`."""
    state = {
        "version": __version__,
        **{key: value for key, value in asdict(outcome).items() if key != "details"},
        MADE_WITH: corrections_digest(corrections),
        **known,
    }
    write_state(folder, state)
