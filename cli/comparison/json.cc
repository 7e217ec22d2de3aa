// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include "cli/comparison/tables.h"

namespace veneer::cli {
namespace {

using Json = nlohmann::ordered_json;

template <class Errors>
Json errors_json(const Errors& errors) {
  return {{"avg", errors.avg}, {"min", errors.min}, {"max", errors.max}};
}

Json views_json(const btf::ViewsError& error) {
  return {{"views", error.views}, {"epsilon", error.epsilon}, {"rmse_linear", error.rmse}};
}

Json held_out_json(const HeldOutFit& fit) {
  return {{"fit_seconds", fit.fit_seconds},
          {"texels", fit.errors.texels},
          {"beyond", views_json(fit.errors.beyond)},
          {"within", views_json(fit.errors.within)}};
}

Json model_json(const Comparison& comparison, const ComparedModel& model) {
  Json json{{"name", model.name}, {"fit_seconds", model.fit_seconds}};
  if (model.errors) json["epsilon"] = errors_json(*model.errors);
  json["values_per_texel"] = model.values_per_texel;
  json["bytes_per_texel"] = model.bytes_per_texel;
  json["fetches"] = model.fetches;
  if (model.cost) {
    json["alu"] = model.cost->arithmetic;
    json["alu_is_complete"] = !model.cost->loops_left;
  }
  if (model.timing) {
    json["ms_median"] = model.timing->ms_median;
    json["ms_p95"] = model.timing->ms_p95;
    json["ratio"] = model.timing->ratio;
  }
  if (model.held_out) json["held_out"] = held_out_json(*model.held_out);
  if (const PublishedModel* paper = model.published) {
    Json& published = json["published"] = {
        {"label", paper->label},
        {"values_by_formula",
         paper->values_of(
             {comparison.width * comparison.height, comparison.views, comparison.lights})},
        {"values_per_texel", paper->values},
        {"bytes_per_texel", paper->bytes},
        {"fetches", paper->fetches},
        {"alu", paper->alu},
        {"fps", paper->fps}};
    if (comparison.material != nullptr) {
      const auto index = static_cast<std::size_t>(paper - published_models().data());
      published["epsilon"] = errors_json(comparison.material->errors[index]);
    }
  }
  return json;
}

}  // namespace

nlohmann::ordered_json to_json(const Comparison& comparison) {
  Json json{{"set", comparison.set},
            {"texels", {comparison.width, comparison.height}},
            {"views", comparison.views},
            {"lights", comparison.lights}};
  json["published_material"] =
      comparison.material == nullptr ? Json() : Json(comparison.material->name);
  json["epsilon_domain"] = "samples cut to [0, 1], exponent 1/2.2; over texels";
  if (comparison.mean_brdf) json["mean_brdf_epsilon"] = errors_json(*comparison.mean_brdf);
  if (comparison.most_theta_deg) json["held_out_beyond_deg"] = *comparison.most_theta_deg;
  json["models"] = Json::array();
  for (const ComparedModel& model : comparison.models)
    json["models"].push_back(model_json(comparison, model));
  json["order"] = Json::array();
  for (const OrderClaim& claim : published_order(comparison))
    json["order"].push_back({{"worse", claim.worse->published->label},
                             {"better", claim.better->published->label},
                             {"holds", claim.holds}});
  json["values_differ"] = wrong_values(comparison);
  if (comparison.table3) {
    if (!comparison.no_cost.empty()) json["no_alu"] = comparison.no_cost;
    if (comparison.no_timing.empty()) {
      json["renderer"] = comparison.renderer;
      json["clock"] = comparison.timing_clock;
      json["size"] = comparison.timing_size;
      json["plain_ms"] = comparison.plain_ms;
    } else {
      json["no_timing"] = comparison.no_timing;
    }
  }
  return json;
}

}  // namespace veneer::cli
