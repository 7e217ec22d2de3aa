// SPDX-License-Identifier: Apache-2.0
#include "simulation/recovery/layer_agreement.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "btf/direction.h"
#include "simulation/materials/body_materials.h"

namespace veneer::simulation {
namespace {

constexpr int kSize = 16;
constexpr int kTexels = kSize * kSize;

const BodyMaterial& bars() { return *find_body_material("bars"); }

LayerTruth truth_of_bars() { return layer_truth(bars().make(kSize, 1), kSize, bars().heights); }

// What the truth would be as a stack, its normals turned about x by so much.
btf::LayerStack stack_of(const LayerTruth& truth, double turn_deg) {
  std::vector<float> heights;
  for (const double height : bars().heights) heights.push_back(static_cast<float>(height * kSize));
  const double turn = turn_deg * std::numbers::pi / 180.0;
  btf::LayerStack stack(kSize, kSize, heights);
  for (int layer = 0; layer < stack.layer_count(); ++layer)
    for (int texel = 0; texel < kTexels; ++texel) {
      const auto at = static_cast<std::size_t>(layer * kTexels + texel);
      if (truth.occupancy[at] < 0.5F) continue;
      const Eigen::Vector3f n = truth.normals[at];
      const auto c = static_cast<float>(std::cos(turn));
      const auto s = static_cast<float>(std::sin(turn));
      stack.set_point(
          layer,
          texel,
          {.transmittance = 0.0F, .normal = {n.x(), c * n.y() - s * n.z(), s * n.y() + c * n.z()}});
    }
  return stack;
}

TEST(LayerAgreement, OfTheTruthItselfIsWhole) {
  const LayerTruth truth = truth_of_bars();
  const LayerAgreement same = layer_agreement(stack_of(truth, 0.0), truth, btf::bonn_directions());
  EXPECT_EQ(same.occupancy, 1.0);
  EXPECT_LT(same.occupancy_of_none, 0.8);
  EXPECT_LT(same.normal_median_deg, 0.05);  // float16
  EXPECT_GT(same.compared, kTexels / 4);
  EXPECT_LE(same.judged, 2 * kTexels);
}

TEST(LayerAgreement, TellsHowFarNormalsAreOff) {
  const LayerTruth truth = truth_of_bars();
  const LayerAgreement off = layer_agreement(stack_of(truth, 17.0), truth, btf::bonn_directions());
  EXPECT_EQ(off.occupancy, 1.0);
  EXPECT_NEAR(off.normal_median_deg, 17.0, 0.1);
}

TEST(LayerAgreement, OfAClearStackIsTheShareThatIsClear) {
  const LayerTruth truth = truth_of_bars();
  const btf::LayerStack clear(kSize, kSize, {1.6F, 0.8F, 0.0F});
  const LayerAgreement none = layer_agreement(clear, truth, btf::bonn_directions());
  // Bars cover 0.36 of each layer, and each other, so that the share of clear points is more.
  EXPECT_NEAR(none.occupancy, 0.65, 0.06);
  EXPECT_EQ(none.occupancy, none.occupancy_of_none);
  EXPECT_EQ(none.compared, 0);
}

TEST(LayerAgreement, DoesNotJudgeWhatNoViewSees) {
  LayerTruth truth;
  truth.occupancy.assign(3 * kTexels, 1.0F);  // all opaque: the top is all that is seen
  truth.normals.assign(3 * kTexels, Eigen::Vector3f::UnitZ());
  const btf::LayerStack clear(kSize, kSize, {1.6F, 0.8F, 0.0F});
  const LayerAgreement covered = layer_agreement(clear, truth, btf::bonn_directions());
  EXPECT_EQ(covered.judged, kTexels);
  EXPECT_EQ(covered.occupancy, 0.0);
  EXPECT_EQ(covered.occupancy_of_none, 1.0);
}

}  // namespace
}  // namespace veneer::simulation
