// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/random.h"
#include "simulation/bench/testing.h"

namespace veneer::simulation {
namespace {

using testing::add_square;
using testing::plain_truth;
using testing::square;
using testing::turned;
using testing::uniform_frame;

constexpr double kFloat = 2e-6;  // relative: pictures are kept in 32-bit floats
constexpr Rgb16 kFull{255, 255, 255};

std::unique_ptr<Bench> make_bench(const BenchTruth& truth, Mesh mesh) {
  auto bench = Bench::create(truth, std::move(mesh));
  EXPECT_TRUE(bench) << bench.error().what;
  return std::move(*bench);
}

EyeView look(const Bench& bench,
             const RigidTransform& pose = {},
             const Eigen::Vector3d& eye = {0, 0, 1}) {
  auto view = bench.look(pose, eye);
  EXPECT_TRUE(view) << view.error().what;
  return std::move(*view);
}

Image<Rgb32f> observe(const Bench& bench, const EyeView& view, const Rgb16& code) {
  const Image<Rgb16> frame = uniform_frame(bench.truth(), code);
  auto picture = bench.observe(view, frame.view());
  EXPECT_TRUE(picture) << picture.error().what;
  return std::move(*picture);
}

/// XYZ in the middle of the eye's picture, where the object's origin is, for full drive.
Xyz centre_of(const Bench& bench, const RigidTransform& pose, const Eigen::Vector3d& eye) {
  const EyeView view = look(bench, pose, eye);
  return observe(bench, view, kFull)(view.width() / 2, view.height() / 2).cast<double>();
}

TEST(Bench, AWhitePlateAtTheReferenceSendsWhiteBlackAndAmbient) {
  BenchTruth truth = plain_truth();
  truth.projector.black_fraction = 0.01;
  truth.room.ambient_nits = 3;
  const auto bench = make_bench(truth, square(0.3));
  const Xyz seen = centre_of(*bench, {}, {0, 0, 1});
  // The middle pixel's rays end within half a pixel of the axis, where cos^3 is 1 to 1e-5.
  EXPECT_NEAR(seen.y(), 800 * 1.01 + 3, 800 * 1e-5);
  EXPECT_TRUE(bench->board(kFull, {32, 24}, true, false).isApprox(seen, 1e-5));
  EXPECT_NEAR(bench->board(kFull, {32, 24}, false, true).y(), 3, 1e-9);
}

TEST(Bench, LightFallsWithTheSquareOfTheDistance) {
  const auto bench = make_bench(plain_truth(), square(1));
  for (const double distance : {0.5, 0.8, 1.0, 2.0}) {
    RigidTransform pose;
    pose.translation.z() = 1 - distance;
    const double y = centre_of(*bench, pose, {0, 0, 1.0}).y();
    EXPECT_NEAR(y * distance * distance, 800, 800 * 1e-5) << distance << " m";
  }
}

TEST(Bench, LightFallsWithTheCosineOfTheSlant) {
  BenchTruth truth = plain_truth();
  truth.eye.vertical_fov_deg = 0.1;  // so that distance and slant do not vary over the pixel
  const auto bench = make_bench(truth, square(0.3));
  for (const double degrees : {0.0, 20.0, 45.0, 60.0, 80.0}) {
    const double y = centre_of(*bench, turned(degrees, Eigen::Vector3d::UnitY()), {0, 0, 1}).y();
    EXPECT_NEAR(y, 800 * std::cos(degrees * std::numbers::pi / 180), 800 * 1e-4) << degrees;
  }
}

TEST(Bench, ALambertianSurfaceLooksTheSameFromEverywhere) {
  BenchTruth truth = plain_truth();
  truth.eye.vertical_fov_deg = 0.1;
  const auto bench = make_bench(truth, square(0.3));
  for (const Eigen::Vector3d& eye :
       {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0.6, 0, 0.4), Eigen::Vector3d(-0.3, 0.5, 2)})
    EXPECT_NEAR(centre_of(*bench, {}, eye).y(), 800, 800 * 1e-4) << eye.transpose();
}

TEST(Bench, LightIsLinearInTheDrive) {
  BenchTruth truth = plain_truth();
  truth.projector.black_fraction = 0.01;
  truth.projector.blur_px = 0.4;
  truth.room.ambient_nits = 3;
  truth.object.wavelength_nm = {400, 700};
  truth.object.reflectance = {0.3, 0.9};
  const auto bench = make_bench(truth, square(0.3));
  const EyeView view = look(*bench);
  const Image<Rgb32f> dark = observe(*bench, view, {0, 0, 0});
  const Image<Rgb32f> once = observe(*bench, view, {60, 100, 20});
  const Image<Rgb32f> twice = observe(*bench, view, {120, 200, 40});
  for (std::size_t i = 0; i < dark.pixels().size(); ++i) {
    const Rgb32f single = once.pixels()[i] - dark.pixels()[i];
    const Rgb32f doubled = twice.pixels()[i] - dark.pixels()[i];
    EXPECT_TRUE(doubled.isApprox(2 * single, 1e-5F)) << i << ": " << doubled.transpose();
  }
}

TEST(Bench, AnEyeAtTheLensSeesTheFrameAsItIs) {
  // The eye has the projector's pinhole, so its pixel (x, y) sees just raster pixel (x, y): a
  // mirrored, flipped or shifted raster cannot pass.
  const BenchTruth truth = plain_truth();
  for (const char* kind : {"flat", "turned"}) {
    const auto bench = make_bench(truth, square(0.5));
    const EyeView view = look(
        *bench, kind == std::string_view("flat") ? RigidTransform{} : turned(30, {0.6, 0.8, 0}));
    Pcg32 random(8);
    Image<Rgb16> frame(64, 48);
    for (Rgb16& code : frame.pixels()) code = random.uniform() < 0.5 ? Rgb16{0, 0, 0} : kFull;
    const auto picture = bench->observe(view, frame.view());
    ASSERT_TRUE(picture);
    int wrong = 0;
    for (int y = 0; y < 48; ++y)
      for (int x = 0; x < 64; ++x)
        if (((*picture)(x, y).y() > 100) != (frame(x, y)[1] > 0)) ++wrong;
    EXPECT_EQ(wrong, 0) << kind;
  }
}

TEST(Bench, APlateInTheBoardsPlaceSendsWhatTheColorimeterReads) {
  BenchTruth truth = plain_truth();
  ProjectorTruth& p = truth.projector;
  p.focal_px = {40, 40};  // wide, so that slant, distance and vignetting matter
  p.vignetting_exponent = 4;
  p.vignetting_drop = 0.2;
  p.vignetting_off_centre = {0.1, -0.2};
  p.black_fraction = 0.01;
  truth.room.ambient_nits = 5;
  truth.object.wavelength_nm = {400, 700};
  truth.object.reflectance = {0.5, 0.9};
  truth.eye.vertical_fov_deg = 2 * std::atan(24.0 / 40) * 180 / std::numbers::pi;
  truth.eye.samples = 3;
  const auto bench = make_bench(truth, square(2));
  const Image<Rgb32f> picture = observe(*bench, look(*bench), {200, 150, 100});
  for (int y = 0; y < 48; y += 5)
    for (int x = 0; x < 64; x += 5) {
      const Xyz read = bench->board({200, 150, 100}, {x + 0.5, y + 0.5}, true, true);
      // The pixel's mean against its middle: G is curved.
      EXPECT_TRUE(picture(x, y).cast<double>().isApprox(read, 1e-3)) << x << ' ' << y;
    }
}

TEST(Bench, TheEdgeOfThePixelsFootprintIsAveraged) {
  BenchTruth truth = plain_truth();
  truth.eye.samples = 4;
  const auto bench = make_bench(truth, square(0.5));
  // An eye of half the resolution: every pixel sees two by two of the raster's.
  BenchTruth coarse = truth;
  coarse.eye.width = 32;
  coarse.eye.height = 24;
  const auto coarse_bench = make_bench(coarse, square(0.5));
  Pcg32 random(9);
  Image<Rgb16> frame(64, 48);
  for (Rgb16& code : frame.pixels())
    code = {static_cast<std::uint16_t>(255 * random.uniform()), 128, 7};
  const auto fine = bench->observe(look(*bench), frame.view());
  const auto half = coarse_bench->observe(look(*coarse_bench), frame.view());
  ASSERT_TRUE(fine && half);
  for (int y = 0; y < 24; ++y)
    for (int x = 0; x < 32; ++x) {
      const Rgb32f mean = ((*fine)(2 * x, 2 * y) + (*fine)(2 * x + 1, 2 * y) +
                           (*fine)(2 * x, 2 * y + 1) + (*fine)(2 * x + 1, 2 * y + 1)) /
                          4;
      // The fine eye's rays lie at eighths, the coarse one's at quarters of a raster pixel: G
      // differs.
      EXPECT_TRUE((*half)(x, y).isApprox(mean, 1e-3F)) << x << ' ' << y;
    }
}

TEST(Bench, TheFarSideOfASphereGetsNoProjectorLight) {
  BenchTruth truth = plain_truth();
  truth.projector.black_fraction = 0.01;
  truth.room.ambient_nits = 3;
  const auto mesh = load_mesh("sphere");
  ASSERT_TRUE(mesh);
  const auto bench = make_bench(truth, *mesh);
  const EyeView view = look(*bench, {}, {0, 0, -1});
  const Image<Rgb32f> picture = observe(*bench, view, kFull);
  int on_object = 0;
  for (std::size_t i = 0; i < picture.pixels().size(); ++i) {
    const Coverage coverage = view.coverage.pixels()[i];
    EXPECT_NE(coverage, Coverage::kCovered) << i;
    if (coverage == Coverage::kOutside) {
      EXPECT_TRUE(picture.pixels()[i].isZero());
    }
    if (coverage != Coverage::kUnlit) continue;
    ++on_object;
    EXPECT_NEAR(picture.pixels()[i].y(), 3, 3 * kFloat) << i;
  }
  EXPECT_GT(on_object, 500);
}

TEST(Bench, OnePartOfTheObjectShadowsAnother) {
  Mesh mesh = square(0.3);
  add_square(
      mesh, 0.02, 0.5);  // half way to the lens: its shadow on the first is 0.04 m either side
  const auto bench = make_bench(plain_truth(), mesh);
  const EyeView view = look(*bench, {}, {1, 0, 0.6});  // from the side, past the small square
  int shaded = 0;
  for (std::size_t pixel = 0; pixel + 1 < view.first.size(); ++pixel) {
    const std::size_t x = pixel % 64;
    const std::size_t y = pixel / 64;
    for (std::uint32_t i = view.first[pixel]; i < view.first[pixel + 1]; ++i) {
      const EyeSample& sample = view.samples[i];
      if (sample.triangle > 1) continue;  // on the small square itself
      // Position in the plane from the triangle's corners: u and v weigh corners two and three.
      const Mesh& m = mesh;
      const auto& t = m.triangles[sample.triangle];
      const Eigen::Vector3d p = (1.0 - sample.u - sample.v) * m.positions[t[0]] +
                                sample.u * m.positions[t[1]] + sample.v * m.positions[t[2]];
      const double reach = p.cwiseAbs().maxCoeff();
      if (std::abs(reach - 0.04) < 1e-4) continue;
      const bool on_raster = std::abs(p.x()) < 0.0999 && std::abs(p.y()) < 0.0749;
      if (!on_raster) continue;
      EXPECT_EQ(sample.raster_pixel < 0, reach < 0.04) << x << ' ' << y << ": " << p.transpose();
      if (reach < 0.04) ++shaded;
    }
  }
  EXPECT_GT(shaded, 50);
}

TEST(Bench, EveryDriveIsReachableAndMoreThanWhiteIsNot) {
  BenchTruth truth = plain_truth();
  ProjectorTruth& p = truth.projector;
  p.channels[0].exponent = 2.2;
  p.channels[1] = {ChannelTruth::Tone::kSCurve, 0, 2.6, 2.4, 0.5, 535, 20, 1};
  p.leak = 0.02;
  p.interaction = 0.05;
  p.black_fraction = 0.002;
  truth.room.ambient_nits = 2;
  truth.object.reflectance = {0.7};
  const auto bench = make_bench(truth, square(0.3));
  const EyeView view = look(*bench, turned(35, Eigen::Vector3d::UnitX()), {0.2, 0.1, 1});
  Pcg32 random(10);
  const Image<Rgb32f> dark = observe(*bench, view, {0, 0, 0});
  const Image<Rgb32f> white = observe(*bench, view, kFull);
  const Xyz ambient = bench->board({}, {0, 0}, false, true);
  int tried = 0;
  for (int trial = 0; trial < 20; ++trial) {
    Rgb16 code{};
    for (auto& value : code) value = static_cast<std::uint16_t>(256 * random.uniform());
    const Image<Rgb32f> picture = observe(*bench, view, code);
    for (int y = 4; y < 48; y += 7)
      for (int x = 4; x < 64; x += 7) {
        if (view.coverage(x, y) != Coverage::kCovered) continue;
        double geometry = 0;
        const std::size_t pixel = static_cast<std::size_t>(y) * 64 + static_cast<std::size_t>(x);
        for (std::uint32_t i = view.first[pixel]; i < view.first[pixel + 1]; ++i)
          geometry += view.samples[i].geometry;
        geometry /= view.rays_per_pixel;
        EXPECT_TRUE(bench->reachable(picture(x, y).cast<double>(), geometry)) << x << ' ' << y;
        EXPECT_FALSE(bench->reachable(1.05 * white(x, y).cast<double>(), geometry));
        const Xyz half_black = 0.5 * (dark(x, y).cast<double>() + ambient);
        EXPECT_FALSE(bench->reachable(half_black, geometry)) << "darker than black";
        ++tried;
      }
  }
  EXPECT_GT(tried, 200);
}

TEST(Bench, WhereTheProjectorHardlyReachesOnlyTheAmbientLightIsReachable) {
  BenchTruth truth = plain_truth();
  truth.projector.black_fraction = 0.002;
  for (const double ambient_nits : {0.0, 2.0}) {
    truth.room.ambient_nits = ambient_nits;
    const auto bench = make_bench(truth, square(0.3));
    const Xyz ambient = bench->board({}, {0, 0}, false, true);
    for (const double geometry : {0.0, 5e-324, 1e-300, 1e-30, 1e-12, 1e-9})  // below a rounding
      for (const double error : {-kFloat, 0.0, kFloat}) {
        if (ambient_nits > 0 || geometry == 0) {
          EXPECT_TRUE(bench->reachable((1 + error) * ambient, geometry))
              << geometry << ' ' << error;
        }
        EXPECT_FALSE(bench->reachable(1.01 * ambient + Xyz::Constant(0.01), geometry)) << geometry;
        EXPECT_FALSE(bench->reachable(0.99 * ambient - Xyz::Constant(0.01), geometry)) << geometry;
      }
    for (const double geometry : {-1e-9, -1.0, std::nan(""), HUGE_VAL, -HUGE_VAL})
      EXPECT_FALSE(bench->reachable(ambient, geometry)) << geometry;
    for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL})
      for (const double geometry : {0.0, 1e-12, 1.0})
        EXPECT_FALSE(bench->reachable({1, bad, 1}, geometry)) << bad << ' ' << geometry;
  }
}

TEST(Bench, FullDriveIsReachableAtAnyGeometryThoughKeptInFloats) {
  BenchTruth truth = plain_truth();
  truth.projector.interaction = 0.05;
  truth.room.ambient_nits = 2;
  const auto bench = make_bench(truth, square(0.3));
  const Xyz ambient = bench->board({}, {0, 0}, false, true);
  const Xyz full = bench->board(kFull, {32, 24}, true, true) - ambient;  // at G = 1
  for (double geometry = 10; geometry > 1e-12; geometry /= 3) {
    const Xyz sent = geometry * full + ambient;
    EXPECT_TRUE(bench->reachable(sent.cast<float>().cast<double>(), geometry)) << geometry;
    const bool tells = geometry * full.maxCoeff() > 0.01 * ambient.maxCoeff();
    if (tells) {
      EXPECT_FALSE(bench->reachable(sent + 0.05 * geometry * full, geometry)) << geometry;
    }
  }
}

TEST(Bench, APixelIsCoveredHoweverLittleLightItGets) {
  BenchTruth truth = plain_truth();
  truth.eye.vertical_fov_deg *= 1.3;  // so that the raster ends within the eye's picture
  const auto bench = make_bench(truth, square(0.5));
  RigidTransform far = turned(80, Eigen::Vector3d::UnitX());
  far.translation.z() = -9;  // ten times as far and at a slant: G is 0.002
  int on_edge_of_raster = 0;
  for (const RigidTransform& pose : {RigidTransform{}, far}) {
    const EyeView view = look(*bench, pose);
    EXPECT_GT(std::ranges::count(view.coverage.pixels(), Coverage::kCovered), 50);
    for (std::size_t pixel = 0; pixel + 1 < view.first.size(); ++pixel) {
      int lit = 0;
      for (std::uint32_t i = view.first[pixel]; i < view.first[pixel + 1]; ++i)
        if (view.samples[i].raster_pixel >= 0) ++lit;
      const auto hits = static_cast<int>(view.first[pixel + 1] - view.first[pixel]);
      if (hits < view.rays_per_pixel) continue;
      EXPECT_EQ(view.coverage.pixels()[pixel], lit == 0 ? Coverage::kUnlit : Coverage::kCovered)
          << pixel;
      if (lit > 0 && lit < hits) ++on_edge_of_raster;
    }
  }
  EXPECT_GT(on_edge_of_raster, 10);
}

TEST(Bench, ATexturedSurfaceSendsInEachFieldWhatASurfaceOfThatReflectanceDoes) {
  BenchTruth truth = plain_truth();
  truth.projector.black_fraction = 0.002;
  truth.room.ambient_nits = 2;
  truth.object.wavelength_nm = {450, 650};
  truth.object.reflectance = {0.8, 0.4};
  BenchTruth other = truth;
  other.object.reflectance = {0.2, 0.5};
  BenchTruth both = truth;
  both.object.texture = ObjectTruth::Texture::kChecks;
  both.object.texture_fields = 9;
  both.object.texture_reflectance = other.object.reflectance;
  const auto bare = make_bench(truth, square(0.3));
  const auto painted = make_bench(other, square(0.3));
  const auto checks = make_bench(both, square(0.3));
  const Rgb16 code{200, 90, 140};
  const auto picture = [&](const Bench& bench) {
    return observe(bench, look(bench, {}, {0.2, 0.1, 1}), code);
  };
  const Image<Rgb32f> of_bare = picture(*bare);
  const Image<Rgb32f> of_painted = picture(*painted);
  const Image<Rgb32f> of_checks = picture(*checks);
  const EyeView view = look(*checks, {}, {0.2, 0.1, 1});
  std::array<int, 3> seen{};  // bare, painted, an edge
  for (std::size_t pixel = 0; pixel + 1 < view.first.size(); ++pixel) {
    int paint = 0;
    const int rays = static_cast<int>(view.first[pixel + 1] - view.first[pixel]);
    for (std::uint32_t i = view.first[pixel]; i < view.first[pixel + 1]; ++i)
      paint += view.samples[i].painted ? 1 : 0;
    const Rgb32f got = of_checks.pixels()[pixel];
    const Rgb32f at_bare = of_bare.pixels()[pixel];
    const Rgb32f at_painted = of_painted.pixels()[pixel];
    if (rays == 0) continue;
    if (paint == 0) {
      ++seen[0];
      EXPECT_EQ(got, at_bare) << pixel;
    } else if (paint == rays) {
      ++seen[1];
      EXPECT_EQ(got, at_painted) << pixel;
    } else {
      ++seen[2];
      EXPECT_TRUE((got.array() >= at_bare.cwiseMin(at_painted).array() * 0.99F).all()) << pixel;
      EXPECT_TRUE((got.array() <= at_bare.cwiseMax(at_painted).array() * 1.01F).all()) << pixel;
    }
  }
  EXPECT_GT(*std::ranges::min_element(seen), 50);

  // What it sends is in reach of it, on edges too, and is not so if it is of one reflectance alone.
  auto compared = checks->compare(view, of_checks, of_checks);
  ASSERT_TRUE(compared) << compared.error().what;
  EXPECT_EQ(compared->in_gamut_fraction, 1.0);
  const Image<Rgb32f> white = observe(*bare, look(*bare, {}, {0.2, 0.1, 1}), kFull);
  compared = checks->compare(view, white, white);
  ASSERT_TRUE(compared) << compared.error().what;
  EXPECT_NEAR(compared->in_gamut_fraction, 0.5, 0.25);
  EXPECT_TRUE(checks->reachable(painted->board(kFull, {32, 24}, 1, true), 1, 1));
  EXPECT_FALSE(checks->reachable(bare->board(kFull, {32, 24}, 1, true), 1, 1));
  EXPECT_TRUE(checks->reachable(bare->board(kFull, {32, 24}, 1, true), 1, 0));
}

TEST(Bench, RefusesPosesThatMakeNoPicture) {
  const auto bench = make_bench(plain_truth(), square(0.1));
  RigidTransform broken;
  broken.translation.x() = std::nan("");
  EXPECT_FALSE(bench->look(broken, {0, 0, 1}));
  EXPECT_FALSE(bench->look({}, {0, 0, 0}));
  EXPECT_FALSE(bench->look({}, {0, std::nan(""), 1}));
}

TEST(Bench, RefusesAnObjectWithoutTriangles) { EXPECT_FALSE(Bench::create(plain_truth(), Mesh{})); }

}  // namespace
}  // namespace veneer::simulation
