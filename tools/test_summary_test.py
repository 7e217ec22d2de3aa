#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Laws of test_summary.py, on result files made for each."""

import contextlib
import io
import pathlib
import sys
import tempfile
import unittest
from unittest import mock

import test_summary

PASSED = '<testcase name="{}" classname="Law" status="run"/>'
FAILED = '<testcase name="{}" classname="Law" status="{}"><failure message="expected 1"/></testcase>'
SKIPPED = (
    '<testcase name="{}" classname="Law" status="run">'
    '<skipped message="x_test.cc:1&#x0A;{}"/></testcase>'
)


class TestSummary(unittest.TestCase):
    def run_on(self, files, *options):
        """(exit status, last line, all lines) for result files given as name -> test cases."""
        with tempfile.TemporaryDirectory() as folder:
            for name, cases in files.items():
                text = f"<testsuites><testsuite>{''.join(cases)}</testsuite></testsuites>"
                (pathlib.Path(folder) / f"{name}.xml").write_text(text)
            output = io.StringIO()
            with mock.patch.object(sys, "argv", ["test_summary.py", folder, *options]):
                with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
                    status = test_summary.main()
            lines = output.getvalue().splitlines()
            return status, lines[-1], lines

    def test_cases_of_programs_are_summed_and_other_tests_count_as_one(self):
        status, last, _ = self.run_on(
            {
                "ctest": [PASSED.format("base"), PASSED.format("btf"), PASSED.format("floors")],
                "base": [PASSED.format("A"), PASSED.format("B")],
                "btf": [PASSED.format("C"), SKIPPED.format("D", "no EGL here")],
            }
        )
        self.assertEqual((status, last), (0, "4 passed, 0 failed, 1 skipped"))

    def test_failed_case_is_named_and_fails_the_run(self):
        status, last, lines = self.run_on(
            {"ctest": [FAILED.format("base", "fail")], "base": [FAILED.format("A", "run")]}
        )
        self.assertEqual((status, last), (1, "0 passed, 1 failed, 0 skipped"))
        self.assertIn("failed: Law.A: expected 1", lines)

    def test_every_failure_of_a_case_is_told(self):
        twice = FAILED.format("A", "run").replace("</testcase>", '<failure message="expected 2"/></testcase>')
        _, _, lines = self.run_on({"ctest": [FAILED.format("base", "fail")], "base": [twice]})
        self.assertIn("failed: Law.A: expected 1; expected 2", lines)

    def test_program_that_dies_without_results_is_a_failure(self):
        status, last, _ = self.run_on({"ctest": [FAILED.format("base", "fail")]})
        self.assertEqual((status, last), (1, "0 passed, 1 failed, 0 skipped"))

    def test_program_that_fails_after_its_last_case_is_a_failure(self):
        status, last, _ = self.run_on(
            {"ctest": [FAILED.format("base", "fail")], "base": [PASSED.format("A")]}
        )
        self.assertEqual((status, last), (1, "1 passed, 1 failed, 0 skipped"))

    def test_absent_data_fail_only_where_they_are_required(self):
        files = {
            "ctest": [PASSED.format("btf")],
            "btf": [SKIPPED.format("A", "real data absent: wallpaper"), SKIPPED.format("B", "no EGL")],
        }
        self.assertEqual(self.run_on(files)[:2], (0, "0 passed, 0 failed, 2 skipped"))
        self.assertEqual(
            self.run_on(files, "--require-data")[:2], (1, "0 passed, 1 failed, 1 skipped")
        )

    def test_missing_results_fail(self):
        self.assertEqual(self.run_on({})[:2], (1, "0 passed, 1 failed, 0 skipped"))


if __name__ == "__main__":
    unittest.main()
