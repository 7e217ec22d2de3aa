#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Sums up a test run: usage test_summary.py RESULTS [--require-data].

RESULTS holds ctest.xml (ctest --output-junit) and, for every ctest NAME that is a GoogleTest
program, NAME.xml with its cases. A test without such a file counts as one, so that a program that
dies before it writes one is a failure. The last line is "N passed, M failed, K skipped"; the exit
status is 1 if anything failed. With --require-data, a case that was skipped because measured data
are absent has failed.
"""

import argparse
import collections
import pathlib
import sys
import xml.etree.ElementTree as ElementTree

# How the tests begin the message of such a skip.
DATA_ABSENT = "real data absent"


def case_outcome(case):
    """("passed" | "failed" | "skipped", why) of one <testcase>, of GoogleTest or of ctest."""
    failures = case.findall("failure")
    if failures:
        return "failed", "; ".join(failure.get("message", "") for failure in failures)
    skipped = case.find("skipped")
    if skipped is not None:
        return "skipped", skipped.get("message", "")
    if case.get("status") in ("notrun", "disabled"):
        return "skipped", case.get("status")
    return "passed", ""


def outcomes(results):
    """(name, outcome, why) of every case of every test."""
    for test in ElementTree.parse(results / "ctest.xml").iter("testcase"):
        name = test.get("name")
        outcome, why = case_outcome(test)
        cases_file = results / f"{name}.xml"
        if not cases_file.exists():
            yield name, outcome, why
            continue
        cases = []
        for case in ElementTree.parse(cases_file).iter("testcase"):
            cases.append((f"{case.get('classname')}.{case.get('name')}", *case_outcome(case)))
        yield from cases
        if outcome == "failed" and all(case[1] != "failed" for case in cases):
            yield name, "failed", "every case passed, but the program did not end well"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=pathlib.Path)
    parser.add_argument("--require-data", action="store_true")
    options = parser.parse_args()

    counts = collections.Counter()
    try:
        for name, outcome, why in outcomes(options.results):
            if outcome == "skipped" and options.require_data and DATA_ABSENT in why:
                outcome = "failed"
            counts[outcome] += 1
            if outcome != "passed":
                print(f"{outcome}: {name}: {' '.join(why.split())}")
    except (OSError, ElementTree.ParseError) as error:
        print(f"summing up the tests in {options.results}: {error}", file=sys.stderr)
        counts["failed"] += 1
    print(f"{counts['passed']} passed, {counts['failed']} failed, {counts['skipped']} skipped")
    return 1 if counts["failed"] else 0


if __name__ == "__main__":
    sys.exit(main())
