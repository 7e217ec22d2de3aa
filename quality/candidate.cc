// SPDX-License-Identifier: Apache-2.0
#include "quality/candidate.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <tuple>
#include <utility>

#include "btf/fit_region.h"

namespace veneer::quality {
namespace {

using btf::FitOptions;

const FitOptions& default_fit() {
  static const FitOptions options;
  return options;
}

bool has_components(std::string_view model) {
  const auto found = btf::find_model(model);
  return !found || (*found)->terms > 0;
}

/// Free text in a key: what is neither letter, digit nor + becomes a dot and two hexadecimal
/// digits, so that two texts never meet.
std::string keyed(std::string_view text) {
  std::string key;
  for (const char c : text) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '+') {
      key += c;
    } else {
      key += fmt::format(".{:02x}", static_cast<unsigned char>(c));
    }
  }
  return key;
}

/// FNV-1a (Fowler, Noll, Vo 1991) of 64 bits.
class Fingerprint {
 public:
  void add(double value) {
    for (const auto byte : std::bit_cast<std::array<std::uint8_t, sizeof value>>(value)) {
      hash_ = (hash_ ^ byte) * 0x100000001b3U;
    }
  }
  [[nodiscard]] std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325U;
};

std::uint64_t fingerprint(const btf::FitRegion& region) {
  Fingerprint hash;
  for (const btf::DirectionBox& box : {region.views, region.lights})
    for (const double edge : {box.u_min, box.u_max, box.v_min, box.v_max}) hash.add(edge);
  for (const float weight : region.weights.weight) hash.add(weight);
  return hash.value();
}

bool is_finite(const TradePoint& point, double TradePoint::*cost, double TradePoint::*error) {
  return std::isfinite(point.*cost) && std::isfinite(point.*error);
}

/// One bound of a budget.
struct Bound {
  double most;
  double (*of)(const TradePoint& point);
  std::string_view unit;
};

std::vector<Bound> bounds_of(const Budget& budget) {
  std::vector<Bound> bounds;
  if (budget.ms)
    bounds.push_back({*budget.ms, [](const TradePoint& p) { return p.ms_median; }, "ms"});
  if (budget.mb)
    bounds.push_back({*budget.mb, [](const TradePoint& p) { return p.gpu_bytes / 1e6; }, "MB"});
  if (budget.de00)
    bounds.push_back(
        {*budget.de00, [](const TradePoint& p) { return p.received_de00_mean; }, "dE00"});
  return bounds;
}

/// Who comes nearest to a bound: of the points that keep the other bounds, or of all where none
/// does.
std::string nearest_miss(std::span<const TradePoint> points,
                         std::span<const std::size_t> usable,
                         std::span<const Bound> bounds,
                         const Bound& bound) {
  std::size_t best = usable.front();
  bool best_keeps = false;
  for (const std::size_t i : usable) {
    const bool keeps = std::ranges::all_of(bounds, [&](const Bound& other) {
      return &other == &bound || other.of(points[i]) <= other.most;
    });
    if (std::pair(!keeps, bound.of(points[i])) < std::pair(!best_keeps, bound.of(points[best]))) {
      best = i;
      best_keeps = keeps;
    }
  }
  const bool others = bounds.size() > 1;
  const double value = bound.of(points[best]);
  return fmt::format(
      "the least {}{} is {:.4g} ({}{})",
      bound.unit,
      !others      ? ""
      : best_keeps ? " that keeps to the rest"
                   : ", though it misses another bound,",
      value,
      points[best].candidate.name(),
      value > bound.most ? fmt::format("; {:.3g} {} over", value - bound.most, bound.unit) : "");
}

}  // namespace

FitReads reads_of(std::string_view model) {
  constexpr FitReads kNothing{false, false, false, false, false, false, false, false};
  FitReads reads = kNothing;
  if (model == "phong") return reads;
  if (model == "lafortune" || model == "scaled-lafortune" || model == "reflectance-field") {
    reads.lobes = true;
    return reads;
  }
  if (model == "layered") {
    reads.layers = true;
    return reads;
  }
  if (model == "eigen-texture") {
    reads.precision = true;
    return reads;
  }
  reads.clusters = true;
  reads.cache = true;
  if (model == "lpca") return reads;
  reads.angular = true;
  if (model == "revised-lpca") {
    reads.precision = true;
    return reads;
  }
  if (model == "texel-colours") {
    reads.mip_levels = true;
    return reads;
  }
  if (model == "dichromatic-lpca") {
    reads.dichromatic = true;
    return reads;
  }
  return {};
}

std::string Candidate::name() const {
  const FitReads reads = reads_of(model);
  const FitOptions& usual = default_fit();
  std::string text = model;
  if (has_components(model)) text += " " + fit.components;
  const auto add = [&text](const std::string& part) { text += ", " + part; };
  if (reads.lobes) text += fmt::format(" {} lobe{}", fit.lobes, fit.lobes == 1 ? "" : "s");
  if (reads.layers) {
    if (fit.layers > 0) text += fmt::format(" {} layer{}", fit.layers, fit.layers == 1 ? "" : "s");
    if (fit.heights)
      add(fmt::format("heights {:g} to {:g}", fit.heights->lowest, fit.heights->highest));
  }
  if (reads.clusters && fit.clusters != usual.clusters)
    add(fmt::format("{} cluster{}", fit.clusters, fit.clusters == 1 ? "" : "s"));
  if (reads.angular && fit.angular != usual.angular) add(fmt::format("angular {}", fit.angular));
  if (reads.precision && !fit.precision.empty()) add(fit.precision);
  if (reads.dichromatic) {
    if (!fit.form.empty()) add(fit.form);
    if (!fit.specular.empty()) add("specular " + fit.specular);
    if (!fit.clustering.empty()) add("clusters " + fit.clustering);
  }
  if (reads.mip_levels && fit.mip_levels != usual.mip_levels)
    add(fmt::format("{} mip levels", fit.mip_levels));
  if (fit.region != nullptr) add("for the scene");
  if (reads.cache && drawing.cache.spacing > 0) add(fmt::format("cache {}", drawing.cache.spacing));
  if (drawing.average_texels) add("averaged");
  if (drawing.evaluation == render::Evaluation::kCompute) add("compute");
  if (drawing.scale != 1.0) add(fmt::format("scale {:g}", drawing.scale));
  return text;
}

std::string Candidate::fit_key() const {
  const FitReads reads = reads_of(model);
  const FitOptions& usual = default_fit();
  std::string key = model;
  const auto add = [&key](std::string_view tag, const auto& value) {
    key += fmt::format("-{}{}", tag, value);
  };
  const auto add_text = [&](std::string_view tag, const std::string& value) {
    if (!value.empty()) add(tag, "." + keyed(value));
  };
  if (has_components(model)) key += "-" + keyed(fit.components);
  if (reads.lobes) add("lobes", fit.lobes);
  if (reads.layers) {
    if (fit.layers > 0) add("layers", fit.layers);
    if (fit.heights)
      add("heights", fmt::format("{}to{}", fit.heights->lowest, fit.heights->highest));
  }
  if (reads.clusters) {
    if (fit.clusters != usual.clusters) add("clusters", fit.clusters);
    if (fit.basis != usual.basis) add("basis", fit.basis);
    if (fit.iterations != usual.iterations) add("iterations", fit.iterations);
    if (fit.seed != usual.seed) add("seed", fit.seed);
  }
  if (reads.angular && fit.angular != usual.angular) add("angular", fit.angular);
  if (reads.precision) add_text("precision", fit.precision);
  if (reads.dichromatic) {
    add_text("form", fit.form);
    add_text("specular", fit.specular);
    add_text("clustering", fit.clustering);
  }
  if (reads.mip_levels && fit.mip_levels != usual.mip_levels) add("mips", fit.mip_levels);
  if (fit.region != nullptr) add("region", fmt::format("{:016x}", fingerprint(*fit.region)));
  return key;
}

std::string Candidate::key() const {
  const render::DrawingOptions usual;
  std::string key = fit_key();
  if (reads_of(model).cache && drawing.cache.spacing > 0) {
    key += fmt::format("-cache{}", drawing.cache.spacing);
    if (drawing.cache.most_turn != usual.cache.most_turn)
      key += fmt::format("-turn{}", drawing.cache.most_turn);
  }
  if (drawing.average_texels) key += "-averaged";
  if (drawing.evaluation == render::Evaluation::kCompute) key += "-compute";
  if (drawing.scale != usual.scale) key += fmt::format("-scale{}", drawing.scale);
  return key;
}

bool TradePoint::has_idle_cache() const {
  constexpr double kIdle = 0.01;
  return candidate.drawing.cache.spacing > 0 && cache_served < kIdle;
}

std::vector<std::size_t> pareto_front(std::span<const TradePoint> points,
                                      double TradePoint::*cost,
                                      double TradePoint::*error,
                                      double least_gain) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (is_finite(points[i], cost, error) && !points[i].has_idle_cache()) order.push_back(i);
  std::ranges::stable_sort(
      order, {}, [&](std::size_t i) { return std::pair(points[i].*cost, points[i].*error); });
  // From the cheapest on, a point is on the front if its error is enough under all before it, or if
  // it equals the last of them in both.
  std::vector<std::size_t> front;
  for (const std::size_t i : order) {
    if (!front.empty()) {
      const TradePoint& last = points[front.back()];
      const bool equal = points[i].*cost == last.*cost && points[i].*error == last.*error;
      const double gain = last.*error - points[i].*error;
      if (!equal && !(gain > 0.0 && gain >= least_gain)) continue;
    }
    front.push_back(i);
  }
  return front;
}

std::vector<std::size_t> pareto_front(std::span<const TradePoint> points,
                                      double TradePoint::*cost) {
  return pareto_front(points, cost, &TradePoint::received_de00_mean, kLeastGain);
}

Result<std::size_t> choose(std::span<const TradePoint> points, const Budget& budget) {
  const std::vector<Bound> bounds = bounds_of(budget);
  for (const Bound& bound : bounds)
    if (!(bound.most >= 0.0))
      return fail(Errc::kInvalidOption,
                  "choosing a way to draw: a budget of {} {} is none; give a number from 0 on",
                  bound.most,
                  bound.unit);
  std::vector<std::size_t> usable;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const TradePoint& p = points[i];
    if (std::isfinite(p.ms_median) && std::isfinite(p.gpu_bytes) &&
        std::isfinite(p.received_de00_mean) && !p.has_idle_cache())
      usable.push_back(i);
  }
  if (usable.empty())
    return fail(
        Errc::kInvalidOption,
        "choosing a way to draw: none was measured; look at what the run left out, and why");
  std::vector<std::size_t> keeping;
  for (const std::size_t i : usable)
    if (std::ranges::all_of(bounds,
                            [&](const Bound& bound) { return bound.of(points[i]) <= bound.most; }))
      keeping.push_back(i);
  if (!keeping.empty()) {
    const auto error = [&](std::size_t i) { return points[i].received_de00_mean; };
    const bool by_cost = budget.de00 && !budget.ms && !budget.mb;
    const double most =
        by_cost ? *budget.de00 : error(*std::ranges::min_element(keeping, {}, error)) + kLeastGain;
    std::erase_if(keeping, [&](std::size_t i) { return error(i) > most; });
    return *std::ranges::min_element(keeping, {}, [&](std::size_t i) {
      return std::tuple(points[i].ms_median, error(i), points[i].gpu_bytes);
    });
  }
  std::vector<std::string> asked;
  std::vector<std::string> misses;
  for (const Bound& bound : bounds) {
    asked.push_back(fmt::format("{:g} {}", bound.most, bound.unit));
    misses.push_back(nearest_miss(points, usable, bounds, bound));
  }
  return fail(Errc::kInvalidOption,
              "choosing a way to draw: nothing that was measured keeps to {}: {}; allow more, or "
              "measure a finer grid",
              fmt::join(asked, " and "),
              fmt::join(misses, "; "));
}

}  // namespace veneer::quality
