"""Lines of given whiskers, traced as `run` traces those of a video."""

from pipeline.run import trace
from pipeline.tracking import CHUNK_FRAMES, WhiskerSet


def trace_templates(frames, scene, templates, options, chunk_frames=CHUNK_FRAMES, given=None):
    """Centrelines of `WhiskerTemplate`s, chunk by chunk; `given` names, by default all of them."""
    names = tuple(template.name for template in templates)
    given = names if given is None else given
    whisker_set = WhiskerSet(names, tuple(templates), {}, {}, {}, given=given)
    return trace(frames, scene, whisker_set, options, chunk_frames)
