#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""compare_pictures.py EXPECTED.png SCREEN.ppm [CODES]: whether a display scanned out a picture.

Every channel of every pixel may differ by CODES (default 0: bit for bit; 1: to within dither). Exit
status 0 where it holds, 1 where it does not, 2 where a file cannot be read. Python's own library only.
"""

import struct
import sys
import zlib


class Unreadable(Exception):
    """A file that is no picture of the kind that is looked for; says which and why."""


def read_ppm(path):
    """The width, the height and the bytes, RGB, of a PPM of 8 bits as the emulator writes it."""
    with open(path, "rb") as file:
        data = file.read()
    fields = []
    at = 0
    while len(fields) < 4:
        while at < len(data) and data[at:at + 1].isspace():
            at += 1
        end = at
        while end < len(data) and not data[end:end + 1].isspace():
            end += 1
        if end == at:
            raise Unreadable(f"{path}: ends within its header")
        fields.append(data[at:end])
        at = end
    if fields[0] != b"P6" or fields[3] != b"255":
        raise Unreadable(f"{path}: no PPM of 8 bits (P6, 255)")
    width, height = int(fields[1]), int(fields[2])
    pixels = data[at + 1:]
    if len(pixels) != 3 * width * height:
        raise Unreadable(f"{path}: {len(pixels)} bytes of pixels, not {3 * width * height}")
    return width, height, pixels


def unfilter(kind, row, above, step):
    """One row of a PNG as it was before its filter. Source: PNG specification, 9.2."""
    if kind == 0:
        return row
    for i, _ in enumerate(row):
        left = row[i - step] if i >= step else 0
        up = above[i]
        if kind == 1:
            guess = left
        elif kind == 2:
            guess = up
        elif kind == 3:
            guess = (left + up) // 2
        else:
            corner = above[i - step] if i >= step else 0
            base = left + up - corner
            guess = min((left, up, corner), key=lambda c: abs(base - c))
        row[i] = (row[i] + guess) & 0xFF
    return row


def read_png(path):
    """The same of a PNG of RGB or RGBA, 8 or 16 bits, not interlaced; of 16 bits the upper 8."""
    with open(path, "rb") as file:
        data = file.read()
    if data[:8] != b"\x89PNG\r\n\x1a\n":
        raise Unreadable(f"{path}: no PNG")
    at, packed, header = 8, b"", None
    while at + 8 <= len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        if kind == b"IHDR":
            header = struct.unpack(">IIBBBBB", data[at + 8:at + 21])
        if kind == b"IDAT":
            packed += data[at + 8:at + 8 + size]
        at += 12 + size
    if header is None or header[2] not in (8, 16) or header[3] not in (2, 6) or header[6] != 0:
        raise Unreadable(f"{path}: no PNG of RGB or RGBA, 8 or 16 bits, not interlaced")
    width, height, bits, colour = header[:4]
    sample = bits // 8
    step = sample * (3 if colour == 2 else 4)
    try:
        raw = zlib.decompress(packed)
    except zlib.error as error:
        raise Unreadable(f"{path}: {error}") from error
    if len(raw) != height * (1 + step * width):
        raise Unreadable(f"{path}: {len(raw)} bytes of pixels, not {height * (1 + step * width)}")
    above = bytes(step * width)
    pixels = bytearray()
    for y in range(height):
        begin = y * (1 + step * width)
        row = bytearray(raw[begin + 1:begin + 1 + step * width])
        above = unfilter(raw[begin], row, above, step)
        rgb = bytearray(3 * width)
        for channel in range(3):
            rgb[channel::3] = above[channel * sample::step]
        pixels += rgb
    return width, height, bytes(pixels)


def compare(expected, screen, codes):
    """What is wrong with the screen, as a text; empty where nothing is."""
    if expected[:2] != screen[:2]:
        return "%d x %d pixels were expected, %d x %d are on the screen" % (*expected[:2], *screen[:2])
    if expected[2] == screen[2]:
        return ""
    differences = [abs(a - b) for a, b in zip(expected[2], screen[2])]
    wrong = sum(d > codes for d in differences)
    if wrong == 0:
        return ""
    first = next(i for i, d in enumerate(differences) if d > codes) // 3
    width = expected[0]
    return "%d of %d values differ by more than %d, the most by %d; first at column %d, row %d: %s, not %s" % (
        wrong, len(differences), codes, max(differences), first % width, first // width,
        tuple(screen[2][3 * first:3 * first + 3]), tuple(expected[2][3 * first:3 * first + 3]))


def main(arguments):
    if len(arguments) not in (2, 3) or (len(arguments) == 3 and not arguments[2].isdigit()):
        print(__doc__, file=sys.stderr)
        return 2
    try:
        expected, screen = read_png(arguments[0]), read_ppm(arguments[1])
    except (OSError, Unreadable) as error:
        print(f"comparing pictures: {error}", file=sys.stderr)
        return 2
    # A screen that is all of one colour equals another such one, and shows nothing.
    if expected[2] == expected[2][:3] * (expected[0] * expected[1]):
        print(f"{arguments[0]}: is of one colour, so that it proves nothing", file=sys.stderr)
        return 2
    wrong = compare(expected, screen, int(arguments[2]) if len(arguments) == 3 else 0)
    if wrong:
        print(f"{arguments[1]}: {wrong}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
