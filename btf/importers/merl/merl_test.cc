// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/merl/merl.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "btf/importers/internal_test_files.h"

namespace veneer::btf {
namespace {

constexpr double kPi = std::numbers::pi;

// A smooth BRDF of the three angles. The phase tells phi_d from -phi_d; the sines keep it the same
// at the poles whatever phi_d is taken there.
double law(double theta_h, double theta_d, double phi_d, int channel) {
  return 0.1 * (channel + 1) + 0.2 * theta_h + 0.3 * theta_d +
         0.1 * std::sin(theta_h) * std::sin(theta_d) * std::cos(2.0 * phi_d - 0.7);
}
// Its steepest ascent over half a cell (phi_d and theta_d: half a degree; theta_h: one degree where
// cells are widest), and as much again for directions on a border.
constexpr double kCell = 2.0 * (0.3 * 0.0175 + 0.4 * 0.0088 + 0.2 * 0.0088);

std::string merl_file() {
  std::string bytes;
  for (const std::int32_t size : {90, 90, 180}) testing::put(bytes, size);
  const std::array<double, 3> units{1500.0, 1500.0 / 1.15, 1500.0 / 1.66};
  for (int c = 0; c < 3; ++c)
    for (int h = 0; h < 90; ++h)
      for (int d = 0; d < 90; ++d)
        for (int p = 0; p < 180; ++p) {
          const double theta_h = std::pow((h + 0.5) / 90.0, 2.0) * kPi / 2.0;
          testing::put(bytes,
                       units[static_cast<std::size_t>(c)] *
                           law(theta_h, (d + 0.5) * kPi / 180.0, (p + 0.5) * kPi / 180.0, c));
        }
  return bytes;
}

// Half and difference angles by turning the half vector to the normal (Rusinkiewicz 1998).
double law(const Direction& view, const Direction& light, int channel) {
  const Direction half = (view + light).normalized();
  const double phi_h = std::atan2(half.y(), half.x());
  const double theta_h = std::acos(std::clamp(half.z(), -1.0, 1.0));
  const Direction turned = Eigen::AngleAxisd(-theta_h, Direction::UnitY()) *
                           (Eigen::AngleAxisd(-phi_h, Direction::UnitZ()) * light);
  return law(theta_h,
             std::acos(std::clamp(turned.z(), -1.0, 1.0)),
             std::atan2(turned.y(), turned.x()),
             channel);
}

class Merl : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { bytes_ = new std::string(merl_file()); }
  static void TearDownTestSuite() { delete bytes_; }
  // A damaged byte string at a place of an otherwise good file.
  template <class Number>
  void patch(std::size_t offset, Number value) const {
    std::string bytes = *bytes_;
    std::memcpy(&bytes[offset], &value, sizeof value);
    file_.write(bytes);
  }
  static const std::string* bytes_;
  testing::ImportedFile file_{"merl", "paint.binary"};
};
const std::string* Merl::bytes_ = nullptr;

TEST_F(Merl, SamplesFollowTheLaw) {
  ASSERT_EQ(bytes_->size(), 34'992'012U);
  file_.write(*bytes_);
  for (const char* directions : {"bonn81", "ubo151"}) {
    ImportOptions options;
    options.directions = directions;
    const SampleSet set = file_.set(options);
    ASSERT_EQ(set.info().texel_count(), 1);
    ASSERT_EQ(set.info().views, set.info().lights);
    const std::vector<float> samples = testing::samples_of(set);
    std::size_t i = 0;
    for (const Direction& view : set.info().views)
      for (const Direction& light : set.info().lights)
        for (int c = 0; c < 3; ++c) {
          const double scale = kPi * light.z();
          const double expected = scale * law(view, light, c);
          ASSERT_NEAR(samples[i++], expected, scale * kCell + 1e-3 * expected)
              << view.transpose() << " / " << light.transpose();
        }
  }
}

TEST_F(Merl, ValuesThatWereNotMeasuredAreZero) {
  patch(12, -1.0);  // the first cell: the normal itself
  const SampleSet set = file_.set();
  EXPECT_EQ(set.stored(0)[0], Eigen::half(0.0F));
  EXPECT_GT(set.stored(0)[1], Eigen::half(0.0F));
}

TEST_F(Merl, DamageIsRefused) {
  for (const std::size_t offset : {0U, 4U, 8U}) {
    for (const std::int32_t size : {0, -90, 89, std::numeric_limits<std::int32_t>::max()}) {
      patch(offset, size);
      file_.expect_refused("its table is");
    }
  }
  patch(12 + 8 * 4'374'000 - 8, std::numeric_limits<double>::quiet_NaN());
  file_.expect_refused("not finite");
  patch(12, std::numeric_limits<double>::infinity());
  file_.expect_refused("not finite");
  patch(12, 1e300);
  file_.expect_refused("none that a sample can take");
  std::string longer = *bytes_;
  longer.push_back('x');
  file_.write(longer);
  file_.expect_refused("1 bytes follow");
  for (const std::uintmax_t size : {34'992'011U, 34'992'004U, 20'000'000U, 12U, 11U, 3U, 0U}) {
    std::filesystem::resize_file(file_.path(), size);
    file_.expect_refused(size == 0 ? "empty" : "cut short");
  }
  std::filesystem::remove(file_.path());
  file_.expect_refused("reading", Errc::kNotFound);
}

TEST_F(Merl, OptionsAreChecked) {
  file_.write(*bytes_);
  ImportOptions options;
  options.directions = "many";
  const Status unknown = file_.import(options);
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, Errc::kInvalidOption);
  EXPECT_NE(unknown.error().what.find("ubo151"), std::string::npos);
  const Status crop = file_.import({Crop{0, 0, 2, 1}});
  ASSERT_FALSE(crop);
  EXPECT_EQ(crop.error().code, Errc::kInvalidOption);
}

TEST_F(Merl, DamagedBytesAreSurvived) {
  file_.expect_flips_survived(*bytes_, 1000, 10);  // each reads 35 MB
  file_.expect_flips_survived(*bytes_, bytes_->size(), 5);
}

}  // namespace
}  // namespace veneer::btf
