"""What is said of videos without a pole, all together: in no-go trials none is expected."""

from pipeline.errors import counted, some_of
from pipeline.tables.video_messages import missing_pole


def missing_pole_lines(outcomes):
    """Yield the sentence on those of the `Outcome`s in whose videos no pole was found, if any.

    Where another video shows a pole, the settings are right for it, and there may be none in
    these; else it says what was seen in the first one, and what to do.
    """
    without = [each for each in outcomes if each.frames and missing_pole(each.message)]
    if not without:
        return
    names = [each.video for each in without]
    if any(each.pole for each in outcomes):
        count = counted(sum(bool(each.frames) for each in outcomes), "video")
        yield (
            f"{len(names)} of {count} {'shows' if len(names) == 1 else 'show'} no pole, so no "
            f"contacts there: {some_of(names)}; if there is one, see in videos.csv what was seen "
            "in place of it"
        )
        return
    more = f" (nor in {counted(len(names) - 1, 'other video')})" if len(names) > 1 else ""
    yield f"{names[0]}: {missing_pole(without[0].message)}{more}"
