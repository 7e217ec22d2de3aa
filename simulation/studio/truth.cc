// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/truth.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>

#include "base/toml_reader.h"
#include "simulation/materials/synthesize.h"

namespace veneer::simulation {
namespace {

/// A value out of its range, or one that is not a number.
Status in_range(std::string_view name, double value, double low, double high) {
  if (value >= low && value <= high) return {};
  return fail(
      Errc::kInvalidOption, "{} is {}; it must be between {} and {}", name, value, low, high);
}

Status check_light(const StudioTruth& t) {
  constexpr double kPerfect = std::numeric_limits<double>::infinity();
  VENEER_TRY(in_range("light_extinction", t.light_extinction, 1, kPerfect));
  VENEER_TRY(in_range("analyser_extinction", t.analyser_extinction, 1, kPerfect));
  VENEER_TRY(in_range("misalignment_deg", t.misalignment_deg, -90, 90));
  VENEER_TRY(in_range("polarised_gain", t.polarised_gain, 0.1, 10));
  VENEER_TRY(in_range("irradiance", t.irradiance, 1e-6, 1e6));
  VENEER_TRY(in_range("ambient", t.ambient, 0, 10));
  VENEER_TRY(in_range("light_fall_off", t.light_fall_off, 0, 0.9));
  return in_range("light_aim_error_deg", t.light_aim_error_deg, 0, 10);
}

Status check_lens(const StudioTruth& t) {
  VENEER_TRY(in_range("width", t.width, 16, 8192));
  VENEER_TRY(in_range("height", t.height, 16, 8192));
  VENEER_TRY(in_range("focal_px", t.focal_px, 10, 1e6));
  VENEER_TRY(in_range("principal_point[0]", t.principal_point.x(), 0, t.width));
  VENEER_TRY(in_range("principal_point[1]", t.principal_point.y(), 0, t.height));
  VENEER_TRY(in_range("k1", t.k1, -1000, 1000));
  VENEER_TRY(in_range("k2", t.k2, -1e6, 1e6));
  VENEER_TRY(in_range("distance_mm", t.distance_mm, 10, 1e5));
  // The radius s (1 + k1 s^2 + k2 s^4) must rise all over the picture, and with room around it:
  // then a pixel has one ray. In u = s^2 its derivative is 1 + 3 k1 u + 5 k2 u^2, which is least at
  // an end or, for k2 > 0, at its vertex.
  const double most = 1.5 * std::hypot(t.width, t.height) / t.focal_px;
  const auto rise = [&t](double u) { return 1 + 3 * t.k1 * u + 5 * t.k2 * u * u; };
  double least = std::min(1.0, rise(most * most));
  if (t.k2 > 0) {
    const double vertex = -0.3 * t.k1 / t.k2;
    if (vertex > 0 && vertex < most * most) least = std::min(least, rise(vertex));
  }
  if (least > 0.1) return {};
  return fail(Errc::kInvalidOption,
              "with k1 = {}, k2 = {} the distorted picture folds over; bring them closer to 0",
              t.k1,
              t.k2);
}

Status check_sensor(const StudioTruth& t) {
  VENEER_TRY(in_range("full_well", t.full_well, 10, 1e12));
  VENEER_TRY(in_range("read_noise", t.read_noise, 0, 1e5));
  VENEER_TRY(in_range("dark_current", t.dark_current, 0, 1e6));
  VENEER_TRY(in_range("fixed_pattern", t.fixed_pattern, 0, 0.1));
  VENEER_TRY(in_range("bits", t.bits, 8, 16));
  VENEER_TRY(in_range("offset_counts", t.offset_counts, 0, 0.1 * (1 << t.bits)));
  VENEER_TRY(in_range("vignetting", t.vignetting, 0, 0.9));
  VENEER_TRY(in_range("response_gamma", t.response_gamma, 0.1, 10));
  VENEER_TRY(in_range("dropped", t.dropped, 0, 0.9));
  return in_range("repeated", t.repeated, 0, 1 - t.dropped);
}

}  // namespace

Status StudioTruth::check() const {
  VENEER_TRY(find_height_field_material(material));
  if (tile_mm != 0) VENEER_TRY(in_range("tile_mm", tile_mm, 0.1, 1e4));
  VENEER_TRY(in_range("samples", samples, 1, 65536));
  // Below, nothing is left of the interface's reflection to share out between s and p.
  VENEER_TRY(in_range("index", index, 1.01, 5));
  VENEER_TRY(check_light(*this));
  VENEER_TRY(check_lens(*this));
  return check_sensor(*this);
}

Result<StudioTruth> StudioTruth::load(const std::filesystem::path& path) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::open(path));
  StudioTruth t;
  toml.read("material", t.material);
  toml.read("tile_mm", t.tile_mm);
  toml.read("material_seed", t.material_seed);
  toml.read("samples", t.samples);
  toml.read("index", t.index);
  toml.read("light_extinction", t.light_extinction);
  toml.read("analyser_extinction", t.analyser_extinction);
  toml.read("misalignment_deg", t.misalignment_deg);
  toml.read("polarised_gain", t.polarised_gain);
  toml.read("irradiance", t.irradiance);
  toml.read("ambient", t.ambient);
  toml.read("light_fall_off", t.light_fall_off);
  toml.read("light_aim_error_deg", t.light_aim_error_deg);
  toml.read("width", t.width);
  toml.read("height", t.height);
  toml.read("focal_px", t.focal_px);
  t.principal_point = {0.5 * t.width, 0.5 * t.height};
  toml.read("principal_point", t.principal_point);
  toml.read("k1", t.k1);
  toml.read("k2", t.k2);
  toml.read("distance_mm", t.distance_mm);
  toml.read("full_well", t.full_well);
  toml.read("read_noise", t.read_noise);
  toml.read("dark_current", t.dark_current);
  toml.read("fixed_pattern", t.fixed_pattern);
  toml.read("offset_counts", t.offset_counts);
  toml.read("vignetting", t.vignetting);
  toml.read("response_gamma", t.response_gamma);
  toml.read("bits", t.bits);
  toml.read("mosaic", t.mosaic);
  toml.read("dropped", t.dropped);
  toml.read("repeated", t.repeated);
  toml.read("seed", t.seed);
  VENEER_TRY(toml.finish());
  if (const Status valid = t.check(); !valid)
    return fail_while(fmt::format("reading the studio {}", path.string()), valid.error());
  return t;
}

}  // namespace veneer::simulation
