// SPDX-License-Identifier: Apache-2.0
#include "quality/ladder.h"

#include <cmath>
#include <optional>
#include <string_view>

#include "base/files.h"
#include "base/toml_reader.h"
#include "render/evaluation.h"

namespace veneer::quality {
namespace {

namespace fs = std::filesystem;

/// A basic string of TOML: quotes, backslashes and control characters escaped.
std::string toml_string(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (byte < 0x20 || byte == 0x7f) {
      out += fmt::format("\\u{:04X}", byte);
    } else {
      out += c;
    }
  }
  return out + "\"";
}

/// Shortest text that reads back as the same number, and as a float of TOML.
std::string number(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

Status check_count(std::size_t rungs) {
  if (rungs > Ladder::kMost)
    return fail(Errc::kInvalidOption,
                "it has {} rungs, over {}: the materials of all are on the GPU at once; take some "
                "out",
                rungs,
                Ladder::kMost);
  return {};
}

Status check(const Ladder& ladder) {
  if (ladder.rungs.empty())
    return fail(Errc::kInvalidOption,
                "it has no rungs; let `veneer trade` write it, or add a [[rung]]");
  VENEER_TRY(check_count(ladder.rungs.size()));
  const Rung* above = nullptr;
  for (const Rung& rung : ladder.rungs) {
    if (rung.material.empty())
      return fail(Errc::kInvalidOption, "rung \"{}\" names no material", rung.name);
    if (const Status drawing = rung.drawing.check(); !drawing)
      return fail_while(fmt::format("rung \"{}\"", rung.name), drawing.error());
    if (!(rung.ratio > 0.0) || !std::isfinite(rung.ratio))
      return fail(Errc::kInvalidOption,
                  "rung \"{}\" has the ratio {}; it must be above 0",
                  rung.name,
                  rung.ratio);
    if (!(rung.de00_mean >= 0.0) || !std::isfinite(rung.de00_mean))
      return fail(Errc::kInvalidOption,
                  "rung \"{}\" has the de00_mean {}; it must be 0 or more",
                  rung.name,
                  rung.de00_mean);
    if (above != nullptr && !(rung.ratio < above->ratio))
      return fail(Errc::kInvalidOption,
                  "rung \"{}\" costs {} and the one before it {}: costs must descend, the best "
                  "picture comes first",
                  rung.name,
                  rung.ratio,
                  above->ratio);
    if (above != nullptr && rung.de00_mean < above->de00_mean)
      return fail(Errc::kInvalidOption,
                  "rung \"{}\" is better than the one before it and costs less ({} dE00, {}): take "
                  "that one out",
                  rung.name,
                  rung.de00_mean,
                  above->de00_mean);
    above = &rung;
  }
  return {};
}

Rung read_rung(TomlReader& toml) {
  Rung rung;
  toml.require("name", rung.name);
  toml.require("material", rung.material);
  if (!rung.material.empty()) rung.material = toml.folder() / rung.material;
  toml.require("ratio", rung.ratio);
  toml.require("de00_mean", rung.de00_mean);
  toml.read("average_texels", rung.drawing.average_texels);
  toml.read("cache_spacing_px", rung.drawing.cache.spacing);
  toml.read("cache_most_turn", rung.drawing.cache.most_turn);
  toml.read("scale", rung.drawing.scale);
  std::string evaluation = "fragment";
  toml.read("evaluation", evaluation);
  if (const auto parsed = render::parse_evaluation(evaluation)) {
    rung.drawing.evaluation = *parsed;
  } else {
    toml.add_error("evaluation", parsed.error().what);
  }
  return rung;
}

}  // namespace

Result<Ladder> Ladder::load(const fs::path& path) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::open(path));
  Ladder ladder;
  std::vector<TomlReader> tables = toml.tables("rung");
  // First, so that not every mistake in each of very many is kept.
  if (const Status few = check_count(tables.size()); !few)
    return fail_while(fmt::format("reading {}", path.string()), few.error());
  for (TomlReader& rung : tables) ladder.rungs.push_back(read_rung(rung));
  VENEER_TRY(toml.finish());
  if (const Status good = check(ladder); !good)
    return fail_while(fmt::format("reading {}", path.string()), good.error());
  return ladder;
}

Status Ladder::save(const fs::path& path) const {
  const std::string doing = fmt::format("writing {}", path.string());
  if (const Status good = check(*this); !good) return fail_while(doing, good.error());
  std::string text =
      "# The measured front, from the best picture to the cheapest; veneerd steps along it.\n";
  std::error_code error;
  const fs::path folder = fs::absolute(path, error).parent_path();
  const render::DrawingOptions usual;
  for (const Rung& rung : rungs) {
    const fs::path material = fs::absolute(rung.material, error).lexically_relative(folder);
    if (error || material.empty())
      return fail(Errc::kIo, "{}: there is no way from it to {}", doing, rung.material.string());
    text += fmt::format("\n[[rung]]\nname = {}\nmaterial = {}\nratio = {}\nde00_mean = {}\n",
                        toml_string(rung.name),
                        toml_string(material.generic_string()),
                        number(rung.ratio),
                        number(rung.de00_mean));
    const render::DrawingOptions& drawing = rung.drawing;
    if (drawing.average_texels) text += "average_texels = true\n";
    if (drawing.evaluation == render::Evaluation::kCompute) text += "evaluation = \"compute\"\n";
    if (drawing.cache.spacing != usual.cache.spacing)
      text += fmt::format("cache_spacing_px = {}\n", drawing.cache.spacing);
    if (drawing.cache.most_turn != usual.cache.most_turn)
      text += fmt::format("cache_most_turn = {}\n", number(drawing.cache.most_turn));
    if (drawing.scale != usual.scale) text += fmt::format("scale = {}\n", number(drawing.scale));
  }
  return write_text(path, text);
}

Ladder ladder_of(const fs::path& material, bool offers_cache, const render::DrawingOptions& best) {
  // Estimates. Of four evaluations one is left, but what a pixel costs beside them stays; the cache
  // halves what a clustered model costs; the raster's area counts where pixels are what is paid
  // for.
  constexpr double kWithoutAverage = 0.5;
  constexpr double kFromCache = 0.5;
  constexpr int kUsualSpacing = 16;
  constexpr double kScales[] = {0.7, 0.5};
  Ladder ladder;
  Rung rung{
      .name = "as configured", .material = material, .drawing = best, .ratio = 1, .de00_mean = 0};
  ladder.rungs.push_back(rung);
  const auto step = [&](std::string name, double part) {
    rung.name = std::move(name);
    rung.ratio *= part;
    ladder.rungs.push_back(rung);
  };
  if (rung.drawing.average_texels) {
    rung.drawing.average_texels = false;
    step("texels not averaged", kWithoutAverage);
  }
  if (offers_cache && rung.drawing.cache.spacing == 0 &&
      rung.drawing.evaluation == render::Evaluation::kFragment) {
    rung.drawing.cache.spacing = kUsualSpacing;
    step(fmt::format("cache {}", kUsualSpacing), kFromCache);
  }
  for (const double scale : kScales) {
    if (scale >= rung.drawing.scale) continue;
    const double part = scale / rung.drawing.scale;
    rung.drawing.scale = scale;
    step(fmt::format("scale {:g}", scale), part * part);
  }
  return ladder;
}

Ladder ladder_of(std::span<const TradePoint> points, const fs::path& materials) {
  const std::vector<std::size_t> front = pareto_front(points, &TradePoint::ms_median);
  // A step that saves less than this is not worth that anybody sees it, and load varies as much.
  constexpr double kLeastStep = 0.85;
  constexpr double kWider = 0.95;
  Ladder ladder;
  for (double step = kLeastStep;; step *= kWider) {
    ladder.rungs.clear();
    for (auto i = front.rbegin(); i != front.rend(); ++i) {
      const TradePoint& point = points[*i];
      if (!(point.ratio > 0.0) || !std::isfinite(point.ratio)) continue;
      if (!ladder.rungs.empty() && point.ratio > step * ladder.rungs.back().ratio) continue;
      ladder.rungs.push_back({.name = point.candidate.name(),
                              .material = materials / (point.candidate.fit_key() + ".safetensors"),
                              .drawing = point.candidate.drawing,
                              .ratio = point.ratio,
                              .de00_mean = point.received_de00_mean});
    }
    if (ladder.rungs.size() <= Ladder::kMost) return ladder;
  }
}

}  // namespace veneer::quality
