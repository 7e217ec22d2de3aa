// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/ubo2014/ubo2014.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "base/parallel.h"
#include "btf/importers/crop.h"
#include "btf/importers/ubo2014/factors.h"
#include "btf/importers/ubo2014/plain.h"
#include "btf/sample_set.h"

namespace veneer::btf {
namespace {

using ubo2014::Chunk;
using ubo2014::Factors;
using ubo2014::Header;
using ubo2014::Matrix;
using ubo2014::PlainTexels;
using ubo2014::Product;

// Brings decoded texels into the set, from several threads.
class Destination {
 public:
  Destination(SampleSetWriter& writer, const Header& header, const Crop& crop)
      : writer_(writer), width_(header.width), views_(header.views.size()), crop_(crop) {
    for (const Direction& light : header.lights)
      cosines_.push_back(header.cosine_included ? 1.0F
                                                : static_cast<float>(std::max(light.z(), 0.0)));
  }
  [[nodiscard]] const Crop& crop() const { return crop_; }
  [[nodiscard]] std::uint64_t negative() const { return negative_; }
  // The first texel of the source with a value that is not finite.
  [[nodiscard]] std::optional<std::uint64_t> bad_texel() const {
    return bad_ == kNone ? std::nullopt : std::optional<std::uint64_t>(bad_);
  }

  /// @param texel  of the source; dropped where the crop leaves it out.
  /// @param rgb  gives the linear colour of a pair.
  template <class Colour>
  void put(std::uint64_t texel, const Colour& rgb) {
    const int x = static_cast<int>(texel % width_) - crop_.x;
    const int y = static_cast<int>(texel / width_) - crop_.y;
    if (x < 0 || y < 0 || x >= crop_.width || y >= crop_.height) return;
    const std::span<Eigen::half> out = writer_.texel(y * crop_.width + x);
    bool finite = true;
    std::uint64_t negative = 0;
    std::size_t pair = 0;
    for (std::size_t view = 0; view < views_; ++view) {
      for (const float cosine : cosines_) {
        const Eigen::Vector3f value = rgb(pair) * cosine;
        for (std::size_t c = 0; c < 3; ++c) {
          const float linear = value[static_cast<Eigen::Index>(c)];
          if (linear < 0.0F) ++negative;
          const Eigen::half sample(linear < 0.0F ? 0.0F : linear);
          finite = finite && std::isfinite(linear) && (Eigen::numext::isfinite)(sample);
          out[3 * pair + c] = sample;
        }
        ++pair;
      }
    }
    negative_ += negative;
    if (finite) return;
    std::uint64_t before = bad_;
    while (texel < before && !bad_.compare_exchange_weak(before, texel)) {
    }
  }

 private:
  static constexpr std::uint64_t kNone = std::numeric_limits<std::uint64_t>::max();
  SampleSetWriter& writer_;
  std::uint64_t width_;
  std::size_t views_;
  Crop crop_;
  std::vector<float> cosines_;  // to multiply by, of each light
  std::atomic<std::uint64_t> negative_ = 0;
  std::atomic<std::uint64_t> bad_ = kNone;
};

void write_factors(const Factors& factors,
                   const Header& header,
                   Destination& to,
                   Progress& progress) {
  constexpr std::size_t kBlock = 16;  // texels: their values fill a few megabytes
  const Crop& crop = to.crop();
  const std::size_t numbers = static_cast<std::size_t>(header.pair_count()) * 3;
  progress.start("multiplying factors", crop.height);
  parallel_for(crop.height, 1, [&](std::int64_t begin, std::int64_t end) {
    std::vector<float> values(std::min(kBlock, static_cast<std::size_t>(crop.width)) * numbers);
    for (std::int64_t row = begin; row < end; ++row) {
      const std::size_t row_first =
          static_cast<std::size_t>(crop.y + row) * header.width + static_cast<std::size_t>(crop.x);
      for (std::size_t x = 0; x < static_cast<std::size_t>(crop.width); x += kBlock) {
        const std::size_t count = std::min(kBlock, static_cast<std::size_t>(crop.width) - x);
        const std::size_t first = row_first + x;
        for (const Product& product : factors.products) {
          const std::size_t rows = product.texel_rows;
          Matrix block =
              product.per_texel.rows(first * rows, count * rows) * product.per_value.transpose();
          if (product.value_mean.size() > 0) block.rowwise() += product.value_mean.transpose();
          if (!product.texel_mean.bytes.empty())
            block.colwise() += product.texel_mean.rows(first * rows, count * rows).col(0);
          for (std::size_t r = 0; r < count * rows; ++r) {
            float* out = &values[r / rows * numbers + product.first + r % rows];
            for (Eigen::Index i = 0; i < block.cols(); ++i)
              out[static_cast<std::size_t>(i) * product.stride] =
                  block(static_cast<Eigen::Index>(r), i);
          }
        }
        for (std::size_t i = 0; i < count; ++i) {
          const float* texel = &values[i * numbers];
          to.put(first + i, [&](std::size_t pair) {
            return factors.encoding.decode(Eigen::Map<const Eigen::Vector3f>(texel + 3 * pair));
          });
        }
      }
      progress.advance();
    }
  });
}

// False where a chunk is damaged.
bool write_plain(const PlainTexels& texels,
                 const Header& header,
                 Destination& to,
                 Progress& progress) {
  const std::size_t numbers = static_cast<std::size_t>(header.pair_count()) * 3;
  std::atomic<bool> good = true;
  const auto count = static_cast<std::int64_t>(texels.chunks.size());
  progress.start("unpacking texels", count);
  parallel_for(count, 1, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t i = begin; i < end; ++i) {
      const Chunk& chunk = texels.chunks[static_cast<std::size_t>(i)];
      const bool unpacked =
          unpack(chunk,
                 texels.compressed,
                 numbers,
                 [&](std::uint64_t place, std::span<const std::byte> values) {
                   to.put(texels.stored[static_cast<std::size_t>(place)], [&](std::size_t pair) {
                     Eigen::Vector3f rgb;
                     for (std::size_t c = 0; c < 3; ++c)
                       rgb[static_cast<Eigen::Index>(c)] =
                           static_cast<float>(number_at<Eigen::half>(values, 3 * pair + c));
                     return rgb;
                   });
                 });
      if (!unpacked) good = false;
      progress.advance();
    }
  });
  return good;
}

}  // namespace

Status import_ubo2014(const std::filesystem::path& source,
                      const std::filesystem::path& set,
                      const ImportOptions& options,
                      Progress& progress) {
  VENEER_ASSIGN(const BinaryFile file, BinaryFile::open(source));
  BinaryReader reader(file.bytes(), fmt::format("reading {}", source.string()));
  VENEER_ASSIGN(const Header header, ubo2014::read_header(reader));
  Factors factors;
  PlainTexels plain;
  const bool is_plain = header.body == ubo2014::Body::kPlain;
  if (is_plain) {
    VENEER_ASSIGN(plain, ubo2014::read_plain(reader, header));
  } else {
    VENEER_ASSIGN(factors, ubo2014::read_factors(reader, header));
  }
  VENEER_ASSIGN(const Crop crop,
                crop_of(options,
                        static_cast<int>(header.width),
                        static_cast<int>(header.height),
                        fmt::format("importing {}", source.string())));
  SampleSetInfo info;
  info.width = crop.width;
  info.height = crop.height;
  if (std::isfinite(header.texels_per_mm) && header.texels_per_mm > 0.0)
    info.texel_pitch_mm = 1.0 / header.texels_per_mm;
  info.views = header.views;
  info.lights = header.lights;
  info.source = fmt::format("BTF {}", source.filename().string());
  info.licence = "that of the BTF (measurements of the University of Bonn: research use)";
  VENEER_ASSIGN(SampleSetWriter writer, SampleSetWriter::create(set, info));
  Destination destination(writer, header, crop);
  if (!is_plain)
    write_factors(factors, header, destination, progress);
  else if (!write_plain(plain, header, destination, progress))
    return reader.damaged("a compressed chunk is damaged");
  if (const auto texel = destination.bad_texel())
    return reader.damaged(
        "the texel in column {}, row {} has values that are not finite or larger "
        "than a sample can be",
        *texel % header.width,
        *texel / header.width);
  std::string remark;
  if (destination.negative() > 0)
    remark = fmt::format("{} negative values count as 0", destination.negative());
  if (is_plain && plain.stored.size() < header.texel_count())
    remark += fmt::format("{}{} missing texels are black",
                          remark.empty() ? "" : ", ",
                          header.texel_count() - plain.stored.size());
  progress.finish(remark);
  return writer.finish();
}

}  // namespace veneer::btf
