// SPDX-License-Identifier: Apache-2.0
#include "btf/evaluation.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/colour.h"
#include "base/parallel.h"
#include "base/random.h"
#include "base/statistics.h"
#include "btf/mapped_material.h"
#include "btf/spread_texels.h"

namespace veneer::btf {
namespace {

// The exponent of the literature's tables.
constexpr float kEncodingExponent = 1.0F / 2.2F;
// Enough colour differences for a mean and a percentile that are steady to about half a percent.
constexpr std::int64_t kColourSamples = 200'000;
constexpr int kDrawnTexels = 1024;
constexpr std::int64_t kDrawnSamples = 200'000;
// Texels are summed in this many groups, each in order, so that rounding does not depend on
// threads.
constexpr std::int64_t kGroups = 64;

// What is compared: pairs of the set, where they stand in what the material reconstructs, and their
// weights.
struct ComparedPairs {
  std::vector<int> of_set;
  std::vector<int> of_material;
  Eigen::ArrayXd weight;
  bool alike = true;  // all weights are the same

  [[nodiscard]] Eigen::Index count() const { return weight.size(); }
};

// Of the texels of one group, in one domain.
struct Sums {
  Eigen::ArrayXd images;  // of |difference| for each pair, over texels and channels
  double squares = 0.0;   // weighted
  double texel_min = std::numeric_limits<double>::infinity();  // of |difference| over one texel
  double texel_max = 0.0;

  explicit Sums(Eigen::Index pairs = 0) : images(Eigen::ArrayXd::Zero(pairs)) {}
  // One texel's differences, [pair][channel].
  void add(const Eigen::ArrayXf& difference, const Eigen::ArrayXd& weight) {
    const Eigen::Map<const Eigen::Array3Xf> channels(difference.data(), 3, images.size());
    const Eigen::ArrayXd of_pairs = channels.abs().colwise().sum().transpose().cast<double>();
    images += of_pairs;
    squares += (weight * channels.cast<double>().square().colwise().sum().transpose()).sum();
    const double texel = (weight * of_pairs).sum();
    texel_min = std::min(texel_min, texel);
    texel_max = std::max(texel_max, texel);
  }
  void add(const Sums& other) {
    images += other.images;
    squares += other.squares;
    texel_min = std::min(texel_min, other.texel_min);
    texel_max = std::max(texel_max, other.texel_max);
  }
};

Eigen::ArrayXf encode(const Eigen::ArrayXf& linear) { return linear.pow(kEncodingExponent); }

double encode(double linear) {
  return std::pow(std::clamp(linear, 0.0, 1.0), static_cast<double>(kEncodingExponent));
}

// Where each of `some` stands in `all`; less than `some` where one is not there.
std::vector<int> numbers_in(const DirectionSet& all, const DirectionSet& some) {
  std::vector<int> numbers;
  for (const Direction& wanted : some) {
    const auto found = std::ranges::find_if(
        all, [&](const Direction& d) { return (d - wanted).norm() < kEqualDirections; });
    if (found != all.end()) numbers.push_back(static_cast<int>(found - all.begin()));
  }
  return numbers;
}

Result<ComparedPairs> match(const SampleSet& set,
                            const Material& material,
                            const PairWeights* weights) {
  const SampleSetInfo& info = set.info();
  const std::string doing = fmt::format("evaluating a material on {}", set.path().string());
  VENEER_TRY(refuse_texel_map(material, Errc::kBadFormat, doing));
  if (material.width() != info.width || material.height() != info.height)
    return fail(Errc::kBadFormat,
                "{}: the material has {} x {} texels, the set {} x {}; fit it on this set",
                doing,
                material.width(),
                material.height(),
                info.width,
                info.height);
  const std::vector<int> views = numbers_in(info.views, material.views());
  const std::vector<int> lights = numbers_in(info.lights, material.lights());
  if (views.size() != material.views().size() || lights.size() != material.lights().size())
    return fail(Errc::kBadFormat,
                "{}: the material was fitted at other directions; fit it on this set",
                doing);
  if (weights != nullptr) VENEER_TRY(weights->check(info));
  ComparedPairs pairs;
  std::vector<double> of_pairs;
  const auto stride = static_cast<int>(info.lights.size());
  for (std::size_t v = 0; v < views.size(); ++v)
    for (std::size_t l = 0; l < lights.size(); ++l) {
      const int pair = views[v] * stride + lights[l];
      const double weight =
          weights != nullptr ? double(weights->weight[static_cast<std::size_t>(pair)]) : 1.0;
      if (!(weight > 0.0)) continue;
      pairs.of_set.push_back(pair);
      pairs.of_material.push_back(static_cast<int>(v * lights.size() + l));
      of_pairs.push_back(weight);
    }
  if (weights != nullptr &&
      static_cast<std::ptrdiff_t>(of_pairs.size()) !=
          std::ranges::count_if(weights->weight, [](float w) { return w > 0.0F; }))
    return fail(Errc::kBadFormat,
                "{}: the material keeps {} views and {} lights of the set, and there are weights "
                "for others; fit it for the region that these weights are of",
                doing,
                views.size(),
                lights.size());
  pairs.weight = Eigen::Map<const Eigen::ArrayXd>(of_pairs.data(), std::ssize(of_pairs));
  pairs.alike = (pairs.weight == pairs.weight[0]).all();
  return pairs;
}

// Draws numbers with a probability that follows their weights.
class WeightedDraw {
 public:
  explicit WeightedDraw(const ComparedPairs& pairs) : count_(static_cast<int>(pairs.count())) {
    if (pairs.alike) return;
    double sum = 0.0;
    for (const double weight : pairs.weight) sums_.push_back(sum += weight);
  }
  // All in order, each counting the same, where that gives no more than are wanted.
  [[nodiscard]] bool all_in_order(std::int64_t wanted) const {
    return sums_.empty() && wanted >= count_;
  }
  [[nodiscard]] int count() const { return count_; }
  // @param uniform  in [0, 1)
  [[nodiscard]] int operator()(double uniform) const {
    if (sums_.empty()) return static_cast<int>(uniform * count_);
    const auto found = std::ranges::upper_bound(sums_, uniform * sums_.back());
    return std::min(static_cast<int>(found - sums_.begin()), count_ - 1);
  }

 private:
  int count_;
  std::vector<double> sums_;  // of the weights up to each; empty where they are alike
};

// Compared pairs to look at in one texel: all of them where there are few, else drawn at random
// from the texel's own sequence.
std::vector<int> choose_pairs(const WeightedDraw& draw, std::int64_t wanted, std::uint64_t texel) {
  if (draw.all_in_order(wanted)) {
    std::vector<int> pairs(static_cast<std::size_t>(draw.count()));
    std::iota(pairs.begin(), pairs.end(), 0);
    return pairs;
  }
  std::vector<int> pairs(static_cast<std::size_t>(std::min<std::int64_t>(wanted, draw.count())));
  Pcg32 random(texel);
  for (int& pair : pairs) pair = draw(random.uniform());
  return pairs;
}

Lab lab_of(const Eigen::Vector3d& srgb) {
  static const Xyz kWhite = xyz_from_srgb() * Eigen::Vector3d::Ones();
  return lab_from_xyz(xyz_from_srgb() * srgb, kWhite);
}

ImageError image_error(const Sums& sums, const ComparedPairs& pairs, const SampleSetInfo& info) {
  const double per_image = 3.0 * info.texel_count();
  const double weight = pairs.weight.sum();
  return {(pairs.weight * sums.images).sum() / (per_image * weight),
          sums.images.minCoeff() / per_image,
          sums.images.maxCoeff() / per_image,
          std::sqrt(sums.squares / (per_image * weight)),
          sums.texel_min / (3.0 * weight),
          sums.texel_max / (3.0 * weight)};
}

double drawn_epsilon(const SampleSet& set,
                     const Material& material,
                     const ComparedPairs& compared,
                     const WeightedDraw& draw,
                     Progress& progress) {
  const SampleSetInfo& info = set.info();
  const std::vector<int> chosen = spread_texels(info, kDrawnTexels);
  const std::int64_t texels = std::ssize(chosen);
  const std::int64_t per_texel = std::max<std::int64_t>(kDrawnSamples / texels, 1);
  std::vector<double> means(static_cast<std::size_t>(texels));
  progress.start("comparing as drawn", texels);
  parallel_for(texels, 1, [&](std::int64_t begin, std::int64_t end) {
    std::vector<float> rgb(static_cast<std::size_t>(info.pair_count()) * 3);
    for (std::int64_t i = begin; i < end; ++i) {
      const int texel = chosen[static_cast<std::size_t>(i)];
      set.rgb(texel, Part::kTotal, rgb);
      const std::vector<int> pairs = choose_pairs(draw, per_texel, static_cast<std::uint64_t>(i));
      double sum = 0.0;
      for (const int pair : pairs) {
        const auto index =
            static_cast<std::size_t>(compared.of_set[static_cast<std::size_t>(pair)]);
        const Eigen::Vector3d drawn = material.radiance(
            texel, info.views[index / info.lights.size()], info.lights[index % info.lights.size()]);
        for (std::size_t c = 0; c < 3; ++c)
          sum += std::abs(encode(drawn[static_cast<Eigen::Index>(c)]) -
                          encode(static_cast<double>(rgb[index * 3 + c])));
      }
      means[static_cast<std::size_t>(i)] = sum / (3.0 * static_cast<double>(pairs.size()));
      progress.advance();
    }
  });
  return mean(means);
}

}  // namespace

Result<Evaluation> evaluate(const SampleSet& set,
                            const Material& material,
                            Progress& progress,
                            const PairWeights* weights) {
  VENEER_ASSIGN(const ComparedPairs compared, match(set, material, weights));
  VENEER_TRY(set.check_finite());
  const SampleSetInfo& info = set.info();
  const WeightedDraw draw(compared);
  const Eigen::Index pairs = compared.count();
  const std::int64_t texels = info.texel_count();
  const std::int64_t group_count = std::min(kGroups, texels);
  const std::int64_t colours_per_texel =
      std::min<std::int64_t>((kColourSamples + texels - 1) / texels, pairs);
  std::vector<Sums> linear(static_cast<std::size_t>(group_count));
  std::vector<Sums> encoded(static_cast<std::size_t>(group_count));
  std::vector<double> differences(static_cast<std::size_t>(texels * colours_per_texel));
  std::vector<int> non_finite(static_cast<std::size_t>(group_count), 0);

  progress.start("comparing", texels);
  parallel_for(group_count, 1, [&](std::int64_t first_group, std::int64_t last_group) {
    Eigen::ArrayXf measured(pairs * 3);
    Eigen::ArrayXf modelled(pairs * 3);
    Eigen::ArrayXf whole(std::ssize(material.views()) * std::ssize(material.lights()) * 3);
    for (std::int64_t g = first_group; g < last_group; ++g) {
      Sums linear_sums(pairs);
      Sums encoded_sums(pairs);
      for (std::int64_t t = g * texels / group_count; t < (g + 1) * texels / group_count; ++t) {
        const auto texel = static_cast<int>(t);
        set.rgb(texel,
                Part::kTotal,
                compared.of_set,
                {measured.data(), static_cast<std::size_t>(measured.size())});
        material.reconstruct(texel, {whole.data(), static_cast<std::size_t>(whole.size())});
        for (Eigen::Index i = 0; i < pairs; ++i)
          modelled.segment<3>(3 * i) =
              whole.segment<3>(Eigen::Index{3} * compared.of_material[static_cast<std::size_t>(i)]);
        if (!modelled.allFinite()) ++non_finite[static_cast<std::size_t>(g)];
        measured = measured.max(0.0F).min(1.0F);
        modelled = modelled.max(0.0F).min(1.0F);
        linear_sums.add(measured - modelled, compared.weight);
        encoded_sums.add(encode(measured) - encode(modelled), compared.weight);
        auto out = differences.begin() + t * colours_per_texel;
        for (const int pair :
             choose_pairs(draw, colours_per_texel, static_cast<std::uint64_t>(t))) {
          const Eigen::Vector3f a = measured.segment<3>(Eigen::Index{3} * pair);
          const Eigen::Vector3f b = modelled.segment<3>(Eigen::Index{3} * pair);
          *out++ = delta_e_2000(lab_of(a.cast<double>()), lab_of(b.cast<double>()));
        }
        progress.advance();
      }
      linear[static_cast<std::size_t>(g)] = std::move(linear_sums);
      encoded[static_cast<std::size_t>(g)] = std::move(encoded_sums);
    }
  });
  if (const int count = std::accumulate(non_finite.begin(), non_finite.end(), 0); count > 0) {
    progress.finish();
    return fail(
        Errc::kBadFormat,
        "evaluating a material on {}: it gives NaN or infinite values at {} texels; fit it again",
        set.path().string(),
        count);
  }

  for (std::size_t g = 1; g < linear.size(); ++g) {
    linear.front().add(linear[g]);
    encoded.front().add(encoded[g]);
  }
  Evaluation result;
  result.linear = image_error(linear.front(), compared, info);
  result.encoded = image_error(encoded.front(), compared, info);
  result.psnr_db = result.encoded.rmse > 0.0 ? -20.0 * std::log10(result.encoded.rmse)
                                             : std::numeric_limits<double>::infinity();
  result.de00_mean = mean(differences);
  result.de00_p95 = quantile(std::move(differences), 0.95);
  result.drawn_epsilon_avg = drawn_epsilon(set, material, compared, draw, progress);
  const ModelShader shader = material.shader();
  result.bytes_per_texel = static_cast<double>(shader.gpu_bytes()) / static_cast<double>(texels);
  result.fetches = shader.fetches;
  progress.finish(fmt::format("epsilon {:.4f}", result.encoded.epsilon_avg));
  return result;
}

}  // namespace veneer::btf
