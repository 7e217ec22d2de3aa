// SPDX-License-Identifier: Apache-2.0
#include "cli/comparison/tables.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "base/testing/temporary_folder.h"

namespace veneer::cli {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

/// The paper's models with the paper's own errors of a material, and values by the formula.
Comparison as_published(const PublishedMaterial& material) {
  Comparison comparison;
  comparison.set = "fake";
  comparison.width = 64;
  comparison.height = 32;
  comparison.views = 81;
  comparison.lights = 81;
  comparison.material = &material;
  const SetSize size{64 * 32, 81, 81};
  for (std::size_t i = 0; i < 5; ++i) {
    const PublishedModel& published = published_models()[i];
    ComparedModel model;
    model.name = published.model;
    model.published = &published;
    const PublishedErrors& errors = material.errors[i];
    model.errors = TexelErrors{errors.avg, errors.min, errors.max};
    model.values_per_texel = published.values_of(size);
    model.bytes_per_texel = 2.0 * model.values_per_texel;
    model.fetches = published.fetches + 1;
    comparison.models.push_back(model);
  }
  return comparison;
}

/// Every model's error beyond is `factor` times that within, which grows with its number.
void hold_out(Comparison& comparison, double most_theta_deg, double factor) {
  comparison.most_theta_deg = most_theta_deg;
  double epsilon = 0.0;
  for (ComparedModel& model : comparison.models) {
    epsilon += 0.01;
    model.held_out = HeldOutFit{
        1.25, {{57, epsilon / 2, epsilon}, {24, factor * epsilon / 2, factor * epsilon}, 1024}};
  }
}

const PublishedMaterial& wallpaper() { return *find_published_material("wallpaper"); }

TEST(Published, FormulasGiveTable2AtThePapersSize) {
  for (const PublishedModel& model : published_models())
    EXPECT_NEAR(model.values_of(kPublishedSize), model.values, 0.05) << model.label;  // as printed
}

TEST(Published, ASetOfFewTexelsHasNoMoreClustersThanTexels) {
  const PublishedModel& lpca = published_models()[4];
  EXPECT_DOUBLE_EQ(lpca.values_of({1, 3, 5}), 1 + 8 + 3 * 15 * 8.0);
}

TEST(Published, AveragesLieBetweenTheirExtremes) {
  for (const PublishedMaterial& material : published_materials()) {
    for (const PublishedErrors& errors : material.errors) {
      EXPECT_LT(errors.min, errors.avg) << material.name;
      EXPECT_LT(errors.avg, errors.max) << material.name;
    }
  }
}

TEST(Published, MaterialsAreGuessedFromNamesThatTell) {
  const auto name = [](std::string_view set) {
    const PublishedMaterial* material = guess_published_material(set);
    return material == nullptr ? std::string_view("none") : material->name;
  };
  EXPECT_EQ(name("wallpaper64"), "wallpaper");
  EXPECT_EQ(name("Bonn-STONE"), "stone");
  EXPECT_EQ(name("alu"), "aluminium");
  EXPECT_EQ(name("aluminium"), "aluminium");
  for (const char* other : {"", "walnut", "value", "cloth"})
    EXPECT_EQ(name(other), "none") << other;
  EXPECT_EQ(find_published_model("lpca", "4"), nullptr) << "the paper has 8 components only";
}

TEST(PublishedOrder, HoldsOnEveryMaterialOfThePaper) {
  for (const PublishedMaterial& material : published_materials()) {
    const Comparison comparison = as_published(material);
    const std::vector<OrderClaim> claims = published_order(comparison);
    EXPECT_EQ(claims.size(), 8U);  // two between lobe models, three times two with the others
    for (const OrderClaim& claim : claims)
      EXPECT_TRUE(claim.holds) << material.name << ": " << claim.worse->name;
    EXPECT_THAT(to_markdown(comparison), HasSubstr("holds here (8 of 8"));
  }
}

TEST(PublishedOrder, SaysWhichModelsBreakIt) {
  Comparison comparison = as_published(wallpaper());
  comparison.models[1].errors->avg = comparison.models[0].errors->avg;  // SLAF no better than LAF
  const std::vector<OrderClaim> claims = published_order(comparison);
  const auto broken = std::ranges::count_if(claims, [](const OrderClaim& c) { return !c.holds; });
  EXPECT_EQ(broken, 1);
  EXPECT_THAT(to_markdown(comparison), HasSubstr("| LAF | SLAF | 0.0630 to 0.0630 | **no** |"));
  EXPECT_THAT(to_markdown(comparison), HasSubstr("does **not** hold throughout here (7 of 8"));
}

TEST(PublishedOrder, IsOfTheModelsThatAreThere) {
  Comparison comparison = as_published(wallpaper());
  comparison.models.erase(comparison.models.begin() + 1, comparison.models.begin() + 4);
  EXPECT_EQ(published_order(comparison).size(), 1U);  // LAF and LPCA
  comparison.models.pop_back();
  EXPECT_THAT(published_order(comparison), IsEmpty());
  EXPECT_THAT(to_markdown(comparison), Not(HasSubstr("published order")));
}

TEST(WrongValues, NamesModelsWithMoreOrFewerValues) {
  Comparison comparison = as_published(wallpaper());
  EXPECT_THAT(wrong_values(comparison), IsEmpty());
  comparison.models[2].values_per_texel -= 1.0;
  comparison.models[4].values_per_texel = std::nan("");
  EXPECT_THAT(wrong_values(comparison), ElementsAre("reflectance-field", "lpca"));
  EXPECT_THAT(to_markdown(comparison), HasSubstr("formula says: reflectance-field, lpca.**"));
}

TEST(Markdown, EveryRowOfATableHasAsManyCells) {
  Comparison comparison = as_published(wallpaper());
  comparison.models.push_back({.name = "phong", .errors = TexelErrors{.1, .05, .2}});
  comparison.mean_brdf = TexelErrors{.3, .2, .4};
  hold_out(comparison, 60.0, 3.0);
  for (const PublishedMaterial* material :
       {&wallpaper(), static_cast<const PublishedMaterial*>(nullptr)}) {
    comparison.material = material;
    const std::string text = to_markdown(comparison);
    std::ptrdiff_t cells = 0;
    int rows = 0;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      if (!line.starts_with('|')) {
        cells = 0;
        continue;
      }
      const auto bars = std::ranges::count(line, '|');
      if (cells != 0) {
        EXPECT_EQ(bars, cells) << line;
      }
      cells = bars;
      ++rows;
    }
    // Five tables with a header of two lines: 7 + 8 claims + 6 + 6 + 6.
    EXPECT_EQ(rows, 5 * 2 + 7 + 8 + 6 + 6 + 6);
    EXPECT_EQ(text.find("avg, paper") != std::string::npos, material != nullptr);
  }
}

TEST(Markdown, SaysWhatIsMissingAndWhatWasNotAskedFor) {
  Comparison comparison = as_published(wallpaper());
  comparison.no_timing = "there is no GL";
  comparison.no_cost = "spirv-opt is not there";
  EXPECT_THAT(to_markdown(comparison), HasSubstr("Not timed: there is no GL."));
  EXPECT_THAT(to_markdown(comparison), HasSubstr("Not counted: spirv-opt is not there."));
  EXPECT_EQ(to_json(comparison).at("no_timing"), "there is no GL");
  comparison.table1 = comparison.table3 = false;
  EXPECT_THAT(to_markdown(comparison), Not(HasSubstr("Table 1")));
  EXPECT_THAT(to_markdown(comparison), HasSubstr("Table 2"));
  EXPECT_THAT(to_markdown(comparison), Not(HasSubstr("Not timed")));
}

TEST(Json, HoldsOursBesideThePapers) {
  Comparison comparison = as_published(wallpaper());
  comparison.models[3].cost = ShaderCost{100, 91, true};
  const nlohmann::ordered_json json = to_json(comparison);
  EXPECT_EQ(json.at("published_material"), "wallpaper");
  EXPECT_EQ(json.at("order").size(), 8U);
  const auto& pca = json.at("models").at(3);
  EXPECT_EQ(pca.at("epsilon"), pca.at("published").at("epsilon"));
  EXPECT_EQ(pca.at("published").at("fetches"), 91);
  EXPECT_EQ(pca.at("values_per_texel"), 3888);
  EXPECT_EQ(pca.at("alu_is_complete"), false);
  EXPECT_FALSE(json.at("models").at(4).contains("alu"));
}

TEST(HeldOutViews, HaveATableOnlyWhereTheyWereAskedFor) {
  Comparison comparison = as_published(wallpaper());
  EXPECT_THAT(to_markdown(comparison), Not(HasSubstr("Table 4")));
  EXPECT_FALSE(to_json(comparison).contains("held_out_beyond_deg"));
  EXPECT_FALSE(to_json(comparison).at("models").at(0).contains("held_out"));
  hold_out(comparison, 60.0, 3.0);
  comparison.table1 = comparison.table2 = comparison.table3 = false;
  const std::string text = to_markdown(comparison);
  EXPECT_THAT(text, HasSubstr("### Table 4: views beyond 60 degrees, which no fit saw"));
  EXPECT_THAT(text, HasSubstr("on the 57 views up to 60 degrees"));
  EXPECT_THAT(text, HasSubstr("of the 24 views that the fit did not see"));
  EXPECT_THAT(text, HasSubstr("over 1024 texels"));
  EXPECT_THAT(text, Not(HasSubstr("Table 1:")));
}

TEST(HeldOutViews, StandBesideTheFittedOnesForEveryModel) {
  Comparison comparison = as_published(wallpaper());
  hold_out(comparison, 52.5, 3.0);
  const std::string text = to_markdown(comparison);
  EXPECT_THAT(text, HasSubstr("views beyond 52.5 degrees"));
  EXPECT_THAT(text, HasSubstr("| lafortune | LAF | 0.0300 | 0.0100 | 0.0150 | 0.0050 | 1.2 |"));
  EXPECT_THAT(text, HasSubstr("| lpca | LPCA | 0.1500 | 0.0500 | 0.0750 | 0.0250 | 1.2 |"));
  const nlohmann::ordered_json json = to_json(comparison);
  EXPECT_EQ(json.at("held_out_beyond_deg"), 52.5);
  for (const auto& model : json.at("models")) {
    const auto& held_out = model.at("held_out");
    EXPECT_EQ(held_out.at("texels"), 1024);
    EXPECT_EQ(held_out.at("within").at("views"), 57);
    EXPECT_EQ(held_out.at("beyond").at("views"), 24);
    for (const char* figure : {"epsilon", "rmse_linear"})
      EXPECT_DOUBLE_EQ(held_out.at("beyond").at(figure).get<double>(),
                       3.0 * held_out.at("within").at(figure).get<double>())
          << model.at("name");
  }
}

btf::SampleSet write_set(const std::filesystem::path& path, float (*value)(int texel)) {
  btf::SampleSetInfo info;
  info.width = 4;
  info.height = 2;
  info.views = {btf::Direction::UnitZ()};
  info.lights = {btf::Direction::UnitZ(), btf::direction_from_angles({0.5, 1.0})};
  auto writer = btf::SampleSetWriter::create(path, info).value();
  for (int t = 0; t < 8; ++t) std::ranges::fill(writer.texel(t), Eigen::half(value(t)));
  EXPECT_TRUE(writer.finish());
  return btf::SampleSet::open(path).value();
}

TEST(MeanBrdf, IsAllThereIsWhereTexelsAreAlike) {
  const TemporaryFolder folder;
  constexpr double kFloat = 1e-6;
  const auto flat =
      mean_brdf_errors(write_set(folder.path() / "flat.btfset", [](int) { return 0.5F; }));
  EXPECT_NEAR(flat.max, 0.0, kFloat);
  // One texel of eight is white (beyond the cut), the others black: their mean is 1/8.
  const auto one = mean_brdf_errors(
      write_set(folder.path() / "one.btfset", [](int t) { return t == 3 ? 4.0F : 0.0F; }));
  const double mean = std::pow(1.0 / 8.0, 1.0 / 2.2);
  EXPECT_NEAR(one.min, mean, kFloat);
  EXPECT_NEAR(one.max, 1.0 - mean, kFloat);
  EXPECT_NEAR(one.avg, (7 * mean + 1.0 - mean) / 8.0, kFloat);
}

}  // namespace
}  // namespace veneer::cli
