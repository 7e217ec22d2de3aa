// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/selection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "calibration/colour/internal_testing.h"

namespace veneer::calibration {
namespace {

using ::testing::HasSubstr;

constexpr double kNoise = 0.003;

struct Case {
  ExampleReadings fitted;
  std::vector<PatchReading> held_out;
  Additivity additivity;
};

Case example(const LadderDefects& defects, double noise = kNoise) {
  Case result;
  result.fitted = example_readings(defects, noise);
  const LadderProjector projector(defects);
  result.held_out =
      projector.read(verification_patches(8, kVerificationPatches, example_patches()), 8, noise, 2);
  result.additivity =
      *test_additivity(projector.read(additivity_patches({}), 8, noise, 3), result.fitted.black);
  return result;
}

Result<SelectedColour> select(const Case& c) {
  return select_colour_model(c.fitted.patches, c.held_out, c.fitted.black, c.additivity);
}

TEST(Selection, TakesNoChannelIndependentModelWhereChannelsDoNotAddUp) {
  const auto selected = select(example({0, 0.25, 0}));
  ASSERT_TRUE(selected.has_value()) << selected.error().what;
  EXPECT_FALSE(selected->model->is_additive());
  ASSERT_EQ(selected->candidates.size(), colour_model_families().size());
  for (std::size_t i = 0; i < selected->candidates.size(); ++i) {
    const ColourCandidate& candidate = selected->candidates[i];
    EXPECT_EQ(candidate.name, colour_model_families()[i].name);
    EXPECT_EQ(candidate.fitted, colour_model_families()[i].models_interaction);
    EXPECT_EQ(candidate.fitted, candidate.refusal.empty());
    if (!candidate.fitted) {
      EXPECT_THAT(candidate.refusal, HasSubstr("do not add up"));
    }
  }
  EXPECT_THAT(selected->reason, HasSubstr(std::string(selected->model->name())));
}

TEST(Selection, IsWithinTheMarginOfTheBestAndTheSimplestOfThose) {
  for (const LadderDefects& defects :
       {LadderDefects{}, LadderDefects{0.06, 0, 0}, LadderDefects{0.06, 0, 0.05}}) {
    const auto selected = select(example(defects));
    ASSERT_TRUE(selected.has_value());
    double least = HUGE_VAL;
    const ColourCandidate* chosen = nullptr;
    for (const ColourCandidate& candidate : selected->candidates) {
      if (!candidate.fitted) continue;
      least = std::min(least, candidate.held_out.mean);
      if (candidate.name == selected->model->name()) chosen = &candidate;
    }
    ASSERT_NE(chosen, nullptr);
    EXPECT_LE(chosen->held_out.mean, least + kWorthMoreParameters);
    for (const ColourCandidate& candidate : selected->candidates) {
      if (candidate.fitted && candidate.held_out.mean <= least + kWorthMoreParameters) {
        EXPECT_GE(candidate.parameters, chosen->parameters) << candidate.name;
      }
    }
  }
}

TEST(Selection, LeavesOutWhatTheFitSaw) {
  Case c = example({});
  const auto before = select(c);
  // A lie at a drive of the fit would ruin the error, if it counted.
  PatchReading lie = c.fitted.patches[7];
  lie.xyz *= 3.0;
  c.held_out.push_back(lie);
  const auto after = select(c);
  ASSERT_TRUE(before.has_value() && after.has_value());
  for (std::size_t i = 0; i < before->candidates.size(); ++i) {
    EXPECT_EQ(before->candidates[i].held_out.patches, after->candidates[i].held_out.patches);
    EXPECT_EQ(before->candidates[i].held_out.max, after->candidates[i].held_out.max);
  }
  c.held_out = c.fitted.patches;
  EXPECT_FALSE(select(c).has_value());
  c.held_out.clear();
  EXPECT_FALSE(select(c).has_value());
}

TEST(Selection, FitsEverythingWhereTheVerdictIsOpen) {
  Case c = example({});
  c.additivity.additive = false;
  c.additivity.decisive = false;
  const auto selected = select(c);
  ASSERT_TRUE(selected.has_value());
  for (const ColourCandidate& candidate : selected->candidates)
    EXPECT_TRUE(candidate.fitted) << candidate.name << ": " << candidate.refusal;
}

TEST(Selection, FailsWithTheReasonWhereNothingCanBeFitted) {
  Case c = example({});
  c.fitted.patches.resize(4);
  const auto selected = select(c);
  ASSERT_FALSE(selected.has_value());
  EXPECT_EQ(selected.error().code, Errc::kBadFormat);
  EXPECT_THAT(selected.error().what, HasSubstr("ramp"));
  Case broken = example({});
  broken.held_out[0].xyz.z() = std::nan("");
  EXPECT_FALSE(select(broken).has_value());
}

TEST(ColourError, IsZeroForTheModelItself) {
  const Case c = example({}, 0.0);
  const auto selected = select(c);
  ASSERT_TRUE(selected.has_value());
  std::vector<PatchReading> own;
  for (const PatchReading& patch : c.held_out)
    own.push_back({patch.drive, selected->model->forward(patch.drive) + c.fitted.black});
  const Xyz white = LadderProjector({}).white();
  const ColourError error = colour_error(*selected->model, own, c.fitted.black, white);
  EXPECT_EQ(error.patches, kVerificationPatches);
  EXPECT_LT(error.max, 1e-9);
  EXPECT_EQ(colour_error(*selected->model, {}, c.fitted.black, white).patches, 0);
}

}  // namespace
}  // namespace veneer::calibration
