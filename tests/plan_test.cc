// SPDX-License-Identifier: Apache-2.0
// `veneer plan` as a person runs it (docs/howto/plan.md).
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/testing/temporary_folder.h"
#include "tests/facing_projector.h"
#include "tests/program.h"

namespace veneer {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// A small projector that faces the plate of etc/plan/scene.toml.
class PlanTest : public ::testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(facing_projector(160, 120).save(profile_)); }

  [[nodiscard]] std::string synthesized(const std::string& material) const {
    const fs::path set = folder_.path() / (material + ".btfset");
    const Outcome made = run(fmt::format(
        "veneer synthesize {} --size 8 --samples 8 --quiet -o {}", material, set.string()));
    EXPECT_EQ(made.exit_code, 0) << made.err;
    return set.string();
  }

  /// What comes of planning for its specular and its diffuse part.
  [[nodiscard]] Outcome planned(const std::string& set, const std::string& more) const {
    return run(fmt::format(
        "veneer plan {} --scene {}/plan/scene.toml --profile {} --models dichromatic-lpca -o {} "
        "--quiet {}",
        set,
        VENEER_ETC,
        profile_.string(),
        (folder_.path() / "m.safetensors").string(),
        more));
  }

  TemporaryFolder folder_;
  fs::path profile_ = folder_.path() / "profile";
};

TEST_F(PlanTest, DropsTheSpecularTermOfPlasterAndKeepsThatOfCopper) {
  const Outcome matte = planned(synthesized("plaster"), "--no-general --json");
  ASSERT_EQ(matte.exit_code, 0) << matte.err;
  const json plaster = json::parse(matte.out);
  ASSERT_EQ(plaster["dropped"].size(), 1U);
  // In words: what was dropped, what it would have changed, what was saved.
  EXPECT_THAT(plaster["dropped"][0].get<std::string>(),
              testing::AllOf(testing::HasSubstr("specular term of dichromatic-lpca"),
                             testing::HasSubstr("would change nothing by more than"),
                             testing::HasSubstr("it saves 2 of 8 fetches")));
  const json& change = plaster["steps"][0]["difference"];
  EXPECT_TRUE(change["de00_max"] < 0.5 || change["codes_max"] < 1.0) << change;
  // It is not for want of anything to see: the term was there.
  EXPECT_GT(change["rmse"], 0.0) << change;
  EXPECT_THAT(plaster["chosen"]["components"].get<std::string>(), testing::EndsWith("+0"));

  const Outcome glossy = planned(synthesized("hammered"), "--no-general --json");
  ASSERT_EQ(glossy.exit_code, 0) << glossy.err;
  const json copper = json::parse(glossy.out);
  EXPECT_TRUE(copper["dropped"].empty());
  EXPECT_THAT(copper["steps"][0]["verdict"].get<std::string>(), testing::StartsWith("kept"));
}

TEST_F(PlanTest, MeasuresOnTheScreenWhereItIsAskedTo) {
  const std::string set = synthesized("plaster");
  const fs::path page = folder_.path() / "plan.html";
  const Outcome done =
      planned(set, fmt::format("--no-general --on-screen --report {}", page.string()));
  if (done.err.find("EGL") != std::string::npos && done.exit_code == 1)
    GTEST_SKIP() << "no GL here: " << done.err;
  ASSERT_EQ(done.exit_code, 0) << done.err;
  for (const char* part : {"on the screen, a pixel's texel: asked for mean", "; received mean"})
    EXPECT_THAT(done.out, testing::HasSubstr(part));
  const auto html = read_text(page);
  ASSERT_TRUE(html) << html.error().what;
  EXPECT_THAT(*html, testing::HasSubstr("\"on_screen\""));
}

}  // namespace
}  // namespace veneer
