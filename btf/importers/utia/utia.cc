// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/utia/utia.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "btf/importers/binary_reader.h"
#include "btf/importers/brdf.h"

namespace veneer::btf {
namespace {

constexpr int kThetas = 6;
constexpr int kPhis = 48;
constexpr std::size_t kDirections = std::size_t{kThetas} * kPhis;
constexpr double kThetaStep = std::numbers::pi / 12.0;
constexpr double kPhiStep = 2.0 * std::numbers::pi / kPhis;

// The four knots around a direction; beyond the last theta the weights leave [0, 1].
struct Knot {
  std::size_t index;
  double weight;
};
std::array<Knot, 4> knots_around(const Direction& direction) {
  const Angles angles = angles_from_direction(direction);
  const int theta = std::clamp(static_cast<int>(angles.theta / kThetaStep), 0, kThetas - 2);
  const int phi = std::clamp(static_cast<int>(angles.phi / kPhiStep), 0, kPhis - 1);
  const double t = angles.theta / kThetaStep - theta;
  const double p = angles.phi / kPhiStep - phi;
  const auto index = [](int at_theta, int at_phi) {
    return static_cast<std::size_t>(at_theta * kPhis + at_phi % kPhis);
  };
  return {Knot{index(theta, phi), (1.0 - t) * (1.0 - p)},
          Knot{index(theta, phi + 1), (1.0 - t) * p},
          Knot{index(theta + 1, phi), t * (1.0 - p)},
          Knot{index(theta + 1, phi + 1), t * p}};
}

}  // namespace

Status import_utia(const std::filesystem::path& source,
                   const std::filesystem::path& set,
                   const ImportOptions& options,
                   Progress& progress) {
  VENEER_ASSIGN(const BinaryFile file, BinaryFile::open(source));
  BinaryReader reader(file.bytes(), fmt::format("reading {}", source.string()));
  constexpr std::size_t kPlane = kDirections * kDirections;
  VENEER_ASSIGN(const auto values, reader.take({3, kPlane, sizeof(double)}, "the table"));
  VENEER_TRY(reader.expect_end());
  for (std::size_t i = 0; i < 3 * kPlane; ++i) {
    if (!std::isfinite(number_at<double>(values, i)))
      return reader.damaged("value {} of {} is not finite", i, 3 * kPlane);
  }
  progress.start("sampling the BRDF", 1);
  int negative = 0;
  const auto reflected = [&](const Direction& view, const Direction& light) {
    Eigen::Vector3d rgb = Eigen::Vector3d::Zero();
    for (const Knot& l : knots_around(light)) {
      for (const Knot& v : knots_around(view)) {
        for (std::size_t c = 0; c < 3; ++c)
          rgb[static_cast<Eigen::Index>(c)] +=
              l.weight * v.weight *
              number_at<double>(values, c * kPlane + l.index * kDirections + v.index);
      }
    }
    negative += static_cast<int>((rgb.array() < 0.0).count());
    return Eigen::Vector3d(rgb.cwiseMax(0.0) * std::max(light.z(), 0.0));
  };
  VENEER_TRY(write_brdf(source,
                        set,
                        options,
                        fmt::format("UTIA BRDF {}", source.filename().string()),
                        "that of the UTIA BRDF database (research use)",
                        reflected));
  progress.advance();
  progress.finish(negative == 0 ? std::string()
                                : fmt::format("{} negative values count as 0", negative));
  return {};
}

}  // namespace veneer::btf
