// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/btfbase/btfbase.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "btf/importers/btfbase/code_books.h"
#include "btf/importers/crop.h"
#include "btf/sample_set.h"

namespace veneer::btf {
namespace {

constexpr double kGamma = 2.2;  // of the pictures that were compressed

// What to multiply, in linear light: (s v)^2.2 = s^2.2 v^2.2 saves a power for each sample.
double decode(double encoded) { return std::pow(std::max(encoded, 0.0), kGamma); }

}  // namespace

Status import_btfbase(const std::filesystem::path& source,
                      const std::filesystem::path& set,
                      const ImportOptions& options,
                      Progress& progress) {
  VENEER_ASSIGN(const CodeBooks books, CodeBooks::read(source));
  VENEER_ASSIGN(
      const Crop crop,
      crop_of(
          options, books.width(), books.height(), fmt::format("importing {}", source.string())));
  SampleSetInfo info;
  info.width = crop.width;
  info.height = crop.height;
  info.views = bonn_directions();
  info.lights = bonn_directions();
  info.source = fmt::format("BTFBASE code-books \"{}\", columns {} to {}, rows {} to {}",
                            (source / "").parent_path().filename().string(),
                            crop.x,
                            crop.x + crop.width - 1,
                            crop.y,
                            crop.y + crop.height - 1);
  info.licence = "that of the code-books (measurements of the University of Bonn: research use)";
  VENEER_ASSIGN(SampleSetWriter writer, SampleSetWriter::create(set, info));

  std::vector<CodeBooks::Place> places;
  for (const Direction& view : info.views) {
    for (const Direction& light : info.lights) places.push_back(books.place_of(view, light));
  }
  // Many texels share a 4-D function: each one that is used is decoded once.
  constexpr int kUnused = -1;
  std::vector<int> slot_of(static_cast<std::size_t>(books.function_count()), kUnused);
  std::vector<int> used;
  for (int y = crop.y; y < crop.y + crop.height; ++y) {
    for (int x = crop.x; x < crop.x + crop.width; ++x) {
      int& slot = slot_of[static_cast<std::size_t>(books.function_of(x, y))];
      if (slot != kUnused) continue;
      slot = static_cast<int>(used.size());
      used.push_back(books.function_of(x, y));
    }
  }
  const std::size_t samples = places.size() * 3;
  std::vector<float> decoded(used.size() * samples);
  progress.start("decoding functions", static_cast<std::int64_t>(used.size()));
  parallel_for(
      static_cast<std::int64_t>(used.size()), 1, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t slot = begin; slot < end; ++slot) {
          float* out = &decoded[static_cast<std::size_t>(slot) * samples];
          for (const CodeBooks::Place& place : places) {
            const Eigen::Vector3d rgb =
                books.colour(used[static_cast<std::size_t>(slot)], place) / 255.0;
            for (const double value : rgb) *out++ = static_cast<float>(decode(value));
          }
          progress.advance();
        }
      });
  progress.start("writing texels", info.texel_count());
  parallel_for(info.texel_count(), 64, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t texel = begin; texel < end; ++texel) {
      const int x = crop.x + static_cast<int>(texel) % crop.width;
      const int y = crop.y + static_cast<int>(texel) / crop.width;
      const auto slot =
          static_cast<std::size_t>(slot_of[static_cast<std::size_t>(books.function_of(x, y))]);
      const auto scale = static_cast<float>(decode(books.scale_of(x, y)));
      using Samples = Eigen::Map<const Eigen::ArrayXf>;
      const Samples values(&decoded[slot * samples], static_cast<Eigen::Index>(samples));
      const std::span<Eigen::half> out = writer.texel(static_cast<int>(texel));
      Eigen::Map<Eigen::Array<Eigen::half, Eigen::Dynamic, 1>>(out.data(), values.size()) =
          (values * scale).min(1.0F).cast<Eigen::half>();
    }
    progress.advance(end - begin);
  });
  progress.finish();
  return writer.finish();
}

}  // namespace veneer::btf
