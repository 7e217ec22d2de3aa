// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <tuple>
#include <vector>

#include "base/random.h"
#include "base/testing/fp_trap.h"
#include "base/testing/temporary_folder.h"
#include "btf/models/components.h"
#include "tests/stability/gl_probe.h"
#include "tests/stability/subjects.h"

// Every model on data at the edge of what a sample set can be.
namespace veneer::stability {
namespace {

using btf::Direction;
using btf::DirectionSet;
using btf::FitOptions;
using btf::Material;
using btf::SampleSet;
using btf::SampleSetInfo;

constexpr double kDegree = std::numbers::pi / 180.0;

// What must happen.
enum class Must {
  kHold,    // the measured samples come back to the storage's rounding
  kBound,   // values are finite, none over kMostRise times the largest sample
  kBeZero,  // zero everywhere, exactly
  kRefuse,  // with a text
};

// What grids and lobes may rise to between and beyond the samples (lobe_fit.cc bounds a lobe by 4),
// of the largest sample over the cosine of the highest light: under a single light at 75 degrees,
// formulas say what one along the normal would show.
constexpr double kMostRise = 5.0;
// The shader against radiance(): the GPU filters with 8 bits of a texel's distance in each of three
// dimensions and places directions in float (render/model_shader_test.cc), of what is drawn.
constexpr double kGlDifference = 8e-3;

struct Extreme {
  const char* name;
  Must must;
  /// Value of the diffuse part; the specular part is 0 but where `specular` is set.
  double (*sample)(const SampleSetInfo& info, int texel, int view, int light, int channel);
  void (*shape)(SampleSetInfo& info) = [](SampleSetInfo&) {};
  void (*choose)(FitOptions& options, int terms) = [](FitOptions&, int) {};
  /// For kRefuse: words of the message.
  std::vector<const char*> words = {};
  /// Refused by models other than texel-colours only.
  bool for_texel_colours = false;
  /// Whether only models of components hold it; formulas are then bounded.
  bool components_hold = false;
  /// Beside the storage's own: what float16 leaves of the samples, of the largest.
  double more_error = 0.0;
};
void PrintTo(const Extreme& extreme, std::ostream* out) { *out << extreme.name; }

double black(const SampleSetInfo&, int, int, int, int) { return 0.0; }
double matte(const SampleSetInfo& info, int texel, int, int light, int channel) {
  return lambert(info, texel, light, channel);
}
double alike(const SampleSetInfo& info, int, int, int light, int channel) {
  return lambert(info, 0, light, channel);
}
double constant(const SampleSetInfo&, int, int, int, int) { return 0.5; }
double red(const SampleSetInfo& info, int texel, int, int light, int channel) {
  return channel == 0 ? lambert(info, texel, light, 0) : 0.0;
}
double negative(const SampleSetInfo& info, int texel, int, int light, int channel) {
  return -lambert(info, texel, light, channel);
}
double noise(const SampleSetInfo& info, int texel, int view, int light, int channel) {
  const int pair = view * static_cast<int>(info.lights.size()) + light;
  return Pcg32(static_cast<std::uint64_t>(pair * 3 + channel), static_cast<std::uint64_t>(texel))
      .uniform();
}
double signed_noise(const SampleSetInfo& info, int texel, int view, int light, int channel) {
  return 2.0 * noise(info, texel, view, light, channel) - 1.0;
}
double impulse(const SampleSetInfo&, int texel, int view, int light, int channel) {
  return texel == 5 && view == 3 && light == 2 && channel == 1 ? 1000.0 : 0.0;
}
double with_value(double value, const SampleSetInfo& info, int texel, int view, int light, int c) {
  return texel == 5 && view == 3 && light == 2 ? value : matte(info, texel, view, light, c);
}
double not_a_number(const SampleSetInfo& info, int texel, int view, int light, int channel) {
  return with_value(std::nan(""), info, texel, view, light, channel);
}
double infinite(const SampleSetInfo& info, int texel, int view, int light, int channel) {
  return with_value(HUGE_VAL, info, texel, view, light, channel);
}
double minus_infinite(const SampleSetInfo& info, int texel, int view, int light, int channel) {
  return with_value(-HUGE_VAL, info, texel, view, light, channel);
}
// Of texels: 1 to 1e-6 of the brightest.
double range_of_texels(const SampleSetInfo& info, int texel, int, int light, int channel) {
  return 100.0 * std::pow(10.0, -6.0 * texel / 11.0) * lambert(info, 0, light, channel);
}
// Of pairs.
double range_of_pairs(const SampleSetInfo& info, int texel, int view, int light, int channel) {
  const auto spread = static_cast<double>(info.views.size() + info.lights.size() - 2);
  return 100.0 * std::pow(10.0, -6.0 * (view + light) / std::max(spread, 1.0)) *
         colour(texel, channel);
}
double denormal(const SampleSetInfo& info, int texel, int, int light, int channel) {
  return 6e-5 * lambert(info, texel, light, channel);
}
double least_denormal(const SampleSetInfo&, int texel, int, int, int) {
  return texel % 2 == 0 ? 0x1p-24 : 0.0;
}
double largest(const SampleSetInfo& info, int texel, int, int light, int channel) {
  return 65504.0 / 0.9 * lambert(info, texel, light, channel);
}

void one_texel(SampleSetInfo& info) { info.width = info.height = 1; }
void one_view(SampleSetInfo& info) { info.views = {Direction::UnitZ()}; }
void one_slanting_view(SampleSetInfo& info) {
  info.views = {btf::direction_from_angles({75 * kDegree, 0.7})};
}
void one_light(SampleSetInfo& info) { info.lights = {Direction::UnitZ()}; }
void one_slanting_light(SampleSetInfo& info) {
  info.lights = {btf::direction_from_angles({75 * kDegree, 4.0})};
}
void one_of_each(SampleSetInfo& info) {
  one_texel(info);
  one_view(info);
  one_slanting_light(info);
}
DirectionSet horizon() {
  DirectionSet all = btf::testing::ring(7, 90 * kDegree);
  all.erase(all.begin());
  for (Direction& direction : all) direction.z() = 0.0;
  return all;
}
void lights_on_horizon(SampleSetInfo& info) { info.lights = horizon(); }
void views_on_horizon(SampleSetInfo& info) { info.views = horizon(); }
void one_plane(SampleSetInfo& info) {
  info.views.clear();
  for (const double theta : {-70.0, -30.0, 0.0, 20.0, 60.0})
    info.views.push_back(btf::direction_from_angles({theta * kDegree, 0.4}));
  info.lights = info.views;
}
void ring_alone(SampleSetInfo& info) {
  info.views.erase(info.views.begin());
  info.lights.erase(info.lights.begin());
}
// Twice kEqualDirections apart, which is as near as a set allows.
void nearly_equal(SampleSetInfo& info) {
  for (DirectionSet* set : {&info.views, &info.lights})
    set->push_back((set->at(4) + 2e-6 * Direction::UnitZ().cross(set->at(4))).normalized());
}
void one_row(SampleSetInfo& info) {
  info.width = 12;
  info.height = 1;
}
void tiny_scale(SampleSetInfo& info) { info.scale = btf::kLeastScale; }
void huge_scale(SampleSetInfo& info) { info.scale = btf::kMostScale; }

void components(FitOptions& options, int terms, int each) {
  options.components = terms == 2 ? fmt::format("{0}+{0}", each) : fmt::format("{}", each);
}
void one_component(FitOptions& options, int terms) { components(options, terms, 1); }
void most_components(FitOptions& options, int terms) {
  components(options, terms, btf::kMostComponents);
}
void too_many_components(FitOptions& options, int terms) {
  components(options, terms, btf::kMostComponents + 1);
}
void clusters_of(FitOptions& options, int clusters) { options.clusters = clusters; }

std::vector<Extreme> extremes() {
  const auto clusters = []<int count>(std::integral_constant<int, count>) {
    return +[](FitOptions& options, int) { clusters_of(options, count); };
  };
  const auto angular = []<int nodes>(std::integral_constant<int, nodes>) {
    return +[](FitOptions& options, int) { options.angular = nodes; };
  };
  const auto as_it_is = +[](SampleSetInfo&) {};
  return {
      // Data.
      {.name = "AllZero", .must = Must::kBeZero, .sample = &black},
      {.name = "Constant", .must = Must::kHold, .sample = &constant, .components_hold = true},
      {.name = "TexelsAlike", .must = Must::kHold, .sample = &alike},
      {.name = "OneChannel", .must = Must::kHold, .sample = &red},
      {.name = "FullRankNoise", .must = Must::kBound, .sample = &noise},
      {.name = "NoiseOfBothSigns", .must = Must::kBound, .sample = &signed_noise},
      {.name = "AllNegative", .must = Must::kBeZero, .sample = &negative},
      {.name = "OneBrightSample", .must = Must::kBound, .sample = &impulse},
      {.name = "TexelsOverSixDecades",
       .must = Must::kHold,
       .sample = &range_of_texels,
       .more_error = 0x1p-10},
      {.name = "PairsOverSixDecades", .must = Must::kBound, .sample = &range_of_pairs},
      {.name = "HalfDenormals", .must = Must::kHold, .sample = &denormal, .more_error = 0x1p-10},
      {.name = "LeastHalfDenormal",
       .must = Must::kHold,
       .sample = &least_denormal,
       .components_hold = true},
      {.name = "LargestHalf", .must = Must::kHold, .sample = &largest},
      {.name = "TinyScale", .must = Must::kHold, .sample = &matte, .shape = &tiny_scale},
      {.name = "HugeScale", .must = Must::kHold, .sample = &matte, .shape = &huge_scale},
      {.name = "NanSample",
       .must = Must::kRefuse,
       .sample = &not_a_number,
       .words = {"NaN or infinite", "texel 5", "row 1", "column 1", "view 3", "light 2", "repair"}},
      {.name = "InfiniteSample",
       .must = Must::kRefuse,
       .sample = &infinite,
       .words = {"NaN or infinite", "texel 5", "view 3", "light 2"}},
      {.name = "MinusInfiniteSample",
       .must = Must::kRefuse,
       .sample = &minus_infinite,
       .words = {"NaN or infinite", "texel 5", "view 3", "light 2"}},
      // Sizes.
      {.name = "OneTexel", .must = Must::kHold, .sample = &matte, .shape = &one_texel},
      {.name = "OneRow", .must = Must::kHold, .sample = &matte, .shape = &one_row},
      {.name = "OneView", .must = Must::kHold, .sample = &matte, .shape = &one_view},
      {.name = "OneSlantingView",
       .must = Must::kHold,
       .sample = &matte,
       .shape = &one_slanting_view},
      {.name = "OneLight", .must = Must::kHold, .sample = &matte, .shape = &one_light},
      {.name = "OneSlantingLight",
       .must = Must::kHold,
       .sample = &matte,
       .shape = &one_slanting_light},
      {.name = "OneOfEach", .must = Must::kHold, .sample = &matte, .shape = &one_of_each},
      // Directions.
      {.name = "LightsOnHorizon",
       .must = Must::kBeZero,
       .sample = &matte,
       .shape = &lights_on_horizon},
      {.name = "ViewsOnHorizon", .must = Must::kHold, .sample = &matte, .shape = &views_on_horizon},
      {.name = "DirectionsInOnePlane", .must = Must::kHold, .sample = &matte, .shape = &one_plane},
      {.name = "NoDirectionAtThePole", .must = Must::kHold, .sample = &matte, .shape = &ring_alone},
      {.name = "DirectionsNearlyEqual",
       .must = Must::kHold,
       .sample = &matte,
       .shape = &nearly_equal},
      // Options.
      {.name = "OneCluster",
       .must = Must::kHold,
       .sample = &matte,
       .choose = clusters(std::integral_constant<int, 1>())},
      {.name = "MoreClustersThanTexels",
       .must = Must::kHold,
       .sample = &matte,
       .choose = clusters(std::integral_constant<int, 256>())},
      {.name = "NoCluster",
       .must = Must::kRefuse,
       .sample = &matte,
       .choose = clusters(std::integral_constant<int, 0>()),
       .words = {"clusters is 0", "1 to 256"}},
      {.name = "OneComponent",
       .must = Must::kHold,
       .sample = &alike,
       .shape = as_it_is,
       .choose = &one_component},
      {.name = "MostComponentsOfRankOne",
       .must = Must::kHold,
       .sample = &alike,
       .shape = as_it_is,
       .choose = &most_components},
      {.name = "TooManyComponents",
       .must = Must::kRefuse,
       .sample = &matte,
       .choose = &too_many_components,
       .words = {"components", "1 to 16"}},
      {.name = "CoarsestGrid",
       .must = Must::kBound,
       .sample = &matte,
       .choose = angular(std::integral_constant<int, FitOptions::kLeastAngular>())},
      {.name = "FinestGrid",
       .must = Must::kHold,
       .sample = &matte,
       .choose = angular(std::integral_constant<int, FitOptions::kMostAngular>())},
      {.name = "GridTooCoarse",
       .must = Must::kRefuse,
       .sample = &matte,
       .choose = angular(std::integral_constant<int, FitOptions::kLeastAngular - 1>()),
       .words = {"angular is 3", "4 to 32"}},
      {.name = "GridTooFine",
       .must = Must::kRefuse,
       .sample = &matte,
       .choose = angular(std::integral_constant<int, FitOptions::kMostAngular + 1>()),
       .words = {"angular is 33", "4 to 32"}},
      {.name = "MostLobes",
       .must = Must::kHold,
       .sample = &matte,
       .choose = [](FitOptions& options, int) { options.lobes = FitOptions::kMostLobes; }},
      {.name = "NoLobe",
       .must = Must::kRefuse,
       .sample = &matte,
       .choose = [](FitOptions& options, int) { options.lobes = 0; },
       .words = {"lobes is 0", "1 to 4"}},
      {.name = "FullSpaceAndOneIteration",
       .must = Must::kHold,
       .sample = &matte,
       .choose =
           [](FitOptions& options, int) {
             options.basis = 0;
             options.iterations = 1;
           }},
      {.name = "MipLevelOfOneTexel",
       .must = Must::kRefuse,
       .sample = &alike,
       .shape = [](SampleSetInfo& info) { info.width = info.height = 2; },
       .choose = [](FitOptions& options, int) { options.mip_levels = 2; },
       .words = {"mip_levels is 2", "leave it out"},
       .for_texel_colours = true},
      {.name = "UnknownPrecision",
       .must = Must::kRefuse,
       .sample = &matte,
       .choose = [](FitOptions& options, int) { options.precision = "float64"; },
       .words = {"precision is \"float64\""}},
  };
}

using Case = std::tuple<Subject, Extreme>;

class ModelOnData : public ::testing::TestWithParam<Case> {
 protected:
  [[nodiscard]] Result<SampleSet> make_set() const {
    const Extreme& extreme = std::get<Extreme>(GetParam());
    SampleSetInfo info = usual_info();
    extreme.shape(info);
    VENEER_ASSIGN(auto writer, btf::SampleSetWriter::create(folder_.path() / "a.btfset", info));
    for (int texel = 0; texel < info.texel_count(); ++texel) {
      auto out = writer.texel(texel).begin();
      for (int view = 0; view < static_cast<int>(info.views.size()); ++view)
        for (int light = 0; light < static_cast<int>(info.lights.size()); ++light) {
          for (int c = 0; c < 3; ++c) *out++ = Eigen::half(0.0F);
          for (int c = 0; c < 3; ++c)
            *out++ = Eigen::half(static_cast<float>(extreme.sample(info, texel, view, light, c)));
        }
    }
    VENEER_TRY(writer.finish());
    return SampleSet::open(folder_.path() / "a.btfset");
  }

  TemporaryFolder folder_;
};

// The subtractive form has one colour for what all texels lose in the shade.
bool is_beyond(const Subject& subject, const Extreme& extreme) {
  const auto own_hues = extreme.sample;
  return subject.options.form == "subtractive" && (own_hues == &matte || own_hues == &negative ||
                                                   own_hues == &denormal || own_hues == &largest);
}

bool has_room_for_levels(const Subject& subject, const SampleSetInfo& info) {
  return subject.options.mip_levels == 1 || std::min(info.width, info.height) > 1;
}

double highest_light(const SampleSet& set) {
  double z = 0.1;  // of lights on the horizon, whose samples are 0
  for (const Direction& light : set.info().lights) z = std::max(z, light.z());
  return z;
}

double largest_of(const SampleSet& set) {
  return set.info().scale * set.largest_stored(0, set.info().texel_count());
}

// What the factors alone give, in float; finite whatever else holds.
void check_reconstruction(const Subject& subject,
                          const Extreme& extreme,
                          const SampleSet& set,
                          const Material& material) {
  const FpTrap trap;
  const double most = largest_of(set);
  const bool holds = extreme.must == Must::kHold && !is_beyond(subject, extreme) &&
                     (subject.has_components || !extreme.components_hold);
  std::vector<float> wanted(static_cast<std::size_t>(set.info().pair_count()) * 3);
  std::vector<float> got(wanted.size());
  for (int texel = 0; texel < set.info().texel_count(); ++texel) {
    set.rgb(texel, btf::Part::kTotal, wanted);
    material.reconstruct(texel, got);
    for (std::size_t i = 0; i < got.size(); ++i) {
      ASSERT_TRUE(std::isfinite(got[i])) << "texel " << texel << ", value " << i;
      ASSERT_LE(std::abs(double(got[i])), kMostRise * most) << "texel " << texel;
      if (holds) {
        ASSERT_NEAR(
            double(got[i]), double(wanted[i]), (subject.storage_error + extreme.more_error) * most)
            << "texel " << texel << ", value " << i;
      }
    }
  }
}

void check_draws(const Subject& subject,
                 const Extreme& extreme,
                 const SampleSet& set,
                 const Material& material) {
  const double most = largest_of(set);
  const DirectionSet directions = awkward_directions();
  const std::vector<Query> queries =
      rounded_to_float(cross(directions, directions, material.width() * material.height()));
  const std::vector<Eigen::Vector3d> values = evaluate(material, queries);
  const auto where = [&](std::size_t i) {
    return fmt::format("texel {}, view {} {} {}, light {} {} {}",
                       queries[i].texel,
                       queries[i].view.x(),
                       queries[i].view.y(),
                       queries[i].view.z(),
                       queries[i].light.x(),
                       queries[i].light.y(),
                       queries[i].light.z());
  };
  for (std::size_t i = 0; i < values.size(); ++i) {
    ASSERT_TRUE(values[i].allFinite()) << where(i);
    ASSERT_GE(values[i].minCoeff(), 0.0) << where(i);
    ASSERT_LE(values[i].maxCoeff(), kMostRise * most / highest_light(set)) << where(i);
    if ((extreme.must == Must::kBeZero && !is_beyond(subject, extreme)) ||
        !(queries[i].light.z() > 0.0)) {
      ASSERT_EQ(values[i], Eigen::Vector3d::Zero()) << where(i);
    }
  }
  const auto probe = GlProbe::create(material);
  if (!probe && probe.error().code == Errc::kUnavailable) {
    ::testing::Test::RecordProperty("gl", "absent");
    return;
  }
  ASSERT_TRUE(probe) << probe.error().what;
  const std::vector<Eigen::Vector3d> drawn = probe->draw(queries);
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    ASSERT_TRUE(drawn[i].allFinite()) << where(i);
    ASSERT_LE((drawn[i] - values[i]).cwiseAbs().maxCoeff(), kGlDifference * most)
        << where(i) << ": drawn " << drawn[i].transpose() << ", evaluated "
        << values[i].transpose();
  }
}

TEST_P(ModelOnData, HoldsIsBoundedOrRefuses) {
  Subject subject = std::get<Subject>(GetParam());
  const Extreme& extreme = std::get<Extreme>(GetParam());
  const auto set = make_set();
  ASSERT_TRUE(set) << set.error().what;
  extreme.choose(subject.options, (*btf::find_model(subject.model))->terms);
  const auto material = fit(subject, *set);
  const bool refuses =
      extreme.must == Must::kRefuse &&
      !(extreme.for_texel_colours && std::string(subject.model) == "texel-colours");
  const bool has_levels = has_room_for_levels(subject, set->info());
  ASSERT_EQ(material.has_value(), !refuses && has_levels)
      << (material ? "" : material.error().what);
  if (!has_levels) {
    EXPECT_NE(material.error().what.find("mip_levels is 2"), std::string::npos)
        << material.error().what;
    return;
  }
  if (refuses) {
    for (const char* word : extreme.words)
      EXPECT_NE(material.error().what.find(word), std::string::npos)
          << word << " is not in: " << material.error().what;
    return;
  }
  check_reconstruction(subject, extreme, *set, **material);
  check_draws(subject, extreme, *set, **material);
}

INSTANTIATE_TEST_SUITE_P(Stability,
                         ModelOnData,
                         ::testing::Combine(::testing::ValuesIn(subjects().begin(),
                                                                subjects().end()),
                                            ::testing::ValuesIn(extremes())),
                         [](const ::testing::TestParamInfo<Case>& test) {
                           return fmt::format("{}_{}",
                                              std::get<Subject>(test.param).name,
                                              std::get<Extreme>(test.param).name);
                         });

// A set with equal directions is refused before there is a model; a stored material by each.
class ModelLoaded : public ::testing::TestWithParam<Subject> {};

TEST_P(ModelLoaded, RefusesEqualDirectionsByTheirNumbers) {
  const TemporaryFolder folder;
  const SampleSet set = glossy_set(folder.path() / "a.btfset");
  const auto material = fit(GetParam(), set);
  ASSERT_TRUE(material) << material.error().what;
  const std::filesystem::path path = folder.path() / "a.safetensors";
  for (const bool views : {true, false}) {
    // The directions of the material in memory are borrowed by its contents.
    const auto& directions = views ? (*material)->views() : (*material)->lights();
    auto& editable = const_cast<DirectionSet&>(directions);
    const Direction kept = editable[4];
    editable[4] = editable[2];
    editable[4].x() += 1e-7;
    ASSERT_TRUE(btf::save_material(**material, path, {}));
    editable[4] = kept;
    const auto loaded = btf::load_material(path);
    ASSERT_FALSE(loaded);
    EXPECT_EQ(loaded.error().code, Errc::kBadFormat);
    EXPECT_NE(loaded.error().what.find(views ? "views: directions 2 and 4 are equal"
                                             : "lights: directions 2 and 4 are equal"),
              std::string::npos)
        << loaded.error().what;
  }
}

INSTANTIATE_TEST_SUITE_P(Stability,
                         ModelLoaded,
                         ::testing::ValuesIn(subjects().begin(), subjects().end()),
                         [](const ::testing::TestParamInfo<Subject>& test) {
                           return std::string(test.param.name);
                         });

TEST(SetAtExtreme, RefusesDirectionsThatAreEqualOrAnUlpApart) {
  const TemporaryFolder folder;
  for (const double apart : {0.0, 1e-16, 1e-7, 9e-7}) {
    SampleSetInfo info = usual_info();
    info.views.push_back((info.views[2] + apart * Direction::UnitZ()).normalized());
    const auto writer = btf::SampleSetWriter::create(folder.path() / "a.btfset", info);
    ASSERT_FALSE(writer) << apart;
    EXPECT_NE(writer.error().what.find("views: directions 2 and 17 are equal"), std::string::npos)
        << writer.error().what;
  }
}

}  // namespace
}  // namespace veneer::stability
