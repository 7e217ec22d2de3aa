#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of compare_pictures.py, on pictures that are written here."""

import contextlib
import io
import os
import random
import struct
import sys
import tempfile
import unittest
import zlib

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import compare_pictures  # noqa: E402  (it stands beside this file)

WIDTH, HEIGHT = 7, 5


def ppm(pixels, width=WIDTH, height=HEIGHT):
    return b"P6\n%d %d\n255\n" % (width, height) + bytes(pixels)


def filtered(kind, row, above, step):
    """As an encoder does it: every byte less what its neighbours foretell."""
    def paeth(a, b, c):
        p = a + b - c
        return min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
    out = bytearray()
    for i, value in enumerate(row):
        a = row[i - step] if i >= step else 0
        b = above[i]
        c = above[i - step] if i >= step else 0
        out.append((value - (0, a, b, (a + b) // 2, paeth(a, b, c))[kind]) % 256)
    return bytes(out)


def png(samples, bits=8, alpha=False, filters=(0, 1, 2, 3, 4), width=WIDTH, height=HEIGHT):
    step = bits // 8 * (4 if alpha else 3)
    raw, above = b"", bytes(step * width)
    for y in range(height):
        row = samples[y * step * width:(y + 1) * step * width]
        kind = filters[y % len(filters)]
        raw += bytes([kind]) + filtered(kind, row, above, step)
        above = row

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
    packed = zlib.compress(raw)
    return (b"\x89PNG\r\n\x1a\n" +
            chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, 6 if alpha else 2, 0, 0, 0)) +
            chunk(b"IDAT", packed[:9]) + chunk(b"IDAT", packed[9:]) + chunk(b"IEND", b""))


class ComparePictures(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        chance = random.Random(1)
        self.pixels = bytes(chance.randrange(256) for _ in range(3 * WIDTH * HEIGHT))

    def run_on(self, expected, screen, *options):
        names = [os.path.join(self.folder, name) for name in ("expected.png", "screen.ppm")]
        for name, data in zip(names, (expected, screen)):
            with open(name, "wb") as file:
                file.write(data)
        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            status = compare_pictures.main([*names, *options])
        return status, said.getvalue()

    def test_equal_pictures_are_equal_by_every_filter(self):
        for kind in range(5):
            self.assertEqual(self.run_on(png(self.pixels, filters=(kind,)), ppm(self.pixels)), (0, ""))
        self.assertEqual(self.run_on(png(self.pixels), ppm(self.pixels))[0], 0)

    def test_alpha_and_lower_bits_do_not_count(self):
        rgba = b"".join(self.pixels[i:i + 3] + b"\x07" for i in range(0, len(self.pixels), 3))
        self.assertEqual(self.run_on(png(rgba, alpha=True), ppm(self.pixels))[0], 0)
        wide = b"".join(bytes([value, 255 - value]) for value in self.pixels)
        self.assertEqual(self.run_on(png(wide, bits=16), ppm(self.pixels))[0], 0)

    def test_any_single_value_counts(self):
        for at in (0, 1, len(self.pixels) // 2, len(self.pixels) - 1):
            wrong = bytearray(self.pixels)
            wrong[at] = (wrong[at] + 1) % 256
            status, said = self.run_on(png(self.pixels), ppm(wrong))
            self.assertEqual(status, 1)
            self.assertIn("1 of %d values differ" % len(self.pixels), said)
            self.assertIn("column %d, row %d" % (at // 3 % WIDTH, at // 3 // WIDTH), said)

    def test_the_tolerance_is_the_last_difference_that_is_let_pass(self):
        middle = bytes(100 + i % 2 for i in range(len(self.pixels)))
        for by in (1, 2, 3):
            other = bytes(value - by for value in middle)
            self.assertEqual(self.run_on(png(middle), ppm(other), str(by))[0], 0)
            self.assertEqual(self.run_on(png(middle), ppm(other), str(by - 1))[0], 1)

    def test_swapped_channels_and_rows_are_found(self):
        swapped = b"".join(self.pixels[i:i + 3][::-1] for i in range(0, len(self.pixels), 3))
        self.assertEqual(self.run_on(png(self.pixels), ppm(swapped), "1")[0], 1)
        row = 3 * WIDTH
        turned = b"".join(self.pixels[y * row:(y + 1) * row] for y in reversed(range(HEIGHT)))
        self.assertEqual(self.run_on(png(self.pixels), ppm(turned), "1")[0], 1)

    def test_another_size_is_said(self):
        status, said = self.run_on(png(self.pixels), ppm(self.pixels, HEIGHT, WIDTH))
        self.assertEqual(status, 1)
        self.assertIn("7 x 5 pixels were expected, 5 x 7 are on the screen", said)

    def test_what_is_no_picture_is_refused(self):
        good_png, good_ppm = png(self.pixels), ppm(self.pixels)
        for expected, screen in ((b"", good_ppm), (good_ppm, good_ppm), (good_png[:60], good_ppm),
                                 (good_png, b""), (good_png, good_ppm[:-1]), (good_png, b"P5" + good_ppm[2:])):
            status, said = self.run_on(expected, screen)
            self.assertEqual((status, said[:18]), (2, "comparing pictures"), said)

    def test_a_picture_of_one_colour_proves_nothing(self):
        plain = bytes([9, 8, 7] * (len(self.pixels) // 3))
        status, said = self.run_on(png(plain), ppm(plain))
        self.assertEqual(status, 2)
        self.assertIn("proves nothing", said)


if __name__ == "__main__":
    unittest.main()
