// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/utia/utia.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "btf/importers/internal_test_files.h"

namespace veneer::btf {
namespace {

constexpr double kPi = std::numbers::pi;

// f_r(theta_l, phi_l, theta_v, phi_v), degrees.
using Law = std::function<double(double, double, double, double)>;

std::string utia_file(const Law& law) {
  std::string bytes;
  for (int c = 0; c < 3; ++c)
    for (int light = 0; light < 288; ++light)
      for (int view = 0; view < 288; ++view)
        testing::put(bytes,
                     (c + 1) * law(15.0 * (light / 48),
                                   7.5 * (light % 48),
                                   15.0 * (view / 48),
                                   7.5 * (view % 48)));
  return bytes;
}

// Samples against the law, within `error` of f_r in the first channel.
void expect_law(const SampleSet& set, const Law& law, double error) {
  const std::vector<float> samples = testing::samples_of(set);
  const auto degrees = [](double radians) { return radians * 180.0 / kPi; };
  std::size_t i = 0;
  for (const Direction& view : set.info().views)
    for (const Direction& light : set.info().lights) {
      const Angles v = angles_from_direction(view);
      const Angles l = angles_from_direction(light);
      const double f = law(degrees(l.theta), degrees(l.phi), degrees(v.theta), degrees(v.phi));
      for (int c = 0; c < 3; ++c) {
        const double expected = (c + 1) * f * kPi * light.z();
        ASSERT_NEAR(samples[i++], expected, 1e-3 * expected + (c + 1) * error * kPi)
            << view.transpose() << " / " << light.transpose();
      }
    }
}

// Linear in all four: what linear interpolation reproduces, the wrap of phi apart.
TEST(Utia, IsLinearBetweenTheKnots) {
  const testing::ImportedFile file("utia", "fabric.bin");
  // The tent has its kinks on knots.
  const auto tent = [](double phi) { return std::abs(phi - 180.0); };
  const Law law = [tent](double tl, double pl, double tv, double pv) {
    return 1.0 + 0.01 * tl + 0.002 * tent(pl) + 0.003 * tv + 0.001 * tent(pv);
  };
  file.write(utia_file(law));
  for (const char* directions : {"bonn81", "ubo151"}) {
    ImportOptions options;
    options.directions = directions;
    SampleSet set = file.set(options);
    // At the normal the file holds 48 values; a direction that is the normal has phi 0.
    expect_law(set, law, 1e-12);
  }
}

TEST(Utia, TellsAzimuthsApart) {
  const testing::ImportedFile file("utia", "fabric.bin");
  const Law law = [](double tl, double pl, double tv, double pv) {
    return 2.0 + std::sin(tl * kPi / 180.0) * std::sin(pl * kPi / 180.0 + 0.3) +
           0.5 * std::sin(tv * kPi / 180.0) * std::cos(pv * kPi / 180.0);
  };
  file.write(utia_file(law));
  // Linear interpolation of a sine over 15 degrees: step^2 / 8 of each of the two angles, twice.
  const double error =
      1.5 * (std::pow(15.0, 2.0) + std::pow(7.5, 2.0)) / 8.0 * std::pow(kPi / 180.0, 2.0);
  ImportOptions options;
  options.directions = "ubo151";
  expect_law(file.set(options), law, error);
}

TEST(Utia, NegativeValuesAreZero) {
  const testing::ImportedFile file("utia", "fabric.bin");
  file.write(utia_file([](double, double, double, double) { return -0.1; }));
  for (const float sample : testing::samples_of(file.set())) ASSERT_EQ(sample, 0.0F);
}

TEST(Utia, DamageIsRefused) {
  const testing::ImportedFile file("utia", "fabric.bin");
  std::string bytes = utia_file([](double, double, double, double) { return 0.1; });
  ASSERT_EQ(bytes.size(), 1'990'656U);
  file.expect_cuts_refused(bytes, 99'991);
  file.write(bytes);
  file.expect_flips_survived(bytes, bytes.size(), 20);
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), -std::numeric_limits<double>::infinity()}) {
    std::memcpy(&bytes[bytes.size() - 8], &bad, sizeof bad);
    file.write(bytes);
    file.expect_refused("not finite");
  }
}

}  // namespace
}  // namespace veneer::btf
