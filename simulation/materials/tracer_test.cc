// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/tracer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "simulation/materials/internal_test_fields.h"
#include "simulation/materials/synthesize.h"

namespace veneer::simulation {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kFloat = 2e-6;  // a few roundings of a float near 1

SynthesisOptions options_for(int size, btf::DirectionSet views, btf::DirectionSet lights) {
  SynthesisOptions options;
  options.size = size;
  options.views = std::move(views);
  options.lights = std::move(lights);
  return options;
}

// Textbook forms in double precision, written apart from microfacet.h: Walter et al. 2007 with
// tangents, Heitz 2014 with Lambda. pi f_r cos_l of the interface alone.
double textbook_interface(const Eigen::Vector3d& n,
                          const Eigen::Vector3d& view,
                          const Eigen::Vector3d& light,
                          double f0,
                          double alpha) {
  const double cos_v = n.dot(view);
  const double cos_l = n.dot(light);
  if (cos_v <= 0.0 || cos_l <= 0.0) return 0.0;
  const Eigen::Vector3d m = (view + light).normalized();
  const double cos_m = std::min(1.0, n.dot(m));
  const double tan_sq = (1.0 - cos_m * cos_m) / (cos_m * cos_m);
  const double a2 = alpha * alpha;
  const double ndf = a2 / (kPi * std::pow(cos_m, 4) * std::pow(a2 + tan_sq, 2));
  const auto lambda = [&](double cosine) {
    return 0.5 * (std::sqrt(1.0 + a2 * (1.0 - cosine * cosine) / (cosine * cosine)) - 1.0);
  };
  const double g = 1.0 / (1.0 + lambda(cos_v) + lambda(cos_l));
  const double f = f0 + (1.0 - f0) * std::pow(1.0 - view.dot(m), 5);
  return kPi * ndf * g * f / (4.0 * cos_v);
}

double textbook_body(double cos_v, double cos_l, double albedo, double f0) {
  if (cos_v <= 0.0 || cos_l <= 0.0) return 0.0;
  const auto passed = [&](double cosine) {
    return 1.0 - f0 - (1.0 - f0) * std::pow(1.0 - cosine, 5);
  };
  return albedo * cos_l * passed(cos_l) * passed(cos_v);
}

TEST(FlatPlane, OfWhiteLambertIsTheCosineOfTheLightForEveryPair) {
  const SynthesisOptions options = options_for(2, btf::bonn_directions(), btf::bonn_directions());
  const TracedSet set(flat_field(8, white_lambert()), options);
  for (int texel = 0; texel < 4; ++texel) {
    for (std::size_t view = 0; view < 81; ++view) {
      for (std::size_t light = 0; light < 81; ++light) {
        for (std::size_t c = 0; c < 3; ++c) {
          EXPECT_NEAR(set.at(texel, view, light, 3 + c), options.lights[light].z(), kFloat)
              << view << ' ' << light;
          EXPECT_EQ(set.at(texel, view, light, c), 0.0) << view << ' ' << light;
        }
      }
    }
  }
}

TEST(FlatPlane, OfGlossMatchesTheTextbookAndIsReciprocal) {
  btf::DirectionSet directions = btf::bonn_directions();
  directions.push_back(toward(89.0, 40.0));
  directions.push_back(toward(89.0, 220.0));
  const std::size_t count = directions.size();
  const SynthesisOptions options = options_for(1, directions, directions);
  // Float in cos_m^2 (alpha^2 - 1) + 1: an ulp of 1 over alpha^2, squared in D, and over cos_v.
  constexpr double kRelative = 3e-4;
  for (const float alpha : {0.1F, 0.35F, 1.0F}) {
    const Surface surface{
        Eigen::Vector3f(0.8F, 0.4F, 0.0F), Eigen::Vector3f(0.04F, 0.3F, 0.9F), alpha};
    const TracedSet set(flat_field(4, surface), options);
    for (std::size_t v = 0; v < count; ++v) {
      for (std::size_t l = 0; l < count; ++l) {
        const double cos_v = directions[v].z();
        const double cos_l = directions[l].z();
        for (std::size_t c = 0; c < 3; ++c) {
          const double f0 = surface.f0[static_cast<int>(c)];
          const double gloss =
              textbook_interface(Eigen::Vector3d::UnitZ(), directions[v], directions[l], f0, alpha);
          const double body = textbook_body(cos_v, cos_l, surface.albedo[static_cast<int>(c)], f0);
          EXPECT_NEAR(set.at(0, v, l, c), gloss, kRelative * gloss + kFloat)
              << v << ' ' << l << ' ' << alpha;
          EXPECT_NEAR(set.at(0, v, l, 3 + c), body, kFloat) << v << ' ' << l << ' ' << alpha;
          const double there = set.at(0, v, l, c) / cos_l;
          EXPECT_NEAR(there, set.at(0, l, v, c) / cos_v, 2.0 * kRelative * there + kFloat)
              << v << ' ' << l;
        }
      }
    }
  }
}

TEST(Parts, AreExactlyZeroWhereTheMaterialHasNoSuchPart) {
  const SynthesisOptions options =
      options_for(8, {toward(0, 0), toward(60, 30)}, {toward(20, 0), toward(70, 200)});
  const TracedSet matte(zigzag(32, 2, 1.0, white_lambert()), options);
  const Surface metal{Eigen::Vector3f::Zero(), Eigen::Vector3f(0.9F, 0.6F, 0.4F), 0.2F};
  const TracedSet glossy(zigzag(32, 2, 1.0, metal), options);
  for (std::size_t i = 0; i < matte.samples().size(); ++i) {
    const bool specular = i % 6 < 3;
    EXPECT_EQ((specular ? matte : glossy).samples()[i], 0.0F) << i;
  }
}

TEST(Shadow, EndsWhereGeometrySays) {
  // Ridges at x = 0 and 1 tile, the valley at 0.5, flanks of 45 degrees; lit from -x at 60 degrees.
  // The edge: 0.5 - x cot(60) = x - 0.5.
  constexpr int kSize = 64;
  const double edge = kSize / (1.0 + 1.0 / std::tan(kPi / 3.0));
  const double lit = std::cos(kPi / 12.0);  // the far flank leans 15 degrees off the light
  for (const bool exact : {true, false}) {
    SynthesisOptions options = options_for(kSize, {toward(0, 0)}, {toward(60, 180)});
    options.bounces = 0;
    options.exact_shadows = exact;
    const TracedSet set(zigzag(kSize, 1, 1.0, white_lambert()), options);
    for (int column = 0; column < kSize; ++column) {
      const double value = set.at(5 * kSize + column, 0, 0, 3);
      // One cell (here a texel) either way for the table's soft edge.
      if (column + 1 < edge - 1.0) {
        EXPECT_EQ(value, 0.0) << column << (exact ? " exact" : " table");
      }
      if (column > edge + 1.0) {
        EXPECT_NEAR(value, lit, 1e-5) << column << (exact ? " exact" : " table");
      }
    }
  }
}

TEST(Orientation, ASlopeThatFacesSmallerRowsIsLitFromPlusY) {
  // Height grows with the row over the tile's upper half: that half faces -row, which is +y.
  constexpr int kSize = 8;
  const HeightField field = sampled_field(
      32,
      10.0,
      [](double, double y) { return 0.3 * (0.5 - std::abs(y - 0.5)); },
      [](double, double) { return white_lambert(); });
  SynthesisOptions options = options_for(kSize, {toward(0, 0)}, {toward(45, 90), toward(45, 270)});
  options.bounces = 0;
  const TracedSet set(field, options);
  const int upper = 1 * kSize + 3;
  const int lower = 6 * kSize + 3;
  EXPECT_GT(set.at(upper, 0, 0, 3), set.at(lower, 0, 0, 3) + 0.2);
  EXPECT_NEAR(set.at(upper, 0, 0, 3), set.at(lower, 0, 1, 3), 1e-5);
}

TEST(Parallax, MovesWhatStandsOutAwayFromTheViewer) {
  constexpr int kSize = 64;
  constexpr float kHeight = 0.1F;
  // A white plateau over columns or rows 16 to 31 of a black plane.
  const auto plateau = [&](bool over_columns) {
    HeightField field = flat_field(kSize, white_lambert());
    for (int row = 0; row < kSize; ++row) {
      for (int column = 0; column < kSize; ++column) {
        const auto i = static_cast<std::size_t>(row * kSize + column);
        const int place = over_columns ? column : row;
        field.heights[i] = place >= 16 && place <= 31 ? kHeight : 0.0F;
        if (place < 16 || place > 30) field.surfaces[i].albedo.setZero();
      }
    }
    return field;
  };
  // 45 degrees: what stands z over the mean plane moves by z.
  const double shift = kSize * kHeight * 0.75;
  const auto centre = [&](const HeightField& field, bool over_columns, const btf::Direction& view) {
    SynthesisOptions options = options_for(kSize, {view}, {toward(0, 0)});
    options.bounces = 0;
    const TracedSet set(field, options);
    double sum = 0.0;
    double weighted = 0.0;
    for (int texel = 0; texel < kSize * kSize; ++texel) {
      const double value = set.at(texel, 0, 0, 3);
      sum += value;
      weighted += value * ((over_columns ? texel % kSize : texel / kSize) + 0.5);
    }
    return weighted / sum;
  };
  constexpr double kNoise = 0.1;  // texels; 16 samples in each of 128 border texels
  EXPECT_NEAR(centre(plateau(true), true, toward(0, 0)), 23.5, kNoise);
  EXPECT_NEAR(centre(plateau(true), true, toward(45, 0)), 23.5 - shift, kNoise);
  EXPECT_NEAR(centre(plateau(true), true, toward(45, 180)), 23.5 + shift, kNoise);
  EXPECT_NEAR(centre(plateau(false), false, toward(45, 90)), 23.5 + shift, kNoise);
  EXPECT_NEAR(centre(plateau(false), false, toward(45, 270)), 23.5 - shift, kNoise);
}

TEST(Interreflection, BrightensAWhiteGrooveAndLosesNothing) {
  SynthesisOptions options = options_for(4, {}, {toward(30, 0)});
  // Views spread evenly over the projected hemisphere: their mean is the reflected share.
  for (int i = 0; i < 6; ++i) {
    const double theta_deg = std::asin(std::sqrt((i + 0.5) / 6.0)) * 180.0 / kPi;
    for (int k = 0; k < 12; ++k) options.views.push_back(toward(theta_deg, 30.0 * k + 7.0));
  }
  options.samples = 64;
  options.exact_shadows = true;
  const auto reflected = [&](int bounces) {
    options.bounces = bounces;
    const TracedSet set(zigzag(16, 2, 1.5, white_lambert()), options);
    double sum = 0.0;
    for (std::size_t view = 0; view < options.views.size(); ++view) sum += set.mean(view, 0, 0);
    return sum / static_cast<double>(options.views.size()) / options.lights[0].z();
  };
  const double direct = reflected(0);
  const double once = reflected(1);
  const double all = reflected(32);
  constexpr double kTolerance = 0.015;  // quadrature over 72 views and noise of 73,728 paths
  EXPECT_GT(once, direct + 0.05);
  EXPECT_GT(all, once + 0.02);
  EXPECT_NEAR(all, 1.0, kTolerance);
}

TEST(Reciprocity, HoldsForTheTilesMeanWithMaskingShadowsAndBounces) {
  const btf::DirectionSet directions{
      toward(5, 10), toward(40, 100), toward(65, 200), toward(75, 350)};
  SynthesisOptions options = options_for(16, directions, directions);
  options.samples = 128;
  options.exact_shadows = true;
  const Surface varnished{
      Eigen::Vector3f(0.9F, 0.6F, 0.3F), Eigen::Vector3f::Constant(0.05F), 0.3F};
  HeightField field = (*find_height_field_material("leather"))->make(16, 3);
  for (Surface& surface : field.surfaces) surface = varnished;
  for (float& height : field.heights) height *= 4.0F;
  const TracedSet set(field, options);
  constexpr double kNoise = 0.02;  // relative
  for (std::size_t a = 0; a < directions.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      const double there = set.mean(a, b, 0) / directions[b].z();
      const double back = set.mean(b, a, 0) / directions[a].z();
      EXPECT_NEAR(there, back, kNoise * there) << a << ' ' << b;
    }
  }
}

TEST(Energy, NoMaterialSendsMoreThanItGets) {
  SynthesisOptions options = options_for(8, {}, {toward(0, 0), toward(45, 20), toward(75, 110)});
  for (int i = 0; i < 8; ++i) {
    const double theta_deg = std::asin(std::sqrt((i + 0.5) / 8.0)) * 180.0 / kPi;
    for (int k = 0; k < 16; ++k) options.views.push_back(toward(theta_deg, 22.5 * k + 5.0));
  }
  options.bounces = 4;
  constexpr double kTolerance =
      0.02;  // quadrature of a lobe of alpha 0.22 over 128 views, and noise
  for_each_material(8, 1, options, [&](std::string_view name, const TracedSet& set) {
    for (std::size_t light = 0; light < options.lights.size(); ++light) {
      for (std::size_t colour = 0; colour < 3; ++colour) {
        double sum = 0.0;
        for (std::size_t view = 0; view < options.views.size(); ++view)
          sum += set.mean(view, light, colour);
        const double share =
            sum / static_cast<double>(options.views.size()) / options.lights[light].z();
        EXPECT_LE(share, 1.0 + kTolerance) << name << ' ' << light << ' ' << colour;
        EXPECT_GT(share, 0.01) << name << ' ' << light << ' ' << colour;
      }
    }
  });
}

TEST(ShadowTable, AgreesWithTracedShadows) {
  SynthesisOptions options = options_for(
      16, {toward(0, 0), toward(45, 60)}, {toward(30, 10), toward(60, 130), toward(75, 250)});
  options.bounces = 0;
  options.samples = 64;
  for (const auto& material : height_field_materials()) {
    const HeightField field = material.make(16, 1);
    options.exact_shadows = true;
    const TracedSet exact(field, options);
    options.exact_shadows = false;
    const TracedSet table(field, options);
    double difference = 0.0;
    double bias = 0.0;
    double sum = 0.0;
    for (std::size_t i = 0; i < exact.samples().size(); ++i) {
      const double step = table.samples()[i] - exact.samples()[i];
      difference += std::abs(step);
      bias += step;
      sum += exact.samples()[i];
    }
    RecordProperty(std::string(material.name) + "_difference", std::to_string(difference / sum));
    RecordProperty(std::string(material.name) + "_bias", std::to_string(bias / sum));
    EXPECT_LT(difference / sum, 0.03) << material.name;
    EXPECT_LT(std::abs(bias / sum), 0.01) << material.name;
  }
}

// A second tracer, for direct light on a wave that is known as a formula: marches in small steps,
// shares nothing with the first but the conventions.
class WaveByMarching {
 public:
  static constexpr double kAmplitude = 0.06;
  static constexpr double kStep = 5e-4;  // tile widths
  static double height(double x, double y) {
    return kAmplitude * (std::sin(2.0 * kPi * x) + 0.5 * std::cos(4.0 * kPi * y));
  }
  static Eigen::Vector3d normal(double x, double y) {
    return Eigen::Vector3d(-kAmplitude * 2.0 * kPi * std::cos(2.0 * kPi * x),
                           kAmplitude * 2.0 * kPi * std::sin(4.0 * kPi * y),
                           1.0)
        .normalized();
  }
  // Unit albedo under an interface; `y` follows the rows.
  static Eigen::Vector2d radiance(
      double x, double y, Eigen::Vector3d view, Eigen::Vector3d light, double f0, double alpha) {
    view.y() = -view.y();
    light.y() = -light.y();
    Eigen::Vector3d p = Eigen::Vector3d(x, y, 0.0) + view * (1.6 * kAmplitude / view.z());
    while (p.z() > height(p.x(), p.y())) p -= kStep * view;
    p += 0.5 * kStep * view;
    const Eigen::Vector3d n = normal(p.x(), p.y());
    const double cos_l = n.dot(light);
    if (cos_l <= 0.0) return Eigen::Vector2d::Zero();
    for (Eigen::Vector3d q = p + 3.0 * kStep * light; q.z() < 1.6 * kAmplitude;
         q += kStep * light) {
      if (q.z() < height(q.x(), q.y())) return Eigen::Vector2d::Zero();
    }
    return {textbook_interface(n, view, light, f0, alpha),
            textbook_body(n.dot(view), cos_l, 1.0, f0)};
  }
};

TEST(Tracer, AgreesWithASecondTracerOnAWave) {
  constexpr int kSize = 4;
  constexpr double kF0 = 0.05;
  constexpr float kAlpha = 0.3F;
  const HeightField field = sampled_field(128, 10.0, &WaveByMarching::height, [&](double, double) {
    return Surface{Eigen::Vector3f::Ones(), Eigen::Vector3f::Constant(kF0), kAlpha};
  });
  SynthesisOptions options = options_for(kSize,
                                         {toward(0, 0), toward(60, 20), toward(75, 130)},
                                         {toward(10, 50), toward(60, 200), toward(75, 300)});
  options.bounces = 0;
  options.samples = 1024;
  const TracedSet set(field, options);
  constexpr int kPlaces = 16;  // along each side of a texel
  // Of a texel's value near 1: places in the texel, the marching's step, the wave cut into patches.
  constexpr double kTolerance = 0.012;
  for (int texel = 0; texel < kSize * kSize; ++texel) {
    for (std::size_t v = 0; v < options.views.size(); ++v) {
      for (std::size_t l = 0; l < options.lights.size(); ++l) {
        Eigen::Vector2d sum = Eigen::Vector2d::Zero();
        for (int i = 0; i < kPlaces * kPlaces; ++i) {
          const double x = (texel % kSize + (i % kPlaces + 0.5) / kPlaces) / kSize;
          const double y = (texel / kSize + (i / kPlaces + 0.5) / kPlaces) / kSize;
          sum += WaveByMarching::radiance(x, y, options.views[v], options.lights[l], kF0, kAlpha);
        }
        sum /= kPlaces * kPlaces;
        EXPECT_NEAR(set.at(texel, v, l, 0), sum[0], kTolerance)
            << "specular " << texel << ' ' << v << ' ' << l;
        EXPECT_NEAR(set.at(texel, v, l, 3), sum[1], kTolerance)
            << "diffuse " << texel << ' ' << v << ' ' << l;
      }
    }
  }
}

TEST(Grazing, ViewsAndLightsGiveFiniteNonNegativeSamples) {
  const btf::DirectionSet grazing{toward(75, 0), toward(89, 0), toward(89, 180), toward(89.8, 77)};
  SynthesisOptions options = options_for(4, grazing, grazing);
  options.bounces = 4;
  for_each_material(4, 1, options, [](std::string_view name, const TracedSet& set) {
    EXPECT_TRUE(std::ranges::all_of(set.samples(), [](float s) {
      return std::isfinite(s) && s >= 0.0F;
    })) << name;
    EXPECT_GT(*std::ranges::max_element(set.samples()), 0.0F) << name;
  });
}

// White bodies in a white furnace: what does not come back at once comes back later, also from
// undersides and through the gaps.
TEST(Bodies, OfWhiteLambertLoseNothing) {
  SynthesisOptions options = options_for(4, {}, {toward(30, 40)});
  for (int i = 0; i < 6; ++i) {
    const double theta_deg = std::asin(std::sqrt((i + 0.5) / 6.0)) * 180.0 / kPi;
    for (int k = 0; k < 12; ++k) options.views.push_back(toward(theta_deg, 30.0 * k + 7.0));
  }
  options.samples = 64;
  options.bounces = 48;
  for (const auto& material : body_materials()) {
    BodyField field = material.make(4, 1);
    field.surface_at = [](const Eigen::Vector3d&, int) { return white_lambert(); };
    const TracedSet set(field, options);
    double sum = 0.0;
    for (std::size_t view = 0; view < options.views.size(); ++view) sum += set.mean(view, 0, 0);
    const double share = sum / static_cast<double>(options.views.size()) / options.lights[0].z();
    EXPECT_NEAR(share, 1.0, 0.02) << material.name;  // 72 views, 73,728 paths
  }
}

TEST(Bodies, AreReciprocalInTheTilesMean) {
  const btf::DirectionSet directions{
      toward(5, 10), toward(40, 100), toward(65, 200), toward(75, 350)};
  SynthesisOptions options = options_for(8, directions, directions);
  options.samples = 256;
  for (const auto& material : body_materials()) {
    const TracedSet set(material.make(8, 3), options);
    constexpr double kNoise = 0.03;  // relative
    for (std::size_t a = 0; a < directions.size(); ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        const double there = set.mean(a, b, 0) / directions[b].z();
        const double back = set.mean(b, a, 0) / directions[a].z();
        EXPECT_NEAR(there, back, kNoise * there) << material.name << ' ' << a << ' ' << b;
      }
    }
  }
}

// A plate that hovers at z over a white ground, seen and lit along the normal and aslant: it stands
// z tan(theta) off, and so does its shadow; under it light comes through.
TEST(Bodies, HoverWithParallaxAndACastShadow) {
  constexpr int kSize = 32;
  constexpr double kHeight = 0.2;
  constexpr double kHalfWidth = 0.1;
  BodyField field;
  field.resolution = kSize;
  field.bodies = {endless_bar(false, 0.5, kHeight, kHalfWidth, 1e-3, 5e-4)};
  field.surface_at = [](const Eigen::Vector3d&, int body) {
    Surface surface = white_lambert();
    if (body != BodyField::kGround) surface.albedo.setZero();
    return surface;
  };
  SynthesisOptions options =
      options_for(kSize, {toward(0, 0), toward(45, 180)}, {toward(0, 0), toward(45, 0)});
  options.bounces = 0;
  options.samples = 64;
  const TracedSet set(field, options);
  // What is dark: the plate, and where it hides the light, as shares of the tile's width.
  const auto dark = [&](std::size_t view, std::size_t light, double low, double high) {
    double sum = 0.0;
    for (int column = 0; column < kSize; ++column)
      if ((column + 0.5) / kSize > low && (column + 0.5) / kSize < high)
        sum += 1.0 - set.at(5 * kSize + column, view, light, 3) / options.lights[light].z();
    return sum / kSize;
  };
  constexpr double kNoise = 0.005;
  constexpr double kColumn = 0.25 / kSize;  // where a window ends within a texel
  const double width = 2.0 * kHalfWidth;
  EXPECT_NEAR(dark(0, 0, 0.35, 0.65), width, kNoise);
  EXPECT_NEAR(dark(0, 0, 0.0, 1.0), width, kNoise);
  // From -x: the ground plane's point behind it is moved to +x.
  EXPECT_NEAR(dark(1, 0, 0.60, 0.85), width, kColumn);
  // The shadow under a vertical light stays at 0.5, and shows beside the plate.
  EXPECT_NEAR(dark(1, 0, 0.35, 0.60), width, kColumn);
  EXPECT_NEAR(dark(1, 0, 0.0, 1.0), 2.0 * width, 2.0 * kNoise);
  // Lit from +x the shadow falls to -x, and both are seen.
  EXPECT_NEAR(dark(0, 1, 0.15, 0.40), width, kColumn);
  EXPECT_NEAR(dark(0, 1, 0.0, 1.0), 2.0 * width, 2.0 * kNoise);
}

}  // namespace
}  // namespace veneer::simulation
