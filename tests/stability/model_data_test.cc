// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>
#include <vector>

#include "base/testing/fp_trap.h"
#include "base/testing/temporary_folder.h"
#include "tests/stability/extremes.h"
#include "tests/stability/gl_probe.h"
#include "tests/stability/subjects.h"

// Every model on data at the edge of what a sample set can be.
namespace veneer::stability {
namespace {

using btf::Direction;
using btf::DirectionSet;
using btf::Material;
using btf::SampleSet;
using btf::SampleSetInfo;

// What grids and lobes may rise to between and beyond the samples (lobe_fit.cc bounds a lobe by 4),
// of the largest sample over the cosine of the highest light: under a single light at 75 degrees,
// formulas say what one along the normal would show.
constexpr double kMostRise = 5.0;
// The shader against radiance(): the GPU filters with 8 bits of a texel's distance in each of three
// dimensions and places directions in float (render/model_shader_test.cc), of what is drawn.
constexpr double kGlDifference = 8e-3;

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
  return subject.options.form == "subtractive" && has_own_hues(extreme);
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
