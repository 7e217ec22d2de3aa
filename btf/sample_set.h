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
  DirectionSet views;
  DirectionSet lights;
  std::string source;  ///< where the samples come from
  std::string licence;

  [[nodiscard]] int texel_count() const { return width * height; }
  [[nodiscard]] int pair_count() const { return static_cast<int>(views.size() * lights.size()); }
  [[nodiscard]] int channel_count() const { return polarised ? 6 : 3; }
};

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
  /// All stored values of one texel, [view][light][channel]. Texels are numbered row by row.
  [[nodiscard]] std::span<const Eigen::half> stored(int texel) const;
  /// RGB of one texel for every (view, light), [view][light][3]. A part that an unpolarised set
  /// does not have is a bug of the caller.
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
  [[nodiscard]] Status finish();

 private:
  struct State;
  explicit SampleSetWriter(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace veneer::btf
