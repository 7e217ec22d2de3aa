// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/truth.h"

#include <algorithm>
#include <cmath>
#include <numbers>
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

/// @param turn_rad  axis times angle.
Eigen::Quaterniond turned_by(const Eigen::Vector3d& turn_rad) {
  const double angle = turn_rad.norm();
  if (!(angle > 0)) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, turn_rad / angle));
}

void read_texture(TomlReader& toml, ObjectTruth& object) {
  std::string name = "none";
  toml.read("texture", name);
  if (name == "none") return;
  if (name == "checks")
    object.texture = ObjectTruth::Texture::kChecks;
  else if (name == "stripes")
    object.texture = ObjectTruth::Texture::kStripes;
  else
    toml.add_error("texture", "must be \"none\", \"checks\" or \"stripes\"");
  toml.read("texture_fields", object.texture_fields);
  toml.require("texture_reflectance", object.texture_reflectance);
}

/// Where a device stands and which way it looks.
RigidTransform read_aim(TomlReader& toml) {
  Eigen::Vector3d position = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d target = Eigen::Vector3d::Zero();
  Eigen::Vector3d up = Eigen::Vector3d::UnitY();
  toml.require("position", position);
  toml.require("target", target);
  toml.read("up", up);
  if (!((target - position).norm() > 1e-6)) {
    toml.add_error("target", "must be away from the position");
    return {};
  }
  return look_at(position, target, up);
}

void read_projector(TomlReader toml, ProjectorTruth& p) {
  toml.require("width", p.width);
  toml.require("height", p.height);
  toml.read("bits", p.bits);
  toml.require("focal_px", p.focal_px);
  p.principal_point = {0.5 * p.width, 0.5 * p.height};
  toml.read("principal_point", p.principal_point);
  p.world_from_projector = read_aim(toml);
  for (std::size_t c = 0; c < 3; ++c) read_channel(toml.table(kChannelNames[c]), p.channels[c]);
  toml.read("leak", p.leak);
  toml.read("interaction", p.interaction);
  toml.read("chromaticity_drift", p.chromaticity_drift);
  toml.read("white_segment", p.white_segment);
  toml.read("white_segment_exponent", p.white_segment_exponent);
  toml.read("white_segment_kelvin", p.white_segment_kelvin);
  toml.read("lamp_drift", p.lamp_drift);
  toml.read("lamp_settling_s", p.lamp_settling_s);
  toml.require("white_nits", p.white_nits);
  toml.require("reference_distance_m", p.reference_distance_m);
  toml.read("black_fraction", p.black_fraction);
  toml.read("black_kelvin", p.black_kelvin);
  toml.read("vignetting_exponent", p.vignetting_exponent);
  toml.read("vignetting_drop", p.vignetting_drop);
  toml.read("vignetting_off_centre", p.vignetting_off_centre);
  toml.read("blur_px", p.blur_px);
}

void read_instrument(TomlReader toml, InstrumentTruth& i) {
  toml.read("relative_noise", i.relative_noise);
  toml.read("dark_noise_nits", i.dark_noise_nits);
  toml.read("drift_per_hour", i.drift_per_hour);
  toml.read("matrix_error", i.matrix_error);
  toml.read("seed", i.seed);
}

void read_tracker(TomlReader toml, TrackerTruth& t) {
  toml.read("position_noise_m", t.position_noise_m);
  toml.read("rotation_noise_deg", t.rotation_noise_deg);
  toml.read("seed", t.seed);
}

CameraTruth read_camera(TomlReader toml) {
  CameraTruth c;
  toml.read("width", c.width);
  toml.read("height", c.height);
  toml.require("focal_px", c.focal_px);
  c.principal_point = {0.5 * c.width, 0.5 * c.height};
  toml.read("principal_point", c.principal_point);
  toml.read("k1", c.k1);
  toml.read("k2", c.k2);
  c.world_from_camera = read_aim(toml);
  toml.read("sensitivity", c.sensitivity);
  toml.read("full_well", c.full_well);
  toml.read("read_noise", c.read_noise);
  toml.read("bits", c.bits);
  toml.read("least_exposure_s", c.least_exposure_s);
  toml.read("most_exposure_s", c.most_exposure_s);
  toml.read("samples", c.samples);
  toml.read("seed", c.seed);
  return c;
}

BoardTruth read_board(TomlReader toml) {
  BoardTruth b;
  toml.read("columns", b.columns);
  toml.read("rows", b.rows);
  toml.read("square_m", b.square_m);
  toml.read("border_m", b.border_m);
  toml.read("white", b.white);
  toml.read("black", b.black);
  toml.read("poses", b.poses);
  toml.read("tilt_deg", b.tilt_deg);
  toml.read("seed", b.seed);
  // Of the sensor in the board's frame; the turn is an axis times an angle.
  Eigen::Vector3d turn_deg = Eigen::Vector3d::Zero();
  toml.read("sensor_position", b.board_from_sensor.translation);
  toml.read("sensor_turn_deg", turn_deg);
  b.board_from_sensor.rotation = turned_by(turn_deg * (std::numbers::pi / 180));
  return b;
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
  VENEER_TRY(in_range("projector.chromaticity_drift", p.chromaticity_drift, 0, 0.3));
  VENEER_TRY(in_range("projector.white_segment", p.white_segment, 0, 0.6));
  VENEER_TRY(in_range("projector.white_segment_exponent", p.white_segment_exponent, 1, 4));
  VENEER_TRY(in_range("projector.white_segment_kelvin", p.white_segment_kelvin, 1000, 40000));
  VENEER_TRY(in_range("projector.lamp_drift", p.lamp_drift, 0, 0.3));
  VENEER_TRY(in_range("projector.lamp_settling_s", p.lamp_settling_s, 1, 1e5));
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
  const std::size_t wanted =
      object.texture == ObjectTruth::Texture::kNone ? 0 : object.wavelength_nm.size();
  if (object.texture_reflectance.size() != wanted)
    return fail(Errc::kInvalidOption,
                "object.texture_reflectance has {} values; with this texture it needs {}",
                object.texture_reflectance.size(),
                wanted);
  for (const double reflectance : object.texture_reflectance)
    VENEER_TRY(in_range("object.texture_reflectance", reflectance, 1e-3, 1));
  return in_range("object.texture_fields", object.texture_fields, 1, 1000);
}

Status check_instrument(const InstrumentTruth& i) {
  VENEER_TRY(in_range("instrument.relative_noise", i.relative_noise, 0, 0.2));
  VENEER_TRY(in_range("instrument.dark_noise_nits", i.dark_noise_nits, 0, 10));
  VENEER_TRY(in_range("instrument.drift_per_hour", i.drift_per_hour, -0.5, 0.5));
  for (const double error : i.matrix_error.reshaped())
    VENEER_TRY(in_range("instrument.matrix_error", error, -0.3, 0.3));
  return {};
}

Status check_tracker(const TrackerTruth& t) {
  VENEER_TRY(in_range("tracker.position_noise_m", t.position_noise_m, 0, 0.1));
  return in_range("tracker.rotation_noise_deg", t.rotation_noise_deg, 0, 10);
}

Status check_camera(const CameraTruth& c) {
  VENEER_TRY(in_range("camera.width", c.width, 16, 8192));
  VENEER_TRY(in_range("camera.height", c.height, 16, 8192));
  VENEER_TRY(in_range("camera.focal_px", c.focal_px, 10, 1e6));
  VENEER_TRY(in_range("camera.principal_point[0]", c.principal_point.x(), 0, c.width));
  VENEER_TRY(in_range("camera.principal_point[1]", c.principal_point.y(), 0, c.height));
  VENEER_TRY(in_range("camera.k1", c.k1, -10, 10));
  VENEER_TRY(in_range("camera.k2", c.k2, -100, 100));
  // The radius s (1 + k1 s^2 + k2 s^4) must rise all over the picture, and with room around it:
  // then a pixel has one ray. In u = s^2 its derivative is 1 + 3 k1 u + 5 k2 u^2, which is least at
  // an end or, for k2 > 0, at its vertex.
  const double most = 1.5 * Eigen::Vector2d(c.width, c.height).norm() / c.focal_px;
  const auto slope = [&c](double u) { return 1 + 3 * c.k1 * u + 5 * c.k2 * u * u; };
  double least = std::min(1.0, slope(most * most));
  if (const double vertex = -0.3 * c.k1 / c.k2; vertex > 0 && vertex < most * most)
    least = std::min(least, slope(vertex));
  if (!(least > 0.1))
    return fail(Errc::kInvalidOption,
                "camera: with k1 = {}, k2 = {} the distorted picture folds over; bring them closer "
                "to 0",
                c.k1,
                c.k2);
  VENEER_TRY(in_range("camera.sensitivity", c.sensitivity, 1e-3, 1e9));
  VENEER_TRY(in_range("camera.full_well", c.full_well, 10, 1e7));
  VENEER_TRY(in_range("camera.read_noise", c.read_noise, 0, 1e5));
  VENEER_TRY(in_range("camera.bits", c.bits, 1, 16));
  VENEER_TRY(in_range("camera.least_exposure_s", c.least_exposure_s, 1e-7, 100));
  VENEER_TRY(in_range("camera.most_exposure_s", c.most_exposure_s, c.least_exposure_s, 100));
  return in_range("camera.samples", c.samples, 1, 8);
}

Status check_board(const BoardTruth& b) {
  VENEER_TRY(in_range("board.columns", b.columns, 2, 100));
  VENEER_TRY(in_range("board.rows", b.rows, 2, 100));
  VENEER_TRY(in_range("board.square_m", b.square_m, 1e-4, 1));
  VENEER_TRY(in_range("board.border_m", b.border_m, 0, 1));
  VENEER_TRY(in_range("board.white", b.white, 0, 1));
  VENEER_TRY(in_range("board.black", b.black, 0, b.white));
  VENEER_TRY(in_range("board.poses", b.poses, 3, 100));
  return in_range("board.tilt_deg", b.tilt_deg, 0, 60);
}

}  // namespace

bool ObjectTruth::painted(const Eigen::Vector2d& uv) const {
  if (texture == Texture::kNone) return false;
  double field = std::floor(uv.x() * texture_fields);
  if (texture == Texture::kChecks) field += std::floor(uv.y() * texture_fields);
  return std::fmod(std::abs(field), 2.0) == 1.0;
}

Status BenchTruth::check() const {
  VENEER_TRY(check_projector(projector));
  VENEER_TRY(check_object(object));
  VENEER_TRY(in_range("room.ambient_nits", room.ambient_nits, 0, 1e5));
  VENEER_TRY(in_range("room.ambient_kelvin", room.ambient_kelvin, 1000, 40000));
  VENEER_TRY(in_range("eye.width", eye.width, 1, 8192));
  VENEER_TRY(in_range("eye.height", eye.height, 1, 8192));
  VENEER_TRY(in_range("eye.vertical_fov_deg", eye.vertical_fov_deg, 0.01, 170));
  VENEER_TRY(in_range("eye.samples", eye.samples, 1, 16));
  VENEER_TRY(check_instrument(instrument));
  VENEER_TRY(check_tracker(tracker));
  if (camera.has_value() != board.has_value())
    return fail(Errc::kInvalidOption, "[camera] and [board] go together; give both or neither");
  if (!camera) return {};
  VENEER_TRY(check_camera(*camera));
  return check_board(*board);
}

Result<BenchTruth> BenchTruth::load(const std::filesystem::path& path) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::open(path));
  BenchTruth truth;
  read_projector(toml.table("projector"), truth.projector);

  TomlReader object = toml.table("object");
  object.require("mesh", truth.object.mesh);
  object.require("wavelength_nm", truth.object.wavelength_nm);
  object.require("reflectance", truth.object.reflectance);
  read_texture(object, truth.object);
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

  read_instrument(toml.table("instrument"), truth.instrument);
  read_tracker(toml.table("tracker"), truth.tracker);
  if (toml.contains("camera")) truth.camera = read_camera(toml.table("camera"));
  if (toml.contains("board")) truth.board = read_board(toml.table("board"));

  VENEER_TRY(toml.finish());
  if (const Status valid = truth.check(); !valid)
    return fail_while(fmt::format("reading the bench {}", path.string()), valid.error());
  return truth;
}

}  // namespace veneer::simulation
