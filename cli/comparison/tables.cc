// SPDX-License-Identifier: Apache-2.0
#include "cli/comparison/tables.h"

#include <Eigen/Core>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "base/parallel.h"
#include "base/statistics.h"

namespace veneer::cli {
namespace {

constexpr double kSameValues = 1e-9;  // relative; both sides are a few sums and products

SetSize size_of(const Comparison& comparison) {
  return {comparison.width * comparison.height, comparison.views, comparison.lights};
}

}  // namespace

TexelErrors mean_brdf_errors(const btf::SampleSet& set) {
  const btf::SampleSetInfo& info = set.info();
  const auto count = static_cast<std::size_t>(info.pair_count()) * 3;
  const auto samples = [&set](int texel, std::vector<float>& rgb) {
    set.rgb(texel, btf::Part::kTotal, rgb);
    return Eigen::Map<const Eigen::ArrayXf>(rgb.data(), static_cast<Eigen::Index>(rgb.size()))
        .max(0.0F)
        .min(1.0F);
  };
  std::vector<float> rgb(count);
  Eigen::ArrayXd sum = Eigen::ArrayXd::Zero(static_cast<Eigen::Index>(count));
  for (int texel = 0; texel < info.texel_count(); ++texel)
    sum += samples(texel, rgb).cast<double>();
  constexpr float kEncoding = 1.0F / 2.2F;
  const Eigen::ArrayXf mean_brdf = (sum / info.texel_count()).cast<float>().pow(kEncoding);

  std::vector<double> epsilons(static_cast<std::size_t>(info.texel_count()));
  parallel_for(info.texel_count(), 16, [&](std::int64_t begin, std::int64_t end) {
    std::vector<float> of_texel(count);
    for (std::int64_t texel = begin; texel < end; ++texel) {
      const auto measured = samples(static_cast<int>(texel), of_texel);
      epsilons[static_cast<std::size_t>(texel)] =
          static_cast<double>((measured.pow(kEncoding) - mean_brdf).abs().mean());
    }
  });
  const auto [least, most] = std::ranges::minmax(epsilons);
  return {mean(epsilons), least, most};
}

std::vector<OrderClaim> published_order(const Comparison& comparison) {
  const auto find = [&comparison](const PublishedModel& published) -> const ComparedModel* {
    const auto found = std::ranges::find(comparison.models, &published, &ComparedModel::published);
    return found == comparison.models.end() || !found->errors ? nullptr : &*found;
  };
  std::vector<OrderClaim> claims;
  const auto published = published_models();
  for (std::size_t i = 0; i < published.size(); ++i) {
    for (std::size_t j = i + 1; j < published.size(); ++j) {
      // Lobe models next to each other in the paper's order, and each of them with each of the
      // decompositions, between which the paper's own order depends on the material.
      if (!published[i].lobes || (published[j].lobes && j != i + 1)) continue;
      const ComparedModel* worse = find(published[i]);
      const ComparedModel* better = find(published[j]);
      if (worse != nullptr && better != nullptr)
        claims.push_back({worse, better, worse->errors->avg > better->errors->avg});
    }
  }
  return claims;
}

std::vector<std::string> wrong_values(const Comparison& comparison) {
  std::vector<std::string> wrong;
  for (const ComparedModel& model : comparison.models) {
    if (model.published == nullptr) continue;
    const double expected = model.published->values_of(size_of(comparison));
    if (!(std::abs(model.values_per_texel - expected) <= kSameValues * expected))
      wrong.push_back(model.name);
  }
  return wrong;
}

}  // namespace veneer::cli
