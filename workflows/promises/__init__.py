"""What the program promises, each tried many times; `workflows/reliability.py` runs them all."""

import functools

from promises.bad_files import try_folders, try_own, try_tables
from promises.bad_scenes import try_random, try_scenes
from promises.bad_video import WRITERS, try_container, try_odd
from promises.by_tests import bounds, escaped, page
from promises.disk import try_full_disk, try_no_handles, try_read_only, try_removed, try_two_runs
from promises.killed_at_steps import try_steps
from promises.killed_curations import try_curations
from promises.killed_runs import try_dying_workers, try_interrupts, try_kills
from promises.load import try_long, try_many_videos, try_many_whiskers
from promises.same_bytes import try_same
from promises.trial import Promise

INTERRUPTIONS = "Interruptions"
DISK = "Disk and rights"
BAD_VIDEO = "Bad video"
SCENES = "Bad scenes"
LOAD = "Load"
OTHERS = "Page, names, bytes and indices"
BAD_FILES = "Damaged settings, corrections, records and tables"

PROMISES = (
    Promise(
        "steps",
        INTERRUPTIONS,
        "A run killed before any change of a file, or while writing one, leaves whole files "
        "only, all earlier results and all corrections; the next run computes no finished "
        "video again, and its tables are those of an undisturbed run",
        try_steps,
        in_ci=0.04,
    ),
    Promise(
        "kills",
        INTERRUPTIONS,
        "The same for whole runs over curated results, killed (SIGKILL) at random moments",
        try_kills,
    ),
    Promise(
        "curations",
        INTERRUPTIONS,
        "A curation killed before any change of a file, or while writing one, keeps every "
        "decision that was answered; the next run, without looking at the videos again, makes "
        "all tables and the report as a run from the videos makes them with these decisions",
        try_curations,
        in_ci=0.05,
    ),
    Promise(
        "interrupts", INTERRUPTIONS, "Ctrl-C stops a run cleanly within seconds", try_interrupts
    ),
    Promise(
        "workers",
        INTERRUPTIONS,
        "A worker process that dies costs no video; if two die on the same video, that video "
        "alone fails, with a message",
        try_dying_workers,
    ),
    Promise(
        "full disk",
        DISK,
        "A full disk, or a limit on file sizes, gives one line of message; nothing is lost, "
        "and the next run completes the results",
        try_full_disk,
        in_ci=0.1,
    ),
    Promise(
        "read-only",
        DISK,
        "The same for a results folder, a video's folder or a file without write permission",
        try_read_only,
        in_ci=1,
    ),
    Promise(
        "no handles",
        DISK,
        "The same where the system opens no more files",
        try_no_handles,
        in_ci=0.25,
    ),
    Promise(
        "removed",
        DISK,
        "The same where results or videos are removed during a run",
        try_removed,
        in_ci=0.1,
    ),
    Promise(
        "two runs",
        DISK,
        "Of two runs started at once on one folder, one does everything and the other is refused",
        try_two_runs,
        in_ci=0.2,
    ),
    *(
        Promise(
            f"damaged {kind}",
            BAD_VIDEO,
            f"{kind}: any cut, flipped bit, overwritten or lost stretch and absurd number ends in "
            "frames or one line of message, without a crash, a hang, or more than 1 GB; frames "
            "that a cut removed are reported",
            functools.partial(try_container, kind),
            in_ci=0.2,
        )
        for kind in WRITERS
    ),
    Promise(
        "odd video",
        BAD_VIDEO,
        "Empty files, wrong suffixes, 1×1 to 10,000×1 px, 16 bits, colour, changing sizes and "
        "false headers go through the whole analysis and end in tables or one line of message",
        try_odd,
        in_ci=0.5,
    ),
    Promise(
        "own formats",
        BAD_FILES,
        "session.toml, corrections.csv, run.json and .seq files with any content are read, or "
        "refused in one line (random changes, guided by the lines of code they reach)",
        try_own,
        in_ci=0.1,
    ),
    Promise(
        "tables",
        BAD_FILES,
        "A damaged parquet table is refused; values that were never written are never read",
        try_tables,
        in_ci=0.3,
    ),
    Promise(
        "results",
        BAD_FILES,
        "A damaged file in a results folder is made again or named; it stops no run",
        try_folders,
        in_ci=0.1,
    ),
    Promise(
        "scenes",
        SCENES,
        "Scenes in which nothing, or not everything, can be measured are flagged; no contact "
        "and no force is invented",
        try_scenes,
    ),
    Promise(
        "random scenes",
        SCENES,
        "In random scenes, each with a disturbance, every number is finite or empty with a "
        "flag, and no contact is far from a true one",
        try_random,
    ),
    Promise(
        "many videos",
        LOAD,
        "10,000 short videos in one folder: memory and open files are bounded, and finished "
        "videos cost milliseconds",
        try_many_videos,
        in_ci=0.005,
    ),
    Promise(
        "long video",
        LOAD,
        "A video of a million frames: memory and open files are bounded",
        try_long,
    ),
    Promise(
        "many whiskers",
        LOAD,
        "32 whiskers in one picture: memory and open files are bounded",
        try_many_whiskers,
    ),
    Promise(
        "same bytes",
        OTHERS,
        "The same input and settings give the same bytes in all tables, with one job or two "
        "(times aside)",
        try_same,
    ),
    Promise(
        "page",
        OTHERS,
        "The curation page answers this computer only; it refuses other hosts, other origins, "
        "forged sessions and paths outside the results; two tabs see the same corrections, "
        "and none is lost",
        page,
    ),
    Promise(
        "names",
        OTHERS,
        "Names of files and whiskers are escaped in every page and table, and none is read as "
        "a formula",
        escaped,
    ),
    Promise(
        "bounds", OTHERS, "Compiled code reads and writes no element beyond an array's end", bounds
    ),
)
