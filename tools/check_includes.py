#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks every C++ file of the tree against the house rules on includes; usage check_includes.py
[--root DIR]. Prints "file:line: what is wrong" and exits 1 if anything is.

- A file includes headers of its own module or of strictly lower floors. A module is a folder whose
  CMakeLists.txt says veneer_add_module(NAME LAYER n ...); tests/ and benchmarks/ stand above all.
- A quoted include is a path from the root of the repository, and the file is there. (An embedded
  shader "x.frag.inc" counts as there if x.frag is.)
- The physics of the virtual bench and studio reaches no header of the modules that it is to judge,
  not even through others; only the bench's adaptors and the tests may.
- GL, EGL, USB and display headers stay out of a module's public headers.
- The first line is the SPDX licence line, a header has #pragma once, and a .cc file with a header
  of its own includes that one first, which proves that the header stands alone.
"""

import argparse
import fnmatch
import os
import pathlib
import re
import sys

SPDX = "// SPDX-License-Identifier: Apache-2.0"

# Folders of C++ code that are no modules: they may use every floor.
ABOVE_ALL_FLOORS = ("tests", "benchmarks")

# What judges without knowing what it judges: its name, its files, those among them that may know
# (the bench's adaptors give it the faces of the HAL), and what it judges.
JUDGES = (
    (
        "the bench's physics",
        ("simulation/bench.h", "simulation/bench/*"),
        (
            "simulation/bench/camera*",
            "simulation/bench/colorimeter*",
            "simulation/bench/registration*",
            "simulation/bench/rig*",
            "simulation/bench/*_test.cc",
        ),
        ("render/", "calibration/"),
    ),
    (
        "the studio",
        ("simulation/studio/*",),
        ("simulation/studio/*_test.cc",),
        ("capture/polarisation/", "capture/development/"),
    ),
)

# Headers that would make every user of a module depend on a driver's, and the headers of ours that
# exist to wrap them.
DRIVER_HEADER = re.compile(r"<(GL|GLES\w*|EGL|epoxy|libusb|gbm|libdrm|xf86drm|hidapi|arv|gphoto2)\b")
MAY_SHOW_DRIVER_HEADERS = ("*/internal_*.h", "render/gl_objects.h", "render/egl_context.h")

MODULE = re.compile(r"^\s*veneer_add_module\(\s*(\w+)\s+LAYER\s+(\d+)", re.MULTILINE)
INCLUDE = re.compile(r'^\s*#\s*include\s+(?:"([^"]+)"|(<[^>]+>))')


def matches(path, patterns):
    return any(fnmatch.fnmatch(path, pattern) for pattern in patterns)


def tree(root):
    """Paths of the tree's files from its root, without what is built, written or hidden."""
    for folder, folders, files in os.walk(root):
        here = pathlib.Path(folder)
        at_root = here == root
        folders[:] = sorted(
            f for f in folders if not f.startswith(".") and not (at_root and f in ("build", "out"))
        )
        for file in sorted(files):
            yield (here / file).relative_to(root).as_posix()


class Checker:
    def __init__(self, root):
        self.root = root
        self.problems = []
        self.floors = {}  # folder -> floor
        self.includes = {}  # C++ file -> [(line number, quoted path or <name>)]
        self.texts = {}
        self.files = set(tree(root))
        for path in sorted(self.files):
            if path.endswith("/CMakeLists.txt") and not self._is_above_all_floors(path):
                self._read_floor(path)
            elif path.endswith((".cc", ".h")):
                text = (root / path).read_text(encoding="utf-8")
                self.texts[path] = text
                self.includes[path] = [
                    (number, match[1] or match[2])
                    for number, line in enumerate(text.splitlines(), 1)
                    if (match := INCLUDE.match(line))
                ]

    def _read_floor(self, path):
        for _, layer in MODULE.findall((self.root / path).read_text(encoding="utf-8")):
            folder = path.rpartition("/")[0]
            if self.floors.setdefault(folder, int(layer)) != int(layer):
                self._problem(path, 1, "the modules of one folder stand on different floors")

    def _problem(self, path, line, text):
        self.problems.append(f"{path}:{line}: {text}")

    def module_of(self, path):
        """The innermost module folder around a file, or None; a/b.h is the face of the module a/b."""
        folder = path.rpartition(".")[0] + "/"
        while "/" in folder:
            folder = folder.rpartition("/")[0]
            if folder in self.floors:
                return folder
        return None

    @staticmethod
    def _is_above_all_floors(path):
        return path.partition("/")[0] in ABOVE_ALL_FLOORS

    def check(self):
        for path in self.includes:
            self._check_form(path)
            if self.module_of(path) is None and not self._is_above_all_floors(path):
                self._problem(path, 1, "the file belongs to no module (veneer_add_module)")
            for line, include in self.includes[path]:
                if include.startswith("<"):
                    self._check_driver_header(path, line, include)
                else:
                    self._check_quoted(path, line, include)
            for name, files, may_know, judged in JUDGES:
                if matches(path, files) and not matches(path, may_know):
                    self._check_judge(path, name, judged)
        return self.problems

    def _check_form(self, path):
        text = self.texts[path]
        if text.partition("\n")[0] != SPDX:
            self._problem(path, 1, f"the first line is not {SPDX!r}")
        if path.endswith(".h") and not re.search(r"^#pragma once$", text, re.MULTILINE):
            self._problem(path, 1, "no #pragma once")
        own = path[: -len(".cc")] + ".h"
        if path.endswith(".cc") and own in self.includes and self.includes[path]:
            line, first = self.includes[path][0]
            if first != own:
                self._problem(path, line, f'the first include is not its own "{own}"')

    def _check_driver_header(self, path, line, include):
        public = path.endswith(".h") and not matches(path, MAY_SHOW_DRIVER_HEADERS)
        if public and DRIVER_HEADER.match(include):
            self._problem(path, line, f"{include} in a public header; wrap it, or move it to the .cc")

    def _check_quoted(self, path, line, include):
        if include not in self.files and include.removesuffix(".inc") not in self.files:
            self._problem(path, line, f'no file "{include}" from the root of the repository')
            return
        user, used = self.module_of(path), self.module_of(include)
        if user is None or user == used:
            return
        if used is None:
            self._problem(path, line, f'"{include}" belongs to no module (veneer_add_module)')
        elif self.floors[used] >= self.floors[user]:
            self._problem(
                path,
                line,
                f'{user} (floor {self.floors[user]}) may not include "{include}" '
                f"(floor {self.floors[used]})",
            )

    def _check_judge(self, path, name, judged):
        for line, include in self.includes[path]:
            if chain := self._way_to(include, judged, {path}):
                self._problem(path, line, f"{name} reaches " + " -> ".join(chain))

    def _way_to(self, include, prefixes, seen):
        """The includes from `include` to a file that begins with one of prefixes; [] if none."""
        if include.startswith(prefixes):
            return [include]
        if include in seen:
            return []
        seen.add(include)
        for _, following in self.includes.get(include, []):
            if way := self._way_to(following, prefixes, seen):
                return [include, *way]
        return []


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    here = pathlib.Path(__file__).resolve().parent.parent
    parser.add_argument("--root", type=pathlib.Path, default=here)
    problems = Checker(parser.parse_args().root.resolve()).check()
    for problem in problems:
        print(problem)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
