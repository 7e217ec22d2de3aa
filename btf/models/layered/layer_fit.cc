// SPDX-License-Identifier: Apache-2.0
#include "btf/models/layered/layer_fit.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/parallel.h"
#include "base/random.h"
#include "btf/models/layered/layer_heights.h"
#include "btf/models/layered/layer_views.h"
#include "btf/models/layered/point_solver.h"

namespace veneer::btf {
namespace {

constexpr std::int64_t kGrain = 16;  // texels of a piece of work
constexpr int kSweeps = 9;
// Until the layers have found their places what lies in shadow would only mislead them.
constexpr int kSweepsWithoutShadows = 3;
// Steps of the solver in one pass over the views.
constexpr int kSteps = 8;
// Passes behind it, at most, that take all views before their one step; and when they end.
constexpr int kWholePasses = 3;
constexpr double kConverged = 0.999;
constexpr double kNextToNothing = 0.01;
// Views that a sweep looks at, at least; the last two sweeps look at all.
constexpr int kLeastViews = 32;
// Sweeps in which every point's lobe is also looked for from the start, since some end in a narrow
// one.
constexpr bool looks_again(int sweep) { return sweep == 3 || sweep == 5; }
constexpr double kLeastForgetting = 0.95;
// What a simpler answer, clear or opaque, may cost of a point's error: about ten times what as many
// unknowns gain on noise alone.
constexpr double kSimplerAt = 1.01;

// By how much more or less where all eight neighbours are so, or are not. Parts of one colour lie
// at any height as far as they alone can tell; their edges tell, and this carries it inwards. 24 x
// 24 texels of lichen, two seeds: 0 puts 82 % of them right, this 94 %; errors are alike, and those
// of views beyond the fitted ones a sixth smaller. From 1 on nothing would be clear beside what is
// opaque.
constexpr double kNeighbours = 0.7;
// How much of that at a depth: a sample that is flat as far as can be told has nothing to carry on,
// and layers are but a richer formula for it.
double share_of(double depth) {
  return std::clamp(2.0 * depth / kHeightResolution - 1.0, 0.0, 1.0);
}

// Both colours at most, of the largest sample under a light along the normal: between and beyond
// the data nothing holds a lobe otherwise.
constexpr float kMostRise = 4.0F;
constexpr float kLeastShare = 0.05F;

// Sums over a point's samples of what it sends (L) and what comes from below (B), both as they are
// seen, against what is wanted (R).
struct Blend {
  double ll = 0.0, lb = 0.0, bb = 0.0, lr = 0.0, br = 0.0;
};

// One point with all that is said of it.
class PointFit {
 public:
  // @param neighbours  how much they count.
  PointFit(const LayerViews& stack, std::span<const int> order, double neighbours)
      : stack_(stack), order_(order), neighbours_(neighbours), views_(stack.view_count()) {}

  struct Outcome {
    LayerPoint point;
    double error = 0.0;
    bool fell_back = false;
    bool simpler = false;  // taken though another has less error
  };

  // @param forgetting  where it begins; it rises to 1 over the passes.
  // @param opaque_around  the share of the neighbours that are opaque.
  [[nodiscard]] Outcome fit(
      int layer, int texel, double forgetting, double opaque_around, bool again) {
    stack_.look(layer, texel, order_, views_);
    const LayerPoint before = stack_.points(layer)[static_cast<std::size_t>(texel)];
    shade_ = stack_.arriving(layer, texel);
    with_radiance_ = layer > 0 && shade_.minCoeff() < 1.0F;

    const double error_before = error_of(before);
    take_measure();
    if (!(energy_ > 0.0)) return {before, error_before};

    const bool lowest = layer == stack_.layer_count() - 1;
    const bool known = before.diffuse.maxCoeff() > 0.0F && before.transmittance < 0.9F;
    LayerPoint point = known ? before : start_of(views_, order_, shade_, stack_.lights());
    point.diffuse_radiance = before.diffuse_radiance;
    point.transmittance = 0.0F;
    Outcome best = solved(point, forgetting);
    if (!known) best = solved(best.point, 1.0);
    if (!lowest) best = blended(best, opaque_around);
    if (again) best = with_fresh_lobe(best);
    if (!best.simpler && !(best.error < error_before * (1.0 + 1e-6))) {
      // Where the neighbours have moved, what was there before may fit better than a new answer.
      best = {before, error_before, best.fell_back};
    }
    return best;
  }

 private:
  // The point that the views lead to from another; its transmittance stays.
  [[nodiscard]] Outcome solved(const LayerPoint& from, double forgetting) {
    Outcome best{from, error_of(from)};
    best.fell_back = !pass(best, forgetting, kSteps);
    for (int i = 0; i < kWholePasses; ++i) {
      const double before = best.error;
      pass(best, 1.0, 1);
      if (best.error > kConverged * before) break;
    }
    return best;
  }
  // False where no step held.
  bool pass(Outcome& best, double forgetting, int steps) {
    PointSolver solver(best.point, with_radiance_, most_colour_);
    const std::size_t chunk =
        std::max<std::size_t>(1, order_.size() / static_cast<std::size_t>(steps));
    std::size_t taken = 0;
    bool moved = false;
    for (const int v : order_) {
      const PointView& view = views_[static_cast<std::size_t>(v)];
      if (view.visible > 0.0F) solver.add(view, shade_, stack_.lights());
      if (++taken % chunk != 0 && taken != order_.size()) continue;
      const double done = static_cast<double>(taken) / static_cast<double>(order_.size());
      moved = solver.step(forgetting + (1.0 - forgetting) * done) || moved;
    }
    if (!moved) return false;
    const double error = error_of(solver.point());
    if (error < best.error) {
      best.point = solver.point();
      best.error = error;
    }
    return true;
  }

  // Eq. (13): how much of the candidate and how much of what lies below; then the layer again.
  [[nodiscard]] Outcome blended(const Outcome& opaque, double opaque_around) {
    const double lean = neighbours_ * (2.0 * opaque_around - 1.0);
    const Blend blend = blend_of(opaque.point);
    const double clear_error = error_of({});
    // Below this all is rounding, and the simpler one of two is taken.
    const double rounding = 1e-9 * energy_;
    double of_layer = 1.0;
    double of_below = 0.0;
    const double determinant = blend.ll * blend.bb - blend.lb * blend.lb;
    // Where the layer and what lies below look the same, nothing tells them apart.
    if (determinant > 1e-6 * blend.ll * blend.bb) {
      of_below = std::clamp((blend.ll * blend.br - blend.lb * blend.lr) / determinant, 0.0, 1.0);
      of_layer = std::max(0.0, (blend.lr - of_below * blend.lb) / blend.ll);
    }
    Outcome best = opaque;
    // The rest is the same layer again where next to nothing comes from below.
    if (of_below > kNextToNothing) {
      LayerPoint mixed = opaque.point;
      mixed.transmittance = static_cast<float>(of_below);
      mixed.diffuse *= static_cast<float>(of_layer);
      mixed.specular *= static_cast<float>(of_layer);
      const Outcome through = solved(mixed, 1.0);
      best.simpler = opaque.error <= (kSimplerAt + lean) * through.error + rounding;
      if (!best.simpler) best = through;
    }
    if (clear_error <= (kSimplerAt - lean) * best.error + rounding)
      best = {LayerPoint{}, clear_error, false, true};
    return best;
  }

  [[nodiscard]] Outcome with_fresh_lobe(const Outcome& known) {
    if (!(known.point.diffuse.maxCoeff() > 0.0F)) return known;
    LayerPoint point = known.point;
    const LayerPoint fresh = start_of(views_, order_, shade_, stack_.lights());
    point.specular = fresh.specular;
    point.exponent = fresh.exponent;
    point.lobe = fresh.lobe;
    Outcome found = solved(point, kLeastForgetting);
    found.simpler = known.simpler;
    return found.error < known.error ? found : known;
  }

  // What a point sends.
  [[nodiscard]] LightRows sent_by(const LayerPoint& point, const PointView& view) {
    const Eigen::ArrayXf shine = (stack_.lights().matrix() * point.normal).array().max(0.0F) *
                                 (shade_ + point.diffuse_radiance);
    lobe_rows(point, view.u, lobe_);
    LightRows sent(shine.size(), 3);
    for (int c = 0; c < 3; ++c)
      sent.col(c) = shine * (point.diffuse[c] + point.specular[c] * lobe_);
    return sent;
  }

  // What is wanted in all, and how bright a point may be to send it.
  void take_measure() {
    energy_ = 0.0;
    float largest = 0.0F;
    for (const int v : order_) {
      const PointView& view = views_[static_cast<std::size_t>(v)];
      if (!(view.visible > 0.0F)) continue;
      energy_ += double(view.wanted.square().sum());
      largest = std::max(largest, view.wanted.maxCoeff() / std::max(view.visible, kLeastShare));
    }
    most_colour_ = kMostRise * largest / std::max(stack_.lights().col(2).maxCoeff(), kLeastShare);
  }

  // Of the whole along its views, as residuals, since sums of squares of what is nearly equal
  // cancel.
  [[nodiscard]] double error_of(const LayerPoint& point) {
    double error = 0.0;
    for (const int v : order_) {
      const PointView& view = views_[static_cast<std::size_t>(v)];
      if (!(view.visible > 0.0F)) continue;
      LightRows rest =
          (sent_by(point, view) + point.transmittance * view.below) * view.visible - view.wanted;
      if (view.weight.size() > 0) rest.colwise() *= view.weight.sqrt();
      error += double(rest.square().sum());
    }
    return error;
  }

  [[nodiscard]] Blend blend_of(const LayerPoint& point) {
    Blend blend;
    for (const int v : order_) {
      const PointView& view = views_[static_cast<std::size_t>(v)];
      if (!(view.visible > 0.0F)) continue;
      LightRows sent = sent_by(point, view) * view.visible;
      LightRows below = view.below * view.visible;
      LightRows wanted = view.wanted;
      if (view.weight.size() > 0) {
        const Eigen::ArrayXf root = view.weight.sqrt();
        for (LightRows* rows : {&sent, &below, &wanted}) rows->colwise() *= root;
      }
      blend.ll += double(sent.square().sum());
      blend.lb += double((sent * below).sum());
      blend.bb += double(below.square().sum());
      blend.lr += double((sent * wanted).sum());
      blend.br += double((below * wanted).sum());
    }
    return blend;
  }

  const LayerViews& stack_;
  std::span<const int> order_;
  double neighbours_;
  std::vector<PointView> views_;
  Eigen::ArrayXf shade_;
  bool with_radiance_ = false;
  double energy_ = 0.0;
  float most_colour_ = 0.0F;
  Eigen::ArrayXf lobe_;
};

// The views, so that each few of them lie all about.
std::vector<int> mixed_order(int count, std::uint64_t seed) {
  std::vector<int> order(static_cast<std::size_t>(count));
  std::iota(order.begin(), order.end(), 0);
  Pcg32 random(seed);
  for (std::size_t i = order.size(); i > 1; --i)
    std::swap(order[i - 1], order[static_cast<std::size_t>(random.uniform() * double(i))]);
  return order;
}

// Moves each layer to where the stack as a whole is nearest to the data: shadows tell the distance
// of two layers more finely than the views do.
void refine_heights(LayerViews& stack) {
  constexpr float kStep = 0.125F;  // texels
  constexpr int kTries = 4;
  constexpr int kTexels = 1024;
  const int stride = std::max(1, stack.texel_count() / kTexels);
  for (int layer = stack.layer_count() - 1; layer >= 0; --layer) {
    const auto at = static_cast<std::size_t>(layer);
    const float here = stack.heights()[at];
    std::vector<float> best;
    double least = std::numeric_limits<double>::infinity();
    for (int i = -kTries; i <= kTries; ++i) {
      const float height = here + kStep * static_cast<float>(i);
      if (std::abs(height) > LayerStack::kMostHeight ||
          (layer > 0 && height >= stack.heights()[at - 1]) ||
          (at + 1 < stack.heights().size() && height <= stack.heights()[at + 1]))
        continue;
      stack.set_height(layer, height);
      const double error = stack.squared_error(stride);
      if (error < least * (1.0 - 1e-6)) best.clear();
      if (error <= least * (1.0 + 1e-6)) best.push_back(height);
      least = std::min(least, error);
    }
    // Steps are whole texels, so that heights next to each other may do the same.
    stack.set_height(layer, best[best.size() / 2]);
  }
}

}  // namespace

LayerFit fit_layers(const SampleSet& set,
                    const FittedPairs& pairs,
                    const FitOptions& options,
                    Progress& progress) {
  const MaterialFrame& frame = pairs.frame();
  const LayerHeights heights = layer_heights(set, pairs, options, progress);
  LayerViews stack(set, pairs, heights.heights);
  const double neighbours = kNeighbours * share_of(heights.depth);
  const int layers = stack.layer_count();
  std::vector<int> order = mixed_order(static_cast<int>(frame.views.size()), options.seed);
  const int sweeps = layers == 1 ? 2 : kSweeps;
  int fallbacks = 0;
  progress.start("layers", std::int64_t{sweeps} * layers * frame.texel_count());
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    if (sweep == kSweepsWithoutShadows) stack.set_shadows(true);
    const double forgetting =
        kLeastForgetting + (1.0 - kLeastForgetting) * sweep / std::max(1, sweeps - 1);
    std::atomic<int> fell_back = 0;
    // Others each time, so that all are heard.
    const std::size_t looked_at =
        sweep + 2 < sweeps
            ? std::min(order.size(), std::max<std::size_t>(kLeastViews, order.size() / 2))
            : order.size();
    std::rotate(order.begin(),
                order.begin() + static_cast<std::ptrdiff_t>(looked_at % order.size()),
                order.end());
    for (int layer = layers - 1; layer >= 0; --layer) {
      std::vector<LayerPoint> points = stack.points(layer);
      parallel_for(frame.texel_count(), kGrain, [&](std::int64_t begin, std::int64_t end) {
        PointFit fit(stack, std::span(order).first(looked_at), neighbours);
        for (auto texel = static_cast<int>(begin); texel < end; ++texel) {
          const PointFit::Outcome outcome = fit.fit(
              layer, texel, forgetting, stack.opaque_around(layer, texel), looks_again(sweep));
          points[static_cast<std::size_t>(texel)] = outcome.point;
          fell_back += outcome.fell_back ? 1 : 0;
        }
        progress.advance(end - begin);
      });
      stack.set_points(layer, std::move(points));
    }
    if (!options.heights && sweep == kSweepsWithoutShadows) refine_heights(stack);
    fallbacks = fell_back;
  }
  progress.finish(fallbacks == 0 ? "" : fmt::format("{} points stay as they were", fallbacks));
  return LayerFit{stack.stack(), fallbacks};
}

}  // namespace veneer::btf
