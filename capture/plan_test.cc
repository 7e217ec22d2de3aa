// SPDX-License-Identifier: Apache-2.0
#include "capture/plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "capture/internal_plan_json.h"

namespace veneer::capture {
namespace {

using testing::HasSubstr;

constexpr double kDegree = std::numbers::pi / 180;

constexpr std::string_view kRig = R"(
[sample]
name = "corrugated"
columns = 32
rows = 16
left_mm = 20
top_mm = 21
width_mm = 64
height_mm = 32
lift_mm = 0.25
[board]
columns = 10
[polarisation]
axis = [0, 2, 0]
analyser_deg = [0, 45, 90, 135]
[exposure]
step = 3
multiple_of_s = 0.01
[lights]
from = "projector"
profile = "bench"
sample_position = [0, 0.5, 1.5]
sample_turn_deg = [0, 0, 90]
arc_deg = [-60, 60, 5]
[views]
theta_phi_deg = [[0, 0], [30, 90]]
[lens]
focal_px = [2200, 2201]
principal_point = [320, 240]
k1 = -0.1
[mirror]
light = 12
)";

Result<CapturePlan> read(const std::string& text) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::parse(text, "rig.toml"));
  CapturePlan plan = CapturePlan::read(toml);
  VENEER_TRY(toml.finish());
  return plan;
}

/// The rig with a part replaced.
std::string rig_with(std::string_view part, std::string_view other) {
  std::string text(kRig);
  const std::size_t at = text.find(part);
  VENEER_CHECK(at != std::string::npos);
  return text.replace(at, part.size(), other);
}

TEST(CapturePlan, ReadsARig) {
  const auto plan = read(std::string(kRig));
  ASSERT_TRUE(plan) << plan.error().what;
  EXPECT_EQ(plan->name, "corrugated");
  EXPECT_EQ(plan->area.lift_mm, 0.25);
  EXPECT_EQ(plan->board.columns, 10);
  EXPECT_EQ(plan->board.rows, MarkBoard{}.rows);
  EXPECT_EQ(plan->polarisation.axis, Eigen::Vector3d(0, 1, 0));
  ASSERT_EQ(plan->polarisation.analyser_rad.size(), 4U);
  EXPECT_DOUBLE_EQ(plan->polarisation.analyser_rad[1], std::numbers::pi / 4);
  ASSERT_EQ(plan->lights.size(), 25U);
  EXPECT_EQ(plan->light_source, LightSource::kProjector);
  EXPECT_EQ(plan->profile, "bench");
  // The sample's x is along the world's y, 0.5 m from the axis.
  EXPECT_LT(
      (plan->world_from_sample * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(0, 1.5, 1.5)).norm(),
      1e-12);
  ASSERT_EQ(plan->views.size(), 2U);
  EXPECT_LT((plan->views[1] - Eigen::Vector3d(0, 0.5, std::sqrt(0.75))).norm(), 1e-12);
  ASSERT_TRUE(plan->lens);
  EXPECT_EQ(plan->lens->focal_px.y(), 2201);
  EXPECT_EQ(plan->mirror_light, 12);
}

// An arc is even, ends where it is told to, and is the mirror image of itself about the normal.
TEST(CapturePlan, AnArcGoesFromItsFirstToItsLast) {
  const auto plan = read(std::string(kRig));
  ASSERT_TRUE(plan);
  const btf::DirectionSet& lights = plan->lights;
  EXPECT_NEAR(std::asin(lights.front().x()), -60 * kDegree, 1e-12);
  EXPECT_NEAR(std::asin(lights.back().x()), 60 * kDegree, 1e-12);
  for (std::size_t i = 0; i < lights.size(); ++i) {
    const Eigen::Vector3d mirrored =
        lights[lights.size() - 1 - i].cwiseProduct(Eigen::Vector3d(-1, 1, 1));
    EXPECT_LT((lights[i] - mirrored).norm(), 1e-12) << i;
    if (i == 0) continue;
    EXPECT_NEAR(std::acos(lights[i].dot(lights[i - 1])), 5 * kDegree, 1e-9) << i;
  }
}

TEST(CapturePlan, WithoutViewsLooksAlongTheNormal) {
  const auto plan = read(rig_with("theta_phi_deg = [[0, 0], [30, 90]]", ""));
  ASSERT_TRUE(plan) << plan.error().what;
  ASSERT_EQ(plan->views.size(), 1U);
  EXPECT_EQ(plan->views[0], Eigen::Vector3d(0, 0, 1));
}

TEST(CapturePlan, SaysWhichKeyIsWrong) {
  struct Case {
    const char* part;
    const char* other;
    const char* said;
  };
  const std::vector<Case> cases{
      {"left_mm = 20", "", "left_mm"},
      {"width_mm = 64", "width_mm = 0", "sample.width_mm is 0"},
      {"columns = 10", "columns = 2", "board.columns is 2"},
      {"columns = 10", "marker_mm = 10", "board.marker_mm is 10"},
      {"axis = [0, 2, 0]", "axis = [0, 0, 0]", "polarisation.axis"},
      {"[0, 45, 90, 135]", "[0]", "analyser_deg"},
      {"[0, 45, 90, 135]", "[0, 80]", "analyser_deg"},
      {"[0, 45, 90, 135]", "[0, 90, 180]", "same position"},
      {"step = 3", "step = 1", "exposure.step is 1"},
      {"step = 3", "most = 13", "exposure.most is 13"},
      {"step = 3", "frames = 0", "exposure.frames is 0"},
      {"from = \"projector\"", "from = \"lamp\"", "lamp"},
      {"profile = \"bench\"", "", "lights.profile"},
      {"arc_deg = [-60, 60, 5]", "arc_deg = [-60, 60, 7]", "arc_deg"},
      {"arc_deg = [-60, 60, 5]", "arc_deg = [-60, 60, 0]", "arc_deg"},
      {"arc_deg = [-60, 60, 5]", "arc_deg = [60, -60, 5]", "arc_deg"},
      {"arc_deg = [-60, 60, 5]", "arc_deg = [-90, 90, 5]", "horizon"},
      {"arc_deg = [-60, 60, 5]", "arc_deg = [0, 0, 1]\ntheta_phi_deg = [[1, 0]]", "keep one"},
      {"[[0, 0], [30, 90]]", "[[0, 0], [90, 90]]", "theta is 90"},
      {"[[0, 0], [30, 90]]", "[[0, 0], [0, 90]]", "same direction"},
      {"[[0, 0], [30, 90]]", "[[0, 0], [1, 2, 3]]", "theta_phi_deg"},
      {"focal_px = [2200, 2201]", "focal_px = [2200, 0]", "lens.focal_px is 0"},
      {"light = 12", "light = 25", "0 to 24"},
      {"light = 12", "light = -1", "mirror.light is -1"},
      {"k1 = -0.1", "k1 = -0.1\nk3 = 1", "k3"},
  };
  for (const Case& each : cases) {
    const auto plan = read(rig_with(each.part, each.other));
    ASSERT_FALSE(plan) << each.other;
    EXPECT_EQ(plan.error().code, Errc::kInvalidOption) << each.other;
    EXPECT_THAT(plan.error().what, HasSubstr(each.said)) << each.other;
  }
}

TEST(CapturePlan, LeavesTheProjectorsDirectionToTheSession) {
  const auto plan = read(rig_with("arc_deg = [-60, 60, 5]", "")
                             .erase(rig_with("arc_deg = [-60, 60, 5]", "").find("[mirror]")));
  ASSERT_TRUE(plan) << plan.error().what;
  EXPECT_TRUE(plan->lights.empty());
}

TEST(CapturePlan, RefusesWhatIsNoNumber) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const CapturePlan good = read(std::string(kRig)).value();
  ASSERT_TRUE(good.check());
  const std::vector<std::function<void(CapturePlan&, double)>> spoils{
      [](CapturePlan& plan, double value) { plan.area.left_mm = value; },
      [](CapturePlan& plan, double value) { plan.area.width_mm = value; },
      [](CapturePlan& plan, double value) { plan.area.lift_mm = value; },
      [](CapturePlan& plan, double value) { plan.board.marker_mm = value; },
      [](CapturePlan& plan, double value) { plan.polarisation.axis.y() = value; },
      [](CapturePlan& plan, double value) { plan.polarisation.analyser_rad[2] = value; },
      [](CapturePlan& plan, double value) { plan.exposure.step = value; },
      [](CapturePlan& plan, double value) { plan.exposure.multiple_of_s = value; },
      [](CapturePlan& plan, double value) { plan.lights[3].x() = value; },
      [](CapturePlan& plan, double value) { plan.views[0].z() = value; },
      [](CapturePlan& plan, double value) { plan.lens->k2 = value; },
      [](CapturePlan& plan, double value) { plan.world_from_sample.translation.x() = value; },
      [](CapturePlan& plan, double value) { plan.white_reflectance = value; },
  };
  for (std::size_t i = 0; i < spoils.size(); ++i) {
    for (const double value : {nan, infinity, -infinity}) {
      CapturePlan plan = good;
      spoils[i](plan, value);
      EXPECT_FALSE(plan.check()) << i << ": " << value;
    }
  }
}

TEST(CapturePlan, OutlivesJsonToTheLastBit) {
  for (const bool all : {true, false}) {
    CapturePlan plan = read(std::string(kRig)).value();
    plan.exposure.multiple_of_s = 1.0 / 3;
    if (!all) {
      plan.lens.reset();
      plan.mirror_light.reset();
    }
    const nlohmann::json json = json_of(plan);
    const auto again = plan_from(nlohmann::json::parse(json.dump()));
    ASSERT_TRUE(again) << again.error().what;
    EXPECT_EQ(json_of(*again), json);
    EXPECT_EQ(again->lights[7], plan.lights[7]);
    EXPECT_EQ(again->lens.has_value(), all);
    EXPECT_EQ(difference(json, json_of(*again)), "nothing");
  }
}

// Whatever is missing or of another type is refused, never guessed.
TEST(CapturePlan, RefusesJsonThatLacksAnything) {
  const nlohmann::json json = json_of(read(std::string(kRig)).value());
  for (const auto& [key, value] : json.items()) {
    for (const nlohmann::json& other :
         {nlohmann::json(), nlohmann::json("x"), nlohmann::json(-1e300)}) {
      if (other.is_string() && value.is_string()) continue;
      if ((key == "lens" || key == "mirror_light") && !other.is_number()) continue;
      if (key == "lens" || (key == "ball_radius_mm" && other.is_number())) continue;
      nlohmann::json changed = json;
      changed[key] = other;
      EXPECT_FALSE(plan_from(changed)) << key << " = " << other;
    }
    if (!value.is_object() || key == "lens") continue;
    for (const auto& [below, ignored] : value.items()) {
      nlohmann::json changed = json;
      changed[key].erase(below);
      EXPECT_FALSE(plan_from(changed)) << key << "." << below;
    }
  }
  EXPECT_FALSE(plan_from(nlohmann::json::array()));
}

TEST(CapturePlan, NamesWhatDiffers) {
  CapturePlan plan = read(std::string(kRig)).value();
  const nlohmann::json there = json_of(plan);
  plan.exposure.step = 2;
  EXPECT_EQ(difference(there, json_of(plan)), "its exposure.step is 3.0, not 2.0");
}

}  // namespace
}  // namespace veneer::capture
