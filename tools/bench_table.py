#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Prints what `veneer bench render --json` measured as a table: usage bench_table.py FILE."""

import json
import pathlib
import sys


def main():
    report = json.loads(pathlib.Path(sys.argv[1]).read_text())
    rows = report["results"]
    width = max(len(row["name"]) for row in rows)
    print(report["renderer"])
    print(f"{'':{width}}  {'ms':>8}  {'x plain':>7}  {'fetches':>7}  {'epsilon':>7}  {'cached':>6}")
    for row in rows:
        epsilon = f"{row['screen_epsilon']:.4f}" if "screen_epsilon" in row else ""
        cached = f"{100 * row['served']:.0f} %" if "served" in row else ""
        print(
            f"{row['name']:{width}}  {row['ms_median']:8.2f}  {row['ratio']:7.2f}"
            f"  {row['fetches']:7d}  {epsilon:>7}  {cached:>6}"
        )


if __name__ == "__main__":
    main()
