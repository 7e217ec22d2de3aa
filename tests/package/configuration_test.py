#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Keeps veneer.toml(5) and the default /etc/veneer/veneer.toml true: keys are found in the sources
that read them, and each has to be in the page; those that a reload does not take are marked."""

import pathlib
import re
import tomllib
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/man/veneer.toml.5"
DEFAULT = ROOT / "etc/veneer.toml"

# Who reads veneer.toml. Invented trackers have a page of their own (docs/howto/scenario.md).
READERS = ("daemon", "tracking", "projector")
NOT_READERS = ("tracking/drivers/simulated", "tracking/drivers/simulated_device")

# read("key", ...), read_path(toml, "key", ...), toml.table("key"), whatever the helper is called.
READS = re.compile(r'\b(?:\w+_)?(?:read|require|table|tables)(?:_\w+)?\(\s*(?:\w+,\s*)?"([a-z][a-z0-9_]*)"')


def keys_read():
    """Key -> the first file that reads it."""
    keys = {}
    for folder in READERS:
        for path in sorted((ROOT / folder).rglob("*.cc")):
            name = path.relative_to(ROOT).as_posix()
            if path.stem.endswith("_test") or path.stem.startswith(("fake_", "mock_")):
                continue
            if any(name.startswith(folder + "/") for folder in NOT_READERS):
                continue
            text = path.read_text()
            if "TomlReader" not in text:
                continue
            for key in READS.findall(text):
                keys.setdefault(key, name)
    return keys


def keys_of_page():
    page = PAGE.read_text().replace("\\-", "-")
    return set(re.findall(r"^\\fB([a-z0-9_]+)\\fR", page, re.MULTILINE)) | set(
        re.findall(r"^\.SH TABLE \[(\w+)\]", page, re.MULTILINE)
    )


def keys_of_tables(table):
    for key, value in table.items():
        yield key
        for each in value if isinstance(value, list) else [value]:
            if isinstance(each, dict):
                yield from keys_of_tables(each)


class ConfigurationTest(unittest.TestCase):
    def test_every_key_that_is_read_is_in_the_page(self):
        read = keys_read()
        # Should the reader's calls change their looks, this test must not fall silent.
        for known in ("scene", "frame_rate_hz", "geometry_floor", "horizon_s", "host", "driver"):
            self.assertIn(known, read)
        rehearsal = {"scenario", "expect", "path", "fault"}  # tables of rehearsals
        missing = {key: file for key, file in read.items() if key not in keys_of_page() | rehearsal}
        self.assertEqual(missing, {}, f"read, but not in {PAGE.name}")

    def test_what_a_reload_does_not_take_is_marked(self):
        source = (ROOT / "daemon/reloader.cc").read_text()
        taken = re.findall(r'"([\w.]+)"', re.search(r"kTaken\{(.*?)\};", source, re.DOTALL)[1])
        self.assertIn("scene", taken)
        self.assertIn("render.", taken)
        page = PAGE.read_text()
        top = page.split(".SH TOP LEVEL")[1].split(".SH TABLE")[0]
        found = re.findall(r"^\\fB(\w+)\\fR(\\\(dg)? =", top, re.MULTILINE)
        tables = re.findall(r"^\.SH TABLE \[(\w+)\]( \\\(dg)?$", page, re.MULTILINE)
        found += [(name + ".", mark) for name, mark in tables]
        self.assertGreater(len(found), 15)
        self.assertEqual({name for name, mark in found if not mark}, set(taken))

    def test_every_key_of_the_default_configuration_is_in_the_page(self):
        default = tomllib.loads(DEFAULT.read_text())
        invented = {"path", "body", "kind", "position"}  # of the simulated tracker
        self.assertEqual(set(keys_of_tables(default)) - keys_of_page() - invented, set())

    def test_drivers_that_the_default_offers_exist(self):
        offered = re.findall(r'^# driver = "([\w-]+)"', DEFAULT.read_text(), re.MULTILINE)
        tables = (ROOT / "tracking/drivers.cc").read_text() + (ROOT / "projector/controls.cc").read_text()
        self.assertGreater(len(offered), 3)
        for driver in offered:
            self.assertTrue(f'"{driver}"' in tables, driver)

    def test_the_default_says_where_what_must_be_made_goes(self):
        default = tomllib.loads(DEFAULT.read_text())
        for key in ("scene", "material", "profile"):
            self.assertTrue(default[key].startswith("/var/lib/veneer/"), default[key])
        self.assertEqual(default["output"]["driver"], "kms")
        self.assertEqual(default["service"]["bus"], "system")


if __name__ == "__main__":
    unittest.main()
