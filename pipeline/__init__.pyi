from . import calibrate, convert
from .analysis import Analysis
from .contacts import ContactTables
from .convert import read_results
from .detection import Line, PoleTrack, StaticScene
from .errors import CorrectionsError, InputError, VideoError
from .kinematics import Kinematics, Stations
from .reports import plot_centrelines, plot_contacts, plot_course
from .run import analyse, analyse_lines
from .session import Parameters, Recording, Settings, SettingsError, read_session, write_session
from .tables import Centrelines, read_centrelines
from .video import Video, find_videos, open_video

__version__: str
__all__ = [
    "Analysis",
    "Centrelines",
    "ContactTables",
    "CorrectionsError",
    "InputError",
    "Kinematics",
    "Line",
    "Parameters",
    "PoleTrack",
    "Recording",
    "Settings",
    "SettingsError",
    "StaticScene",
    "Stations",
    "Video",
    "VideoError",
    "analyse",
    "analyse_lines",
    "calibrate",
    "convert",
    "find_videos",
    "open_video",
    "plot_centrelines",
    "plot_contacts",
    "plot_course",
    "read_centrelines",
    "read_results",
    "read_session",
    "write_session",
]
