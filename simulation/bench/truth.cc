// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/truth.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "base/toml_reader.h"

namespace veneer::simulation {
namespace {

constexpr std::array<std::string_view, 3> kChannelNames{"red", "green", "blue"};

void read_channel(TomlReader toml, ChannelTruth& channel) {
  std::string kind = "power";
  toml.require("tone", kind);
  if (kind == "power") {
    channel.tone = ChannelTruth::Tone::kPower;
    toml.require("exponent", channel.exponent);
  } else if (kind == "s-curve") {
    channel.tone = ChannelTruth::Tone::kSCurve;
    toml.require("a", channel.a);
    toml.require("b", channel.b);
    toml.require("c", channel.c);
  } else {
    toml.add_error("tone", "must be \"power\" or \"s-curve\"");
  }
  toml.require("centre_nm", channel.centre_nm);
  toml.require("width_nm", channel.width_nm);
  toml.read("power", channel.power);
}

void read_projector(TomlReader toml, ProjectorTruth& p) {
  toml.require("width", p.width);
  toml.require("height", p.height);
  toml.read("bits", p.bits);
  toml.require("focal_px", p.focal_px);
  p.principal_point = {0.5 * p.width, 0.5 * p.height};
  toml.read("principal_point", p.principal_point);
  Eigen::Vector3d position = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d target = Eigen::Vector3d::Zero();
  Eigen::Vector3d up = Eigen::Vector3d::UnitY();
  toml.require("position", position);
  toml.require("target", target);
  toml.read("up", up);
  if (!((target - position).norm() > 1e-6)) {
    toml.add_error("target", "must be away from the position");
  } else {
    p.world_from_projector = look_at(position, target, up);
  }
  for (std::size_t c = 0; c < 3; ++c) read_channel(toml.table(kChannelNames[c]), p.channels[c]);
  toml.read("leak", p.leak);
  toml.read("interaction", p.interaction);
  toml.require("white_nits", p.white_nits);
  toml.require("reference_distance_m", p.reference_distance_m);
  toml.read("black_fraction", p.black_fraction);
  toml.read("black_kelvin", p.black_kelvin);
  toml.read("vignetting_exponent", p.vignetting_exponent);
  toml.read("vignetting_drop", p.vignetting_drop);
  toml.read("vignetting_off_centre", p.vignetting_off_centre);
  toml.read("blur_px", p.blur_px);
}

/// A value out of its range, or one that is not a number.
Status in_range(std::string_view name, double value, double low, double high) {
  if (value >= low && value <= high) return {};
  return fail(
      Errc::kInvalidOption, "{} is {}; it must be between {} and {}", name, value, low, high);
}

Status check_channel(std::string_view name, const ChannelTruth& channel) {
  const auto named = [name](std::string_view field) { return fmt::format("{}.{}", name, field); };
  if (channel.tone == ChannelTruth::Tone::kPower) {
    VENEER_TRY(in_range(named("exponent"), channel.exponent, 0.2, 6));
  } else {
    VENEER_TRY(in_range(named("a"), channel.a, 0.2, 20));
    VENEER_TRY(in_range(named("b"), channel.b, 0.2, 20));
    VENEER_TRY(in_range(named("c"), channel.c, 1e-6, 1e6));
    // The derivative is d^(a-1) ((a - b) d^b + a c) times a positive number, least at d = 1 for b >
    // a.
    if ((channel.a - channel.b) + channel.a * channel.c < 0)
      return fail(Errc::kInvalidOption,
                  "{}: an s-curve with a = {}, b = {}, c = {} falls before full drive; raise c",
                  name,
                  channel.a,
                  channel.b,
                  channel.c);
  }
  VENEER_TRY(in_range(named("centre_nm"), channel.centre_nm, 400, 700));
  VENEER_TRY(in_range(named("width_nm"), channel.width_nm, 5, 200));
  return in_range(named("power"), channel.power, 1e-3, 1e3);
}

Status check_projector(const ProjectorTruth& p) {
  VENEER_TRY(in_range("projector.width", p.width, 1, 16384));
  VENEER_TRY(in_range("projector.height", p.height, 1, 16384));
  VENEER_TRY(in_range("projector.bits", p.bits, 1, 16));
  VENEER_TRY(in_range("projector.focal_px[0]", p.focal_px.x(), 1, 1e6));
  VENEER_TRY(in_range("projector.focal_px[1]", p.focal_px.y(), 1, 1e6));
  VENEER_TRY(in_range("projector.principal_point[0]", p.principal_point.x(), -1e5, 1e5));
  VENEER_TRY(in_range("projector.principal_point[1]", p.principal_point.y(), -1e5, 1e5));
  for (std::size_t c = 0; c < 3; ++c)
    VENEER_TRY(check_channel(fmt::format("projector.{}", kChannelNames[c]), p.channels[c]));
  VENEER_TRY(in_range("projector.leak", p.leak, 0, 0.3));
  VENEER_TRY(in_range("projector.interaction", p.interaction, 0, 0.3));
  VENEER_TRY(in_range("projector.white_nits", p.white_nits, 1e-3, 1e6));
  VENEER_TRY(in_range("projector.reference_distance_m", p.reference_distance_m, 1e-2, 1e3));
  VENEER_TRY(in_range("projector.black_fraction", p.black_fraction, 0, 0.5));
  VENEER_TRY(in_range("projector.black_kelvin", p.black_kelvin, 1000, 40000));
  VENEER_TRY(in_range("projector.vignetting_exponent", p.vignetting_exponent, 0, 10));
  VENEER_TRY(in_range("projector.vignetting_drop", p.vignetting_drop, 0, 0.5));
  VENEER_TRY(in_range("projector.vignetting_off_centre", p.vignetting_off_centre.norm(), 0, 0.35));
  return in_range("projector.blur_px", p.blur_px, 0, 20);
}

Status check_object(const ObjectTruth& object) {
  if (object.wavelength_nm.empty() || object.wavelength_nm.size() != object.reflectance.size())
    return fail(
        Errc::kInvalidOption,
        "object.wavelength_nm has {} values and object.reflectance {}; give as many of each",
        object.wavelength_nm.size(),
        object.reflectance.size());
  for (std::size_t i = 0; i < object.reflectance.size(); ++i) {
    VENEER_TRY(in_range("object.reflectance", object.reflectance[i], 1e-3, 1));
    VENEER_TRY(in_range("object.wavelength_nm", object.wavelength_nm[i], 100, 2000));
  }
  if (std::ranges::adjacent_find(object.wavelength_nm, std::ranges::greater_equal{}) !=
      object.wavelength_nm.end())
    return fail(Errc::kInvalidOption, "object.wavelength_nm does not rise");
  return {};
}

}  // namespace

Status BenchTruth::check() const {
  VENEER_TRY(check_projector(projector));
  VENEER_TRY(check_object(object));
  VENEER_TRY(in_range("room.ambient_nits", room.ambient_nits, 0, 1e5));
  VENEER_TRY(in_range("room.ambient_kelvin", room.ambient_kelvin, 1000, 40000));
  VENEER_TRY(in_range("eye.width", eye.width, 1, 8192));
  VENEER_TRY(in_range("eye.height", eye.height, 1, 8192));
  VENEER_TRY(in_range("eye.vertical_fov_deg", eye.vertical_fov_deg, 0.01, 170));
  return in_range("eye.samples", eye.samples, 1, 16);
}

Result<BenchTruth> BenchTruth::load(const std::filesystem::path& path) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::open(path));
  BenchTruth truth;
  read_projector(toml.table("projector"), truth.projector);

  TomlReader object = toml.table("object");
  object.require("mesh", truth.object.mesh);
  object.require("wavelength_nm", truth.object.wavelength_nm);
  object.require("reflectance", truth.object.reflectance);
  // A name without an extension is a built-in mesh.
  if (std::filesystem::path(truth.object.mesh).has_extension())
    truth.object.mesh = (toml.folder() / truth.object.mesh).string();

  TomlReader room = toml.table("room");
  room.read("ambient_nits", truth.room.ambient_nits);
  room.read("ambient_kelvin", truth.room.ambient_kelvin);

  TomlReader eye = toml.table("eye");
  eye.read("width", truth.eye.width);
  eye.read("height", truth.eye.height);
  eye.read("vertical_fov_deg", truth.eye.vertical_fov_deg);
  eye.read("samples", truth.eye.samples);

  VENEER_TRY(toml.finish());
  if (const Status valid = truth.check(); !valid)
    return fail_while(fmt::format("reading the bench {}", path.string()), valid.error());
  return truth;
}

}  // namespace veneer::simulation
