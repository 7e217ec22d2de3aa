// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/merl/merl.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "btf/importers/binary_reader.h"
#include "btf/importers/brdf.h"

namespace veneer::btf {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr std::int32_t kThetaH = 90;
constexpr std::int32_t kThetaD = 90;
constexpr std::int32_t kPhiD = 180;
constexpr std::size_t kCells = std::size_t{kThetaH} * kThetaD * kPhiD;
constexpr std::array kScale{1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0};

int cell(double position, int count) {
  return std::clamp(static_cast<int>(position * count), 0, count - 1);
}

// Where a pair falls. Both directions lie in the upper hemisphere, so the half vector exists unless
// they are opposite on the horizon, where any cell does: the cosine there is 0.
std::size_t cell_of(const Direction& view, const Direction& light) {
  const Direction sum = view + light;
  constexpr double kOpposite = 1e-12;
  const Direction half = sum.norm() < kOpposite ? Direction::UnitZ() : sum.normalized();
  const Angles h = angles_from_direction(half);
  // The light in a frame whose z is the half vector and whose x points away from the normal. At the
  // normal itself that frame keeps the surface's azimuth, and at theta_d = 0 phi_d is 0.
  const Direction x(
      std::cos(h.theta) * std::cos(h.phi), std::cos(h.theta) * std::sin(h.phi), -std::sin(h.theta));
  const Direction y(-std::sin(h.phi), std::cos(h.phi), 0.0);
  const Angles d = angles_from_direction({light.dot(x), light.dot(y), light.dot(half)});
  const double phi_d = d.phi >= kPi ? d.phi - kPi : d.phi;  // f_r is the same with both exchanged
  const auto at_h = static_cast<std::size_t>(cell(std::sqrt(h.theta / (kPi / 2.0)), kThetaH));
  const auto at_d = static_cast<std::size_t>(cell(d.theta / (kPi / 2.0), kThetaD));
  const auto at_phi = static_cast<std::size_t>(cell(phi_d / kPi, kPhiD));
  return at_phi + kPhiD * (at_d + kThetaD * at_h);
}

}  // namespace

Status import_merl(const std::filesystem::path& source,
                   const std::filesystem::path& set,
                   const ImportOptions& options,
                   Progress& progress) {
  VENEER_ASSIGN(const BinaryFile file, BinaryFile::open(source));
  BinaryReader reader(file.bytes(), fmt::format("reading {}", source.string()));
  for (const std::int32_t expected : {kThetaH, kThetaD, kPhiD}) {
    VENEER_ASSIGN(const auto found, reader.read<std::int32_t>("the table's size"));
    if (found != expected)
      return reader.damaged(
          "its table is {} where MERL's is {}: it is no such file, or damaged", found, expected);
  }
  VENEER_ASSIGN(const auto values, reader.take({3, kCells, sizeof(double)}, "the table"));
  VENEER_TRY(reader.expect_end());
  for (std::size_t i = 0; i < 3 * kCells; ++i) {
    if (!std::isfinite(number_at<double>(values, i)))
      return reader.damaged("value {} of {} is not finite", i, 3 * kCells);
  }
  progress.start("sampling the BRDF", 1);
  int unmeasured = 0;
  const auto reflected = [&](const Direction& view, const Direction& light) {
    const std::size_t at = cell_of(view, light);
    Eigen::Vector3d rgb;
    for (std::size_t c = 0; c < 3; ++c) {
      const double stored = number_at<double>(values, c * kCells + at);
      if (stored < 0.0) ++unmeasured;
      rgb[static_cast<Eigen::Index>(c)] = std::max(stored, 0.0) * kScale[c];
    }
    return Eigen::Vector3d(rgb * std::max(light.z(), 0.0));
  };
  VENEER_TRY(write_brdf(source,
                        set,
                        options,
                        fmt::format("MERL BRDF {}", source.filename().string()),
                        "that of the MERL BRDF database (CC-BY-SA-4.0 since 2023)",
                        reflected));
  progress.advance();
  progress.finish(unmeasured == 0 ? std::string()
                                  : fmt::format("{} unmeasured values count as 0", unmeasured));
  return {};
}

}  // namespace veneer::btf
