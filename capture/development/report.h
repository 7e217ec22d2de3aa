// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "capture/development/developer.h"
#include "capture/development/sample_set.h"

namespace veneer::capture {

/// Samples as a picture for a screen: sRGB, 1 is white, cut to [0, 1].
[[nodiscard]] Image<Rgb8> picture_of_samples(const Image<Rgb32f>& samples);

/// The report of a capture: index.html, report.json and pictures/ with a contact sheet of parallel,
/// cross, specular, shadow, diffuse and what is masked. The shadow is Obara's C =
/// I_cross(reference)
/// - I_cross(light), the reference being the light nearest the normal.
class CaptureReport {
 public:
  /// @param developer  borrowed; must outlive the report.
  CaptureReport(const Developer& developer, std::filesystem::path folder);
  /// Adds the pictures of one direction, of at most kMostPictured of them, spread over all.
  /// Errors: kIo, those of Developer::develop().
  [[nodiscard]] Status add(const DevelopedDirection& direction);
  /// @param warnings  of the session.   @return  what report.json says. Errors: kIo.
  [[nodiscard]] Result<nlohmann::ordered_json> write(const DevelopedSet& set,
                                                     const std::vector<std::string>& warnings);

  static constexpr int kMostPictured = 60;

 private:
  const Developer& developer_;
  std::filesystem::path folder_;
  std::map<int, Image<Rgb32f>> reference_;               // of a view: cross
  std::map<std::pair<int, int>, std::string> pictured_;  // view and light: names begin with
};

}  // namespace veneer::capture
