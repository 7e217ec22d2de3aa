// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/material.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <numbers>
#include <span>
#include <string_view>

#include "simulation/bench/testing.h"

namespace veneer::simulation {
namespace {

using testing::plain_truth;
using testing::square;
using testing::turned;

constexpr double kFloat = 1e-6;  // relative: the picture is kept in 32-bit floats

TexelSource lambert() {
  return {1, 1, [](int, const Eigen::Vector3d&, const Eigen::Vector3d& light) {
            return Eigen::Vector3d(Eigen::Vector3d::Constant(light.z()));
          }};
}

/// One of 4 x 4 texels gets all the red its column gives and all the green its row gives.
TexelSource chequer() {
  return {4, 4, [](int texel, const Eigen::Vector3d&, const Eigen::Vector3d&) {
            return Eigen::Vector3d(texel % 4, texel / 4, 1);
          }};
}

class MaterialTruthTest : public ::testing::Test {
 protected:
  void make(const RigidTransform& pose, const Eigen::Vector3d& eye, double half_side = 0.3) {
    auto bench = Bench::create(plain_truth(), square(half_side));
    ASSERT_TRUE(bench) << bench.error().what;
    bench_ = std::move(*bench);
    auto view = bench_->look(pose, eye);
    ASSERT_TRUE(view) << view.error().what;
    view_ = std::move(*view);
  }
  /// Linear sRGB times pi, which is sample times illuminance.
  [[nodiscard]] Eigen::Vector3d at(const Image<Rgb32f>& picture, int x, int y) const {
    return std::numbers::pi * (srgb_from_xyz() * picture(x, y).cast<double>());
  }

  std::unique_ptr<Bench> bench_;
  EyeView view_;
};

TEST_F(MaterialTruthTest, WhiteLambertSendsTheCosineTimesIlluminanceOverPi) {
  for (const double degrees : {0.0, 30.0, 60.0, 85.0}) {
    make(turned(degrees, Eigen::Vector3d::UnitY()), {0.2, 0.1, 1});
    const BenchLight light{BenchLight::Kind::kDirectional, {0, 0, 2}, {300, 200, 100}};
    const Image<Rgb32f> picture = bench_->material_truth(view_, lambert(), {1, 1}, {light});
    const double cosine = std::cos(degrees * std::numbers::pi / 180);
    const Xyz expected = xyz_from_srgb() * (light.rgb * cosine / std::numbers::pi);
    EXPECT_TRUE(picture(32, 24).cast<double>().isApprox(expected, kFloat)) << degrees;
  }
}

TEST_F(MaterialTruthTest, LightFromBehindDoesNotCount) {
  make({}, {0.2, 0.1, 1});
  const BenchLight light{BenchLight::Kind::kDirectional, {0, 0.3, -1}, {300, 300, 300}};
  EXPECT_TRUE(bench_->material_truth(view_, lambert(), {1, 1}, {light})(32, 24).isZero());
}

TEST_F(MaterialTruthTest, PointLightsFallWithTheSquareAndAdd) {
  make({}, {0, 0, 1});
  const BenchLight near{BenchLight::Kind::kPoint, {0, 0, 0.5}, {10, 10, 10}};
  const BenchLight far{BenchLight::Kind::kPoint, {0, 0, 2}, {10, 10, 10}};
  const Image<Rgb32f> both = bench_->material_truth(view_, lambert(), {1, 1}, {near, far});
  // The middle pixel's rays end within 4 mm of the foot of the perpendicular.
  EXPECT_NEAR(at(both, 32, 24).x(), 10 / 0.25 + 10 / 4.0, 42.5 * 1e-3);
}

TEST_F(MaterialTruthTest, TexturesStandUprightAndRepeat) {
  make({}, {0, 0, 1}, 0.075);  // the square just fills the picture's height: 8 to 56 of 64 columns
  const BenchLight light{};
  const Image<Rgb32f> once = bench_->material_truth(view_, chequer(), {1, 1}, {light});
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) {
      const Eigen::Vector3d rgb = at(once, 8 + 12 * column + 6, 12 * row + 6);
      EXPECT_NEAR(rgb.x(), column, 1e-4) << "u runs to the right";
      EXPECT_NEAR(rgb.y(), row, 1e-4) << "v runs down";
    }
  const Image<Rgb32f> twice = bench_->material_truth(view_, chequer(), {2, 3}, {light});
  EXPECT_NEAR(at(twice, 8 + 6 * 5 + 3, 6).x(), 1, 1e-4) << "sixth texel of eight";
  EXPECT_NEAR(at(twice, 20, 4 * 5 + 2).y(), 1, 1e-4) << "sixth texel of twelve";
}

TEST_F(MaterialTruthTest, TheLocalFrameIsTangentUpNormal) {
  Eigen::Vector3d seen_view;
  Eigen::Vector3d seen_light;
  const TexelSource spy{1, 1, [&](int, const Eigen::Vector3d& view, const Eigen::Vector3d& light) {
                          seen_view = view;
                          seen_light = light;
                          return Eigen::Vector3d(0, 0, 0);
                        }};
  const RigidTransform pose = turned(40, Eigen::Vector3d(1, 2, 3).normalized());
  make(pose, pose * Eigen::Vector3d(0.3, 0.4, 1.2));
  const Eigen::Vector3d light = Eigen::Vector3d(0.5, -0.2, 0.7).normalized();
  // One sample only, so that the spy sees one direction.
  EyeView single = view_;
  single.samples = {EyeSample{0, 0.5F, 0, 0, 1}};  // the middle of the square's diagonal
  single.first.assign(single.first.size(), 1);
  single.first.front() = 0;
  (void)bench_->material_truth(
      single, spy, {1, 1}, {{BenchLight::Kind::kDirectional, pose.rotation * light, {1, 1, 1}}});
  // The square's own axes: u along +x, normal +z, and y = z cross x along +y, where rows get
  // smaller.
  EXPECT_TRUE(seen_light.isApprox(light, 1e-9)) << seen_light.transpose();
  EXPECT_TRUE(seen_view.isApprox(Eigen::Vector3d(0.3, 0.4, 1.2).normalized(), 1e-9))
      << seen_view.transpose();
}

/// Two texels that send `light.z` times one and two.
class TwoLambertTexels final : public btf::Material {
 public:
  [[nodiscard]] std::string_view model() const override { return "two-lambert-texels"; }
  [[nodiscard]] int width() const override { return 2; }
  [[nodiscard]] int height() const override { return 1; }
  [[nodiscard]] const btf::DirectionSet& views() const override { return directions_; }
  [[nodiscard]] const btf::DirectionSet& lights() const override { return directions_; }
  void reconstruct(int /*texel*/, std::span<float> /*rgb*/) const override {}
  [[nodiscard]] Eigen::Vector3d radiance(int texel,
                                         const btf::Direction& /*view*/,
                                         const btf::Direction& light) const override {
    return Eigen::Vector3d::Constant((texel + 1) * light.z());
  }
  [[nodiscard]] btf::ModelShader shader() const override { return {}; }
  [[nodiscard]] double values_per_texel() const override { return 1; }
  [[nodiscard]] Contents contents() const override { return {}; }

 private:
  btf::DirectionSet directions_ = btf::bonn_directions();
};

TEST_F(MaterialTruthTest, AFittedMaterialSendsItsOwnRadiance) {
  const TwoLambertTexels material;
  make({}, {0, 0, 1}, 0.075);  // columns 8 to 56 of 64
  const BenchLight light{BenchLight::Kind::kDirectional, {0, 0.6, 0.8}, {2, 2, 2}};
  const Image<Rgb32f> picture =
      bench_->material_truth(view_, texel_source(material), {1, 1}, {light});
  EXPECT_NEAR(at(picture, 20, 24).x(), 2 * 0.8, 1e-5) << "the left texel";
  EXPECT_NEAR(at(picture, 44, 24).x(), 4 * 0.8, 1e-5) << "the right one";
}

TEST_F(MaterialTruthTest, ASetOfAWhiteLambertSampleSendsTheCosine) {
  btf::SampleSetInfo info;
  info.width = 2;
  info.height = 1;
  info.views = btf::bonn_directions();
  info.lights = btf::bonn_directions();
  info.source = "Lambert's law";
  info.licence = "none needed";
  const auto folder = std::filesystem::temp_directory_path() /
                      fmt::format("veneer_bench_lambert_{}.btfset", ::getpid());
  {
    auto writer = btf::SampleSetWriter::create(folder, info);
    ASSERT_TRUE(writer) << writer.error().what;
    for (int texel = 0; texel < 2; ++texel) {
      const auto samples = writer->texel(texel);
      std::size_t i = 0;
      for (std::size_t view = 0; view < info.views.size(); ++view)
        for (const btf::Direction& light : info.lights)
          for (int channel = 0; channel < 3; ++channel)
            samples[i++] = static_cast<Eigen::half>(static_cast<float>(light.z()));
    }
    ASSERT_TRUE(writer->finish());
  }
  auto set = btf::SampleSet::open(folder);
  ASSERT_TRUE(set) << set.error().what;
  const btf::InterpolatedSet interpolated(std::move(*set));
  make({}, {0.2, 0.1, 1});
  for (const btf::Direction& direction : info.lights) {
    const BenchLight light{BenchLight::Kind::kDirectional, direction, {1, 1, 1}};
    const Image<Rgb32f> picture =
        bench_->material_truth(view_, texel_source(interpolated), {3, 1}, {light});
    constexpr double kHalf = 5e-4;  // rounding of a value under 1 in float16
    EXPECT_NEAR(at(picture, 32, 24).y(), direction.z(), kHalf) << direction.transpose();
  }
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace veneer::simulation
