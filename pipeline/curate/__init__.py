"""The page in the browser in which a person corrects contacts.

From the inside out: review.py (edits of one video's contacts), items.py (what to look at, how
doubtful it is), results.py (a results folder, tables kept in step), frames.py (the video's frames
in any order), view.py (where the person is), desk.py (what the person does), page.py with
picture.py, courses.py and panels.py (how it is shown), server.py.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submod_attrs={"server": ["curate"]})
