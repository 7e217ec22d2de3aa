#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Compares dichromatic-lpca with a model of RGB Eigen-BRDFs on one polarised sample set, as Obara
et al. 2006 do in their Fig. 8: rmse of the recombined RGB by number of components.

Fits and evaluates each with the program `veneer`, prints a Markdown table and, for each number of
components of dichromatic-lpca, how many the rival needs to reach it. `--svg` draws the curves.
"""

import argparse
import json
import pathlib
import subprocess
import tempfile

OURS = "dichromatic-lpca"
COLOURS = ("#1b6ca8", "#c8102e", "#2e8b57", "#8a5a00")


def measure(arguments, model, components, clusters, folder):
    """One row: fits `model` and returns what `veneer evaluate` says of it."""
    material = pathlib.Path(folder) / f"{model}-{components}-{clusters}.safetensors"
    options = ["--model", model, "--components", components, "--clusters", str(clusters)]
    if arguments.precision and model != OURS:
        options += ["--precision", arguments.precision]
    if arguments.form and model == OURS:
        options += ["--form", arguments.form]
    fit = [arguments.veneer, "fit", arguments.set, *options, "-o", str(material)]
    subprocess.run(fit, check=True, capture_output=True)
    evaluate = [arguments.veneer, "evaluate", arguments.set, str(material), "--json"]
    report = json.loads(subprocess.run(evaluate, check=True, capture_output=True).stdout)
    return {
        "model": model,
        "components": components,
        "clusters": clusters,
        "rmse_encoded": report["encoded"]["rmse"],
        "rmse_linear": report["linear"]["rmse"],
        "drawn_epsilon": report["drawn_epsilon_avg"],
        "fetches": report["fetches"],
    }


def fewest(rows, ours, error):
    """The rival's row of the fewest components that is at most `error` of `ours`, or None."""
    good = [
        row
        for row in rows
        if row["model"] != OURS and row["clusters"] == ours["clusters"] and row[error] <= ours[error]
    ]
    return min(good, key=lambda row: int(row["components"]), default=None)


def table(rows):
    lines = [
        "| model | components | clusters | rmse encoded | rmse linear | epsilon as drawn | fetches |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {r['model']} | {r['components']} | {r['clusters']} | {r['rmse_encoded']:.5f} | "
        f"{r['rmse_linear']:.5f} | {r['drawn_epsilon']:.5f} | {r['fetches']} |"
        for r in rows
    ]
    return "\n".join(lines)


def needed(rows):
    lines = []
    for ours in (row for row in rows if row["model"] == OURS):
        for error in ("rmse_encoded", "rmse_linear"):
            rival = fewest(rows, ours, error)
            said = "none of the rival's" if rival is None else f"{rival['model']} {rival['components']}"
            lines.append(
                f"{OURS} {ours['components']}, {ours['clusters']} clusters, "
                f"{error.replace('_', ' ')}: reached by {said}"
            )
    return "\n".join(lines)


def count(row):
    """Components as in Obara's figure: 2+2 is 2 of each kind."""
    return int(row["components"].split("+")[0])


def svg(rows, title):
    """Curves of rmse encoded over components, one for each model and number of clusters."""
    width, height, left, bottom = 560, 360, 64, 48
    most = max(row["rmse_encoded"] for row in rows) * 1.05 or 1.0
    widest = max(count(row) for row in rows)
    x = lambda n: left + (width - left - 20) * (n - 1) / max(1, widest - 1)
    y = lambda e: height - bottom - (height - bottom - 40) * e / most
    text = 'font-family="sans-serif" font-size="12"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}">',
        '<rect width="100%" height="100%" fill="white"/>',
        f'<text x="{left}" y="20" {text}>{title}</text>',
        f'<text x="{width // 2 - 40}" y="{height - 10}" {text}>components (of each kind)</text>',
        f'<path d="M{left},40V{height - bottom}H{width - 20}" fill="none" stroke="black"/>',
    ]
    for n in range(1, widest + 1):
        parts.append(f'<text x="{x(n) - 4:.0f}" y="{height - bottom + 16}" {text}>{n}</text>')
    for step in range(5):
        error = most * step / 4
        parts.append(f'<text x="8" y="{y(error) + 4:.0f}" {text}>{error:.4f}</text>')
    curves = {}
    for row in rows:
        curves.setdefault((row["model"], row["clusters"]), []).append(row)
    for i, ((model, clusters), curve) in enumerate(curves.items()):
        colour = COLOURS[i % len(COLOURS)]
        points = " ".join(f"{x(count(r)):.1f},{y(r['rmse_encoded']):.1f}" for r in curve)
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"/>')
        parts.append(
            f'<text x="{width - 230}" y="{52 + 16 * i}" fill="{colour}" {text}>'
            f"{model}, {clusters} clusters</text>"
        )
    return "\n".join([*parts, "</svg>", ""])


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("set", help="a polarised sample set, NAME.btfset")
    parser.add_argument("--veneer", default="veneer", help="the program")
    parser.add_argument("--rival", default="lpca", help="lpca or revised-lpca")
    parser.add_argument("--precision", help="of the rival, where it offers several")
    parser.add_argument("--form", help="of dichromatic-lpca")
    parser.add_argument("--components", type=int, nargs="+", default=[1, 2, 3, 4, 5, 6, 7, 8])
    parser.add_argument("--ours", type=int, nargs="+", default=[1, 2, 3, 4], help="n stands for n+n")
    parser.add_argument("--clusters", type=int, nargs="+", default=[8, 32])
    parser.add_argument("--materials", type=pathlib.Path, help="a folder to keep what was fitted in")
    parser.add_argument("--svg", type=pathlib.Path, help="where to draw the curves")
    parser.add_argument("--json", type=pathlib.Path, help="where to write the rows")
    arguments = parser.parse_args(argv)
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.materials or scratch
        for clusters in arguments.clusters:
            wanted = [(arguments.rival, str(n)) for n in arguments.components]
            wanted += [(OURS, f"{n}+{n}") for n in arguments.ours]
            rows += [measure(arguments, *one, clusters, folder) for one in wanted]
    print(table(rows))
    print()
    print(needed(rows))
    if arguments.svg:
        arguments.svg.write_text(svg(rows, pathlib.Path(arguments.set).stem))
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
