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
constexpr int kVersion = 3;  // 2 added the surface's map, 3 the colour residual and the record
constexpr const char* kVignettingFile = "vignetting.exr";
constexpr const char* kSurfaceMapFile = "surface_map.exr";
constexpr const char* kResidualFile = "colour_residual.exr";
constexpr std::array<std::string_view, 3> kChannelNames{"red", "green", "blue"};

/// A matrix whose columns span less than this part of the box of their lengths counts as singular:
/// real primaries and surfaces stay above 1e-2.
constexpr double kLeastVolume = 1e-6;

/// Pieces of sqrt(t) along each axis in which the colour residual is looked at. A finer grid's
/// noise in the dark is no fold that anybody could see: the first of these pieces ends at t =
/// 0.004.
constexpr int kFoldCells = 16;
/// What t -> t + rho(t) must leave of a piece's volume. Real projectors stay above 0.5.
constexpr double kLeastResidualVolume = 1e-3;
/// A fitted rho is a part of full drive; larger values are no colour model's.
constexpr double kLargestResidual = 10.0;

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

/// Whether t -> t + rho(t) turns a piece of the grid inside out. A piece is cut into six tetrahedra
/// along its diagonal, one for each order in which the channels rise from its lowest corner.
Status check_residual(const ColourResidual& rho) {
  if (rho.empty()) return {};
  if (!std::ranges::all_of(rho.values(), [](const Eigen::Vector3d& value) {
        return value.allFinite() && value.cwiseAbs().maxCoeff() <= kLargestResidual;
      }))
    return fail(Errc::kBadFormat,
                "the colour residual is not finite, or above {}, somewhere",
                kLargestResidual);
  const int cells = std::min(rho.nodes() - 1, kFoldCells);
  const auto drive_at = [cells](const Eigen::Array3i& node) -> Eigen::Vector3d {
    return (node.cast<double>() / cells).square().matrix();
  };
  const auto keeps_orientation = [&](const Eigen::Array3i& lowest,
                                     const std::array<int, 3>& order) {
    Eigen::Matrix3d drive_edges;
    Eigen::Matrix3d image_edges;
    Eigen::Array3i corner = lowest;
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d from = drive_at(corner);
      ++corner[order[static_cast<std::size_t>(i)]];
      const Eigen::Vector3d to = drive_at(corner);
      drive_edges.col(i) = to - from;
      image_edges.col(i) = to + rho(to) - from - rho(from);
    }
    return image_edges.determinant() / drive_edges.determinant() > kLeastResidualVolume;
  };
  for (int b = 0; b < cells; ++b) {
    for (int g = 0; g < cells; ++g) {
      for (int r = 0; r < cells; ++r) {
        std::array<int, 3> order{0, 1, 2};
        do {
          if (keeps_orientation({r, g, b}, order)) continue;
          const Eigen::Vector3d at = drive_at({r, g, b});
          return fail(Errc::kBadFormat,
                      "the colour residual folds drives onto one another near the linear drive "
                      "{:.3f} {:.3f} {:.3f}, so that no drive can be found for a colour",
                      at.x(),
                      at.y(),
                      at.z());
        } while (std::next_permutation(order.begin(), order.end()));
      }
    }
  }
  return {};
}

bool is_utf8(const std::string& text) {
  try {
    static_cast<void>(Json(text).dump());  // throws on other bytes
    return true;
  } catch (const Json::exception&) {
    return false;
  }
}

Status check_record(const ProjectorProfile& p) {
  bool valid = is_utf8(p.colour_model);
  for (const auto& [key, value] : p.record) valid = valid && is_utf8(key) && is_utf8(value);
  if (!valid)
    return fail(Errc::kBadFormat, "the name of the colour model or the record is not UTF-8");
  return {};
}

/// A row of nodes a row of pixels, from the darkest blue down.
Image<Rgb32f> picture_of(const ColourResidual& rho) {
  const int n = rho.nodes();
  Image<Rgb32f> picture(n, n * n);
  std::ranges::transform(rho.values(), picture.pixels().begin(), [](const Eigen::Vector3d& value) {
    return Rgb32f(value.cast<float>());
  });
  return picture;
}

Result<ColourResidual> residual_from(const Image<Rgb32f>& picture) {
  const int n = picture.width();
  constexpr int kMostNodes = 129;  // ColourResidual's
  if (n < 2 || n > kMostNodes || picture.height() != n * n)
    return fail(Errc::kBadFormat,
                "{} has {} x {} pixels instead of n x n^2 with n from 2 to {}",
                kResidualFile,
                n,
                picture.height(),
                kMostNodes);
  std::vector<Eigen::Vector3d> values;
  values.reserve(picture.pixels().size());
  for (const Rgb32f& value : picture.pixels()) {
    if (!value.allFinite()) return fail(Errc::kBadFormat, "{} is not finite", kResidualFile);
    values.emplace_back(value.cast<double>());
  }
  return ColourResidual(n, std::move(values));
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
  json["has_colour_residual"] = !p.residual.empty();
  json["colour_model"] = p.colour_model;
  json["record"] = p.record;
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
  p.colour_model = json.value("colour_model", std::string());
  p.record = json.value("record", std::map<std::string, std::string>());
  return p;
}

/// What is in profile.json, once its version and its own checksum have been found right.
struct Manifest {
  ProjectorProfile profile;  // without the maps
  std::string vignetting_checksum;
  std::optional<std::string> surface_map_checksum;  // none: the surface has no map
  std::optional<std::string> residual_checksum;     // none: there is no residual
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
        profile_from(json.at("profile")), files.at(kVignettingFile).get<std::string>(), {}, {}};
    if (json.at("profile").value("has_surface_map", false))
      manifest.surface_map_checksum = files.at(kSurfaceMapFile).get<std::string>();
    if (json.at("profile").value("has_colour_residual", false))
      manifest.residual_checksum = files.at(kResidualFile).get<std::string>();
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
  if (manifest.residual_checksum) {
    VENEER_TRY(verify_file(folder / kResidualFile, *manifest.residual_checksum));
    VENEER_ASSIGN(const Image<Rgb32f> picture, read_exr_rgb(folder / kResidualFile));
    VENEER_ASSIGN(manifest.profile.residual, residual_from(picture));
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

Eigen::Vector3d ProjectorProfile::linear_drive(const std::array<std::uint16_t, 3>& code) const {
  return {tone_curves[0].at(code[0]), tone_curves[1].at(code[1]), tone_curves[2].at(code[2])};
}

Xyz ProjectorProfile::emitted(const Eigen::Vector3d& linear_drive) const {
  return primaries * (linear_drive + residual(linear_drive));
}

Xyz ProjectorProfile::white() const { return emitted(Eigen::Vector3d::Ones()) + black; }

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
  VENEER_TRY(check_residual(residual));
  return check_record(*this);
}

Status ProjectorProfile::save(const std::filesystem::path& folder, const ExtraFiles& extra) const {
  const std::string doing = fmt::format("saving the projector profile {}", folder.string());
  if (const Status valid = check(); !valid) return fail_while(doing, valid.error());
  VENEER_ASSIGN(StagedFolder staged, StagedFolder::create(folder));
  VENEER_TRY(write_exr(staged.path() / kVignettingFile, {{"Y", vignetting}}));
  std::vector<const char*> maps{kVignettingFile};
  if (!surface_map.empty()) {
    VENEER_TRY(write_exr(staged.path() / kSurfaceMapFile, surface_map.view()));
    maps.push_back(kSurfaceMapFile);
  }
  if (!residual.empty()) {
    const Image<Rgb32f> picture = picture_of(residual);
    VENEER_TRY(write_exr(staged.path() / kResidualFile, picture.view()));
    maps.push_back(kResidualFile);
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
  if (extra) VENEER_TRY(extra(staged.path()));
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
