"""How far apart colours are, also for people who cannot distinguish red from green.

Simulation after Machado, Oliveira & Fernandes 2009 (severity 1), differences as CIEDE2000.
"""

import numpy as np

SIGHTS = {
    "normal": np.eye(3),
    "protan": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
         [-0.003882, -0.048116, 1.051998]]
    ),
    "deutan": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
         [-0.011820, 0.042940, 0.968881]]
    ),
}  # fmt: skip
TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
     [0.0193339, 0.1191920, 0.9503041]]
)  # fmt: skip
WHITE = np.array([0.95047, 1.0, 1.08883])


def difference(one, other, sight="normal") -> float:
    """ΔE 2000 of two colours, "#rrggbb" or (red, green, blue) of 0–255, as somebody sees them."""
    return delta_e(_lab(one, sight), _lab(other, sight))


def _lab(colour, sight):
    if isinstance(colour, str):
        colour = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    share = np.asarray(colour, float) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    linear = np.clip(SIGHTS[sight] @ linear, 0, 1)
    xyz = TO_XYZ @ linear / WHITE
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def delta_e(one, other) -> float:
    """CIEDE2000 of two colours in CIELAB (Sharma, Wu & Dalal 2005).

    >>> round(delta_e((50, 2.6772, -79.7751), (50, 0, -82.7485)), 4)
    2.0425
    >>> round(delta_e((50, 2.5, 0), (56, -27, -3)), 4)
    31.903
    """
    (l1, a1, b1), (l2, a2, b2) = one, other
    far = (np.hypot(a1, b1) + np.hypot(a2, b2)) ** 7 / 2**7
    grow = 1 + 0.5 * (1 - np.sqrt(far / (far + 25**7)))
    c1, c2 = np.hypot(grow * a1, b1), np.hypot(grow * a2, b2)
    h1, h2 = (np.degrees(np.arctan2(b, grow * a)) % 360 for a, b in ((a1, b1), (a2, b2)))
    turn = (h2 - h1 + 180) % 360 - 180 if c1 * c2 else 0.0
    dl, dc, dh = l2 - l1, c2 - c1, 2 * np.sqrt(c1 * c2) * np.sin(np.radians(turn) / 2)
    light, chroma, hue = (l1 + l2) / 2, (c1 + c2) / 2, (h1 + turn / 2 if c1 * c2 else h1 + h2)
    t = (
        1
        - 0.17 * np.cos(np.radians(hue - 30))
        + 0.24 * np.cos(np.radians(2 * hue))
        + 0.32 * np.cos(np.radians(3 * hue + 6))
        - 0.20 * np.cos(np.radians(4 * hue - 63))
    )
    s_l = 1 + 0.015 * (light - 50) ** 2 / np.sqrt(20 + (light - 50) ** 2)
    s_c, s_h = 1 + 0.045 * chroma, 1 + 0.015 * chroma * t
    around = 30 * np.exp(-((((hue % 360) - 275) / 25) ** 2))
    r = -2 * np.sqrt(chroma**7 / (chroma**7 + 25**7)) * np.sin(np.radians(2 * around))
    parts = dl / s_l, dc / s_c, dh / s_h
    return float(np.sqrt(sum(p**2 for p in parts) + r * parts[1] * parts[2]))
