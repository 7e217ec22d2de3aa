// SPDX-License-Identifier: Apache-2.0
#include "calibration/maps/surface_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "base/random.h"
#include "calibration/maps/form_factor.h"

namespace veneer::calibration {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
/// Half a count of rounding in the thousands that are counted.
constexpr double kRounding = 1e-3;

/// A round object with a painted pattern, 3 camera pixels along a raster pixel.
struct FakeScene {
  ProjectorProfile profile;
  CameraFallOff camera{{240, 180}, 300, {-0.3, -0.1, 0}};
  double noise = 0;  // standard deviation in the dark, counts
  double counts_per_electron = 0;
  double exposure = 12000;
  std::array<double, 3> exposures{1, 1, 1};  // of the primaries
  double dark = 64;                          // counts of black
  Eigen::Vector2d reference{70, 50};         // the middle of a field
  double radius = 2.5;
  /// How the camera's channels (rows) count the primaries (columns).
  Eigen::Matrix3d mixing =
      (Eigen::Matrix3d() << 0.5, 0.06, 0.02, 0.1, 0.6, 0.12, 0.01, 0.1, 0.45).finished();
  std::function<Eigen::Vector3d(const Eigen::Vector2d& place)> albedo =
      [](const Eigen::Vector2d& place) {
        const bool dark_field =
            (static_cast<int>(place.x() / 20) + static_cast<int>(place.y() / 20)) % 2 == 1;
        return dark_field ? Eigen::Vector3d(0.2, 0.3, 0.6) : Eigen::Vector3d(0.8, 0.7, 0.5);
      };
  Image<float> form_factor{160, 120};
  Image<Eigen::Vector2f> projector{480, 360, Eigen::Vector2f(kNan, kNan)};
  Image<float> confidence{480, 360, 1.0F};
  std::array<Image<Rgb16>, 3> pictures;
  Image<Rgb16> black;

  FakeScene() {
    profile.geometry = {160, 120, 200, 200, 80, 60, {}};
    profile.vignetting = Image<float>(16, 12);
    for (int y = 0; y < 12; ++y)
      for (int x = 0; x < 16; ++x)
        profile.vignetting(x, y) =
            static_cast<float>(1.0 - 0.004 * (std::pow(x - 7.5, 2) + std::pow(y - 5.5, 2)));
    for (int y = 0; y < 120; ++y)
      for (int x = 0; x < 160; ++x)
        form_factor(x, y) = static_cast<float>(shape({x + 0.5, y + 0.5}));
  }

  /// The form factor of a sphere of radius 50 pixels, far from the lens.
  [[nodiscard]] static double shape(const Eigen::Vector2d& place) {
    const double square = (place - Eigen::Vector2d(80, 60)).squaredNorm() / 2500.0;
    return square < 1 ? std::sqrt(1 - square) : 0.0;
  }

  void grab() {
    Pcg32 random(3);
    black = Image<Rgb16>(480, 360);
    for (auto& picture : pictures) picture = Image<Rgb16>(480, 360);
    const auto count = [&](double light) {
      const double deviation = std::sqrt(noise * noise + counts_per_electron * light);
      const double counts = light + dark + (noise > 0 ? deviation * random.normal() : 0.0);
      return static_cast<std::uint16_t>(std::clamp(std::round(counts), 0.0, 65535.0));
    };
    for (int y = 0; y < 360; ++y)
      for (int x = 0; x < 480; ++x) {
        const Eigen::Vector2d place((x + 0.5) / 3, (y + 0.5) / 3);
        const Eigen::Vector2i texel(static_cast<int>(place.x()), static_cast<int>(place.y()));
        const double light = exposure * form_factor(texel.x(), texel.y()) *
                             profile.vignetting_at(place) * camera({x + 0.5, y + 0.5});
        if (light > 0) projector(x, y) = place.cast<float>();
        const Eigen::Vector3d reflects = albedo(place);
        for (std::size_t c = 0; c < 3; ++c) {
          const auto row = static_cast<Eigen::Index>(c);
          black(x, y)[c] = count(0);
          for (std::size_t p = 0; p < 3; ++p) {
            const auto column = static_cast<Eigen::Index>(p);
            pictures[p](x, y)[c] =
                count(light * exposures[p] * mixing(row, column) * reflects[column]);
          }
        }
      }
  }

  [[nodiscard]] SurfacePictures borrowed() const {
    return {{pictures[0].view(), pictures[1].view(), pictures[2].view()},
            {black.view(), black.view(), black.view()},
            projector.view(),
            confidence.view()};
  }
  [[nodiscard]] MapOptions options() const {
    MapOptions options;
    options.dark_noise = noise;
    options.counts_per_electron = counts_per_electron;
    return options;
  }
  [[nodiscard]] Result<SurfaceMap> measure(const MapOptions& options) const {
    return measure_surface_map(
        borrowed(), form_factor.view(), profile, camera, reference, radius, options);
  }
  [[nodiscard]] Result<SurfaceMap> measure() const { return measure(options()); }

  [[nodiscard]] Eigen::Vector3d truth(int x, int y) const {
    return albedo({x + 0.5, y + 0.5}).cwiseQuotient(albedo(reference));
  }
  /// Root mean square of the map's error over what was seen, in parts of the reference.
  [[nodiscard]] double error(const SurfaceMap& measured) const {
    double squares = 0;
    int values = 0;
    for (int y = 0; y < measured.map.height(); ++y)
      for (int x = 0; x < measured.map.width(); ++x) {
        if (measured.quality.source(x, y) != MapSource::kSeen) continue;
        squares += (measured.map(x, y).cast<double>() - truth(x, y)).squaredNorm();
        values += 3;
      }
    return std::sqrt(squares / values);
  }
};

TEST(SurfaceMap, IsTheRatioOfTheAlbedosToThatOfTheReference) {
  FakeScene scene;
  scene.exposures = {1, 0.5, 0.8};  // what the reference divides out
  scene.grab();
  const auto measured = scene.measure();
  ASSERT_TRUE(measured) << measured.error().what;
  EXPECT_EQ(measured->map.width(), 160);
  EXPECT_EQ(measured->map.height(), 120);
  EXPECT_LT(scene.error(*measured), kRounding);
  EXPECT_THAT(measured->quality.warnings, IsEmpty());
  EXPECT_EQ(measured->quality.pixels_per_texel, 9);
  // A sphere's form factor is under a tenth where its radius is over sqrt(0.99) of the rim: 1 % of
  // its area.
  EXPECT_NEAR(measured->quality.seen, 0.99, 0.01);
  EXPECT_NEAR(measured->quality.filled, 0.01, 0.01);
  EXPECT_EQ(measured->quality.stray + measured->quality.unsure + measured->quality.saturated, 0);
}

TEST(SurfaceMap, TakesForEachPrimaryTheChannelThatCountsItMost) {
  FakeScene scene;
  scene.mixing << 0.1, 0.6, 0.02, 0.5, 0.06, 0.12, 0.01, 0.1, 0.45;  // red and green exchanged
  scene.grab();
  const auto measured = scene.measure();
  ASSERT_TRUE(measured) << measured.error().what;
  EXPECT_EQ(measured->channels, (std::array{1, 0, 2}));
  EXPECT_LT(scene.error(*measured), kRounding);
}

TEST(SurfaceMap, IsWithinItsOwnNoiseOfTheTruth) {
  FakeScene scene;
  scene.noise = 12;
  scene.counts_per_electron = 4;
  scene.grab();
  const auto measured = scene.measure();
  ASSERT_TRUE(measured) << measured.error().what;
  double squares = 0;
  int values = 0;
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 160; ++x) {
      if (measured->quality.source(x, y) != MapSource::kSeen) continue;
      const Eigen::Vector3d noise = measured->noise(x, y).cast<double>();
      EXPECT_LE(noise.maxCoeff(), scene.options().most_noise);
      const Eigen::Vector3d off = measured->map(x, y).cast<double>() - scene.truth(x, y);
      squares += off.cwiseQuotient(noise).squaredNorm();
      values += 3;
    }
  ASSERT_GT(values, 20000);
  // The reference's noise is common to all; what is small beside it widens this by a few per cent.
  EXPECT_NEAR(std::sqrt(squares / values), 1.0, 0.1);
  EXPECT_GT(measured->reference_noise.minCoeff(), 0);
  EXPECT_LT(measured->reference_noise.maxCoeff(), 0.01);
}

TEST(SurfaceMap, OfFewerTexelsIsTheMeanOverTheirAreas) {
  FakeScene scene;
  scene.albedo = [](const Eigen::Vector2d& place) {
    const double value = 0.4 + 0.002 * place.x() - 0.001 * place.y();
    return Eigen::Vector3d(value, value, value);
  };
  scene.grab();
  MapOptions options = scene.options();
  options.width = 40;
  options.height = 30;
  const auto measured = scene.measure(options);
  ASSERT_TRUE(measured) << measured.error().what;
  EXPECT_EQ(measured->quality.pixels_per_texel, 144);
  int compared = 0;
  for (int y = 0; y < 30; ++y)
    for (int x = 0; x < 40; ++x) {
      const Eigen::Vector2d centre(4 * x + 2, 4 * y + 2);
      if ((centre - Eigen::Vector2d(80, 60)).norm() > 40) continue;
      const double truth = scene.albedo(centre).x() / scene.albedo(scene.reference).x();
      // By light: the form factor's slope over a texel shifts the mean.
      EXPECT_NEAR(measured->map(x, y).x(), truth, 3e-3) << x << ' ' << y;
      ++compared;
    }
  EXPECT_GT(compared, 200);
}

TEST(SurfaceMap, FillsHolesFromTheirNeighboursAndIsOneFarFromThem) {
  FakeScene scene;
  scene.albedo = [](const Eigen::Vector2d& place) {
    return Eigen::Vector3d::Constant(place.x() < 90 ? 0.4 : 0.8).eval();
  };
  scene.grab();
  for (int y = 0; y < 360; ++y)  // what did not decode: places 100 to 106 by 50 to 56
    for (int x = 0; x < 480; ++x)
      if (x >= 300 && x < 318 && y >= 150 && y < 168) scene.projector(x, y).setConstant(kNan);
  MapOptions options = scene.options();
  options.most_fill = 4;
  const auto filled = scene.measure(options);
  ASSERT_TRUE(filled) << filled.error().what;
  EXPECT_EQ(filled->quality.source(103, 53), MapSource::kFilled);
  EXPECT_NEAR(filled->map(103, 53).x(), 2.0, kRounding);
  EXPECT_EQ(filled->noise(103, 53), Rgb32f(Rgb32f::Zero()));
  EXPECT_EQ(filled->quality.source(2, 2), MapSource::kNone);
  EXPECT_EQ(filled->map(2, 2), Rgb32f(Rgb32f::Ones()));
  options.most_fill = 2;
  const auto bounded = scene.measure(options);
  ASSERT_TRUE(bounded);
  EXPECT_EQ(bounded->quality.source(101, 53), MapSource::kFilled);
  EXPECT_EQ(bounded->quality.source(102, 53), MapSource::kNone);
  EXPECT_EQ(bounded->map(102, 53), Rgb32f(Rgb32f::Ones()));
  options.most_fill = 0;
  const auto open = scene.measure(options);
  ASSERT_TRUE(open);
  EXPECT_EQ(open->quality.filled, 0);
  EXPECT_NEAR(filled->quality.seen, open->quality.seen, 1e-12);
}

TEST(SurfaceMap, TakesNothingFromGrazingUnsureSaturatedAndStrayPixels) {
  FakeScene scene;
  scene.grab();
  const auto clean = scene.measure();
  ASSERT_TRUE(clean);
  // Wrong values, each with a reason not to be taken.
  scene.confidence(240, 150) = 0.05F;
  scene.confidence(241, 150) = kNan;
  scene.pictures[0](243, 150) = {65535, 0, 0};
  scene.projector(246, 150) = {-1, 20};
  scene.projector(247, 150) = {3, 3};  // the object is not there
  for (const int x : {240, 241, 246, 247}) scene.pictures[1](x, 150) = {9, 9, 9};
  const auto measured = scene.measure();
  ASSERT_TRUE(measured);
  EXPECT_EQ(measured->quality.unsure, 2);
  EXPECT_EQ(measured->quality.saturated, 1);
  EXPECT_EQ(measured->quality.stray, 2);
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 160; ++x) {
      const double off = (measured->map(x, y) - clean->map(x, y)).cwiseAbs().maxCoeff();
      ASSERT_LT(off, 2 * kRounding) << x << ' ' << y;
      // A sphere's rim gets next to no light.
      const double graze = FakeScene::shape({x + 0.5, y + 0.5});
      if (graze > 0 && graze < 0.05) {
        ASSERT_NE(measured->quality.source(x, y), MapSource::kSeen);
      }
    }
}

TEST(SurfaceMap, OfABlackSpotIsItsNoiseAndNotBelowTheLeastReflectance) {
  FakeScene scene;
  scene.noise = 8;
  scene.albedo = [](const Eigen::Vector2d& place) {
    return Eigen::Vector3d::Constant(place.x() > 95 ? 0.0 : 0.7).eval();
  };
  scene.grab();
  const auto measured = scene.measure();
  ASSERT_TRUE(measured) << measured.error().what;
  for (int y = 40; y < 80; ++y) {
    ASSERT_EQ(measured->quality.source(105, y), MapSource::kSeen);
    EXPECT_TRUE((measured->map(105, y).array() >= measured->noise(105, y).array()).all());
    EXPECT_LT(measured->map(105, y).maxCoeff(), 0.01);
  }
  // Without any noise stated, the limit of the profile remains, which then can be saved.
  MapOptions options = scene.options();
  options.dark_noise = 0;
  const auto bare = scene.measure(options);
  ASSERT_TRUE(bare);
  float least = 1;
  for (const Rgb32f& value : bare->map.pixels()) least = std::min(least, value.minCoeff());
  EXPECT_EQ(least, kLeastReflectance);
}

TEST(SurfaceMap, WithoutLightAtTheReferenceIsRefused) {
  FakeScene scene;
  scene.grab();
  FakeScene off = scene;
  off.reference = {5, 5};  // past the object
  EXPECT_THAT(off.measure().error().what, HasSubstr("0 camera pixels are sure"));
  EXPECT_EQ(off.measure().error().code, Errc::kBadFormat);
  FakeScene dark = scene;
  dark.pictures[2] = dark.black;
  EXPECT_THAT(dark.measure().error().what, HasSubstr("full blue gives 0 counts"));
  FakeScene inverted = scene;
  std::swap(inverted.pictures[1], inverted.black);
  EXPECT_THAT(inverted.measure().error().what, HasSubstr("lost in the noise"));
}

TEST(SurfaceMap, BadInputIsRefusedBySayingWhat) {
  FakeScene scene;
  scene.grab();
  const auto refuses = [&](const std::function<void(MapOptions&)>& spoil, std::string_view name) {
    MapOptions options = scene.options();
    spoil(options);
    const auto refused = scene.measure(options);
    ASSERT_FALSE(refused) << name;
    EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
    EXPECT_THAT(refused.error().what, HasSubstr(std::string(name)));
  };
  refuses([](auto& o) { o.width = 10; }, "size");
  refuses([](auto& o) { o.full_scale = -1; }, "full_scale");
  refuses([](auto& o) { o.least_confidence = kNan; }, "least_confidence");
  refuses([](auto& o) { o.dark_noise = kNan; }, "dark_noise");
  refuses([](auto& o) { o.counts_per_electron = -1; }, "counts_per_electron");
  refuses([](auto& o) { o.least_light = 0; }, "least_light");
  refuses([](auto& o) { o.most_noise = 0; }, "most_noise");
  refuses([](auto& o) { o.most_fill = -1; }, "most_fill");

  const auto spoilt = [&](const std::function<void(FakeScene&)>& spoil) {
    FakeScene bad = scene;
    spoil(bad);
    const auto refused = bad.measure();
    return refused ? Error{Errc::kIo, "accepted"} : refused.error();
  };
  EXPECT_THAT(spoilt([](FakeScene& s) { s.black = Image<Rgb16>(3, 3); }).what, HasSubstr("3 x 3"));
  EXPECT_THAT(spoilt([](FakeScene& s) { s.confidence = Image<float>(3, 3); }).what,
              HasSubstr("confidence"));
  EXPECT_THAT(spoilt([](FakeScene& s) { s.projector = {}; }).what, HasSubstr("decoded"));
  EXPECT_THAT(spoilt([](FakeScene& s) { s.form_factor = {}; }).what, HasSubstr("form factor"));
  EXPECT_THAT(spoilt([](FakeScene& s) { s.radius = 0; }).what, HasSubstr("radius"));
  EXPECT_THAT(spoilt([](FakeScene& s) { s.reference.x() = kNan; }).what, HasSubstr("reference"));
  EXPECT_THAT(spoilt([](FakeScene& s) { s.profile.geometry.width = 0; }).what, HasSubstr("raster"));
}

TEST(FormFactor, OfAWhiteObjectIsItsShapeAndServesTheSurfaceMap) {
  FakeScene white;
  white.albedo = [](const Eigen::Vector2d&) { return Eigen::Vector3d::Constant(0.8).eval(); };
  white.grab();
  Image<Rgb16> lit(480, 360);
  for (int y = 0; y < 360; ++y)
    for (int x = 0; x < 480; ++x)
      for (std::size_t c = 0; c < 3; ++c)
        for (const auto& picture : white.pictures)
          lit(x, y)[c] = static_cast<std::uint16_t>(lit(x, y)[c] + picture(x, y)[c]);
  Image<Rgb16> unlit(480, 360, Rgb16{192, 192, 192});  // three times black, as above
  const double reference_counts = white.exposure * 0.8 * white.mixing.sum();
  const auto measured = measure_form_factor(lit.view(),
                                            unlit.view(),
                                            white.projector.view(),
                                            white.confidence.view(),
                                            white.profile,
                                            white.camera,
                                            reference_counts,
                                            white.options());
  ASSERT_TRUE(measured) << measured.error().what;
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 160; ++x)
      ASSERT_NEAR(measured->map(x, y), white.form_factor(x, y), kRounding) << x << ' ' << y;
  EXPECT_EQ(measured->quality.seen, 1.0);

  FakeScene painted;
  painted.grab();
  painted.form_factor = measured->map;  // in place of the mesh's
  const auto map = painted.measure();
  ASSERT_TRUE(map) << map.error().what;
  EXPECT_LT(painted.error(*map), 2 * kRounding);
}

TEST(FormFactor, ClosesHolesButDoesNotGrowTheObject) {
  FakeScene white;
  white.albedo = [](const Eigen::Vector2d&) { return Eigen::Vector3d::Constant(0.8).eval(); };
  white.grab();
  for (int y = 180; y < 186; ++y)
    for (int x = 240; x < 246; ++x) white.projector(x, y).setConstant(kNan);
  const auto measure = [&](double reference_counts) {
    return measure_form_factor(white.pictures[1].view(),
                               white.black.view(),
                               white.projector.view(),
                               {},
                               white.profile,
                               white.camera,
                               reference_counts,
                               white.options());
  };
  const auto measured = measure(white.exposure * 0.8 * white.mixing.col(1).sum());
  ASSERT_TRUE(measured) << measured.error().what;
  EXPECT_EQ(measured->quality.source(80, 60), MapSource::kFilled);
  EXPECT_NEAR(measured->map(80, 60), 1.0, 2e-3);  // nearly flat there
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 160; ++x)
      if (FakeScene::shape({x + 0.5, y + 0.5}) == 0) {
        ASSERT_EQ(measured->map(x, y), 0) << x << ' ' << y;
      }
  for (const double bad : {0.0, -1.0, std::nan("")})
    EXPECT_EQ(measure(bad).error().code, Errc::kInvalidOption);
  white.projector = Image<Eigen::Vector2f>(480, 360, Eigen::Vector2f(kNan, kNan));
  EXPECT_THAT(measure(1).error().what, HasSubstr("saw nothing"));
}

}  // namespace
}  // namespace veneer::calibration
