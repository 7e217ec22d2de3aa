#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Laws of check_includes.py, on small trees made for each."""

import pathlib
import tempfile
import unittest

import check_includes

SPDX = check_includes.SPDX + "\n"
HEADER = SPDX + "#pragma once\n"

# A tree without fault: every test changes one thing in it.
SOUND = {
    "base/CMakeLists.txt": "veneer_add_module(base LAYER 1 SRCS a.cc)\n",
    "base/a.h": HEADER,
    "base/a.cc": SPDX + '#include "base/a.h"\n\n#include <vector>\n',
    "btf/CMakeLists.txt": "veneer_add_module(btf\n  LAYER 2\n  SRCS b.cc)\n",
    "btf/b.h": HEADER + '#include "base/a.h"\n',
    "btf/models/m/m.cc": SPDX + '#include "btf/b.h"\n#include "btf/models/m/m.glsl.inc"\n',
    "btf/models/m/m.glsl": "float one() { return 1.0; }\n",
    "tracking/CMakeLists.txt": "veneer_add_module(tracking LAYER 2 SRCS t.cc)\n",
    "tracking/t.h": HEADER,
    "calibration/CMakeLists.txt": "veneer_add_module(calibration LAYER 4 SRCS c.cc)\n",
    "calibration/c.h": HEADER,
    "render/CMakeLists.txt": "veneer_add_module(render LAYER 5 SRCS r.cc)\n",
    "render/r.h": HEADER + '#include "calibration/c.h"\n',
    "render/internal_gl.h": HEADER + "#include <epoxy/gl.h>\n",
    "simulation/CMakeLists.txt": "add_subdirectory(bench)\n",
    "simulation/bench.h": HEADER,
    "simulation/bench/CMakeLists.txt": "veneer_add_module(bench LAYER 6 SRCS s.cc)\n",
    "simulation/bench/projector.h": HEADER + '#include "base/a.h"\n#include "simulation/bench.h"\n',
    "simulation/bench/colorimeter.h": HEADER + '#include "calibration/c.h"\n',
    "capture/CMakeLists.txt": "veneer_add_module(capture LAYER 3 SRCS c.cc)\n",
    "capture/plan.h": HEADER,
    "capture/polarisation/mueller.h": HEADER,
    "capture/development/CMakeLists.txt": "veneer_add_module(development LAYER 4 SRCS d.cc)\n",
    "capture/development/set.h": HEADER + '#include "capture/polarisation/mueller.h"\n',
    "simulation/studio/CMakeLists.txt": "veneer_add_module(studio LAYER 6 SRCS v.cc)\n",
    "simulation/studio/scene.h": HEADER + '#include "capture/plan.h"\n',
    "simulation/studio/scene_test.cc": SPDX + '#include "capture/polarisation/mueller.h"\n',
    "tests/end_to_end_test.cc": SPDX + '#include "render/r.h"\n',
    "build/generated/stray.h": "not ours\n",
}


class CheckIncludes(unittest.TestCase):
    def problems(self, changes):
        """What is found in the sound tree after `changes` (path -> text)."""
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for path, text in {**SOUND, **changes}.items():
                (root / path).parent.mkdir(parents=True, exist_ok=True)
                (root / path).write_text(text)
            return check_includes.Checker(root).check()

    def assert_one_problem(self, changes, *parts):
        problems = self.problems(changes)
        self.assertEqual(len(problems), 1, problems)
        for part in parts:
            self.assertIn(part, problems[0])

    def test_sound_tree_has_no_problem(self):
        self.assertEqual(self.problems({}), [])

    def test_higher_floor_is_refused_with_file_and_line(self):
        self.assert_one_problem(
            {"base/a.h": HEADER + '\n#include "btf/b.h"\n'}, "base/a.h:4:", "floor 1", "floor 2"
        )

    def test_other_module_of_same_floor_is_refused(self):
        self.assert_one_problem({"btf/b.h": HEADER + '#include "tracking/t.h"\n'}, "btf/b.h:3:")

    def test_indented_include_is_seen(self):
        self.assert_one_problem({"base/a.h": HEADER + '#  include "btf/b.h"\n'}, "base/a.h:3:")

    def test_include_must_be_a_path_from_the_root(self):
        self.assert_one_problem({"btf/b.h": HEADER + '#include "b2.h"\n'}, "no file")

    def test_folder_without_module_is_refused(self):
        self.assert_one_problem(
            {"extras/x.h": HEADER + '#include "base/a.h"\n'}, "extras/x.h", "no module"
        )

    def test_modules_of_one_folder_share_a_floor(self):
        both = "veneer_add_module(base LAYER 1)\nveneer_add_module(base_extra LAYER 3)\n"
        self.assert_one_problem({"base/CMakeLists.txt": both}, "different floors")

    def test_bench_physics_may_not_include_what_it_judges(self):
        self.assert_one_problem(
            {"simulation/bench/projector.h": HEADER + '#include "calibration/c.h"\n'},
            "simulation/bench/projector.h:3:",
        )

    def test_bench_physics_may_not_reach_it_through_another_header(self):
        self.assert_one_problem(
            {"simulation/bench/projector.h": HEADER + '#include "simulation/bench/colorimeter.h"\n'},
            "simulation/bench/projector.h:3:",
            "simulation/bench/colorimeter.h -> calibration/c.h",
        )

    def test_studio_may_not_include_the_polarisation_or_development_that_it_judges(self):
        for judged in ("polarisation/mueller.h", "development/set.h"):
            self.assert_one_problem(
                {"simulation/studio/scene.h": HEADER + f'#include "capture/{judged}"\n'},
                "simulation/studio/scene.h:3:",
                "the studio reaches",
                judged,
            )

    def test_studio_may_not_reach_them_through_another_header(self):
        self.assert_one_problem(
            {"capture/plan.h": HEADER + '#include "capture/polarisation/mueller.h"\n'},
            "simulation/studio/scene.h:3:",
            "capture/plan.h -> capture/polarisation/mueller.h",
        )

    def test_circle_of_includes_ends(self):
        self.assertEqual(
            self.problems({"simulation/bench.h": HEADER + '#include "simulation/bench/projector.h"\n'}),
            [],
        )

    def test_face_of_a_module_is_part_of_it(self):
        self.assert_one_problem(
            {"simulation/bench.h": HEADER + '#include "render/r.h"\n', "simulation/bench/projector.h": HEADER},
            "simulation/bench.h:3:",
        )

    def test_driver_header_is_refused_in_public_headers_only(self):
        for driver in ("epoxy/egl.h", "GL/gl.h", "EGL/egl.h", "libusb-1.0/libusb.h", "gbm.h"):
            include = f"#include <{driver}>\n"
            self.assert_one_problem({"render/r.h": HEADER + include}, driver)
            self.assertEqual(self.problems({"render/r.cc": SPDX + '#include "render/r.h"\n' + include}), [])

    def test_licence_line_comes_first(self):
        self.assert_one_problem({"base/a.h": "\n" + HEADER}, "base/a.h:1:", "first line")

    def test_header_has_pragma_once(self):
        self.assert_one_problem({"base/a.h": SPDX}, "pragma once")

    def test_own_header_comes_first(self):
        self.assert_one_problem(
            {"base/a.cc": SPDX + '#include <vector>\n#include "base/a.h"\n'}, "base/a.cc:2:", "own"
        )


if __name__ == "__main__":
    unittest.main()
