// SPDX-License-Identifier: Apache-2.0
#include "btf/sample_set.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <mutex>
#include <utility>

#include "base/parallel.h"
#include "base/toml_reader.h"
#include "btf/internal_sample_set.h"

namespace veneer::btf {
namespace {

// The keys of set.toml as they stand in the file.
struct SetToml {
  std::string layout;
  int width = 0;
  int height = 0;
  double texel_pitch_mm = 0.0;
  std::vector<std::string> channels;
  double scale = 1.0;
  std::string cosine;
  std::string source;
  std::string licence;
};

// What is wrong inside a set is damage to the set, not a wrong option.
Status as_bad_format(Status status) {
  if (!status && status.error().code == Errc::kInvalidOption)
    return tl::unexpected<Error>(Error{Errc::kBadFormat, status.error().what});
  return status;
}

Result<SetToml> read_set_toml(const std::filesystem::path& path) {
  auto opened = TomlReader::open(path);
  if (!opened) {
    Status status = tl::unexpected<Error>(opened.error());
    VENEER_TRY(as_bad_format(std::move(status)));
  }
  TomlReader toml = std::move(*opened);
  SetToml set;
  toml.require("layout", set.layout);
  toml.require("width", set.width);
  toml.require("height", set.height);
  toml.read("texel_pitch_mm", set.texel_pitch_mm);
  toml.require("channels", set.channels);
  toml.read("scale", set.scale);
  toml.require("cosine", set.cosine);
  toml.read("source", set.source);
  toml.read("licence", set.licence);
  const auto expect = [&toml](std::string_view key, bool good, std::string_view text) {
    if (toml.contains(key) && !good) toml.add_error(key, text);
  };
  expect("layout", set.layout == "product", "expected \"product\" (every view with every light)");
  expect("width", set.width > 0, "expected a number of texels above 0");
  expect("height", set.height > 0, "expected a number of texels above 0");
  expect("texel_pitch_mm",
         std::isfinite(set.texel_pitch_mm) && set.texel_pitch_mm >= 0.0,
         "expected millimetres, or 0 where unknown");
  expect("channels",
         set.channels == internal::channel_names(false) ||
             set.channels == internal::channel_names(true),
         "expected R, G, B or specular.R, specular.G, specular.B, diffuse.R, diffuse.G, diffuse.B");
  expect("scale",
         set.scale >= kLeastScale && set.scale <= kMostScale,
         "expected 1e-25 to 1e25: a sample is what is stored times the scale");
  expect("cosine", set.cosine == "included", "expected \"included\"");
  VENEER_TRY(as_bad_format(toml.finish()));
  return set;
}

// How many of `values` are NaN or infinite: those with all exponent bits set.
std::int64_t count_non_finite(std::span<const Eigen::half> values) {
  constexpr std::uint16_t kExponent = 0x7c00;
  std::int64_t count = 0;
  for (const Eigen::half& value : values) {
    std::uint16_t bits = 0;
    std::memcpy(&bits, &value, sizeof(bits));
    count += (bits & kExponent) == kExponent ? 1 : 0;
  }
  return count;
}

}  // namespace

namespace internal {

const std::vector<std::string>& channel_names(bool polarised) {
  static const std::vector<std::string> kTotal{"R", "G", "B"};
  static const std::vector<std::string> kPolarised{
      "specular.R", "specular.G", "specular.B", "diffuse.R", "diffuse.G", "diffuse.B"};
  return polarised ? kPolarised : kTotal;
}

std::vector<std::int64_t> sample_shape(const SampleSetInfo& info) {
  return {static_cast<std::int64_t>(info.width) * info.height,
          static_cast<std::int64_t>(info.views.size()),
          static_cast<std::int64_t>(info.lights.size()),
          info.channel_count()};
}

Status check_info(const SampleSetInfo& info, Errc code, std::string_view doing) {
  constexpr std::int64_t kMost = std::numeric_limits<int>::max();
  if (info.width <= 0 || info.height <= 0 ||
      static_cast<std::int64_t>(info.width) * info.height > kMost)
    return fail(
        code, "{}: {} x {} texels; expected 1 to {}", doing, info.width, info.height, kMost);
  for (const auto& [name, directions] :
       {std::pair{"views", &info.views}, {"lights", &info.lights}}) {
    if (directions->empty()) return fail(code, "{}: there are no {}", doing, name);
    if (directions->size() > kMostDirections)
      return fail(code,
                  "{}: there are {} {}, over {}; leave some out",
                  doing,
                  directions->size(),
                  name,
                  kMostDirections);
    for (std::size_t i = 0; i < directions->size(); ++i) {
      const Direction& d = (*directions)[i];
      // As far below the horizon as rounding takes a direction that lies on it.
      constexpr double kRounding = 1e-6;
      if (!d.allFinite() || std::abs(d.norm() - 1.0) > kRounding || d.z() < -kRounding)
        return fail(code,
                    "{}: {}: direction {} ({}, {}, {}) is no unit vector of the upper hemisphere",
                    doing,
                    name,
                    i,
                    d.x(),
                    d.y(),
                    d.z());
    }
    if (const auto equal = find_equal_directions(*directions))
      return fail(code,
                  "{}: {}: directions {} and {} are equal; keep one of them",
                  doing,
                  name,
                  equal->first,
                  equal->second);
  }
  if (!(info.scale >= kLeastScale && info.scale <= kMostScale))
    return fail(code,
                "{}: the scale is {}; it must be {} to {}",
                doing,
                info.scale,
                kLeastScale,
                kMostScale);
  // Three floats for every pair must be countable in an int (SampleSet::rgb).
  const auto pairs =
      static_cast<std::int64_t>(info.views.size()) * static_cast<std::int64_t>(info.lights.size());
  if (pairs > kMost / 6) return fail(code, "{}: {} pairs of directions are too many", doing, pairs);
  return {};
}

}  // namespace internal

double scale_for(double largest) {
  constexpr double kLeast = 1.0 / 16.0;
  constexpr double kMost = 65504.0;
  if (!std::isfinite(largest) || largest <= 0.0 || (largest >= kLeast && largest <= kMost))
    return 1.0;
  constexpr int kHigh = 14;
  return std::clamp(std::ldexp(1.0, std::ilogb(largest) - kHigh), kLeastScale, kMostScale);
}

SampleSet::SampleSet(std::filesystem::path path,
                     SampleSetInfo info,
                     SafetensorsFile file,
                     TensorView samples)
    : path_(std::move(path)),
      info_(std::make_shared<const SampleSetInfo>(std::move(info))),
      file_(std::move(file)),
      samples_(std::move(samples)) {}

Result<SampleSet> SampleSet::open(const std::filesystem::path& folder) {
  const std::string doing = fmt::format("opening sample set {}", folder.string());
  std::error_code ignored;
  if (!std::filesystem::is_directory(folder, ignored))
    return fail(Errc::kNotFound, "{}: there is no such folder", doing);
  VENEER_ASSIGN(const SetToml toml, read_set_toml(folder / internal::kTomlName));
  SampleSetInfo info;
  info.width = toml.width;
  info.height = toml.height;
  info.texel_pitch_mm = toml.texel_pitch_mm;
  info.polarised = toml.channels == internal::channel_names(true);
  info.scale = toml.scale;
  info.source = toml.source;
  info.licence = toml.licence;
  VENEER_ASSIGN(info.views, read_directions(folder / internal::kViewsName));
  VENEER_ASSIGN(info.lights, read_directions(folder / internal::kLightsName));
  VENEER_TRY(internal::check_info(info, Errc::kBadFormat, doing));
  VENEER_ASSIGN(SafetensorsFile file, SafetensorsFile::open(folder / internal::kSamplesName));
  VENEER_ASSIGN(TensorView samples,
                file.tensor(internal::kTensorName, DType::kF16, internal::sample_shape(info)));
  return SampleSet(folder, std::move(info), std::move(file), std::move(samples));
}

std::span<const Eigen::half> SampleSet::stored(int texel) const {
  VENEER_CHECK(texel >= 0 && texel < info_->texel_count());
  const auto size = static_cast<std::size_t>(info_->pair_count()) *
                    static_cast<std::size_t>(info_->channel_count());
  return samples_.as<Eigen::half>().subspan(static_cast<std::size_t>(texel) * size, size);
}

SampleSet SampleSet::with_scale(double scale) const {
  SampleSet set = *this;
  SampleSetInfo info = *info_;
  info.scale = scale;
  set.info_ = std::make_shared<const SampleSetInfo>(std::move(info));
  return set;
}

double SampleSet::largest_stored(int first, int count) const {
  VENEER_CHECK(first >= 0 && count >= 0 && count <= info_->texel_count() - first);
  std::mutex mutex;
  std::uint16_t largest = 0;
  parallel_for(count, 16, [&](std::int64_t begin, std::int64_t end) {
    // Finite magnitudes are ordered as their bits are.
    constexpr std::uint16_t kMagnitude = 0x7fff;
    constexpr std::uint16_t kInfinite = 0x7c00;
    std::uint16_t own = 0;
    for (auto texel = static_cast<int>(first + begin); texel < first + end; ++texel)
      for (const Eigen::half value : stored(texel)) {
        const std::uint16_t bits = Eigen::numext::bit_cast<std::uint16_t>(value) & kMagnitude;
        own = std::max(own, bits < kInfinite ? bits : std::uint16_t{0});
      }
    const std::lock_guard lock(mutex);
    largest = std::max(largest, own);
  });
  return static_cast<double>(Eigen::numext::bit_cast<Eigen::half>(largest));
}

void SampleSet::rgb(int texel, Part part, std::span<float> out) const {
  const Eigen::Index pairs = info_->pair_count();
  VENEER_CHECK(out.size() == static_cast<std::size_t>(pairs) * 3);
  VENEER_CHECK(info_->polarised || part == Part::kTotal);
  const std::span<const Eigen::half> samples = stored(texel);
  Eigen::Map<Eigen::Array3Xf> rgb(out.data(), 3, pairs);
  if (!info_->polarised) {
    // Eigen converts eight at a time.
    Eigen::Map<Eigen::ArrayXf>(out.data(), pairs * 3) =
        Eigen::Map<const Eigen::Array<Eigen::half, Eigen::Dynamic, 1>>(samples.data(), pairs * 3)
            .cast<float>();
  } else {
    using Stored = Eigen::Map<const Eigen::Array<Eigen::half, 6, Eigen::Dynamic>>;
    const Stored all(samples.data(), 6, pairs);
    switch (part) {
      case Part::kSpecular:
        rgb = all.topRows<3>().cast<float>();
        break;
      case Part::kDiffuse:
        rgb = all.bottomRows<3>().cast<float>();
        break;
      case Part::kTotal:
        rgb = all.topRows<3>().cast<float>() + all.bottomRows<3>().cast<float>();
        break;
    }
  }
  if (info_->scale != 1.0) rgb *= static_cast<float>(info_->scale);
}

void SampleSet::rgb(int texel, Part part, std::span<const int> pairs, std::span<float> out) const {
  VENEER_CHECK(out.size() == pairs.size() * 3);
  VENEER_CHECK(info_->polarised || part == Part::kTotal);
  const std::span<const Eigen::half> samples = stored(texel);
  const auto channels = static_cast<std::size_t>(info_->channel_count());
  const auto scale = static_cast<float>(info_->scale);
  auto to = out.begin();
  for (const int pair : pairs) {
    const auto from = samples.subspan(static_cast<std::size_t>(pair) * channels, channels);
    for (std::size_t c = 0; c < 3; ++c) {
      const auto first = static_cast<float>(from[part == Part::kDiffuse ? c + 3 : c]);
      const bool both = info_->polarised && part == Part::kTotal;
      *to++ = scale * (both ? first + static_cast<float>(from[c + 3]) : first);
    }
  }
}

Status SampleSet::check_finite() const { return check_finite(0, info_->texel_count()); }

Status SampleSet::check_finite(int first, int count) const {
  VENEER_CHECK(first >= 0 && count >= 0 && count <= info_->texel_count() - first);
  std::atomic<std::int64_t> total = 0;
  std::mutex mutex;
  int first_texel = info_->texel_count();
  parallel_for(count, 16, [&](std::int64_t begin, std::int64_t end) {
    for (auto texel = static_cast<int>(first + begin); texel < first + end; ++texel) {
      const std::int64_t found = count_non_finite(stored(texel));
      if (found == 0) continue;
      total += found;
      const std::lock_guard lock(mutex);
      first_texel = std::min(first_texel, texel);
    }
  });
  if (total == 0) return {};
  const std::span<const Eigen::half> samples = stored(first_texel);
  const auto bad = std::find_if(samples.begin(), samples.end(), [](const Eigen::half& value) {
    return count_non_finite({&value, 1}) != 0;
  });
  const auto pair = (bad - samples.begin()) / info_->channel_count();
  const auto lights = static_cast<std::ptrdiff_t>(info_->lights.size());
  return fail(
      Errc::kBadFormat,
      "checking sample set {}: {} samples are NaN or infinite, the first at texel {} (row {}, "
      "column {}), view {}, light {}; repair or import it again",
      path_.string(),
      total.load(),
      first_texel,
      first_texel / info_->width,
      first_texel % info_->width,
      pair / lights,
      pair % lights);
}

}  // namespace veneer::btf
