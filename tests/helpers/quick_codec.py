"""Rendered videos whose frames are read in a moment."""

import contextlib

import pytest

from synthetic import encode

QUICK = "ffvhuff", "gray", {}


@contextlib.contextmanager
def quick_to_read():
    """Write no FFV1, which takes longer to read than whiskers to follow, but another code.

    That one loses nothing either: the frames are the same. It holds in this process only.
    """
    usual = encode.encoder_of

    def quick(codec):
        return QUICK if codec.name == "ffv1" else usual(codec)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(encode, "encoder_of", quick)
        yield
