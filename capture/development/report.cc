// SPDX-License-Identifier: Apache-2.0
#include "capture/development/report.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/colour.h"
#include "base/files.h"
#include "base/image_files.h"
#include "base/report_page.h"

namespace veneer::capture {
namespace {

using nlohmann::ordered_json;

constexpr char kPage[] =
#include "capture/development/report.html.inc"
    ;

constexpr double kDegrees = 180 / std::numbers::pi;

ordered_json list(const Eigen::Array3d& v) { return {v[0], v[1], v[2]}; }

ordered_json direction_json(const btf::Direction& direction) {
  const btf::Angles angles = btf::angles_from_direction(direction);
  return {{"theta_deg", angles.theta * kDegrees}, {"phi_deg", angles.phi * kDegrees}};
}

ordered_json findings_json(const DirectionFindings& f) {
  return {{"masked", f.masked_fraction},
          {"saturated", {f.saturated_fraction[0], f.saturated_fraction[1]}},
          {"specular_rms", f.specular_rms},
          {"diffuse_rms", f.diffuse_rms},
          {"specular_noise", f.specular_noise},
          {"diffuse_noise", f.diffuse_noise},
          {"specular_negative", f.specular_negative},
          {"diffuse_negative", f.diffuse_negative},
          {"most_negative", f.most_negative},
          {"incidence_deg", f.fresnel.incidence_rad * kDegrees},
          {"azimuth_deg", f.fresnel.azimuth_rad * kDegrees},
          {"gain", f.fresnel.gain},
          {"cross_fraction", f.fresnel.cross_fraction},
          {"predicted_specular_error", f.predicted.specular},
          {"predicted_diffuse_error", f.predicted.diffuse},
          {"degree_of_polarisation", f.degree_of_polarisation},
          {"angle_of_polarisation_deg", f.angle_of_polarisation_rad * kDegrees}};
}

ordered_json rig_json(const RigFindings& rig) {
  ordered_json json{{"marks_moved_px", rig.marks_moved_px},
                    {"focal_px", {rig.lens.focal_px.x(), rig.lens.focal_px.y()}},
                    {"lens_was_calibrated", rig.lens_was_calibrated},
                    {"response_is_linear", rig.response.linear()},
                    {"response_residual", rig.response_residual},
                    {"noise_was_measured", rig.noise_was_measured},
                    {"leak_was_measured", rig.leak_was_measured},
                    {"leak_was_corrected", (rig.contrasts.specular < 1).any()},
                    {"mirror_contrast", list(rig.measured.specular)},
                    {"mirror_contrast_deviation", list(rig.measured.specular_deviation)},
                    // Without correction specular light is short by this part, diffuse too bright.
                    {"leak", list(1 - rig.measured.specular)},
                    {"white_range", rig.white_range}};
  if (rig.noise_was_measured) {
    json["electrons_per_count"] = rig.noise.electrons_per_count;
    json["read_noise_counts"] = rig.noise.read_noise_counts;
  }
  json["views"] = ordered_json::array();
  for (std::size_t v = 0; v < rig.planes.size(); ++v) {
    ordered_json view = direction_json(rig.views[v]);
    view["marks_rms_px"] = rig.planes[v].rms_px;
    view["marks_worst_px"] = rig.planes[v].worst_px;
    view["spread_deg"] = rig.planes[v].view_spread_rad * kDegrees;
    json["views"].push_back(std::move(view));
  }
  json["lights"] = ordered_json::array();
  for (const btf::Direction& light : rig.lights) json["lights"].push_back(direction_json(light));
  return json;
}

}  // namespace

Image<Rgb8> picture_of_samples(const Image<Rgb32f>& samples) {
  Image<Rgb8> picture(samples.width(), samples.height());
  for (std::size_t i = 0; i < samples.pixels().size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      const double value = samples.pixels()[i][static_cast<Eigen::Index>(c)];
      picture.pixels()[i][c] =
          static_cast<std::uint8_t>(std::lround(255 * srgb_encode(std::clamp(value, 0.0, 1.0))));
    }
  }
  return picture;
}

CaptureReport::CaptureReport(const Developer& developer, std::filesystem::path folder)
    : developer_(developer), folder_(std::move(folder)) {}

Status CaptureReport::add(const DevelopedDirection& direction) {
  const RigFindings& rig = developer_.findings();
  const auto lights = static_cast<int>(rig.lights.size());
  const int pairs = static_cast<int>(rig.views.size()) * lights;
  const int every = (pairs + kMostPictured - 1) / kMostPictured;
  if ((direction.view * lights + direction.light) % every != 0) return {};
  if (!reference_.contains(direction.view)) {
    const auto nearest =
        std::ranges::max_element(rig.lights, {}, [](const auto& light) { return light.z(); });
    VENEER_ASSIGN(
        DevelopedDirection reference,
        developer_.develop(direction.view, static_cast<int>(nearest - rig.lights.begin())));
    reference_[direction.view] = std::move(reference.cross);
  }
  const Image<Rgb32f>& reference = reference_[direction.view];
  Image<Rgb32f> shadow(reference.width(), reference.height());
  Image<Rgb32f> parallel(reference.width(), reference.height());
  Image<Rgb32f> cross(reference.width(), reference.height());
  Image<Rgb32f> masked(reference.width(), reference.height());
  for (std::size_t i = 0; i < shadow.pixels().size(); ++i) {
    // Pictures behind an analyser are shown as bright as what they are taken for: twice.
    shadow.pixels()[i] = 2 * (reference.pixels()[i] - direction.cross.pixels()[i]);
    parallel.pixels()[i] = 2 * direction.parallel.pixels()[i];
    cross.pixels()[i] = 2 * direction.cross.pixels()[i];
    if (direction.masked.pixels()[i] != 0) masked.pixels()[i] = Rgb32f(1, 0.1F, 0.05F);
  }
  const std::string name = fmt::format("v{:02}-l{:02}", direction.view, direction.light);
  const std::pair<const char*, const Image<Rgb32f>*> parts[]{{"parallel", &parallel},
                                                             {"cross", &cross},
                                                             {"specular", &direction.specular},
                                                             {"shadow", &shadow},
                                                             {"diffuse", &direction.diffuse},
                                                             {"masked", &masked}};
  for (const auto& [part, image] : parts) {
    const Image<Rgb8> picture = picture_of_samples(*image);
    VENEER_TRY(
        write_png(folder_ / "pictures" / fmt::format("{}-{}.png", name, part), picture.view()));
  }
  pictured_[{direction.view, direction.light}] = name;
  return {};
}

Result<ordered_json> CaptureReport::write(const DevelopedSet& set,
                                          const std::vector<std::string>& warnings) {
  const RigFindings& rig = developer_.findings();
  const CapturePlan& plan = developer_.plan();
  ordered_json report{{"name", plan.name},
                      {"texels", {plan.area.columns, plan.area.rows}},
                      {"size_mm", {plan.area.width_mm, plan.area.height_mm}},
                      {"white_reflectance", plan.white_reflectance},
                      {"rig", rig_json(rig)}};
  report["warnings"] = warnings;
  for (const std::string& warning : rig.warnings) report["warnings"].push_back(warning);
  report["set"] = {{"masked", set.masked_fraction},
                   {"specular_negative", set.specular_negative},
                   {"diffuse_negative", set.diffuse_negative},
                   {"light_added", set.light_added}};
  report["directions"] = ordered_json::array();
  const std::size_t lights = rig.lights.size();
  for (std::size_t i = 0; i < set.directions.size(); ++i) {
    const auto view = static_cast<int>(i / lights);
    const auto light = static_cast<int>(i % lights);
    ordered_json direction{{"view", view}, {"light", light}};
    direction.update(findings_json(set.directions[i]));
    const auto pictured = pictured_.find({view, light});
    if (pictured != pictured_.end()) direction["pictures"] = pictured->second;
    report["directions"].push_back(std::move(direction));
  }
  VENEER_TRY(write_text(folder_ / "index.html", page_with_data(kPage, report)));
  VENEER_TRY(write_text(folder_ / "report.json", report.dump(2) + "\n"));
  return report;
}

}  // namespace veneer::capture
