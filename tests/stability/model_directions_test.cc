// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <tuple>
#include <vector>

#include "base/random.h"
#include "base/testing/temporary_folder.h"
#include "btf/elevated_concentric.h"
#include "btf/models/direction_lookup.h"
#include "tests/stability/gl_probe.h"
#include "tests/stability/subjects.h"

// Every model at the directions where its parametrisation has an edge.
namespace veneer::stability {
namespace {

using btf::Direction;
using btf::DirectionSet;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;
constexpr double kBorder = 75.0 * kPi / 180.0;  // where the data end
constexpr int kTexels = 12;

// What must hold beside: finite, not negative, at most kMostRise times the largest sample, zero for
// lights on the horizon and below it, and the shader within kGlDifference of radiance().
enum class Law {
  kBounded,     // no more than that
  kZero,        // zero, exactly, on the GPU too
  kContinuous,  // of queries 2i and 2i + 1, which differ by 1e-7 or less: Subject::jump
  kEqual,       // of queries 2i and 2i + 1: to rounding
  kMeasured,    // queries are measured pairs: what the factors alone give
  kFading,      // query 2i is at the border of the data and 2i + 1 beyond: falls with the cosine
};

constexpr double kMostRise = 5.0;
constexpr double kGlDifference = 8e-3;  // see model_data_test.cc
constexpr double kRounding = 1e-9;
// What a grid of 8 nodes makes of measured directions that lie between them. It is largest at the
// pole, where an even number of nodes has none and which the highlight has its peak at: 0.147.
constexpr double kGridError = 0.16;

Direction at(double theta, double phi) { return btf::direction_from_angles({theta, phi}); }

class Directions {
 public:
  // Anywhere up to the border of the data.
  Direction inside() {
    const double lowest = std::cos(kBorder);
    const double z = lowest + (1.0 - lowest) * random_.uniform();
    return at(std::acos(std::min(z, 1.0)), 2 * kPi * random_.uniform());
  }
  double azimuth() { return 2 * kPi * random_.uniform(); }
  double uniform() { return random_.uniform(); }
  int below(int count) { return static_cast<int>(random_.next() % static_cast<unsigned>(count)); }
  // Pairs of queries that have `a` and `b` in turn as views and as lights.
  void add_pairs(const Direction& a, const Direction& b, std::vector<Query>& queries) {
    const Direction other = inside();
    const int texel = below(kTexels);
    for (const Direction& direction : {a, b}) queries.push_back({texel, direction, other});
    for (const Direction& direction : {a, b}) queries.push_back({texel, other, direction});
  }

 private:
  Pcg32 random_{11};
};

struct Family {
  const char* name;
  Law law;
  std::vector<Query> (*queries)();
};
void PrintTo(const Family& family, std::ostream* out) { *out << family.name; }

constexpr int kCount = 60;

// `make` gives two directions beside each other.
template <class Make>
std::vector<Query> pairs(const Make& make) {
  Directions directions;
  std::vector<Query> queries;
  for (int i = 0; i < kCount; ++i) {
    const auto [a, b] = make(directions, i);
    directions.add_pairs(a, b, queries);
  }
  return queries;
}
using Two = std::pair<Direction, Direction>;

std::vector<Query> grazing(bool view) {
  Directions directions;
  std::vector<Query> queries;
  for (int i = 0; i < kCount; ++i)
    for (const double over : {1e-2, 1e-4, 1e-7, 1e-12, 0.0}) {
      const Direction flat = at(kPi / 2 - over, directions.azimuth());
      const Direction other = directions.inside();
      queries.push_back({i % kTexels, view ? flat : other, view ? other : flat});
    }
  return queries;
}
std::vector<Query> grazing_views() { return grazing(true); }
std::vector<Query> grazing_lights() { return grazing(false); }
std::vector<Query> both_grazing() {
  Directions directions;
  std::vector<Query> queries;
  for (int i = 0; i < kCount; ++i)
    for (const double over : {1e-3, 1e-6, 1e-9})
      queries.push_back({i % kTexels,
                         at(kPi / 2 - over * directions.uniform(), directions.azimuth()),
                         at(kPi / 2 - over * directions.uniform(), directions.azimuth())});
  return queries;
}
std::vector<Query> lights_below() {
  Directions directions;
  std::vector<Query> queries;
  for (int i = 0; i < kCount; ++i)
    for (const double under : {0.0, 1e-12, 1e-6, 0.1, 1.0, kPi / 2}) {
      Direction light = at(kPi / 2 + under, directions.azimuth());
      light.z() = std::min(light.z(), 0.0);
      queries.push_back({i % kTexels, directions.inside(), light});
    }
  return queries;
}
std::vector<Query> views_below() {
  Directions directions;
  std::vector<Query> queries;
  for (int i = 0; i < kCount; ++i)
    for (const double under : {1e-12, 1e-6, 0.05, 0.5}) {
      const Direction view = at(kPi / 2 + under, directions.azimuth());
      const Direction light = directions.inside();
      queries.push_back({i % kTexels, {view.x(), view.y(), 0.0}, light});
      queries.push_back({i % kTexels, view, light});
    }
  return queries;
}
std::vector<Query> all_along_the_normal() {
  std::vector<Query> queries;
  for (int texel = 0; texel < kTexels; ++texel)
    queries.push_back({texel, Direction::UnitZ(), Direction::UnitZ()});
  return queries;
}
std::vector<Query> about_the_pole() {
  return pairs([](Directions& directions, int i) -> Two {
    const double theta = std::pow(10.0, -7.5 - 0.1 * i);
    const double phi = directions.azimuth();
    return {at(theta, phi), at(theta, phi + kPi)};
  });
}
std::vector<Query> azimuth_seam() {
  return pairs([](Directions& directions, int) -> Two {
    const double theta = std::acos(directions.uniform());
    const double aside = 5e-8 * directions.uniform();
    return {at(theta, aside), at(theta, 2 * kPi - aside)};
  });
}
std::vector<Query> folds_of_the_square() {
  return pairs([](Directions& directions, int i) -> Two {
    const double theta = std::acos(directions.uniform());
    const double fold = kPi / 4 * (i % 8);
    return {at(theta, fold - 4e-8), at(theta, fold + 4e-8)};
  });
}
// On the lines of the square's grid of `cells`: tables of 256 cells, volumes of 7.
std::vector<Query> lines_of(int cells) {
  Directions directions;
  std::vector<Query> queries;
  for (int i = 0; i < kCount; ++i) {
    const double line = double(1 + directions.below(cells - 1)) / cells;
    const double along = directions.uniform();
    const Eigen::Vector2d st =
        i % 2 == 0 ? Eigen::Vector2d(line, along) : Eigen::Vector2d(along, line);
    const Eigen::Vector2d aside =
        i % 2 == 0 ? Eigen::Vector2d(1e-9, 0.0) : Eigen::Vector2d(0.0, 1e-9);
    directions.add_pairs(
        btf::direction_from_square(st - aside), btf::direction_from_square(st + aside), queries);
  }
  return queries;
}
std::vector<Query> lines_of_the_table() { return lines_of(btf::DirectionLookup::kSide); }
std::vector<Query> lines_of_the_grid() { return lines_of(7); }
// The map that is looked up differs from the exact one by 9e-4: its own corners, where octants
// meet.
std::vector<Query> corners_of_the_square() {
  return pairs([](Directions&, int i) -> Two {
    const double s = i % 2 == 0 ? 1e-9 : 1.0 - 1e-9;
    const double t = i / 2 % 2 == 0 ? 1e-9 : 1.0 - 1e-9;
    return {btf::direction_from_square({s, t}),
            btf::direction_from_square({std::round(s), std::round(t)})};
  });
}
// View = light, mirrored, and opposite on the horizon, where the half vector is zero.
std::vector<Query> poles_of_the_half_angle() {
  Directions directions;
  std::vector<Query> queries;
  for (int i = 0; i < kCount; ++i) {
    const Direction view = directions.inside();
    const double phi = directions.azimuth();
    const Direction flat = at(kPi / 2, phi);
    const Direction aside = 1e-8 * view.cross(Direction(0.3, 0.4, -0.2));
    for (const Direction& light : {view, Direction(-view.x(), -view.y(), view.z())}) {
      queries.push_back({i % kTexels, view, light});
      queries.push_back({i % kTexels, view, (light + aside).normalized()});
    }
    const Direction against(-flat.x(), -flat.y(), 1e-9);
    queries.push_back({i % kTexels, flat, against});
    queries.push_back({i % kTexels, flat, {against.x(), against.y(), 2e-9}});
  }
  return queries;
}
std::vector<Query> off_unit_length() {
  return pairs([](Directions& directions, int i) -> Two {
    const Direction d = directions.inside();
    return {d, d * (1.0 + (i % 2 == 0 ? 1e-7 : -1e-7))};
  });
}
std::vector<Query> one_ulp_from_measured() {
  return pairs([](Directions& directions, int i) -> Two {
    const DirectionSet measured = measured_directions();
    const Direction d = measured[static_cast<std::size_t>(directions.below(17))];
    Direction beside = d;
    beside[i % 3] = std::nextafter(d[i % 3], i % 2 == 0 ? 2.0 : -2.0);
    return {d, beside};
  });
}
std::vector<Query> measured_pairs() {
  const DirectionSet measured = measured_directions();
  std::vector<Query> queries;
  for (int texel = 0; texel < kTexels; texel += 5)
    for (const Direction& view : measured)
      for (const Direction& light : measured) queries.push_back({texel, view, light});
  return queries;
}
std::vector<Query> edge_of_the_data() {
  return pairs([](Directions& directions, int) -> Two {
    const double phi = directions.azimuth();
    return {at(kBorder - 4e-8, phi), at(kBorder + 4e-8, phi)};
  });
}
std::vector<Query> beyond_the_data() {
  Directions directions;
  std::vector<Query> queries;
  for (int i = 0; i < 40; ++i)
    for (const double theta : {76.0, 80.0, 85.0, 89.0, 89.99}) {
      const double phi = kPi / 5 * (i % 10);  // of measured lights
      const Direction view = directions.inside();
      queries.push_back({i % kTexels, view, at(kBorder, phi)});
      queries.push_back({i % kTexels, view, at(theta * kPi / 180.0, phi)});
    }
  return queries;
}

const std::vector<Family>& families() {
  static const std::vector<Family> kFamilies{
      {"GrazingViews", Law::kBounded, &grazing_views},
      {"GrazingLights", Law::kBounded, &grazing_lights},
      {"BothGrazing", Law::kBounded, &both_grazing},
      {"LightsBelowTheHorizon", Law::kZero, &lights_below},
      {"ViewsBelowTheHorizon", Law::kEqual, &views_below},
      {"AllAlongTheNormal", Law::kMeasured, &all_along_the_normal},
      {"AboutThePole", Law::kContinuous, &about_the_pole},
      {"AzimuthSeam", Law::kContinuous, &azimuth_seam},
      {"FoldsOfTheSquare", Law::kContinuous, &folds_of_the_square},
      {"CornersOfTheSquare", Law::kContinuous, &corners_of_the_square},
      {"LinesOfTheTable", Law::kContinuous, &lines_of_the_table},
      {"LinesOfTheGrid", Law::kContinuous, &lines_of_the_grid},
      {"PolesOfTheHalfAngle", Law::kContinuous, &poles_of_the_half_angle},
      {"OffUnitLength", Law::kContinuous, &off_unit_length},
      {"OneUlpFromMeasured", Law::kContinuous, &one_ulp_from_measured},
      {"MeasuredPairs", Law::kMeasured, &measured_pairs},
      {"EdgeOfTheData", Law::kContinuous, &edge_of_the_data},
      {"BeyondTheData", Law::kFading, &beyond_the_data},
  };
  return kFamilies;
}

// A subject's material and its shader, for all families.
struct Prepared {
  std::unique_ptr<btf::Material> material;
  std::unique_ptr<GlProbe> probe;  // none without GL
  double most = 0.0;               // of the samples
};
std::map<std::string, Prepared>& all_prepared() {
  static std::map<std::string, Prepared> all;
  return all;
}
class ModelAtDirections : public ::testing::TestWithParam<std::tuple<Subject, Family>> {
 protected:
  // Before the context goes.
  static void TearDownTestSuite() { all_prepared().clear(); }
  void SetUp() override {
    const Subject& subject = std::get<Subject>(GetParam());
    Prepared& prepared = all_prepared()[subject.name];
    if (!prepared.material) {
      const TemporaryFolder folder;
      const btf::SampleSet set = glossy_set(folder.path() / "a.btfset");
      auto material = fit(subject, set);
      ASSERT_TRUE(material) << material.error().what;
      prepared.material = std::move(*material);
      prepared.most = set.largest_stored(0, kTexels);
      auto probe = GlProbe::create(*prepared.material);
      if (!probe && probe.error().code != Errc::kUnavailable) FAIL() << probe.error().what;
      if (probe) prepared.probe = std::make_unique<GlProbe>(std::move(*probe));
    }
    prepared_ = &prepared;
  }

  const Prepared* prepared_ = nullptr;
};

bool is_table(const Subject& subject) {
  return std::string(subject.model) == "lpca" || std::string(subject.model) == "eigen-texture";
}

std::string text_of(const Query& query) {
  return fmt::format("texel {}, view {} {} {}, light {} {} {}",
                     query.texel,
                     query.view.x(),
                     query.view.y(),
                     query.view.z(),
                     query.light.x(),
                     query.light.y(),
                     query.light.z());
}

// Of queries 2i and 2i + 1. Not where one light is under the horizon and one above: there phong's
// highlight, which has no cosine, is cut.
double largest_step(const std::vector<Query>& queries, const std::vector<Vector3d>& values) {
  double largest = 0.0;
  for (std::size_t i = 0; i + 1 < values.size(); i += 2)
    if ((queries[i].light.z() > 0.0) == (queries[i + 1].light.z() > 0.0))
      largest = std::max(largest, (values[i + 1] - values[i]).cwiseAbs().maxCoeff());
  return largest;
}

void check_measured(const Subject& subject,
                    const Prepared& prepared,
                    const std::vector<Query>& queries,
                    const std::vector<Vector3d>& values) {
  const btf::Material& material = *prepared.material;
  std::vector<float> rgb(material.views().size() * material.lights().size() * 3);
  const auto index = [](const DirectionSet& set, const Direction& direction) {
    return std::ranges::max_element(set, {}, [&](const Direction& d) { return d.dot(direction); }) -
           set.begin();
  };
  const bool grid = subject.has_components && !is_table(subject);
  const double tolerance = grid ? kGridError : 1e-3;
  double largest = 0.0;
  for (std::size_t i = 0; i < queries.size(); ++i) {
    material.reconstruct(queries[i].texel, rgb);
    const auto pair = index(material.views(), queries[i].view) *
                          static_cast<std::ptrdiff_t>(material.lights().size()) +
                      index(material.lights(), queries[i].light);
    const Vector3d wanted =
        Eigen::Map<const Eigen::Vector3f>(&rgb[static_cast<std::size_t>(3 * pair)])
            .cast<double>()
            .cwiseMax(0.0);
    largest = std::max(largest, (values[i] - wanted).cwiseAbs().maxCoeff());
    ASSERT_LE((values[i] - wanted).cwiseAbs().maxCoeff(), tolerance * prepared.most)
        << text_of(queries[i]);
  }
  ::testing::Test::RecordProperty("error", fmt::format("{:.3g}", largest / prepared.most));
}

// Tables follow docs/CONVENTIONS.md, "Outside the data". Grids are within what their nodes leave of
// it. Formulas have an answer of their own there, which the cosine takes to 0; but not phong's
// highlight, which is cut at the horizon.
void check_fading(const Subject& subject,
                  const Prepared& prepared,
                  const std::vector<Query>& queries,
                  const std::vector<Vector3d>& values) {
  constexpr double kTableError = 1e-3;
  constexpr double kSteepest = 8.0;  // of a formula: the value over the cosine, of the largest
  if (std::string(subject.model) == "phong") return;
  for (std::size_t i = 0; i + 1 < values.size(); i += 2) {
    const double share = queries[i + 1].light.z() / queries[i].light.z();
    const double off = (values[i + 1] - share * values[i]).cwiseAbs().maxCoeff();
    if (subject.has_components) {
      ASSERT_LE(off, (is_table(subject) ? kTableError : kGridError) * prepared.most)
          << text_of(queries[i + 1]);
    } else {
      ASSERT_LE(values[i + 1].maxCoeff(), kSteepest * queries[i + 1].light.z() * prepared.most)
          << text_of(queries[i + 1]);
    }
  }
}

TEST_P(ModelAtDirections, KeepsItsLaw) {
  const auto& [subject, family] = GetParam();
  const double most = prepared_->most;
  const std::vector<Query> queries = family.queries();
  const std::vector<Vector3d> values = evaluate(*prepared_->material, queries);
  double brightest = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    ASSERT_TRUE(values[i].allFinite()) << text_of(queries[i]);
    ASSERT_GE(values[i].minCoeff(), 0.0) << text_of(queries[i]);
    ASSERT_LE(values[i].maxCoeff(), kMostRise * most) << text_of(queries[i]);
    if (!(queries[i].light.z() > 0.0) || family.law == Law::kZero) {
      ASSERT_EQ(values[i], Vector3d::Zero()) << text_of(queries[i]);
    }
    brightest = std::max(brightest, values[i].maxCoeff());
  }
  if (family.law == Law::kContinuous || family.law == Law::kEqual || family.law == Law::kMeasured) {
    EXPECT_GT(brightest, 0.05 * most) << "nothing was drawn";
  }
  const double step = largest_step(queries, values) / most;
  if (family.law == Law::kContinuous) {
    RecordProperty("step", fmt::format("{:.3g}", step));
    EXPECT_LE(step, subject.jump);
  }
  if (family.law == Law::kEqual) {
    EXPECT_LE(step, kRounding);
  }
  if (family.law == Law::kMeasured) check_measured(subject, *prepared_, queries, values);
  if (family.law == Law::kFading) check_fading(subject, *prepared_, queries, values);

  if (!prepared_->probe) return;
  const std::vector<Query> rounded = rounded_to_float(queries);
  const std::vector<Vector3d> wanted = evaluate(*prepared_->material, rounded);
  const std::vector<Vector3d> drawn = prepared_->probe->draw(rounded);
  // Float may fall into the next cell of a table.
  const double tolerance = kGlDifference + (family.law == Law::kContinuous ? subject.jump : 0.0);
  double largest = 0.0;
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    ASSERT_TRUE(drawn[i].allFinite()) << text_of(rounded[i]);
    const double off = (drawn[i] - wanted[i]).cwiseAbs().maxCoeff();
    largest = std::max(largest, off);
    ASSERT_LE(off, tolerance * most) << text_of(rounded[i]) << ": drawn " << drawn[i].transpose()
                                     << ", evaluated " << wanted[i].transpose();
    if (family.law == Law::kZero) {
      ASSERT_EQ(drawn[i], Vector3d::Zero()) << text_of(rounded[i]);
    }
  }
  RecordProperty("gl", fmt::format("{:.3g}", largest / most));
}

INSTANTIATE_TEST_SUITE_P(Stability,
                         ModelAtDirections,
                         ::testing::Combine(::testing::ValuesIn(subjects().begin(),
                                                                subjects().end()),
                                            ::testing::ValuesIn(families())),
                         [](const ::testing::TestParamInfo<std::tuple<Subject, Family>>& test) {
                           return fmt::format("{}_{}",
                                              std::get<Subject>(test.param).name,
                                              std::get<Family>(test.param).name);
                         });

}  // namespace
}  // namespace veneer::stability
