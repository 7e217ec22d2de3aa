// SPDX-License-Identifier: Apache-2.0
#include "calibration/profile.h"

#include <Eigen/LU>
#include <nlohmann/json.hpp>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string_view>
#include <utility>

#include "base/files.h"
#include "base/image_files.h"

namespace veneer::calibration {
namespace {

using Json = nlohmann::json;

constexpr std::string_view kFormat = "veneer-projector-profile";
constexpr int kVersion = 2;  // 2 added the surface's map
constexpr const char* kVignettingFile = "vignetting.exr";
constexpr const char* kSurfaceMapFile = "surface_map.exr";
constexpr std::array<std::string_view, 3> kChannelNames{"red", "green", "blue"};

/// A matrix whose columns span less than this part of the box of their lengths counts as singular:
/// real primaries and surfaces stay above 1e-2.
constexpr double kLeastVolume = 1e-6;

double to_double(float value) { return value; }
Eigen::Vector3d to_double(const Rgb32f& value) { return value.cast<double>(); }

/// `map`, not empty, stretched over the raster, at `pixel`.
template <class Texel>
auto sample(const Image<Texel>& map,
            const ProjectorGeometry& geometry,
            const Eigen::Vector2d& pixel) {
  const double x =
      std::clamp(pixel.x() * map.width() / geometry.width - 0.5, 0.0, map.width() - 1.0);
  const double y =
      std::clamp(pixel.y() * map.height() / geometry.height - 0.5, 0.0, map.height() - 1.0);
  const int x0 = static_cast<int>(x);
  const int y0 = static_cast<int>(y);
  const int x1 = std::min(x0 + 1, map.width() - 1);
  const int y1 = std::min(y0 + 1, map.height() - 1);
  using Value = decltype(to_double(map(0, 0)));
  const auto between = [](const Value& a, const Value& b, double part) {
    return Value((1.0 - part) * a + part * b);
  };
  const Value upper = between(to_double(map(x0, y0)), to_double(map(x1, y0)), x - x0);
  const Value lower = between(to_double(map(x0, y1)), to_double(map(x1, y1)), x - x0);
  return between(upper, lower, y - y0);
}

bool is_reflectance(const Rgb32f& s) {
  return s.allFinite() && s.minCoeff() >= kLeastReflectance &&
         s.maxCoeff() <= 1.0F / kLeastReflectance;
}

bool invertible(const Eigen::Matrix3d& m) {
  const double box = m.col(0).norm() * m.col(1).norm() * m.col(2).norm();
  return m.allFinite() && std::abs(m.determinant()) > kLeastVolume * box;
}

Status check_geometry(const ProjectorGeometry& g) {
  const Eigen::Quaterniond& q = g.world_from_projector.rotation;
  constexpr double kUnitTolerance = 1e-6;  // what a file with 7 digits keeps of a unit quaternion
  if (g.width <= 0 || g.height <= 0)
    return fail(Errc::kBadFormat, "the raster is {} x {} pixels", g.width, g.height);
  if (!(g.fx > 0 && g.fy > 0 && std::isfinite(g.fx) && std::isfinite(g.fy)))
    return fail(Errc::kBadFormat, "the focal lengths {}, {} are not positive", g.fx, g.fy);
  if (!(std::isfinite(g.cx) && std::isfinite(g.cy)))
    return fail(Errc::kBadFormat, "the principal point {}, {} is not finite", g.cx, g.cy);
  if (!g.world_from_projector.translation.allFinite() ||
      !(std::abs(q.norm() - 1.0) <= kUnitTolerance))
    return fail(Errc::kBadFormat, "the pose is not finite or its rotation not of unit length");
  return {};
}

Status check_tone_curve(const std::vector<double>& curve, int bits, std::string_view channel) {
  const std::size_t size = std::size_t{1} << bits;
  if (curve.size() != size)
    return fail(Errc::kBadFormat,
                "the tone curve of {} has {} values; {} bits need {}",
                channel,
                curve.size(),
                bits,
                size);
  if (!std::ranges::all_of(curve, [](double t) { return std::isfinite(t); }))
    return fail(Errc::kBadFormat, "the tone curve of {} is not finite", channel);
  if (!std::ranges::is_sorted(curve))
    return fail(Errc::kBadFormat, "the tone curve of {} falls", channel);
  if (curve.front() != 0.0 || curve.back() != 1.0)
    return fail(Errc::kBadFormat,
                "the tone curve of {} runs from {} to {} instead of from 0 to 1",
                channel,
                curve.front(),
                curve.back());
  return {};
}

std::string checksum(std::string_view bytes) {
  const uLong crc = crc32_z(
      0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());  // NOLINT: zlib's type
  return fmt::format("crc32:{:08x}", crc);
}

Json to_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json to_json(const Eigen::Matrix3d& m) {
  Json rows = Json::array();
  for (int row = 0; row < 3; ++row) rows.push_back(to_json(Eigen::Vector3d(m.row(row))));
  return rows;
}

Eigen::Vector3d vector_from(const Json& json) {
  const auto v = json.get<std::array<double, 3>>();
  return {v[0], v[1], v[2]};
}

Eigen::Matrix3d matrix_from(const Json& json) {
  Eigen::Matrix3d m;
  for (int row = 0; row < 3; ++row)
    m.row(row) = vector_from(json.at(static_cast<std::size_t>(row)));
  return m;
}

Json contents_of(const ProjectorProfile& p) {
  const ProjectorGeometry& g = p.geometry;
  const Eigen::Quaterniond& q = g.world_from_projector.rotation;
  Json json;
  json["geometry"] = {{"width", g.width},
                      {"height", g.height},
                      {"fx", g.fx},
                      {"fy", g.fy},
                      {"cx", g.cx},
                      {"cy", g.cy},
                      {"rotation_wxyz", {q.w(), q.x(), q.y(), q.z()}},
                      {"position_m", to_json(g.world_from_projector.translation)}};
  json["bits"] = p.bits;
  json["tone_curves"] = p.tone_curves;
  json["primaries_xyz"] = to_json(p.primaries);
  json["black_xyz"] = to_json(p.black);
  json["reference_distance_m"] = p.reference_distance_m;
  json["surface_xyz"] = to_json(p.surface);
  json["has_surface_map"] = !p.surface_map.empty();
  json["ambient_xyz"] = to_json(p.ambient);
  return json;
}

/// Throws nlohmann's exceptions; load() catches them.
ProjectorProfile profile_from(const Json& json) {
  ProjectorProfile p;
  const Json& geometry = json.at("geometry");
  geometry.at("width").get_to(p.geometry.width);
  geometry.at("height").get_to(p.geometry.height);
  geometry.at("fx").get_to(p.geometry.fx);
  geometry.at("fy").get_to(p.geometry.fy);
  geometry.at("cx").get_to(p.geometry.cx);
  geometry.at("cy").get_to(p.geometry.cy);
  const auto q = geometry.at("rotation_wxyz").get<std::array<double, 4>>();
  p.geometry.world_from_projector.rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
  p.geometry.world_from_projector.translation = vector_from(geometry.at("position_m"));
  json.at("bits").get_to(p.bits);
  json.at("tone_curves").get_to(p.tone_curves);
  p.primaries = matrix_from(json.at("primaries_xyz"));
  p.black = vector_from(json.at("black_xyz"));
  json.at("reference_distance_m").get_to(p.reference_distance_m);
  p.surface = matrix_from(json.at("surface_xyz"));
  p.ambient = vector_from(json.at("ambient_xyz"));
  return p;
}

/// What is in profile.json, once its version and its own checksum have been found right.
struct Manifest {
  ProjectorProfile profile;  // without the maps
  std::string vignetting_checksum;
  std::optional<std::string> surface_map_checksum;  // none: the surface has no map
};

Result<Manifest> parse_manifest(const std::string& text) {
  const Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object() || !json.contains("format") || json["format"] != kFormat)
    return fail(Errc::kBadFormat, "profile.json is no projector profile; calibrate again");
  try {
    const int version = json.at("version").get<int>();
    if (version > kVersion)
      return fail(
          Errc::kBadFormat,
          "it has version {}, newer than {}, the newest that this Veneer reads; update Veneer",
          version,
          kVersion);
    if (version < 1) return fail(Errc::kBadFormat, "its version is {}; calibrate again", version);
    // dump() of what was parsed is canonical: sorted keys, the shortest digits that read back the
    // same.
    if (json.at("checksum").get<std::string>() != checksum(json.at("profile").dump()))
      return fail(Errc::kBadFormat,
                  "profile.json was changed or damaged (its checksum differs); calibrate again");
    const Json& files = json.at("files");
    Manifest manifest{
        profile_from(json.at("profile")), files.at(kVignettingFile).get<std::string>(), {}};
    if (json.at("profile").value("has_surface_map", false))
      manifest.surface_map_checksum = files.at(kSurfaceMapFile).get<std::string>();
    return manifest;
  } catch (const Json::exception& e) {
    return fail(Errc::kBadFormat, "profile.json: {}; calibrate again", e.what());
  }
}

Status verify_file(const std::filesystem::path& path, const std::string& expected_checksum) {
  VENEER_ASSIGN(const std::string bytes, read_text(path));
  if (checksum(bytes) != expected_checksum)
    return fail(Errc::kBadFormat,
                "{} was changed or damaged (its checksum differs); calibrate again",
                path.filename().string());
  return {};
}

Result<ProjectorProfile> load_from(const std::filesystem::path& folder) {
  VENEER_ASSIGN(const std::string text, read_text(folder / "profile.json"));
  VENEER_ASSIGN(Manifest manifest, parse_manifest(text));
  VENEER_TRY(verify_file(folder / kVignettingFile, manifest.vignetting_checksum));
  VENEER_ASSIGN(std::vector<ExrChannel> channels, read_exr(folder / kVignettingFile));
  if (channels.size() != 1)
    return fail(
        Errc::kBadFormat, "{} has {} channels instead of 1", kVignettingFile, channels.size());
  manifest.profile.vignetting = std::move(channels.front().pixels);
  if (manifest.surface_map_checksum) {
    VENEER_TRY(verify_file(folder / kSurfaceMapFile, *manifest.surface_map_checksum));
    VENEER_ASSIGN(manifest.profile.surface_map, read_exr_rgb(folder / kSurfaceMapFile));
  }
  VENEER_TRY(manifest.profile.check());
  return std::move(manifest.profile);
}

}  // namespace

double ProjectorProfile::vignetting_at(const Eigen::Vector2d& pixel) const {
  return vignetting.empty() ? 1.0 : sample(vignetting, geometry, pixel);
}

Eigen::Vector3d ProjectorProfile::reflectance_at(const Eigen::Vector2d& pixel) const {
  if (surface_map.empty()) return Eigen::Vector3d::Ones();
  return sample(surface_map, geometry, pixel);
}

Status ProjectorProfile::check() const {
  VENEER_TRY(check_geometry(geometry));
  if (bits < 1 || bits > 16) return fail(Errc::kBadFormat, "a drive code has {} bits", bits);
  for (std::size_t c = 0; c < 3; ++c)
    VENEER_TRY(check_tone_curve(tone_curves[c], bits, kChannelNames[c]));
  if (!invertible(primaries))
    return fail(Errc::kBadFormat, "the primaries are not finite or not independent of each other");
  if (!invertible(surface))
    return fail(Errc::kBadFormat, "the surface's matrix is not finite or cannot be inverted");
  if (!(black.allFinite() && black.minCoeff() >= 0))
    return fail(Errc::kBadFormat, "the black level is negative or not finite");
  if (!(ambient.allFinite() && ambient.minCoeff() >= 0))
    return fail(Errc::kBadFormat, "the ambient light is negative or not finite");
  if (!(std::isfinite(reference_distance_m) && reference_distance_m > 0))
    return fail(Errc::kBadFormat, "the reference distance is {} m", reference_distance_m);
  if (vignetting.empty()) return fail(Errc::kBadFormat, "the vignetting has no pixels");
  if (!std::ranges::all_of(vignetting.pixels(), [](float v) { return std::isfinite(v) && v > 0; }))
    return fail(Errc::kBadFormat, "the vignetting is not finite and positive everywhere");
  if (!std::ranges::all_of(surface_map.pixels(), is_reflectance))
    return fail(Errc::kBadFormat,
                "the surface's map is not finite, or not between {} and {}, somewhere",
                kLeastReflectance,
                1.0F / kLeastReflectance);
  return {};
}

Status ProjectorProfile::save(const std::filesystem::path& folder) const {
  const std::string doing = fmt::format("saving the projector profile {}", folder.string());
  if (const Status valid = check(); !valid) return fail_while(doing, valid.error());
  VENEER_ASSIGN(StagedFolder staged, StagedFolder::create(folder));
  VENEER_TRY(write_exr(staged.path() / kVignettingFile, {{"Y", vignetting}}));
  std::vector<const char*> maps{kVignettingFile};
  if (!surface_map.empty()) {
    VENEER_TRY(write_exr(staged.path() / kSurfaceMapFile, surface_map.view()));
    maps.push_back(kSurfaceMapFile);
  }
  Json json;
  json["format"] = kFormat;
  json["version"] = kVersion;
  json["profile"] = contents_of(*this);
  json["checksum"] = checksum(json["profile"].dump());
  for (const char* map : maps) {
    VENEER_ASSIGN(const std::string bytes, read_text(staged.path() / map));
    json["files"][map] = checksum(bytes);
  }
  VENEER_TRY(write_text(staged.path() / "profile.json", json.dump(1) + "\n"));
  return staged.commit();
}

Result<ProjectorProfile> ProjectorProfile::load(const std::filesystem::path& folder) {
  auto profile = load_from(folder);
  if (!profile)
    return fail_while(fmt::format("loading the projector profile {}", folder.string()),
                      profile.error());
  return profile;
}

}  // namespace veneer::calibration
