// SPDX-License-Identifier: Apache-2.0
#include "quality/plan/plan_report.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "base/files.h"
#include "base/report_page.h"
#include "btf/elevated_concentric.h"

namespace veneer::quality {
namespace {

using nlohmann::ordered_json;

constexpr char kPage[] =
#include "quality/plan/plan.html.inc"
    ;

constexpr double kDegrees = 180.0 / std::numbers::pi;

ordered_json json_of(const VisibleDifference& d) {
  return {{"de00_mean", d.de00_mean},
          {"de00_p95", d.de00_p95},
          {"de00_max", d.de00_max},
          {"codes_mean", d.codes_mean},
          {"codes_p95", d.codes_p95},
          {"codes_max", d.codes_max},
          {"rmse", d.rmse}};
}

ordered_json json_of(const ScreenError& e) {
  return {{"epsilon", e.epsilon},
          {"rmse", e.rmse},
          {"de00_mean", e.de00_mean},
          {"de00_p95", e.de00_p95},
          {"de00_max", e.de00_max},
          {"pixels", e.pixels}};
}

ordered_json json_of(const ScreenErrors& e) {
  return {{"target", json_of(e.target)}, {"received", json_of(e.received)}};
}

ordered_json json_of(const btf::DirectionBox& box) {
  return {{"u", {box.u_min, box.u_max}}, {"v", {box.v_min, box.v_max}}};
}

ordered_json json_of(const PlannedFit& fit) {
  ordered_json json{{"name", fit.name()},
                    {"model", fit.model},
                    {"components", fit.options.components},
                    {"clusters", fit.options.clusters},
                    {"angular", fit.options.angular},
                    {"fetches", fit.fetches},
                    {"gpu_bytes", fit.bytes},
                    {"fit_seconds", fit.fit_seconds},
                    {"set_rmse", fit.set_rmse},
                    {"difference", json_of(fit.difference)}};
  if (fit.frame_ms) json["frame_ms"] = *fit.frame_ms;
  if (fit.on_screen)
    json["on_screen"] = {{"centre", json_of(fit.on_screen->centre)},
                         {"averaged", json_of(fit.on_screen->averaged)}};
  return json;
}

// A ratio whose divisor may be nothing at all.
double over(double part, double whole) { return whole > 0 ? part / whole : 0; }

// As asked for, a pixel the mean of its texels: of the fits themselves.
std::optional<double> screen_rmse_ratio(const PlannedFit& general, const PlannedFit& chosen) {
  if (!general.on_screen || !chosen.on_screen) return std::nullopt;
  return over(chosen.on_screen->averaged.target.rmse, general.on_screen->averaged.target.rmse);
}

ordered_json compared_json(const PlannedFit& general, const PlannedFit& chosen) {
  ordered_json json = json_of(general);
  json["fetches_ratio"] = over(chosen.fetches, general.fetches);
  json["bytes_ratio"] = over(chosen.bytes, general.bytes);
  json["set_rmse_ratio"] = over(chosen.set_rmse, general.set_rmse);
  json["rmse_ratio"] = over(chosen.difference.rmse, general.difference.rmse);
  if (const auto ratio = screen_rmse_ratio(general, chosen)) json["screen_rmse_ratio"] = *ratio;
  return json;
}

std::string megabytes(double bytes) { return fmt::format("{:.3f} MB", bytes / 1e6); }

std::string screen_text(const ScreenError& e) {
  return fmt::format("mean {:.2f}, 95 % {:.2f}, most {:.2f} dE00, eps {:.4f}, rmse {:.4f}",
                     e.de00_mean,
                     e.de00_p95,
                     e.de00_max,
                     e.epsilon,
                     e.rmse);
}

std::string screen_text(const PlannedFit& fit) {
  if (!fit.on_screen) return "";
  std::string text;
  for (const auto& [how, errors] :
       {std::pair<const char*, const ScreenErrors&>{"a pixel's texel", fit.on_screen->centre},
        {"a pixel's mean", fit.on_screen->averaged}})
    text += fmt::format("  on the screen, {}: asked for {}; received {}\n",
                        how,
                        screen_text(errors.target),
                        screen_text(errors.received));
  return text;
}

std::string compared_text(std::string_view what,
                          const PlannedFit& general,
                          const PlannedFit& chosen) {
  std::string text = fmt::format(
      "{}: {}: {} fetches, {}, mean {:.2f} dE00, rmse {:.4f} drawn, {:.4f} in the set\n",
      what,
      general.name(),
      general.fetches,
      megabytes(general.bytes),
      general.difference.de00_mean,
      general.difference.rmse,
      general.set_rmse);
  text += screen_text(general);
  text += fmt::format(
      "  so the plan takes {:.2f} of its fetches, {:.4f} of its bytes, and has {:.2f} of its rmse "
      "drawn, {:.2f} in the set",
      over(chosen.fetches, general.fetches),
      over(chosen.bytes, general.bytes),
      over(chosen.difference.rmse, general.difference.rmse),
      over(chosen.set_rmse, general.set_rmse));
  if (const auto ratio = screen_rmse_ratio(general, chosen))
    text += fmt::format(", {:.2f} on the screen", *ratio);
  return text + "\n";
}

std::string mip_advice(const Reach& reach) {
  if (!(reach.texels_per_pixel_median > 0.0)) return "";
  // Below this a pixel holds hardly more than the texel at its centre.
  constexpr double kWorthIt = 1.5;
  return fmt::format(
      "a pixel is {:.2f} texels wide (median; 95 %: {:.2f}): {}\n",
      reach.texels_per_pixel_median,
      reach.texels_per_pixel_p95,
      reach.texels_per_pixel_p95 < kWorthIt
          ? "mip levels are not worth it"
          : fmt::format("mip levels are worth it (fit --model texel-colours --mip-levels {})",
                        1 + static_cast<int>(std::ceil(std::log2(reach.texels_per_pixel_p95)))));
}

ordered_json point_of(const btf::Direction& direction) {
  // As a map of the hemisphere: theta from the middle, 1 at the horizon.
  const btf::Angles angles = btf::angles_from_direction(direction);
  const double radius = angles.theta / (std::numbers::pi / 2);
  const auto rounded = [](double x) { return std::round(x * 1e4) / 1e4; };
  return {rounded(radius * std::cos(angles.phi)), rounded(radius * std::sin(angles.phi))};
}

// The box's outline on that map.
ordered_json outline_of(const btf::DirectionBox& box) {
  ordered_json outline = ordered_json::array();
  constexpr int kSteps = 24;
  const std::array<Eigen::Vector2d, 5> corners{Eigen::Vector2d{box.u_min, box.v_min},
                                               {box.u_max, box.v_min},
                                               {box.u_max, box.v_max},
                                               {box.u_min, box.v_max},
                                               {box.u_min, box.v_min}};
  for (std::size_t i = 0; i + 1 < corners.size(); ++i)
    for (int s = 0; s < kSteps; ++s)
      outline.push_back(point_of(btf::direction_from_square(
          corners[i] + (corners[i + 1] - corners[i]) * (double(s) / kSteps))));
  return outline;
}

ordered_json plots(const Reach& reach, const btf::SampleSetInfo& set) {
  constexpr std::size_t kMostPoints = 1500;
  std::vector<double> of_view(set.views.size());
  std::vector<double> of_light(set.lights.size());
  for (std::size_t v = 0; v < set.views.size(); ++v)
    for (std::size_t l = 0; l < set.lights.size(); ++l) {
      const double weight = reach.region.weights.weight[v * set.lights.size() + l];
      of_view[v] += weight;
      of_light[l] += weight;
    }
  const auto plot = [&](const btf::DirectionSet& measured,
                        const std::vector<double>& weights,
                        const btf::DirectionBox& box,
                        const auto& asked_for) {
    const double most = *std::ranges::max_element(weights);
    ordered_json json{{"measured", ordered_json::array()},
                      {"asked", ordered_json::array()},
                      {"box", outline_of(box)}};
    for (std::size_t i = 0; i < measured.size(); ++i) {
      ordered_json point = point_of(measured[i]);
      point.push_back(std::round(1e3 * over(weights[i], most)) / 1e3);
      json["measured"].push_back(std::move(point));
    }
    for (std::size_t i = 0; i < std::min(reach.asked.size(), kMostPoints); ++i)
      asked_for(reach.asked[i],
                [&](const btf::Direction& d) { json["asked"].push_back(point_of(d)); });
    return json;
  };
  return {{"views",
           plot(set.views,
                of_view,
                reach.region.views,
                [](const Asked& asked, const auto& add) { add(asked.view); })},
          {"lights",
           plot(set.lights, of_light, reach.region.lights, [](const Asked& asked, const auto& add) {
             for (int k = 0; k < asked.lights; ++k)
               add(asked.lit[static_cast<std::size_t>(k)].light);
           })}};
}

}  // namespace

std::string region_in_words(const Reach& reach) {
  if (reach.any_pose)
    return "the object is held any way, so everything can be asked; put it at rest (no "
           "object.tracker_body) to plan for less";
  const auto box = [](const btf::DirectionBox& b) {
    return fmt::format(
        "u {:.3f} to {:.3f}, v {:.3f} to {:.3f}", b.u_min, b.u_max, b.v_min, b.v_max);
  };
  return fmt::format(
      "views up to {:.0f} degrees from the normal ({}), lights up to {:.0f} ({}): {:.1f} % of the "
      "measured pairs",
      reach.view_theta_max * kDegrees,
      box(reach.region.views),
      reach.light_theta_max * kDegrees,
      box(reach.region.lights),
      100 * reach.reached_pairs);
}

std::string plan_text(const Plan& plan) {
  std::string text = fmt::format("what can be asked: {}\n", region_in_words(plan.reach));
  if (plan.reach.below_horizon > 0)
    text += fmt::format("  {:.0f} % of eyes and lights are behind the surface they look at\n",
                        100 * plan.reach.below_horizon);
  text += mip_advice(plan.reach);
  text += "what was tried:\n";
  for (const PlanStep& step : plan.steps) {
    text += fmt::format("  {} {}: mean {:.2f}, 95 % {:.2f}, most {:.2f} dE00; mean {:.2f} codes",
                        step.taken ? '*' : '-',
                        step.what,
                        step.difference.de00_mean,
                        step.difference.de00_p95,
                        step.difference.de00_max,
                        step.difference.codes_mean);
    if (step.fetches > 0)
      text += fmt::format("; {} fetches, {}", step.fetches, megabytes(step.bytes));
    text += fmt::format("\n    {}\n", step.verdict);
  }
  for (const std::string& term : plan.dropped) text += fmt::format("dropped: {}\n", term);
  const PlannedFit& chosen = plan.chosen;
  text += fmt::format(
      "chosen: {}: {} fetches, {}, mean {:.2f} dE00, rmse {:.4f} drawn, {:.4f} in the set{}\n",
      chosen.name(),
      chosen.fetches,
      megabytes(chosen.bytes),
      chosen.difference.de00_mean,
      chosen.difference.rmse,
      chosen.set_rmse,
      plan.is_invisible ? "" : "; its error is seen, nothing better was found");
  text += screen_text(chosen);
  if (plan.general) text += compared_text("fitted for any scene", *plan.general, chosen);
  if (plan.general_alike && plan.general_alike->options.components != chosen.options.components)
    text += compared_text(plan.general_alike->difference.rmse <= chosen.difference.rmse
                              ? "for any scene with no more error"
                              : "for any scene with all its components, still with more error",
                          *plan.general_alike,
                          chosen);
  text.pop_back();
  return text;
}

ordered_json plan_json(const Plan& plan, const PlanSource& source) {
  const Reach& reach = plan.reach;
  ordered_json json{{"set", source.set}, {"scene", source.scene}, {"profile", source.profile}};
  json["reach"] = {{"region", region_in_words(reach)},
                   {"any_pose", reach.any_pose},
                   {"reached_pairs", reach.reached_pairs},
                   {"view_theta_max_deg", reach.view_theta_max * kDegrees},
                   {"light_theta_max_deg", reach.light_theta_max * kDegrees},
                   {"below_horizon", reach.below_horizon},
                   {"texels_per_pixel_median", reach.texels_per_pixel_median},
                   {"texels_per_pixel_p95", reach.texels_per_pixel_p95},
                   {"views", json_of(reach.region.views)},
                   {"lights", json_of(reach.region.lights)}};
  json["chosen"] = json_of(plan.chosen);
  json["is_invisible"] = plan.is_invisible;
  json["dropped"] = plan.dropped;
  if (plan.general) json["general"] = compared_json(*plan.general, plan.chosen);
  if (plan.general_alike) json["general_alike"] = compared_json(*plan.general_alike, plan.chosen);
  json["steps"] = ordered_json::array();
  for (const PlanStep& step : plan.steps) {
    ordered_json one{{"what", step.what}, {"taken", step.taken}, {"verdict", step.verdict}};
    if (step.fetches > 0) {
      one["fetches"] = step.fetches;
      one["gpu_bytes"] = step.bytes;
    }
    one["difference"] = json_of(step.difference);
    json["steps"].push_back(std::move(one));
  }
  return json;
}

std::map<std::string, std::string> plan_provenance(const Plan& plan,
                                                   const PlanSource& source,
                                                   const btf::SampleSetInfo& set) {
  const btf::FitOptions& options = plan.chosen.options;
  return {{"fitted_on", set.source},
          {"clusters", std::to_string(options.clusters)},
          {"components", options.components},
          {"seed", std::to_string(options.seed)},
          {"planned_for", source.scene},
          {"planned_on", source.profile},
          {"planned_region", region_in_words(plan.reach)}};
}

Status write_plan_page(const std::filesystem::path& path,
                       const Plan& plan,
                       const PlanSource& source,
                       const btf::SampleSetInfo& set) {
  ordered_json data = plan_json(plan, source);
  data["text"] = plan_text(plan);
  data["plots"] = plots(plan.reach, set);
  return write_text(path, page_with_data(kPage, data));
}

}  // namespace veneer::quality
