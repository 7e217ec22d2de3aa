// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <fstream>

#include "base/testing/fuzzing.h"
#include "base/testing/temporary_folder.h"
#include "quality/ladder.h"

namespace veneer::quality {
namespace {

bool is_same(const Rung& a, const Rung& b) {
  return a.name == b.name && a.material.lexically_normal() == b.material.lexically_normal() &&
         a.ratio == b.ratio && a.de00_mean == b.de00_mean &&
         a.drawing.average_texels == b.drawing.average_texels &&
         a.drawing.cache.spacing == b.drawing.cache.spacing &&
         a.drawing.cache.most_turn == b.drawing.cache.most_turn &&
         a.drawing.scale == b.drawing.scale && a.drawing.evaluation == b.drawing.evaluation;
}

/// A front that can be stepped along, and that comes back as it was saved.
std::string laws_of(const Ladder& ladder, const std::filesystem::path& folder) {
  if (ladder.rungs.empty() || ladder.rungs.size() > Ladder::kMost) return "the number of rungs";
  const Rung* above = nullptr;
  for (const Rung& rung : ladder.rungs) {
    if (rung.material.empty()) return "a rung without a material";
    if (!rung.drawing.check()) return "a way to draw that does not pass its check";
    if (!(std::isfinite(rung.ratio) && rung.ratio > 0)) return "a cost that is none";
    if (!(std::isfinite(rung.de00_mean) && rung.de00_mean >= 0)) return "an error that is none";
    if (above != nullptr && !(rung.ratio < above->ratio && rung.de00_mean >= above->de00_mean))
      return "no front";
    above = &rung;
  }
  const std::filesystem::path file = folder / "again.toml";
  const Status saved = ladder.save(file);
  if (!saved) return "what was read is not written: " + saved.error().what;
  const auto again = Ladder::load(file);
  if (!again) return "what was written is not read: " + again.error().what;
  return std::ranges::equal(ladder.rungs, again->rungs, &is_same) ? "" : "another ladder";
}

Verdict read(std::string_view text) {
  static const TemporaryFolder kFolder;
  const std::filesystem::path file = kFolder.path() / "ladder.toml";
  std::ofstream(file, std::ios::binary) << text;
  const auto ladder = Ladder::load(file);
  if (!ladder) return refused(ladder.error());
  return accepted(laws_of(*ladder, kFolder.path()));
}

/// As many rungs, with all that a rung may have.
std::string rungs(std::size_t count) {
  std::string text;
  for (std::size_t i = 0; i < count; ++i)
    text += fmt::format(
        "[[rung]]\nname = \"texel-colours {0}+2\"\nmaterial = \"materials/m-{0}.safetensors\"\n"
        "ratio = {1}\nde00_mean = 0.{0}\naverage_texels = true\ncache_spacing_px = 8\n"
        "cache_most_turn = 0.15\nscale = 0.5\nevaluation = \"fragment\"\n",
        i,
        9.5 - static_cast<double>(i));
  return text;
}

}  // namespace
}  // namespace veneer::quality

const veneer::FuzzedReader& veneer::fuzzed_reader() {
  using namespace quality;
  static const FuzzedReader kReader{
      &read,
      {rungs(1),
       rungs(Ladder::kMost),
       "[[rung]]\nname = \"\\u0007 \\\"a\\\"\"\nmaterial = \"/m\"\nratio = 1e-300\nde00_mean = 0\n"
       "evaluation = \"compute\"\n"},
      {40 << 10, 96},
      {rungs(Ladder::kMost + 1),
       "[[rung]]\nname = \"a\"\nmaterial = \"m\"\nratio = nan\nde00_mean = inf\n",
       "rung = [{name = \"a\", material = \"m\", ratio = 1, de00_mean = 1}]\n"}};
  return kReader;
}
