"""Follow docs/tutorial.md word for word, with the Python that runs this, in a folder.

    python workflows/tutorial.py FOLDER

The folder should be empty. Commands are run by the shell, Python in a single process, as a
reader would; exit status 1 where one of them fails.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).resolve().parents[1] / "docs" / "tutorial.md"
FENCE = re.compile(r"^```(sh|python)\n(.*?)^```", re.DOTALL | re.MULTILINE)


def blocks(page=PAGE) -> list[tuple[str, str]]:
    """(language, code) of each block of a page, in order."""
    return FENCE.findall(Path(page).read_text(encoding="utf-8"))


def follow(folder) -> int:
    """Do everything that the page says; returns the exit status of the first failure, else 0."""
    found = blocks()
    shell = [code for language, code in found if language == "sh"]
    python = "\n".join(code for language, code in found if language == "python")
    programs = str(Path(sys.executable).parent)
    environment = os.environ | {
        "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}", "MPLBACKEND": "agg",
    }  # fmt: skip
    for command in (["sh", "-e", "-c", "".join(shell)], [sys.executable, "-c", python]):
        status = subprocess.run(command, cwd=folder, env=environment).returncode
        if status:
            return status
    return 0


if __name__ == "__main__":
    sys.exit(1 if follow(sys.argv[1]) else 0)
