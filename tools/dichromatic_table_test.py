#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Laws of dichromatic_table.py, with a program in veneer's place whose errors are known."""

import contextlib
import io
import json
import pathlib
import sys
import tempfile
import unittest
import xml.etree.ElementTree

import dichromatic_table

# Fits write down what they were asked for; the error of lpca is 0.1 / n, ours half of it.
PROGRAM = """#!{python}
import json, sys
command, path = sys.argv[1:3]
if command == "fit":
    options = dict(zip(sys.argv[3::2], sys.argv[4::2]))
    open(options["-o"], "w").write(json.dumps(options))
else:
    options = json.load(open(sys.argv[3]))
    n = int(options["--components"].split("+")[0])
    rmse = 0.1 / n * (0.5 if options["--model"] == "dichromatic-lpca" else 1.0)
    error = {{"rmse": rmse}}
    print(json.dumps({{"encoded": error, "linear": error, "drawn_epsilon_avg": 0.1, "fetches": n}}))
"""


def row(model, components, clusters, rmse):
    return {
        "model": model,
        "components": components,
        "clusters": clusters,
        "rmse_encoded": rmse,
        "rmse_linear": rmse,
        "drawn_epsilon": rmse,
        "fetches": 1,
    }


class DichromaticTable(unittest.TestCase):
    def test_the_fewest_components_are_of_the_same_clusters_and_at_most_as_wrong(self):
        ours = row("dichromatic-lpca", "2+2", 8, 0.02)
        rows = [
            row("lpca", "3", 8, 0.021),
            row("lpca", "10", 8, 0.001),
            row("lpca", "9", 8, 0.02),
            row("lpca", "1", 32, 0.001),
            ours,
        ]
        self.assertEqual(dichromatic_table.fewest(rows, ours, "rmse_linear")["components"], "9")
        self.assertIsNone(dichromatic_table.fewest(rows[:1] + [ours], ours, "rmse_linear"))

    def test_the_curves_are_xml_with_one_line_each_even_for_one_point(self):
        rows = [row("lpca", "1", 8, 0.0), row("lpca", "1", 32, 0.0), row("lpca", "2", 32, 0.1)]
        for some in (rows, rows[2:]):
            root = xml.etree.ElementTree.fromstring(dichromatic_table.svg(some, "a"))
            lines = root.findall("{http://www.w3.org/2000/svg}polyline")
            self.assertEqual(len(lines), len({(r["model"], r["clusters"]) for r in some}))

    def test_the_whole_table_is_measured_with_the_program_it_is_given(self):
        with tempfile.TemporaryDirectory() as folder:
            program = pathlib.Path(folder) / "veneer"
            program.write_text(PROGRAM.format(python=sys.executable))
            program.chmod(0o755)
            rows = pathlib.Path(folder) / "rows.json"
            arguments = ["set", "--veneer", str(program), "--json", str(rows), "--clusters", "8"]
            arguments += ["--materials", folder]
            with contextlib.redirect_stdout(io.StringIO()) as out:
                dichromatic_table.main(arguments)
            self.assertEqual(len(json.loads(rows.read_text())), 8 + 4)
            self.assertEqual(len(list(pathlib.Path(folder).glob("*.safetensors"))), 8 + 4)
        self.assertIn("| dichromatic-lpca | 2+2 | 8 | 0.02500 |", out.getvalue())
        self.assertIn("2+2, 8 clusters, rmse encoded: reached by lpca 4", out.getvalue())


if __name__ == "__main__":
    unittest.main()
