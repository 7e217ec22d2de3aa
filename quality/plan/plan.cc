// SPDX-License-Identifier: Apache-2.0
#include "quality/plan/plan.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <tuple>

#include "btf/interpolated_set.h"

namespace veneer::quality {
namespace {

// What a general fit has.
constexpr int kGeneralNodes = 16;
constexpr int kGeneralClusters = 32;
// A planned one begins with the finest grid and the most clusters whose volume is no larger: both
// cost bytes, of which a small box hardly needs any, and no fetches. Nodes are counted along the
// whole square; a fit crops them to its box.
constexpr std::array kNodes{32, 24, 16, 12, 8, 6, 4};
constexpr int kMoreClusters = 4;
constexpr int kTexelsOfCluster = 16;  // fewer keep next to a component each

// Of models of one term, and of two: every further entry costs fetches. Scalars are packed four to
// a volume, so there is nothing between.
constexpr std::array kOneTerm{"1", "2", "3", "4", "6", "8", "12", "16"};
constexpr std::array kTwoTerms{"3+1", "6+2", "9+3", "12+4"};
constexpr std::array kFirstTerm{"4+0", "8+0", "12+0", "16+0"};
// Describes both terms well enough to see what the second one does.
constexpr const char* kProbe = "8+4";
constexpr const char* kProbeWithout = "8+0";

// A box no wider than this is one direction and its margin.
bool is_one_place(const btf::DirectionBox& box) {
  constexpr double kWidth = 4 * kLeastMargin;
  return box.u_max - box.u_min < kWidth && box.v_max - box.v_min < kWidth;
}

double nodes_in(const btf::FitRegion& region, int angular) {
  double count = 1;
  for (const btf::DirectionBox* box : {&region.views, &region.lights})
    for (const double side : {box->u_max - box->u_min, box->v_max - box->v_min})
      count *= std::max(2.0, std::ceil(angular * side));
  return count;
}

// What a fit to the region begins with.
btf::FitOptions finest_for(const btf::FitRegion& region, int texels) {
  const double most = std::pow(kGeneralNodes, 4);
  btf::FitOptions options;
  options.angular = kGeneralNodes;
  for (const int nodes : kNodes)
    if (nodes >= kGeneralNodes && nodes_in(region, nodes) <= most) {
      options.angular = nodes;
      break;
    }
  const int room = static_cast<int>(most / nodes_in(region, options.angular));
  const int more = std::clamp(texels / (kTexelsOfCluster * kGeneralClusters), 1, kMoreClusters);
  options.clusters = std::min(texels, kGeneralClusters * std::clamp(room, 1, more));
  return options;
}

std::span<const char* const> ladder_of(int terms, bool second_dropped) {
  if (terms == 1) return kOneTerm;
  return second_dropped ? std::span<const char* const>(kFirstTerm) : kTwoTerms;
}

Reflecting drawn_by(const btf::Material& material) {
  return [&material](int texel, const btf::Direction& view, const btf::Direction& light) {
    return material.radiance(texel, view, light);
  };
}
Reflecting without_specular(const btf::Material& material) {
  return [&material](int texel, const btf::Direction& view, const btf::Direction& light) {
    return material.diffuse_radiance(texel, view, light);
  };
}

bool costs_less(const PlannedFit& a, const PlannedFit& b) {
  return std::tuple(a.fetches, a.bytes) < std::tuple(b.fetches, b.bytes);
}

class Planner {
 public:
  Planner(const btf::SampleSet& set,
          const calibration::ProjectorProfile& profile,
          const PlanOptions& options,
          Plan& plan,
          VisibleDifferences from_full,
          Progress& progress)
      : set_(set),
        profile_(profile),
        options_(options),
        plan_(plan),
        from_full_(std::move(from_full)),
        progress_(progress) {}

  Status try_model(const std::string& name);
  Status choose(const TimeMaterial& time);
  Status compare_with_general();

 private:
  [[nodiscard]] bool is_invisible(const VisibleDifference& d) const {
    return d.de00_mean <= options_.max_de00 || d.codes_mean < 1.0;
  }
  [[nodiscard]] Result<PlannedFit> fit(const std::string& model,
                                       const btf::FitOptions& options,
                                       bool for_region);
  // Notes the fit as a step, and among those of which is chosen.
  [[nodiscard]] Result<PlannedFit> tried(const std::string& model, const btf::FitOptions& options);
  [[nodiscard]] Result<bool> second_term_is_seen(const std::string& model, btf::FitOptions options);
  void take_away(const std::string& model, PlannedFit& best);

  const btf::SampleSet& set_;
  const calibration::ProjectorProfile& profile_;
  const PlanOptions& options_;
  Plan& plan_;
  VisibleDifferences from_full_;
  Progress& progress_;
  std::vector<PlannedFit> fits_;
  std::optional<PlannedFit> best_;  // invisible, cheapest
};

Result<PlannedFit> Planner::fit(const std::string& model,
                                const btf::FitOptions& options,
                                bool for_region) {
  VENEER_ASSIGN(const btf::Model* found, btf::find_model(model));
  PlannedFit fitted;
  fitted.model = model;
  fitted.options = options;
  fitted.for_region = for_region;
  btf::FitOptions own = options;
  own.region = for_region ? &plan_.reach.region : nullptr;
  // A line for each fit, not for each of its stages.
  progress_.start(for_region ? fitted.name() : fitted.name() + ", for any scene", 1);
  SilentProgress silent;
  const auto begin = std::chrono::steady_clock::now();
  VENEER_ASSIGN(fitted.material, found->fit(set_, own, silent));
  fitted.fit_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const btf::ModelShader shader = fitted.material->shader();
  fitted.fetches = shader.fetches;
  fitted.bytes = static_cast<double>(shader.gpu_bytes());
  fitted.difference = from_full_.of(drawn_by(*fitted.material));
  VENEER_ASSIGN(fitted.set_rmse, weighted_rmse(set_, *fitted.material, plan_.reach.region.weights));
  progress_.advance();
  progress_.finish(fmt::format("mean {:.2f} dE00, {} fetches, {:.3f} MB: its error is {}",
                               fitted.difference.de00_mean,
                               fitted.fetches,
                               fitted.bytes / 1e6,
                               is_invisible(fitted.difference) ? "not seen" : "seen"));
  return fitted;
}

Result<PlannedFit> Planner::tried(const std::string& model, const btf::FitOptions& options) {
  VENEER_ASSIGN(PlannedFit fitted, fit(model, options, true));
  const bool invisible = is_invisible(fitted.difference);
  plan_.steps.push_back({fitted.name(),
                         fitted.difference,
                         fitted.fetches,
                         fitted.bytes,
                         false,
                         invisible ? "its error is not seen" : "its error is seen"});
  if (invisible && (!best_ || costs_less(fitted, *best_))) best_ = fitted;
  fits_.push_back(fitted);
  return fitted;
}

Result<bool> Planner::second_term_is_seen(const std::string& model, btf::FitOptions options) {
  options.components = kProbe;
  VENEER_ASSIGN(const PlannedFit probe, fit(model, options, true));
  if (!probe.material->has_specular_term()) return true;
  VENEER_ASSIGN(VisibleDifferences effect,
                VisibleDifferences::make(profile_, plan_.reach.asked, set_.info()));
  effect.set_reference(drawn_by(*probe.material));
  const VisibleDifference change = effect.of(without_specular(*probe.material));
  PlanStep step{fmt::format("leave out the specular term of {}", model), change, 0, 0, false, ""};
  step.taken = change.is_never_seen();
  if (step.taken) {
    options.components = kProbeWithout;
    VENEER_ASSIGN(const PlannedFit without, fit(model, options, true));
    const std::string saved = fmt::format(
        "it would change nothing by more than {:.2f} dE00 and {:.2f} codes, which is not seen; of "
        "{} it saves {} of {} fetches and {:.3f} of {:.3f} MB",
        change.de00_max,
        change.codes_max,
        probe.name(),
        probe.fetches - without.fetches,
        probe.fetches,
        (probe.bytes - without.bytes) / 1e6,
        probe.bytes / 1e6);
    step.verdict = "dropped: " + saved;
    plan_.dropped.push_back(fmt::format("specular term of {}: {}", model, saved));
  } else {
    step.verdict = fmt::format("kept: without it up to {:.1f} dE00 and {:.1f} codes are wrong",
                               change.de00_max,
                               change.codes_max);
  }
  plan_.steps.push_back(step);
  return !step.taken;
}

// Nodes and clusters, as long as nobody sees it.
void Planner::take_away(const std::string& model, PlannedFit& best) {
  const auto while_unseen = [&](const auto& less) {
    for (;;) {
      btf::FitOptions options = best.options;
      if (!less(options)) return;
      const auto fitted = tried(model, options);
      if (!fitted || !is_invisible(fitted->difference) || !costs_less(*fitted, best)) return;
      best = *fitted;
    }
  };
  while_unseen([](btf::FitOptions& options) {
    const auto* next =
        std::ranges::find_if(kNodes, [&](int nodes) { return nodes < options.angular; });
    if (next == kNodes.end()) return false;
    options.angular = *next;
    return true;
  });
  while_unseen([](btf::FitOptions& options) {
    if (options.clusters < 2) return false;
    options.clusters /= 2;
    return true;
  });
}

Status Planner::try_model(const std::string& name) {
  VENEER_ASSIGN(const btf::Model* model, btf::find_model(name));
  if (model->polarised && !set_.info().polarised)
    return fail(Errc::kInvalidOption,
                "planning: {} needs a set that knows specular and diffuse apart, which {} does not",
                name,
                set_.path().string());
  btf::FitOptions options = finest_for(plan_.reach.region, set_.info().texel_count());
  options.seed = options_.seed;
  if (model->terms == 0) {
    VENEER_ASSIGN(const PlannedFit fitted, tried(name, options));
    return {};
  }
  bool second_dropped = false;
  if (model->terms == 2 && model->polarised) {
    VENEER_ASSIGN(const bool seen, second_term_is_seen(name, options));
    second_dropped = !seen;
  }
  const std::span<const char* const> ladder = ladder_of(model->terms, second_dropped);
  for (std::size_t i = 0; i < ladder.size(); ++i) {
    options.components = ladder[i];
    auto fitted = tried(name, options);
    // A fit that this set or these GPUs do not allow ends the ladder; the first must work.
    if (!fitted && i > 0) break;
    VENEER_TRY(fitted);
    if (is_invisible(fitted->difference)) {
      PlannedFit best = *fitted;
      if (model->terms == 2 && !second_dropped) {
        btf::FitOptions one = best.options;
        one.components = kFirstTerm[static_cast<std::size_t>(
            std::ranges::find(ladder, std::string_view(best.options.components)) - ladder.begin())];
        if (const auto other = tried(name, one);
            other && is_invisible(other->difference) && costs_less(*other, best))
          best = *other;
      }
      if (model->over_ranks) take_away(name, best);
      return {};
    }
    // What follows fetches more than what is good enough already.
    if (best_ && fitted->fetches > best_->fetches) return {};
  }
  return {};
}

Status Planner::choose(const TimeMaterial& time) {
  if (fits_.empty())
    return fail(Errc::kInvalidOption, "planning: no model could be fitted to this set");
  const auto error = [](const PlannedFit& fitted) { return fitted.difference.de00_mean; };
  plan_.chosen = best_ ? *best_ : *std::ranges::min_element(fits_, {}, error);
  if (options_.frame_ms) {
    std::ranges::stable_sort(fits_, {}, error);
    VENEER_ASSIGN(plan_.chosen.frame_ms, time(*plan_.chosen.material));
    PlannedFit fastest = plan_.chosen;
    if (*plan_.chosen.frame_ms > *options_.frame_ms) {
      for (PlannedFit& fitted : fits_) {
        // Each kind of cost once: what fetches as much takes as long.
        if (fitted.fetches >= fastest.fetches) continue;
        VENEER_ASSIGN(fitted.frame_ms, time(*fitted.material));
        if (*fitted.frame_ms < *fastest.frame_ms) fastest = fitted;
        if (*fitted.frame_ms <= *options_.frame_ms) break;
      }
      plan_.steps.push_back(
          {fmt::format("keep a frame within {} ms", *options_.frame_ms),
           fastest.difference,
           0,
           0,
           true,
           fmt::format("{} takes {:.2f} ms; {} takes {:.2f} ms{}",
                       plan_.chosen.name(),
                       *plan_.chosen.frame_ms,
                       fastest.name(),
                       *fastest.frame_ms,
                       *fastest.frame_ms <= *options_.frame_ms
                           ? ""
                           : ": nothing that was tried is fast enough; draw on a smaller raster "
                             "(render --scale) or from the angular cache (--cache)")});
      plan_.chosen = fastest;
    }
  }
  plan_.is_invisible = is_invisible(plan_.chosen.difference);
  for (PlanStep& step : plan_.steps)
    if (step.fetches > 0 && step.what == plan_.chosen.name()) {
      step.taken = true;
      step.verdict = plan_.is_invisible ? "chosen: its error is not seen, and nothing cheaper's"
                                        : "chosen: the least error that was found";
    }
  return {};
}

Status Planner::compare_with_general() {
  const PlannedFit& chosen = plan_.chosen;
  VENEER_ASSIGN(const btf::Model* model, btf::find_model(chosen.model));
  btf::FitOptions options = chosen.options;
  options.clusters = std::min(kGeneralClusters, set_.info().texel_count());
  options.angular = kGeneralNodes;
  VENEER_ASSIGN(plan_.general, fit(chosen.model, options, false));
  plan_.general_alike = plan_.general;
  if (model->terms == 0) return {};
  const auto ladder = ladder_of(model->terms, chosen.options.components.ends_with("+0"));
  if (plan_.general_alike->difference.rmse <= chosen.difference.rmse) return {};
  // The fewest that do: more components leave less, so halving finds them.
  auto first = std::ranges::find(ladder, std::string_view(chosen.options.components)) + 1;
  auto last = ladder.end();
  while (first < last) {
    const auto middle = first + (last - first) / 2;
    options.components = *middle;
    auto fitted = fit(chosen.model, options, false);
    if (!fitted) {  // larger than GPUs take
      last = middle;
      continue;
    }
    const bool is_alike = fitted->difference.rmse <= chosen.difference.rmse;
    if (is_alike || plan_.general_alike->difference.rmse > fitted->difference.rmse)
      plan_.general_alike = *fitted;
    if (is_alike) {
      last = middle;
    } else {
      first = middle + 1;
    }
  }
  return {};
}

}  // namespace

Status PlanOptions::check() const {
  if (frame_ms && !(*frame_ms > 0.0 && *frame_ms < 1e4))
    return fail(Errc::kInvalidOption,
                "planning: frame-ms is {}; it must be above 0 and under 10000",
                *frame_ms);
  if (!(max_de00 > 0.0 && max_de00 <= 100.0))
    return fail(Errc::kInvalidOption,
                "planning: max-de00 is {}; it must be above 0 and at most 100",
                max_de00);
  for (const std::string& model : models) VENEER_TRY(btf::find_model(model));
  return {};
}

std::string PlannedFit::name() const {
  std::string text = model;
  const auto found = btf::find_model(model);
  if (!found || (*found)->terms == 0) return text;
  text += fmt::format(" {}", options.components);
  if ((*found)->over_ranks)
    text += fmt::format(", {} clusters, {} nodes", options.clusters, options.angular);
  return text;
}

std::vector<std::string> planned_models(const btf::SampleSetInfo& set, const Reach& reach) {
  std::vector<std::string> models{"phong", "lafortune"};
  if (set.polarised) models.emplace_back("dichromatic-lpca");
  models.emplace_back("texel-colours");
  models.emplace_back("revised-lpca");
  if (is_one_place(reach.region.lights)) models.emplace_back("eigen-texture");
  return models;
}

Result<Plan> make_plan(const btf::SampleSet& set,
                       const render::Scene& scene,
                       const calibration::ProjectorProfile& profile,
                       const PlanOptions& options,
                       const TimeMaterial& time,
                       Progress& progress) {
  VENEER_TRY(options.check());
  VENEER_TRY(set.check_finite());
  Plan plan;
  VENEER_ASSIGN(plan.reach, find_reach(scene, profile, set.info(), progress));
  VENEER_ASSIGN(VisibleDifferences from_full,
                VisibleDifferences::make(profile, plan.reach.asked, set.info()));
  const btf::InterpolatedSet full(set);
  from_full.set_reference(
      [&full](int texel, const btf::Direction& view, const btf::Direction& light) {
        return full.radiance(texel, view, light);
      });
  Planner planner(set, profile, options, plan, std::move(from_full), progress);
  for (const std::string& model :
       options.models.empty() ? planned_models(set.info(), plan.reach) : options.models)
    VENEER_TRY(planner.try_model(model));
  VENEER_TRY(planner.choose(time));
  if (options.compare_general) VENEER_TRY(planner.compare_with_general());
  return plan;
}

}  // namespace veneer::quality
