// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/btfbase/btfbase.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <string>

#include "base/testing/temporary_folder.h"
#include "btf/importers/btfbase/code_books.h"
#include "btf/sample_set.h"

namespace veneer::btf {
namespace {

namespace fs = std::filesystem;

// Tables of 2 x 1 texels. The first texel's function grows linearly along beta's knots, the
// second's is constant; chroma is neutral except in the second function.
std::map<std::string, std::string> small_tables() {
  return {{"m_PDF6Dslices.txt", "1 2 1 2\n2 1\n"},
          {"m_PDF6Dscale.txt", "1 2 0 1\n1.0 0.5\n"},
          {"all_PDF4Dslices.txt", "2 4 0 1\n0 0 0 0\n1 1 1 1\n"},
          {"all_PDF4Dscale.txt", "2 4 1 1\n1 1 1 1\n1 1 1 1\n"},
          {"all_PDF3Dslices.txt", "2 3 0 1\n0 0 0\n1 1 1\n"},
          {"all_PDF3Dscale.txt", "2 3 1 2\n1 1 1\n1 1 1\n"},
          {"all_PDF2Dindices.txt", "2 2 0 1\n0 0\n1 1\n"},
          {"all_PDF2Dslices.txt", "2 5 0 1\n0 0 0 0 0\n1 1 1 1 1\n"},
          {"all_PDF2Dscale.txt", "2 5 100 100\n100 100 100 100 100\n100 100 100 100 100\n"},
          {"all_PDF1Dslice.txt", "2 6 0 2\n1 1 1 1 1 1\n0.5 0.75 1 1.25 1.5 1.75\n"},
          {"all_PDF2Dcolours.txt", "2 5 0 1\n0 0 0 0 0\n1 1 1 1 1\n"},
          {"all_indexAB.txt", "2 6 0 1\n0 0 0 0 0 0\n1 1 1 1 1 1\n"},
          {"all_colors.txt", "2 2 100 140\n128 128\n128 128\n"}};
}

class SmallBooks : public ::testing::Test {
 protected:
  SmallBooks() { write(small_tables()); }
  void write(const std::map<std::string, std::string>& tables) {
    fs::remove_all(in());
    fs::create_directories(in());
    for (const auto& [name, text] : tables) std::ofstream(in() / name) << text;
  }
  [[nodiscard]] fs::path in() const { return folder_.path() / "m"; }
  [[nodiscard]] fs::path out() const { return folder_.path() / "m.btfset"; }
  void expect_refused(const std::string& table, const std::string& text, const std::string& says) {
    auto tables = small_tables();
    tables[table] = text;
    write(tables);
    SilentProgress progress;
    const Status status = import_btfbase(in(), out(), {}, progress);
    ASSERT_FALSE(status) << says;
    EXPECT_EQ(status.error().code, Errc::kBadFormat);
    EXPECT_NE(status.error().what.find(says), std::string::npos) << status.error().what;
    EXPECT_FALSE(fs::exists(out()));
  }
  TemporaryFolder folder_;
};

// Full luminance scale 1 with neutral chroma, on the scale of 0 to 255.
double grey(double luminance) { return 1.1643828 * luminance - 18.63; }

TEST_F(SmallBooks, TexelsNameFunctionsFromOne) {
  const auto books = CodeBooks::read(in());
  ASSERT_TRUE(books) << books.error().what;
  EXPECT_EQ(books->width(), 2);
  EXPECT_EQ(books->height(), 1);
  EXPECT_EQ(books->function_of(0, 0), 1);
  EXPECT_EQ(books->function_of(1, 0), 0);
  EXPECT_EQ(books->scale_of(1, 0), 0.5);
}

// A line through the knots is reproduced exactly only if every tangent is taken between the right
// neighbours, those of the last intervals too.
TEST_F(SmallBooks, SplineReproducesALine) {
  const auto books = CodeBooks::read(in());
  ASSERT_TRUE(books);
  for (int low = 0; low < 5; ++low) {
    for (const double weight : {0.0, 0.2, 0.5, 0.9, 1.0}) {
      const CodeBooks::Place place{{0, 0.0}, {0, 0.0}, {0, 0.3}, {low, weight}};
      // float tables, and chroma constants of seven digits
      EXPECT_NEAR(books->colour(1, place)[0], grey(100.0 * (0.5 + 0.25 * (low + weight))), 1e-3)
          << low << " " << weight;
    }
  }
}

TEST_F(SmallBooks, WeightsOfEveryLevelSumToOne) {
  const auto books = CodeBooks::read(in());
  ASSERT_TRUE(books);
  for (const Direction& view : bonn_directions())
    for (const Direction& light : bonn_directions()) {
      const Eigen::Vector3d rgb = books->colour(0, books->place_of(view, light));
      EXPECT_LT((rgb.array() - grey(100.0)).abs().maxCoeff(), 1e-2);
    }
}

TEST_F(SmallBooks, PlacesFollowTheGeometry) {
  const auto books = CodeBooks::read(in());
  ASSERT_TRUE(books);
  constexpr double kPi = std::numbers::pi;
  // Lit along the normal: the middle of alpha and beta whatever the view.
  const auto middle = books->place_of(direction_from_angles({0.5, 2.0}), Direction::UnitZ());
  EXPECT_EQ(middle.beta.low, 2);
  EXPECT_NEAR(middle.beta.weight, 0.5, 1e-12);
  EXPECT_NEAR(middle.alpha.low + middle.alpha.weight, 2.0, 1e-12);
  // Turning view and light together changes the view's azimuth alone.
  const auto a =
      books->place_of(direction_from_angles({0.5, 0.3}), direction_from_angles({0.8, 1.1}));
  const auto b =
      books->place_of(direction_from_angles({0.5, 2.3}), direction_from_angles({0.8, 3.1}));
  EXPECT_NEAR(a.alpha.low + a.alpha.weight, b.alpha.low + b.alpha.weight, 1e-12);
  EXPECT_NEAR(a.beta.low + a.beta.weight, b.beta.low + b.beta.weight, 1e-12);
  EXPECT_NE(a.phi.low + a.phi.weight, b.phi.low + b.phi.weight);
  // Azimuth 0, which is a full turn clockwise, falls on the first knot; grazing stays on the table.
  EXPECT_EQ(books->place_of(direction_from_angles({0.5, 0.0}), Direction::UnitZ()).phi.low, 0);
  for (double phi = 0.0; phi < 2.0 * kPi; phi += 0.01) {
    const auto place = books->place_of(direction_from_angles({kPi / 2, phi}),
                                       direction_from_angles({kPi / 2, 2.0 * phi}));
    for (const auto& [knot, most] :
         {std::pair{place.phi, 3}, {place.theta, 1}, {place.alpha, 3}, {place.beta, 4}}) {
      EXPECT_GE(knot.low, 0);
      EXPECT_LE(knot.low, most);
      EXPECT_GE(knot.weight, 0.0);
      EXPECT_LE(knot.weight, 1.0);
    }
  }
}

TEST_F(SmallBooks, ImportLinearisesAndScales) {
  SilentProgress progress;
  const Status status = import_btfbase(in(), out(), {Crop{1, 0, 1, 1}}, progress);
  ASSERT_TRUE(status) << status.error().what;
  const auto set = SampleSet::open(out());
  ASSERT_TRUE(set) << set.error().what;
  EXPECT_EQ(set->info().pair_count(), 81 * 81);
  std::vector<float> rgb(81 * 81 * 3);
  set->rgb(0, Part::kTotal, rgb);
  const double expected = std::pow(0.5 * grey(100.0) / 255.0, 2.2);
  for (const float value : rgb) ASSERT_NEAR(value, expected, expected * 1e-3);  // float16
}

TEST_F(SmallBooks, ValuesAreCutToTheUnitRange) {
  auto tables = small_tables();
  tables["all_PDF2Dscale.txt"] = "2 5 0 1\n9000 9000 9000 9000 9000\n0 0 0 0 0\n";
  write(tables);
  SilentProgress progress;
  ASSERT_TRUE(import_btfbase(in(), out(), {}, progress));
  const auto set = SampleSet::open(out());
  ASSERT_TRUE(set);
  EXPECT_EQ(static_cast<float>(set->stored(1)[0]), 1.0F);
  EXPECT_EQ(static_cast<float>(set->stored(0)[0]), 0.0F);  // luminance 0 lies below black
}

TEST_F(SmallBooks, RefusesDamagedTables) {
  expect_refused("m_PDF6Dslices.txt", "1 2 1 2\n0 1\n", "counts from 1");
  expect_refused("m_PDF6Dslices.txt", "1 2 1 2\n3 1\n", "counts from 1");
  expect_refused("m_PDF6Dslices.txt", "1 2 1 2\n1\n", "number 2 of 2");
  expect_refused("m_PDF6Dslices.txt", "1 2 1 2\n1 2 3\n", "more follows");
  expect_refused("m_PDF6Dscale.txt", "2 1 0 1\n1\n1\n", "differ in size");
  expect_refused("m_PDF6Dscale.txt", "1 2 0 1\n1 nan\n", "number 2 of 2");
  expect_refused("m_PDF6Dscale.txt", "", "rows columns");
  expect_refused("m_PDF6Dscale.txt", "-1 2 0 1\n1 2\n", "rows columns");
  expect_refused("m_PDF6Dscale.txt", "2000000000 2000000000 0 1\n1 2\n", "more than it can hold");
  expect_refused("all_PDF4Dslices.txt", "2 4 0 1\n0 0 0 2\n1 1 1 1\n", "PDF3Dslices");
  expect_refused("all_PDF3Dslices.txt", "2 3 0 1\n0 0 -1\n1 1 1\n", "PDF2Dindices");
  expect_refused("all_PDF2Dindices.txt", "2 2 0 1\n0 0\n1 7\n", "PDF2Dcolours");
  expect_refused("all_PDF2Dindices.txt", "2 2 0 1\n0 0\n7 1\n", "PDF2Dslices");
  expect_refused("all_PDF2Dslices.txt", "2 5 0 1\n0 0 0 0 0\n1 1 1 1 2\n", "PDF1Dslice");
  expect_refused("all_PDF2Dcolours.txt", "2 5 0 1\n0 0 0 0 0\n1 1 1 1 9\n", "indexAB");
  expect_refused("all_indexAB.txt", "2 6 0 1\n0 0 0 0 0 0\n1 1 1 1 1 5\n", "colors");
  expect_refused("all_colors.txt", "2 3 100 140\n128 128 1\n128 128 1\n", "two columns");
  expect_refused(
      "all_PDF1Dslice.txt", "2 6 0 2\n1 1 1 1 1 1\n0.5 oops 1 1.25 1.5 1.75\n", "number 8 of 12");
  expect_refused("n_PDF6Dslices.txt", "1 2 1 2\n2 1\n", "one material");
}

TEST_F(SmallBooks, MissingTableIsNotFound) {
  fs::remove(in() / "all_colors.txt");
  SilentProgress progress;
  const Status status = import_btfbase(in(), out(), {}, progress);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, Errc::kNotFound);
  EXPECT_NE(status.error().what.find("_colors.txt"), std::string::npos);
}

class RealBooks : public ::testing::Test {
 protected:
  void SetUp() override {
    const char* data = std::getenv("VENEER_DATA");
    data_ = fs::path(data == nullptr ? "" : data) / "btfbase";
    if (!fs::exists(data_)) GTEST_SKIP() << "real data absent: " << data_;
  }
  // Mean green of each (view, light) over some texels.
  Eigen::ArrayXXd means(const std::string& material, const Crop& crop) {
    SilentProgress progress;
    const Status status =
        import_btfbase(data_ / material, folder_.path() / "a.btfset", {crop}, progress);
    EXPECT_TRUE(status) << status.error().what;
    const auto set = SampleSet::open(folder_.path() / "a.btfset");
    EXPECT_TRUE(set);
    EXPECT_TRUE(set->check_finite());
    Eigen::ArrayXXd sum = Eigen::ArrayXXd::Zero(81, 81);
    std::vector<float> rgb(81 * 81 * 3);
    for (int texel = 0; texel < set->info().texel_count(); ++texel) {
      set->rgb(texel, Part::kTotal, rgb);
      const auto [least, most] = std::minmax_element(rgb.begin(), rgb.end());
      EXPECT_GE(*least, 0.0F);
      EXPECT_LE(*most, 1.0F);
      for (int pair = 0; pair < 81 * 81; ++pair)
        sum(pair / 81, pair % 81) +=
            static_cast<double>(rgb[static_cast<std::size_t>(pair) * 3 + 1]);
    }
    return sum / set->info().texel_count();
  }
  fs::path data_;
  TemporaryFolder folder_;
};

TEST_F(RealBooks, WallpaperFallsLikeTheCosineOfTheLight) {
  const Eigen::ArrayXXd mean = means("wallpaper", {96, 96, 64, 64});
  const DirectionSet directions = bonn_directions();
  const double above = mean.col(0).mean();
  for (Eigen::Index light = 0; light < 81; ++light) {
    // Nearly matt paper, lit directions mixed over all views: within a fifth of the cosine law.
    const double cosine = directions[static_cast<std::size_t>(light)].z();
    EXPECT_NEAR(mean.col(light).mean() / above, cosine, 0.2 * std::max(cosine, 0.5)) << light;
  }
}

// The frame is right way round: a light at some azimuth is mirrored to the opposite one.
TEST_F(RealBooks, AluminiumReflectsOppositeToTheLight) {
  const Eigen::ArrayXXd mean = means("alu", {0, 0, 32, 32});
  constexpr int kRing = 37;  // theta 60, 20 azimuths of 18 degrees
  for (int light = 0; light < 20; ++light) {
    // Centre of the brightness over the ring of views, as an azimuth.
    Eigen::Vector2d centre = Eigen::Vector2d::Zero();
    for (int view = 0; view < 20; ++view) {
      const double phi = view * std::numbers::pi / 10.0;
      centre += mean(kRing + view, kRing + light) * Eigen::Vector2d(std::cos(phi), std::sin(phi));
    }
    const double opposite = (light + 10) * std::numbers::pi / 10.0;
    const double cosine =
        centre.normalized().dot(Eigen::Vector2d(std::cos(opposite), std::sin(opposite)));
    EXPECT_GT(cosine, 0.5) << light;
  }
}

}  // namespace
}  // namespace veneer::btf
