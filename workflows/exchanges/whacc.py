"""WhACC: its own code writes tables that we read, and reads those that we write."""

import json

import cv2
import numpy as np

from exchanges.others import printed_by
from pipeline.convert.whacc import NONE, TOUCH, UNKNOWN, read_whacc, write_whacc
from pipeline.video import open_video
from synthetic import Codec, write_video

HALF = 30  # px: the picture that WhACC looks for is 61 × 61
# It follows the pole and makes the file; the network that predicts is replaced by given numbers.
TRACKED = """
import json, os, sys
import h5py, numpy
from whacc import PoleTracking, utils
videos, template, given = sys.argv[1:]
tracker = PoleTracking(videos, template_png_full_name=template)
path = tracker.track_all_and_save()
class Given:
    def predict(self, features):
        return features[:, 0]
with h5py.File(path, "r+") as file:
    file["final_features_2105"] = numpy.load(given)[:, None]
utils.make_final_predictions_GBM(path, mod=Given())
with h5py.File(path) as file:
    print()
    print(json.dumps([path, file["yhat"][:].tolist(), sorted(file)]))
"""
# Its page for people: labels are set with its keys, from the last frame on, and saved.
LABELLED = """
import json, sys, tkinter
from PIL import Image
import h5py
from whacc import touch_gui
path, keys = sys.argv[1], json.loads(sys.argv[2])
Image.ANTIALIAS = getattr(Image, "ANTIALIAS", Image.LANCZOS)
def press(root):
    root.update()
    root.focus_force()
    for key in keys:
        root.event_generate(key, when="now")
        root.update()
    buttons = [w for c in root.winfo_children() for w in c.winfo_children()]
    (save,) = [w for w in buttons if w.winfo_class() == "TButton" and w["text"] == "SAVE"]
    save.invoke()
    root.destroy()
tkinter.Tk.mainloop = tkinter.Misc.mainloop = lambda root, n=0: press(root)
touch_gui(path, "labels")
with h5py.File(path) as file:
    print()
    print(json.dumps(file["labels"][:].tolist()))
"""
READ = """
import json, sys
import numpy
from whacc import analysis, image_tools, utils
path = sys.argv[1]
names = utils.h5_string_switcher(utils.getkey(path, "full_file_names"))
counts = utils.getkey(path, "frame_nums")
labels = image_tools.get_h5_key_and_concatenate(path, "labels")
found = analysis.error_analysis(labels, utils.getkey(path, "yhat"), counts)
trials = utils.unique_keep_order(utils.getkey(path, "file_name_nums"))
cell = {"t": counts[0], "k": len(trials), "S_ctk": numpy.zeros((14, int(counts[0]), len(trials))),
        "meta": {"usedTrialNums": list(trials)}}
array = utils.h5_to_U_array_cell(cell, path, labels)
print()
print(json.dumps([names, [int(t) for t in trials], list(map(float, array)),
                  len(found.all_error_type_sorted)]))
"""


def rows(video, folder, others):
    """Both ways."""
    yield from _in(video, folder, others)
    yield from _out(video, folder, others)


def _in(video, folder, others):
    """What it writes: untouched labels, a prediction, a person's labels."""
    videos, template = _as_it_wants(video, folder)
    chance = np.random.default_rng(0).random(video.n_frames)
    np.save(folder / "given.npy", chance)
    arguments = videos, template, folder / "given.npy"
    path, predicted, _ = printed_by(others.whacc_python, TRACKED, *arguments)
    (found,) = read_whacc(path)
    same = found.video == video.name and np.array_equal(found.touch, predicted)
    yield "WhACC", "in", "PoleTracking, make_final_predictions_GBM", (
        f"{len(found.touch)} frames, {int(sum(predicted))} with touch; "
        f"{'the same' if same else 'DIFFERENT'}"
    )  # fmt: skip
    labels = np.full(video.n_frames, UNKNOWN)
    labels[[-1, 0, 1, 3]] = TOUCH, NONE, TOUCH, TOUCH
    keys = ["<Up>", "<Right>", "<Down>", "<Right>", "<Up>", "<Right>", "<Right>", "<Up>"]
    saved = printed_by(others.whacc_python, LABELLED, path, json.dumps(keys))
    (found,) = read_whacc(path)
    expected = np.where(labels == UNKNOWN, predicted, labels)
    same = np.array_equal(saved, labels) and np.array_equal(found.touch, expected)
    yield "WhACC", "in", "touch_gui: labels set and saved", (
        f"{np.sum(labels != UNKNOWN)} labels, which come before the prediction; "
        f"{'the same' if same else 'DIFFERENT'}"
    )  # fmt: skip


def _as_it_wants(video, folder):
    """The video as MP4 in a folder of its own, and a picture of the pole."""
    place = folder / "whacc"
    place.mkdir()
    with open_video(video.path) as source:
        frames = list(source.frames())
    write_video(place / f"{video.name}.mp4", frames, Codec("h264"))
    x, y = (round(float(v[0])) for v in (video.pole().x_px, video.pole().y_px))
    cut = frames[0][y - HALF : y + HALF + 1, x - HALF : x + HALF + 1]
    cv2.imwrite(str(folder / "template.png"), cut)
    return place, folder / "template.png"


def _out(video, folder, others):
    """What it reads: names, trials, contacts, and an array as its lab's MATLAB code has it."""
    path = write_whacc(folder / "ours.h5", [video])
    names, trials, array, errors = printed_by(others.whacc_python, READ, path)
    touching = video.frames.groupby("frame")["in_contact"].any().to_numpy(float)
    same = not errors and np.array_equal(array, touching)
    yield "WhACC", "out", "h5_to_U_array_cell, error_analysis", (
        f"{names[0]}, trial {trials[0]}: {len(array)} frames, {int(touching.sum())} with touch; "
        f"{'the same' if same else 'DIFFERENT'}"
    )  # fmt: skip
