#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Laws of check_package.py: a good package passes, and each thing that is wrong with one is named."""

import pathlib
import unittest

import check_package

DEBIAN = pathlib.Path(__file__).resolve().parents[1] / "cmake/debian"


def listed(name, mode="-rw-r--r--", owner="root/root"):
    return f"{mode} {owner} 12 2026-01-01 00:00 {name}"


def good_listing():
    return [
        listed(name, "-rwxr-xr-x" if name.startswith("./usr/bin/") else "-rw-r--r--")
        for name in check_package.NEEDED
    ] + [listed("./usr/", "drwxr-xr-x")]


def listing_problems(lines):
    return list(check_package.listing_problems("\n".join(lines)))


def control_problems(fields=None, scripts=None, conffiles="/etc/veneer/veneer.toml\n"):
    good = {
        "Version": "1", "Maintainer": "a <b>", "Description": "c", "Section": "graphics",
        "Depends": ", ".join(f"{name} (>= 1)" for name in check_package.LIBRARIES), "Recommends": "d",
    }
    files = {name: (DEBIAN / name).read_text() for name in ("postinst", "prerm", "postrm")}
    return list(check_package.control_problems(good | (fields or {}), files | (scripts or {}), conffiles))


class CheckPackageTest(unittest.TestCase):
    def test_a_good_package_passes(self):
        self.assertEqual(listing_problems(good_listing()), [])
        self.assertEqual(control_problems(), [])

    def test_each_missing_file_is_named(self):
        for name in check_package.NEEDED:
            lines = [line for line in good_listing() if not line.endswith(" " + name)]
            self.assertEqual(listing_problems(lines), [f"{name} is missing"])

    def test_owners_modes_and_places_are_looked_at(self):
        for line, said in (
            (listed("./usr/share/veneer/x", owner="me/me"), "belongs to me/me"),
            (listed("./usr/share/veneer/x", "-rw-rw-r--"), "has mode rw-rw-r--"),
            (listed("./usr/share/veneer/x", "-rwxr-xr-x"), "has mode"),
            (listed("./usr/bin/x"), "has mode"),
            (listed("./usr/bin/x", "-rwsr-xr-x"), "has mode rwsr-xr-x"),
            (listed("./home/me/x"), "not ours"),
        ):
            self.assertIn(said, "\n".join(listing_problems(good_listing() + [line])), line)

    def test_scripts_never_start_the_service(self):
        for wrong in (
            "systemctl start veneerd",
            "systemctl enable --now veneerd.service",
            "systemctl try-restart veneerd",
            '  echo "anew"; systemctl restart veneerd',
        ):
            found = control_problems(scripts={"postinst": f"set -e\nsystemd-sysusers x\n{wrong}\n"})
            self.assertIn("starts the service", "\n".join(found))
        self.assertEqual(len(control_problems(scripts={"postinst": "set -e\n"})), 1)

    def test_fields_and_conffiles_are_needed(self):
        self.assertEqual(len(control_problems(fields={"Maintainer": ""})), 1)
        self.assertEqual(len(control_problems(conffiles="")), 1)
        self.assertEqual(
            len(control_problems(fields={"Depends": "libc6"})), len(check_package.LIBRARIES) - 1
        )


if __name__ == "__main__":
    unittest.main()
