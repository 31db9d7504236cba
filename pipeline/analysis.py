"""`Analysis`: what `analyse` found in one video, to look at, to plot and to save."""

from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from pipeline.detection import PoleTrack
from pipeline.errors import counted
from pipeline.scene.pole_runs import pole_runs
from pipeline.session import Settings, write_session
from pipeline.tables import CONTACT_COLUMNS, Centrelines, write_csv, write_evidence, write_frames
from pipeline.tables.centrelines import centreline_file, centreline_table
from pipeline.tables.own_files import new_files
from pipeline.tables.run_record import write_saved


@dataclass(frozen=True, repr=False)
class Analysis:
    """All that `analyse` found in one video.

    Attributes
    ----------
    frames, contacts : tables of FRAME_COLUMNS and CONTACT_COLUMNS; units in `attrs["units"]`
    evidence : the measurements behind the contacts, aligned with `frames`, SI units
    pole : where the pole was; None if it was never seen
    n_frames : frames read
    messages : what a person should know of: missing whiskers, no pole, no forces and why
    seconds : time spent, by stage
    settings : the settings in force
    lines : the traced lines, chunk by chunk; empty if they went to `keep`
    """

    frames: pd.DataFrame
    contacts: pd.DataFrame
    evidence: pd.DataFrame
    pole: PoleTrack | None
    n_frames: int
    messages: tuple[str, ...] = ()
    seconds: dict[str, float] = field(default_factory=dict)
    settings: Settings | None = None
    lines: tuple[Centrelines, ...] = ()

    @property
    def whiskers(self) -> tuple[str, ...]:
        """Names, in the order of the tables."""
        return tuple(dict.fromkeys(self.frames["whisker"]))

    @property
    def centrelines(self) -> pd.DataFrame:
        """A row per whisker and frame: frame, whisker, x_px, y_px (an array each)."""
        return centreline_table(self.lines)

    def save(self, folder, video=None) -> Path:
        """Write the tables and settings into a folder, as `whiskerforce run` does for a video.

        `pipeline.read_results` reads them again.

        Parameters
        ----------
        folder : made where it is missing
        video : its name in contacts.csv; None: the folder's

        Raises
        ------
        InputError
            Where that would replace a file that was not saved so, such as your session.toml.
        """
        folder = Path(folder)
        with new_files(folder) as new:
            self.write_tables(new, video or folder.resolve().name)
            write_saved(new, self.n_frames, pole_runs(self.pole))
        return folder

    def write_tables(self, folder, video) -> None:
        """Write what `save` does over whatever the folder holds."""
        folder = Path(folder)
        if self.lines:
            with centreline_file(folder / "centrelines.parquet") as keep:
                for chunk in self.lines:
                    keep(chunk)
        write_frames(folder / "frames.parquet", self.frames)
        write_csv(folder / "contacts.csv", self.contacts.assign(video=video), CONTACT_COLUMNS)
        write_evidence(folder, self.evidence)
        write_session(folder / "session.toml", self.settings)

    def plot(self, column="contact_force_uN", whisker=None, ax=None):
        """Draw a column of `frames` over time; see `pipeline.plot_course`."""
        from pipeline.reports import plot_course

        return plot_course(self.frames, column, whisker, ax)

    def plot_centrelines(self, ax=None, step=None):
        """Draw the traced lines; see `pipeline.plot_centrelines`."""
        from pipeline.reports import plot_centrelines

        return plot_centrelines(self.centrelines, ax, step)

    def __repr__(self):
        names = ", ".join(self.whiskers) or "no whisker"
        contacts = counted(len(self.contacts), "contact")
        return f"<Analysis: {counted(self.n_frames, 'frame')} of {names}; {contacts}>"

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        from pipeline.reports.notebook_view import notebook_view

        return notebook_view(self)
