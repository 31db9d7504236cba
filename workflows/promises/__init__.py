"""What the program promises, each tried many times; `workflows/reliability.py` runs them all."""

import functools

from promises.bad_files import try_folders, try_own, try_tables
from promises.bad_scenes import try_random, try_scenes
from promises.bad_video import WRITERS, try_container, try_odd
from promises.by_tests import bounds, escaped, page
from promises.disk import (
    try_full_disk,
    try_no_handles,
    try_read_only,
    try_removed,
    try_two_runs,
)
from promises.killed_at_steps import try_steps
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
        "Killed before any change of a file, or in the middle of writing one, a run leaves whole "
        "files, all results of before and all corrections; the next run computes no finished "
        "video again, and its tables are those of an undisturbed one",
        try_steps,
        in_ci=0.04,
    ),
    Promise(
        "kills",
        INTERRUPTIONS,
        "The same holds for whole runs over curated results, killed (SIGKILL) at random moments",
        try_kills,
    ),
    Promise(
        "interrupts",
        INTERRUPTIONS,
        "Ctrl-C stops a run cleanly within seconds",
        try_interrupts,
    ),
    Promise(
        "workers",
        INTERRUPTIONS,
        "A worker process that dies costs no video; one that dies of the same video twice costs "
        "that video only, and it is said",
        try_dying_workers,
    ),
    Promise(
        "full disk",
        DISK,
        "A full disk, or a limit on files, is told in a line; nothing is lost, and the next run "
        "mends all",
        try_full_disk,
        in_ci=0.1,
    ),
    Promise(
        "read-only",
        DISK,
        "So is a results folder, a video's folder or a file that may not be written",
        try_read_only,
        in_ci=1,
    ),
    Promise(
        "no handles",
        DISK,
        "So is a system that opens no more files",
        try_no_handles,
        in_ci=0.25,
    ),
    Promise(
        "removed",
        DISK,
        "So are results and videos that are removed in the middle of a run",
        try_removed,
        in_ci=0.1,
    ),
    Promise(
        "two runs",
        DISK,
        "Of two runs begun at once into one folder one does all, the other is refused",
        try_two_runs,
        in_ci=0.2,
    ),
    *(
        Promise(
            f"damaged {kind}",
            BAD_VIDEO,
            f"{kind}: whatever is cut, flipped, overwritten, lost or absurd ends in frames or one "
            "line, without a crash, a hang, or more than 1 GB; what a cut has taken is said",
            functools.partial(try_container, kind),
            in_ci=0.2,
        )
        for kind in WRITERS
    ),
    Promise(
        "odd video",
        BAD_VIDEO,
        "Empty files, wrong suffixes, 1×1 to 10,000×1 px, 16 bits, colour, sizes that change and "
        "headers that lie end in tables or one line, through the whole analysis",
        try_odd,
        in_ci=0.5,
    ),
    Promise(
        "own formats",
        BAD_FILES,
        "session.toml, corrections.csv, run.json and .seq are read or refused in a line, whatever "
        "they hold (changed at random, led by the lines of code that they reach)",
        try_own,
        in_ci=0.1,
    ),
    Promise(
        "tables",
        BAD_FILES,
        "A damaged parquet table is refused; no other numbers than were written are ever read",
        try_tables,
        in_ci=0.3,
    ),
    Promise(
        "results",
        BAD_FILES,
        "A file of a results folder that is damaged is made again, or named; it ends no run",
        try_folders,
        in_ci=0.1,
    ),
    Promise(
        "scenes",
        SCENES,
        "Scenes in which nothing can be measured, or not all the time, are said; no contact and "
        "no force is invented",
        try_scenes,
    ),
    Promise(
        "random scenes",
        SCENES,
        "In scenes drawn at random, in each of which something happens, every number is finite, "
        "or empty with a flag, and no contact is far from a true one",
        try_random,
    ),
    Promise(
        "many videos",
        LOAD,
        "10,000 short videos in one folder: memory and open files are bounded, and those that are "
        "finished cost milliseconds",
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
        "Same input, same settings: same bytes in all tables, on one or two jobs (times aside)",
        try_same,
    ),
    Promise(
        "page",
        OTHERS,
        "The curation page is served to this computer only, refuses other hosts, origins, forged "
        "sessions and files of the disk, and two tabs see the same corrections, none of which is "
        "lost",
        page,
    ),
    Promise(
        "names",
        OTHERS,
        "Names of files and whiskers are escaped in every page, and no name is a formula",
        escaped,
    ),
    Promise(
        "bounds",
        OTHERS,
        "Compiled code reads and writes no element beyond an array's end",
        bounds,
    ),
)
