// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/synthesis_options.h"

#include <cmath>
#include <string_view>

namespace veneer::simulation {

namespace {

// Sine of 0.1 degree: nearer to the horizon the mean plane has no footprint left to speak of.
constexpr double kMinElevation = 1.745e-3;
constexpr double kUnitTolerance = 1e-5;  // directions read from files with six digits

Status check_range(std::string_view name, int value, int low, int high) {
  if (value >= low && value <= high) return {};
  return fail(
      Errc::kInvalidOption, "synthesizing: {} is {}; give {} to {}", name, value, low, high);
}

Status check_directions(std::string_view name, const btf::DirectionSet& directions) {
  if (directions.empty())
    return fail(Errc::kInvalidOption, "synthesizing: there are no {}; give at least one", name);
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const btf::Direction& d = directions[i];
    // Written so that a NaN fails both.
    if (!(std::abs(d.norm() - 1.0) <= kUnitTolerance) || !(d.z() >= kMinElevation)) {
      return fail(
          Errc::kInvalidOption,
          "synthesizing: number {} of the {}, ({}, {}, {}), is no unit vector at least 0.1 degree "
          "above the horizon",
          i,
          name,
          d.x(),
          d.y(),
          d.z());
    }
  }
  return {};
}

}  // namespace

Status SynthesisOptions::check() const {
  VENEER_TRY(check_range("size", size, 1, 512));
  VENEER_TRY(check_range("samples", samples, 1, 65536));
  VENEER_TRY(check_range("bounces", bounces, 0, 64));
  VENEER_TRY(check_directions("views", views));
  return check_directions("lights", lights);
}

}  // namespace veneer::simulation
