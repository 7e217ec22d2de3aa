// SPDX-License-Identifier: Apache-2.0
#include "calibration/wizard/report.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/colour.h"
#include "base/report_page.h"

namespace veneer::calibration {
namespace {

using nlohmann::ordered_json;

constexpr char kPage[] =
#include "calibration/wizard/report.html.inc"
    ;

/// Points of a curve that are drawn; more would not be seen.
constexpr int kCurvePoints = 129;

ordered_json list(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

/// CIE 1976 u', v' of a light; null where it is dark.
ordered_json chromaticity(const Xyz& xyz) {
  const double sum = xyz.x() + 15 * xyz.y() + 3 * xyz.z();
  if (!(sum > 0)) return nullptr;
  return {4 * xyz.x() / sum, 9 * xyz.y() / sum};
}

/// "#rrggbb" of a light seen beside `white`, which is shown as the screen's white.
std::string screen_colour(const Xyz& xyz, const Xyz& white) {
  static const Xyz kScreenWhite = xyz_from_srgb() * Eigen::Vector3d::Ones();
  const Eigen::Vector3d rgb = srgb_from_xyz() * xyz.cwiseQuotient(white).cwiseProduct(kScreenWhite);
  const auto byte = [](double linear) {
    return static_cast<int>(std::lround(255 * std::clamp(srgb_encode(linear), 0.0, 1.0)));
  };
  return fmt::format("#{:02x}{:02x}{:02x}", byte(rgb.x()), byte(rgb.y()), byte(rgb.z()));
}

ordered_json json_of(const ColourError& error) {
  return {{"patches", error.patches},
          {"de00_mean", error.mean},
          {"de00_p95", error.p95},
          {"de00_max", error.max}};
}

ordered_json json_of(const Finding& finding) {
  constexpr std::array kNames{"note", "warning", "failure"};
  return {{"severity", kNames.at(static_cast<std::size_t>(finding.severity))},
          {"what", finding.what},
          {"remedy", finding.remedy}};
}

ordered_json steps_of(const std::vector<StepReport>& steps) {
  ordered_json json = ordered_json::array();
  for (const StepReport& step : steps) {
    ordered_json each{{"name", step.name},
                      {"title", step.title},
                      {"skipped", step.skipped},
                      {"summary", step.summary},
                      {"findings", ordered_json::array()}};
    for (const Finding& finding : step.findings) each["findings"].push_back(json_of(finding));
    json.push_back(std::move(each));
  }
  return json;
}

ordered_json geometry_of(const WizardResults& results) {
  const geometry::GeometryCalibration& fit = *results.geometry;
  ordered_json json{
      {"poses", results.views.size()},
      {"camera_rms_px", fit.camera_rms_px},
      {"projector_rms_px", fit.projector_rms_px},
      {"stereo_rms_px", fit.stereo_rms_px},
      {"held_out_camera_rms_px", fit.held_out_camera_rms_px},
      {"held_out_projector_rms_px", fit.held_out_projector_rms_px},
      {"pinhole_rms_px", fit.pinhole.projector_rms_px},
      {"pinhole_off_px", fit.pinhole.most_off_px},
      {"focal_px", {fit.projector.fx, fit.projector.fy}},
      {"focal_deviation_px", {fit.projector_deviations.fx, fit.projector_deviations.fy}},
      {"principal_point_px", {fit.projector.cx, fit.projector.cy}},
      {"start_disagreement", fit.start_disagreement}};
  json["views"] = ordered_json::array();
  for (std::size_t i = 0; i < results.views.size() && i < fit.views.size(); ++i) {
    ordered_json view{{"name", results.views[i].view.name},
                      {"corners", results.views[i].corners},
                      {"corners_decoded", results.views[i].corners_decoded},
                      {"decoded_ratio", results.views[i].decoded_ratio},
                      {"projector_rms_px", fit.views[i].projector_rms_px}};
    if (i < fit.left_out.size()) {
      view["held_out_projector_rms_px"] = fit.left_out[i].held_out_projector_rms_px;
      view["focal_without_px"] = fit.left_out[i].projector_focal;
    }
    json["views"].push_back(std::move(view));
  }
  json["reprojections"] = ordered_json::array();
  for (const Reprojection& each : results.reprojections)
    json["reprojections"].push_back(
        {each.view, each.pixel.x(), each.pixel.y(), each.error.x(), each.error.y()});
  if (results.registration) {
    const geometry::BoardRegistration& r = *results.registration;
    json["registration"] = {{"held_out_position_mm", 1e3 * r.held_out_position_m},
                            {"held_out_rotation_deg", r.held_out_rotation_rad * 180 / EIGEN_PI},
                            {"position_deviation_mm", 1e3 * r.position_deviation_m},
                            {"rotation_deviation_deg", r.rotation_deviation_rad * 180 / EIGEN_PI}};
    if (results.tied) {
      json["registration"]["held_out_px"] = results.tied->held_out_px;
      json["registration"]["cross_hairs"] = results.cross_hairs.size();
      json["registration"]["cross_hair_rms_px"] = results.tied->touch_rms_px;
    }
  }
  return json;
}

/// The levels of each channel's ramp as they were read: drive, output, its standard deviation by
/// the scatter of bright and of dark readings.
ordered_json ramp_points(const MeasuredProfile& measured, const WizardResults& results) {
  ordered_json channels = ordered_json::array();
  for (int c = 0; c < 3; ++c) {
    ordered_json points = ordered_json::array();
    // In the readings' own units: the profile's are those of a board that faces the lens.
    Xyz full = Xyz::Zero();
    for (const PatchReading& patch : measured.patches) {
      if (patch.drive[c] == 1.0 && (patch.drive.array() > 0).count() == 1)
        full = patch.xyz - measured.black;
    }
    for (const PatchReading& patch : measured.patches) {
      if (!(patch.drive[c] > 0) || (patch.drive.array() > 0).count() != 1 || full.isZero())
        continue;
      const double output = (patch.xyz - measured.black).dot(full) / full.squaredNorm();
      const double dark = results.ambient.deviation.norm() / full.norm();
      const double deviation = std::hypot(results.white.relative * output, dark) /
                               std::sqrt(static_cast<double>(measured.patch_repeats));
      points.push_back({patch.drive[c], output, deviation});
    }
    channels.push_back(std::move(points));
  }
  return channels;
}

ordered_json light_of(const MeasuredProfile& measured, const WizardResults& results) {
  const ProjectorProfile& profile = measured.profile;
  const Xyz white = profile.white();
  ordered_json json{{"readings", measured.readings},
                    {"fitted_patches", measured.fitted_patches},
                    {"model", profile.colour_model},
                    {"choice", measured.choice},
                    {"held_out", json_of(measured.held_out)},
                    {"additivity_error", measured.additivity_error},
                    {"additivity", measured.additivity.reason},
                    {"additive", measured.additivity.additive},
                    {"colour_drift", measured.colour_drift},
                    {"lamp_drift", measured.lamp_drift},
                    {"white_xyz", list(white)},
                    {"black_xyz", list(profile.black)},
                    {"ambient_xyz", list(profile.ambient)},
                    {"contrast", white.y() / std::max(profile.black.y(), 1e-9)}};
  json["candidates"] = ordered_json::array();
  for (const ColourCandidate& candidate : measured.candidates) {
    ordered_json each{{"name", candidate.name},
                      {"fitted", candidate.fitted},
                      {"refusal", candidate.refusal},
                      {"parameters", candidate.parameters},
                      {"patches", candidate.patches}};
    if (candidate.fitted) each["held_out"] = json_of(candidate.held_out);
    json["candidates"].push_back(std::move(each));
  }
  const auto last = static_cast<double>(profile.tone_curves[0].size() - 1);
  json["tone_curves"] = ordered_json::array();
  for (const std::vector<double>& curve : profile.tone_curves) {
    ordered_json points = ordered_json::array();
    for (int i = 0; i < kCurvePoints; ++i) {
      const auto code = static_cast<std::size_t>(std::lround(last * i / (kCurvePoints - 1)));
      points.push_back({static_cast<double>(code) / last, curve[code]});
    }
    json["tone_curves"].push_back(std::move(points));
  }
  json["ramp_points"] = ramp_points(measured, results);
  json["gamut"] = {{"primaries", ordered_json::array()}, {"white", chromaticity(white)}};
  for (int c = 0; c < 3; ++c) {
    const Xyz primary = profile.primaries.col(c);
    json["gamut"]["primaries"].push_back(chromaticity(primary));
  }
  json["gamut"]["readings"] = ordered_json::array();
  for (const PatchReading& patch : measured.patches) {
    const Xyz light = patch.xyz - measured.black;
    if (light.y() > 0.01 * white.y())
      json["gamut"]["readings"].push_back(
          {{"at", chromaticity(light)}, {"colour", screen_colour(light, white)}});
  }
  const Image<float>& map = profile.vignetting;
  json["fall_off"] = {{"width", map.width()}, {"height", map.height()}};
  json["fall_off"]["values"] = ordered_json::array();
  for (const float value : map.pixels())
    json["fall_off"]["values"].push_back(std::round(1e4 * static_cast<double>(value)) / 1e4);
  return json;
}

ordered_json proof_of(const ProfileVerification& v) {
  const Verdict verdict = judge(v);
  ordered_json json{{"sentence", verdict.sentence},
                    {"good", verdict.good},
                    {"calibrate_again", verdict.calibrate_again},
                    {"gates", {verdict.gate_mean, verdict.gate_p95, verdict.gate_max}},
                    {"patches", v.patches.size()},
                    {"de00_mean", v.de00_mean},
                    {"de00_p95", v.de00_p95},
                    {"de00_max", v.de00_max},
                    {"noise_de00_mean", v.noise_de00_mean},
                    {"noise_de00_p95", v.noise_de00_p95},
                    {"relative_noise", v.relative_noise},
                    {"additivity_error", v.additivity_error}};
  json["list"] = ordered_json::array();
  for (const VerifiedPatch& patch : v.patches)
    json["list"].push_back({{"code", patch.patch.code},
                            {"on", patch.patch.target == Target::kObject ? "object" : "board"},
                            {"pixel", {patch.patch.pixel.x(), patch.patch.pixel.y()}},
                            {"read_xyz", list(patch.read)},
                            {"predicted_xyz", list(patch.predicted)},
                            {"read", screen_colour(patch.read, v.white)},
                            {"predicted", screen_colour(patch.predicted, v.white)},
                            {"de00", patch.de00}});
  return json;
}

}  // namespace

ordered_json report_of(const WizardResults& results,
                       const std::vector<StepReport>& steps,
                       const Devices& devices) {
  ordered_json json{{"projector", devices.projector},
                    {"instrument", devices.instrument},
                    {"raster", {devices.width, devices.height, devices.bits}},
                    {"steps", steps_of(steps)}};
  if (!results.warm_up.seconds.empty())
    json["warm_up"] = {{"seconds", results.warm_up.seconds},
                       {"luminance", results.warm_up.luminance}};
  if (!results.ramp.drive.empty())
    json["ramp"] = {{"drive", results.ramp.drive},
                    {"luminance", results.ramp.luminance},
                    {"gamma", effective_gamma(results.ramp)}};
  if (results.geometry) json["geometry"] = geometry_of(results);
  if (results.object) {
    const RigidTransform& pose = results.object->b_from_a;
    const Eigen::Quaterniond& q = pose.rotation;
    json["object"] = {{"rotation_wxyz", {q.w(), q.x(), q.y(), q.z()}},
                      {"position_m", list(pose.translation)},
                      {"rms_mm", 1e3 * results.object->rms_m},
                      {"held_out_mm", 1e3 * results.object->held_out_m}};
  }
  if (results.measured) json["light"] = light_of(*results.measured, results);
  if (results.verification) json["proof"] = proof_of(*results.verification);
  return json;
}

std::string report_page(const ordered_json& report) { return page_with_data(kPage, report); }

}  // namespace veneer::calibration
