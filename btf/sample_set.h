// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/safetensors.h"
#include "btf/direction.h"

namespace veneer::btf {

/// What is known of a sample set beside its samples.
///
/// A sample is pi * f_r * cos(theta_l): a white Lambertian texel lit along its normal is 1, and the
/// radiance is sample * E / pi with E the irradiance on a plane facing the light.
struct SampleSetInfo {
  int width = 0;                ///< texels
  int height = 0;               ///< texels
  double texel_pitch_mm = 0.0;  ///< 0 where unknown
  bool polarised = false;       ///< channels are specular.R,G,B, diffuse.R,G,B; else R,G,B
  /// Sample = stored * scale, so that what float16 cannot hold (over 65504) or only coarsely (under
  /// 6.1e-5) has a place. kLeastScale to kMostScale; powers of two cost no precision.
  double scale = 1.0;
  DirectionSet views;
  DirectionSet lights;
  std::string source;  ///< where the samples come from
  std::string licence;

  [[nodiscard]] int texel_count() const { return width * height; }
  [[nodiscard]] int pair_count() const { return static_cast<int>(views.size() * lights.size()); }
  [[nodiscard]] int channel_count() const { return polarised ? 6 : 3; }
};

/// Within these, every stored number times the scale is an ordinary float or 0.
inline constexpr double kLeastScale = 1e-25;
inline constexpr double kMostScale = 1e25;
/// For writers that know their largest sample: 1 where float16 holds it well as it is, else the
/// power of two that brings it to 2^14 to 2^15, which leaves most room below. 1 for 0 and for what
/// is not finite.
[[nodiscard]] double scale_for(double largest);

/// Which part of the reflected light; only polarised sets know more than the total.
enum class Part { kTotal, kSpecular, kDiffuse };

/// A folder NAME.btfset: set.toml, views.csv, lights.csv and samples.safetensors, which holds
/// "samples" in float16 as [texel][view][light][channel], so that one texel's BRDF is contiguous.
/// Memory-mapped; cheap to copy; thread-safe.
class SampleSet {
 public:
  /// Errors: kNotFound; kBadFormat (a tensor whose shape does not match size and directions, equal
  /// or non-unit directions, an unknown key).
  [[nodiscard]] static Result<SampleSet> open(const std::filesystem::path& folder);

  [[nodiscard]] const SampleSetInfo& info() const { return *info_; }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// All stored values of one texel, [view][light][channel], in units of the scale. Texels are
  /// numbered row by row.
  [[nodiscard]] std::span<const Eigen::half> stored(int texel) const;
  /// The same numbers under another scale, which need not be within a file's bounds.
  [[nodiscard]] SampleSet with_scale(double scale) const;
  /// The largest magnitude that texels [first, first + count) have stored, without the scale; of
  /// finite numbers.
  [[nodiscard]] double largest_stored(int first, int count) const;
  /// RGB of one texel for every (view, light), [view][light][3], times the scale. A part that an
  /// unpolarised set does not have is a bug of the caller.
  /// @param out  pair_count() * 3 floats.
  void rgb(int texel, Part part, std::span<float> out) const;
  /// The same of some pairs, numbered view * lights + light. @param out  3 floats each.
  void rgb(int texel, Part part, std::span<const int> pairs, std::span<float> out) const;
  /// Looks at every sample once. Errors: kBadFormat where one is NaN or infinite, with the texel
  /// and pair of the first and how many there are. Fits call it before they start.
  [[nodiscard]] Status check_finite() const;
  /// The same of the texels [first, first + count).
  [[nodiscard]] Status check_finite(int first, int count) const;

 private:
  SampleSet(std::filesystem::path path,
            SampleSetInfo info,
            SafetensorsFile file,
            TensorView samples);
  std::filesystem::path path_;
  std::shared_ptr<const SampleSetInfo> info_;  // shared by copies of the set
  SafetensorsFile file_;
  TensorView samples_;
};

/// Writes a sample set, whole or not at all. Texels may be written from several threads.
class SampleSetWriter {
 public:
  /// Errors: kInvalidOption (no texels, no or equal directions), kIo.
  [[nodiscard]] static Result<SampleSetWriter> create(const std::filesystem::path& folder,
                                                      const SampleSetInfo& info);
  SampleSetWriter(SampleSetWriter&&) noexcept;
  ~SampleSetWriter();
  /// Where to put one texel, [view][light][channel].
  [[nodiscard]] std::span<Eigen::half> texel(int texel);
  /// What to put there for a sample: over the scale, cut to what float16 holds and counted where
  /// it is beyond. NaN stays NaN, for check_finite() to find. From any thread.
  [[nodiscard]] Eigen::half stored(float sample);
  /// Samples that were cut.
  [[nodiscard]] std::int64_t clamped() const;
  /// What to tell of them; empty where there were none.
  [[nodiscard]] std::string clamped_remark() const;
  [[nodiscard]] Status finish();

 private:
  struct State;
  explicit SampleSetWriter(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace veneer::btf
