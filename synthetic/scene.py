"""What is in front of the camera: frozen descriptions, no randomness and no pictures yet.

Lengths are metres in the mechanics frame (x right, y up, so `y = −row / pixels_per_m`); what
belongs to the picture (blur, noise, size) is in pixels and grey levels.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from whiskermodel.whisker import Whisker, mouse_c2

FACES = ("left", "right", "top", "bottom")
CODECS = ("ffv1", "h264", "mjpeg", "tiff")
SPEEDS = ("ultrafast", "superfast", "veryfast", "faster", "fast", "medium")


def _require(condition, argument, value, rule):
    if not condition:
        raise ValueError(f"{argument} must be {rule}, got {value!r}")


@dataclass(frozen=True)
class Camera:
    """Camera, lens and noise.

    Parameters
    ----------
    width, height : size of the picture [px]
    pixels_per_mm : scale
    frames_per_second : frame rate; frame k is taken at k / frames_per_second
    blur_px : SD of the optics' Gaussian [px]
    exposure_s : exposure, centred on the frame's time [s]; 0 freezes the motion
    noise_gain : variance of the photon noise per grey level above black [grey]
    read_noise : SD of the read noise [grey]
    black_level : grey level of no light
    """

    width: int = 640
    height: int = 480
    pixels_per_mm: float = 25.0
    frames_per_second: float = 1000.0
    blur_px: float = 0.7
    exposure_s: float = 1e-4
    noise_gain: float = 0.0045
    read_noise: float = 0.4
    black_level: float = 4.0

    def __post_init__(self):
        for name in ("width", "height"):
            value = getattr(self, name)
            _require(value == int(value) and value >= 16, name, value, "an integer >= 16 px")
        for name in ("pixels_per_mm", "frames_per_second", "blur_px"):
            _require(getattr(self, name) > 0, name, getattr(self, name), "> 0")
        for name in ("exposure_s", "noise_gain", "read_noise", "black_level"):
            _require(getattr(self, name) >= 0, name, getattr(self, name), ">= 0")

    @property
    def pixels_per_m(self) -> float:
        """Scale [px/m]."""
        return 1e3 * self.pixels_per_mm

    def with_noise_sd(self, sd: float, grey: float = 180.0) -> "Camera":
        """Return this camera with noise of SD `sd` at level `grey`, mostly photon noise."""
        _require(sd >= 0, "sd", sd, ">= 0 grey levels")
        gain = sd**2 * 5 / 6 / max(grey - self.black_level, 1.0)
        return replace(self, noise_gain=gain, read_noise=sd * np.sqrt(1 / 6))


@dataclass(frozen=True)
class Lights:
    """The backlight: mean grey level, unevenness (share of the mean), flicker.

    `flicker` is the amplitude (share of the mean) of a lamp's ripple at `flicker_hz`, with a
    slow drift of the same size.
    """

    level: float = 180.0
    unevenness: float = 0.16
    flicker: float = 0.0
    flicker_hz: float = 100.0


@dataclass(frozen=True)
class Face:
    """A dark mass with fur around the follicles.

    Parameters
    ----------
    side : side of the image that it stands on
    direction : where the whiskers point on average, counter-clockwise on the screen [rad];
        None: straight away from `side`
    hidden_length : follicle to the fur's solid edge [m]
    pad : length of the row of follicles [m], across `direction`
    slope : how fast the face falls back on both sides of the pad (1: 45°)
    hairs_per_mm : fur hairs per mm of edge
    hair_length : typical length of a fur hair beyond the edge [m]
    long_hairs : number of thin longer hairs, up to some millimetres
    moving : amplitude of the fur's own motion [m]; 0 keeps it still
    outline : corners ((x, y), …) [m] of the whole mass in place of the wedge that follows from
        direction, hidden length, pad and slope; its fur is combed back, against `direction`
    edge_blur : SD over which the mass of an outline fades at its edge [m]
    glow : light that pale fur throws back, as a share of the backlight; 0: a black face. It
        hides whiskers as a black face does. Only for fur that keeps still
    coat_per_mm2 : hairs that can be told apart on a pale face
    """

    side: str = "left"
    direction: float | None = None
    hidden_length: float = 1.4e-3
    pad: float = 0.0
    slope: float = 0.6
    hairs_per_mm: float = 34.0
    hair_length: float = 0.5e-3
    long_hairs: int = 6
    moving: float = 0.0
    outline: tuple[tuple[float, float], ...] | None = None
    edge_blur: float = 0.0
    glow: float = 0.0
    coat_per_mm2: float = 0.0

    def __post_init__(self):
        _require(self.side in FACES, "side", self.side, f"one of {FACES}")
        _require(
            self.outline is None or len(self.outline) > 2, "outline", self.outline, "3 corners"
        )
        _require(0 <= self.glow < 1, "glow", self.glow, "in [0, 1)")
        _require(not (self.glow and self.moving), "glow", self.glow, "0 where fur moves")
        _require(self.hidden_length >= 0, "hidden_length", self.hidden_length, ">= 0 m")

    @property
    def axis(self) -> float:
        """Direction away from the face on the screen [rad]."""
        straight = {"left": 0.0, "right": np.pi, "top": -np.pi / 2, "bottom": np.pi / 2}
        return straight[self.side] if self.direction is None else self.direction


@dataclass(frozen=True)
class Pole:
    """A round pole seen end on, and the out-of-focus rod behind it.

    Parameters
    ----------
    x, y : centre while the pole is in its place [m]
    radius : [m]
    rod_direction : where the rod leaves on the screen [rad]; None: no rod
    rod_radius : half the rod's width [m]
    rod_blur_px : SD of the rod's blur at its far end [px]; it is sharp at the pole
    away_x, away_y : where it stands when it is withdrawn, from its place [m]
    """

    x: float
    y: float
    radius: float = 0.25e-3
    rod_direction: float | None = 1.0
    rod_radius: float = 0.27e-3
    rod_blur_px: float = 6.0
    away_x: float = 0.0
    away_y: float = 0.0

    def __post_init__(self):
        _require(self.radius > 0, "radius", self.radius, "> 0 m")


@dataclass(frozen=True)
class Shape:
    """A still thing in view that is neither face nor pole: a body, a bar, a spout, an eye.

    Parameters
    ----------
    corners : ((x, y), …) of a polygon [m]
    transmission : share of the light that passes
    blur_px : SD of its edge's blur [px]
    """

    corners: tuple[tuple[float, float], ...]
    transmission: float = 0.02
    blur_px: float = 1.5

    def __post_init__(self):
        _require(len(self.corners) > 2, "corners", self.corners, "3 corners or more")
        _require(0 <= self.transmission < 1, "transmission", self.transmission, "in [0, 1)")
        _require(self.blur_px > 0, "blur_px", self.blur_px, "> 0 px")


@dataclass(frozen=True)
class Particle:
    """A dust particle that sticks to a whisker.

    Parameters
    ----------
    arc_length : where it sticks [m]
    radius : [m]
    aside : of its centre from the centreline, in its radii
    falls_off : first frame without it; None: it stays
    """

    arc_length: float
    radius: float = 80e-6
    aside: float = 0.5
    falls_off: int | None = None

    def __post_init__(self):
        _require(self.radius > 0, "radius", self.radius, "> 0 m")


@dataclass(frozen=True)
class Hair:
    """One whisker of the scene.

    Parameters
    ----------
    whisker : geometry and material
    intrinsic_curvature : κ0(s) = k0 + k1 s + … [1/m, 1/m², …], counter-clockwise positive
    follicle_x, follicle_y : mean place of the follicle [m]
    opacity : share of the light that the hair takes away
    touches : lies in the plane of the pole; False: passes in front of or behind it
    particle : dust that sticks to it, or None
    """

    whisker: Whisker = field(default_factory=mouse_c2)
    intrinsic_curvature: tuple[float, ...] = (0.0,)
    follicle_x: float = 0.0
    follicle_y: float = 0.0
    opacity: float = 0.95
    touches: bool = True
    particle: Particle | None = None

    def __post_init__(self):
        _require(0 < self.opacity <= 1, "opacity", self.opacity, "in (0, 1]")


@dataclass(frozen=True)
class Codec:
    """How the video is stored: "ffv1", "h264", "mjpeg" (quality 2 best – 31) or "tiff".

    `crf` and `speed` are x264's constant rate factor and preset. Where `uneven_frames` is not 0,
    every other stretch of so many frames gets only half of the bits, and each stretch
    begins with a key frame: quality that changes while nothing in the picture does.
    """

    name: str = "ffv1"
    crf: int = 20
    quality: int = 3
    speed: str = "veryfast"
    uneven_frames: int = 0

    def __post_init__(self):
        _require(self.name in CODECS, "name", self.name, f"one of {CODECS}")
        _require(self.speed in SPEEDS, "speed", self.speed, f"one of {SPEEDS}")
        uneven = self.uneven_frames
        _require(uneven == 0 or self.name == "h264", "uneven_frames", uneven, "0, or h264's")


@dataclass(frozen=True)
class Scene:
    """All that is fixed in one video.

    `clutter` counts dust specks in the light's path; `stray_hairs` short unwanted hairs that
    lie about. `seed` drives all that is random in the picture: texture, fur, dust, noise.
    """

    camera: Camera = field(default_factory=Camera)
    lights: Lights = field(default_factory=Lights)
    face: Face = field(default_factory=Face)
    hairs: tuple[Hair, ...] = (Hair(),)
    pole: Pole | None = None
    codec: Codec = field(default_factory=Codec)
    shapes: tuple[Shape, ...] = ()
    clutter: int = 0
    stray_hairs: int = 0
    seed: int = 0

    def __post_init__(self):
        names = [hair.whisker.name for hair in self.hairs]
        _require(len(set(names)) == len(names), "hairs", names, "whiskers of different names")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the whiskers, in the order of `hairs`."""
        return tuple(hair.whisker.name for hair in self.hairs)

    def to_pixels(self, x, y):
        """Pixel coordinates (x right, y down) of a point in the mechanics frame [m]."""
        scale = self.camera.pixels_per_m
        return np.asarray(x) * scale, -np.asarray(y) * scale
