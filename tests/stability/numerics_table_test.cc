// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "base/random.h"
#include "base/safetensors.h"
#include "base/testing/temporary_folder.h"
#include "btf/importers/importer.h"
#include "tests/stability/gl_probe.h"
#include "tests/stability/subjects.h"

// The figures of docs/NUMERICS.md: prints them, and holds them to bounds.
namespace veneer::stability {
namespace {

namespace fs = std::filesystem;
using btf::Direction;
using btf::Material;
using btf::SampleSet;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180.0;

// Differences of two evaluations, of the set's largest sample.
struct Error {
  double most = 0.0;
  double rms = 0.0;
};
Error error_of(const std::vector<Vector3d>& a, const std::vector<Vector3d>& b, double range) {
  Error error;
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Vector3d off = (a[i] - b[i]) / range;
    error.most = std::max(error.most, off.cwiseAbs().maxCoeff());
    sum += off.squaredNorm() / 3.0;
  }
  error.rms = std::sqrt(sum / static_cast<double>(a.size()));
  return error;
}
std::string text_of(const Error& error) {
  return fmt::format("{:.1e} / {:.1e}", error.most, error.rms);
}

std::vector<Query> any_queries(int texels, int count) {
  Pcg32 random(3);
  std::vector<Query> queries;
  for (int i = 0; i < count; ++i) {
    const Direction view = btf::testing::random_direction(random);
    queries.push_back({i % texels, view, btf::testing::random_direction(random)});
  }
  return rounded_to_float(queries);
}

// The material with every stored float16 moved by a step up or down in one of twelve, whose
// variance is that of rounding (a twelfth of a step squared): so much a rounding more or less
// matters.
Result<std::unique_ptr<Material>> rounded_otherwise(const Material& material,
                                                    const fs::path& path) {
  VENEER_TRY(btf::save_material(material, path, {}));
  const fs::path moved = path.string() + ".moved";
  {
    VENEER_ASSIGN(const SafetensorsFile file, SafetensorsFile::open(path));
    Material::Contents contents = material.contents();
    std::ranges::stable_sort(contents.tensors, std::greater{}, [](const auto& tensor) {
      return size_of(tensor.spec.dtype);
    });
    std::vector<TensorSpec> specs;
    for (const auto& tensor : contents.tensors) specs.push_back(tensor.spec);
    VENEER_ASSIGN(SafetensorsWriter writer,
                  SafetensorsWriter::create(moved, specs, file.metadata()));
    Pcg32 random(17);
    for (const auto& tensor : contents.tensors) {
      const TensorSpec& spec = tensor.spec;
      const TensorView view{spec.dtype, spec.shape, tensor.bytes};
      const std::string& name = spec.name;
      const auto copy = [&view, &writer, &name]<class T>(T) {
        std::ranges::copy(view.as<T>(), writer.tensor<T>(name).begin());
      };
      switch (spec.dtype) {
        case DType::kU8:
          copy(std::uint8_t{});
          break;
        case DType::kU16:
          copy(std::uint16_t{});
          break;
        case DType::kI32:
          copy(std::int32_t{});
          break;
        case DType::kF32:
          copy(float{});
          break;
        case DType::kF64:
          copy(double{});
          break;
        case DType::kF16:
          std::ranges::transform(
              view.as<Eigen::half>(), writer.tensor<Eigen::half>(name).begin(), [&](auto h) {
                const auto bits = Eigen::numext::bit_cast<std::uint16_t>(h);
                const std::uint32_t chance = random.next() % 24;
                const auto magnitude = static_cast<std::uint16_t>(bits & 0x7fffU);
                // Exact are zeros, the ones that functions are normalised to, and the bounds of
                // exponents, 1 and 200.
                constexpr std::uint16_t kOne = 0x3c00;
                constexpr std::uint16_t kTwoHundred = 0x5a40;
                if (chance > 1 || magnitude == 0 || magnitude == kOne || magnitude == kTwoHundred)
                  return h;
                return Eigen::numext::bit_cast<Eigen::half>(
                    static_cast<std::uint16_t>(chance == 0 ? bits + 1 : bits - 1));
              });
          break;
      }
    }
    VENEER_TRY(writer.finish());
  }
  return btf::load_material(moved);
}

struct Row {
  std::string name;
  std::optional<Error> gpu;
  Error half;
  std::optional<Error> bytes;
};

void print(const std::string& title, const std::vector<Row>& rows) {
  std::printf("%s: max / rms of the largest sample\n", title.c_str());
  std::printf("| model | float32 (GL) | float16 | 8 bit |\n|---|---|---|---|\n");
  for (const Row& row : rows)
    std::printf("| %s | %s | %s | %s |\n",
                row.name.c_str(),
                row.gpu ? text_of(*row.gpu).c_str() : "no GL",
                text_of(row.half).c_str(),
                row.bytes ? text_of(*row.bytes).c_str() : "");
  std::fflush(stdout);
}

// Of the rms. Float16 rounds by up to 2^-12 of a number, and models sum a few; bytes by 1/254 and
// 1/510. GPUs filter with 8 bits of the place between texels, software with more.
constexpr double kMostHalf = 1e-3;
constexpr double kMostGpu = 2e-3;
constexpr double kMostByte = 4e-3;

void table_of(const std::string& title, const SampleSet& set) {
  const TemporaryFolder folder;
  const double range = set.largest_stored(0, set.info().texel_count());
  const std::vector<Query> queries = any_queries(set.info().texel_count(), 4096);
  std::vector<Row> rows;
  for (const Subject& subject : subjects()) {
    if (!set.info().polarised && std::string(subject.model) == "dichromatic-lpca") continue;
    SCOPED_TRACE(subject.name);
    const auto material = fit(subject, set);
    ASSERT_TRUE(material) << material.error().what;
    const std::vector<Vector3d> values = evaluate(**material, queries);
    Row row;
    row.name = subject.name;
    if (const auto probe = GlProbe::create(**material)) {
      row.gpu = error_of(probe->draw(queries), values, range);
      EXPECT_LE(row.gpu->rms, kMostGpu);
    }
    const auto moved = rounded_otherwise(**material, folder.path() / "a.safetensors");
    ASSERT_TRUE(moved) << moved.error().what;
    row.half = error_of(evaluate(**moved, queries), values, range);
    EXPECT_LE(row.half.rms, kMostHalf);
    EXPECT_GT(row.half.most, 0.0) << "nothing was moved";
    if (subject.options.precision == "8bit") {
      Subject finer = subject;
      finer.options.precision = "float16";
      const auto fine = fit(finer, set);
      ASSERT_TRUE(fine) << fine.error().what;
      row.bytes = error_of(values, evaluate(**fine, queries), range);
      EXPECT_LE(row.bytes->rms, kMostByte);
    }
    rows.push_back(row);
  }
  print(title, rows);
}

TEST(Numerics, PrintsTheTableOfAFormula) {
  const TemporaryFolder folder;
  table_of("a glossy formula, 4 x 3 texels, 17 x 17 directions",
           glossy_set(folder.path() / "a.btfset"));
}

TEST(Numerics, PrintsTheTableOfTheWallpaper) {
  const char* data = std::getenv("VENEER_DATA");
  const fs::path source = fs::path(data == nullptr ? "" : data) / "btfbase" / "wallpaper";
  if (data == nullptr || !fs::exists(source))
    GTEST_SKIP() << "real data absent: VENEER_DATA names no folder with btfbase/wallpaper";
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "wallpaper.btfset";
  SilentProgress progress;
  const Status imported = (*btf::find_importer("btfbase"))
                              ->run(source, path, {.crop = btf::Crop{96, 96, 8, 8}}, progress);
  ASSERT_TRUE(imported) << imported.error().what;
  const auto set = SampleSet::open(path);
  ASSERT_TRUE(set) << set.error().what;
  table_of("wallpaper, 8 x 8 texels, 81 x 81 directions", *set);
}

// Of the formula that the glossy set was made of.
Vector3d truth(int texel, const Direction& view, const Direction& light) {
  if (!(light.z() > 0.0)) return Vector3d::Zero();
  const double base = Direction(-light.x(), -light.y(), light.z()).dot(view);
  const double gloss = 0.3 * (1 + texel % 3) / 3.0 * std::pow(std::max(base, 0.0), 8.0);
  return light.z() * (Vector3d(colour(texel, 0), colour(texel, 1), colour(texel, 2)) +
                      Vector3d::Constant(gloss));
}

// How far beyond the data, which end at 75 degrees, a model's answers still are near the truth.
TEST(Numerics, PrintsTheTableOfAnglesBeyondTheData) {
  const TemporaryFolder folder;
  const SampleSet set = glossy_set(folder.path() / "a.btfset", btf::bonn_directions());
  const double range = set.largest_stored(0, 12);
  constexpr std::array kAngles{60.0, 70.0, 75.0, 80.0, 85.0, 89.0};
  std::printf(
      "rms of the largest sample, against the truth, at polar angles in degrees\n| model |");
  for (const char* of : {"view", "light"})
    for (const double angle : kAngles) std::printf(" %s %g |", of, angle);
  std::printf("\n|---|%s\n", std::string(kAngles.size() * 2 * 4, '-').c_str());
  for (Subject subject : subjects()) {
    subject.options.angular = 16;
    const auto material = fit(subject, set);
    ASSERT_TRUE(material) << material.error().what;
    std::printf("| %s |", subject.name);
    for (const bool of_view : {true, false})
      for (const double angle : kAngles) {
        Pcg32 random(5);
        std::vector<Query> queries;
        for (int i = 0; i < 400; ++i) {
          const double phi = 2.0 * std::numbers::pi * random.uniform();
          const Direction there = btf::direction_from_angles({angle * kDegree, phi});
          const Direction other = btf::testing::random_direction(random, std::cos(75.0 * kDegree));
          queries.push_back({i % 12, of_view ? there : other, of_view ? other : there});
        }
        std::vector<Vector3d> wanted;
        for (const Query& query : queries)
          wanted.push_back(truth(query.texel, query.view, query.light));
        const Error error = error_of(evaluate(**material, queries), wanted, range);
        std::printf(" %.3f |", error.rms);
        // A light fades to nothing with the truth; a view's highlight is not known beyond the data,
        // and was 0.3 of a sample of 1.2 at most.
        EXPECT_LE(error.rms, of_view ? 0.2 : 0.15) << subject.name << " " << angle;
      }
    std::printf("\n");
  }
  std::fflush(stdout);
}

}  // namespace
}  // namespace veneer::stability
