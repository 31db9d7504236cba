"""Whether a file ends where its container says; for containers whose decoder does not notice."""

import os

GIF_END, GIF_TAIL = b"\x3b", 16
TS_PACKETS = (188, 192, 204)  # bytes
Y4M_FRAME = b"FRAME\n"
ASF_FILE_PROPERTIES = bytes.fromhex("a1dcab8c47a9cf118ee400c00c205365")
ASF_HEAD, ASF_SIZE_AT = 4096, 40  # bytes read; place of the file's size in that object
Y4M_SAMPLES = {"mono": 1, "420": 1.5, "422": 2, "444": 3, "411": 1.5}


def is_cut(path, container: str) -> bool:
    """Whether a file lacks its end, as far as the container (FFmpeg's name) lets one know."""
    size = os.path.getsize(path)
    if container == "gif":
        return GIF_END not in _tail(path, GIF_TAIL)
    if container == "mpegts":
        return all(size % packet for packet in TS_PACKETS)
    if container == "asf":
        return size < _asf_size(path)
    if container == "yuv4mpegpipe":
        return _is_cut_y4m(path, size)
    return False


def _head(path, count) -> bytes:
    with open(path, "rb") as file:
        return file.read(count)


def _tail(path, count) -> bytes:
    with open(path, "rb") as file:
        file.seek(max(0, os.path.getsize(path) - count))
        return file.read()


def _asf_size(path) -> int:
    """Size that the header states [bytes]; 0 where it does not (a broadcast)."""
    head = _head(path, ASF_HEAD)
    at = head.find(ASF_FILE_PROPERTIES)
    if at < 0:
        return 0
    return int.from_bytes(head[at + ASF_SIZE_AT : at + ASF_SIZE_AT + 8], "little")


def _is_cut_y4m(path, size) -> bool:
    """The frames, all of one size, do not fill the file."""
    head = _head(path, 512)
    line = head.split(b"\n", 1)[0]
    fields = {part[:1]: part[1:].decode("ascii", "replace") for part in line.split(b" ")[1:]}
    form = fields.get(b"C", "420")
    samples = next((n for name, n in Y4M_SAMPLES.items() if form.startswith(name)), None)
    if samples is None or not head[len(line) + 1 :].startswith(Y4M_FRAME) or "p1" in form:
        return False  # of a kind whose frames' size is not known here
    pixels = int(fields.get(b"W", 0)) * int(fields.get(b"H", 0))
    frame = len(Y4M_FRAME) + int(pixels * samples)
    return (size - len(line) - 1) % frame != 0
