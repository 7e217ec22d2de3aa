// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/traced_sample.h"

#include <fmt/format.h>
#include <stdlib.h>

#include <cmath>
#include <optional>
#include <string>
#include <system_error>

#include "btf/sample_set.h"
#include "simulation/materials/synthesize.h"

namespace veneer::simulation::studio {
namespace {

/// FNV-1a (Fowler, Noll, Vo): only a name for a file, which is looked into before it is believed.
class Fingerprint {
 public:
  void add(std::uint64_t number) {
    for (unsigned byte = 0; byte < 8; ++byte) {
      hash_ ^= (number >> (8 * byte)) & 0xffU;
      hash_ *= 0x100000001b3ULL;
    }
  }
  void add(const btf::DirectionSet& directions) {
    add(directions.size());
    for (const btf::Direction& d : directions)
      for (const double coordinate : d)
        add(static_cast<std::uint64_t>(std::llround(coordinate * 1e9)));
  }
  [[nodiscard]] std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325ULL;
};

// A set keeps its directions as degrees with some digits.
constexpr double kSameDirection = 1e-5;

bool same(const btf::DirectionSet& a, const btf::DirectionSet& b) {
  if (a.size() != b.size()) return false;
  for (std::size_t i = 0; i < a.size(); ++i)
    if (!((a[i] - b[i]).norm() < kSameDirection)) return false;
  return true;
}

bool fits(const btf::SampleSet& set, const SynthesisOptions& options) {
  const btf::SampleSetInfo& info = set.info();
  return info.polarised && info.width == options.size && info.height == options.size &&
         same(info.views, options.views) && same(info.lights, options.lights) && set.check_finite();
}

/// Removes a folder when it goes.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::error_code ignored;
    std::string name =
        (std::filesystem::temp_directory_path(ignored) / "veneer-studio-XXXXXX").string();
    // Where none can be made, writing to the name fails and says so.
    (void)::mkdtemp(name.data());
    path_ = name;
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace

Result<TracedSample> TracedSample::trace(const StudioTruth& truth,
                                         int size,
                                         const btf::DirectionSet& views,
                                         const btf::DirectionSet& lights,
                                         const std::filesystem::path& cache,
                                         Progress& progress) {
  SynthesisOptions options;
  options.size = size;
  options.views = views;
  options.lights = lights;
  options.samples = truth.samples;
  options.seed = truth.material_seed;
  VENEER_ASSIGN(const HeightFieldMaterial* material, find_height_field_material(truth.material));

  Fingerprint fingerprint;
  for (const int number : {options.size, options.samples, options.bounces})
    fingerprint.add(static_cast<std::uint64_t>(number));
  fingerprint.add(options.seed);
  fingerprint.add(views);
  fingerprint.add(lights);
  std::optional<TemporaryFolder> temporary;
  if (cache.empty()) temporary.emplace();
  const std::filesystem::path path =
      (temporary ? temporary->path() : cache) /
      fmt::format("{}-{:016x}.btfset", truth.material, fingerprint.value());

  auto set = btf::SampleSet::open(path);
  if (!set || !fits(*set, options)) {
    if (const Status traced = synthesize(*material, path, options, progress); !traced)
      return fail_while("tracing the studio's sample", traced.error());
    set = btf::SampleSet::open(path);
    if (!set) return fail_while("tracing the studio's sample", set.error());
  }

  TracedSample sample;
  sample.size_ = size;
  sample.lights_ = static_cast<int>(lights.size());
  for (const btf::Direction& light : lights)
    sample.sum_of_cosines_ += static_cast<float>(light.z());
  sample.texels_.resize(views.size() * lights.size() * static_cast<std::size_t>(size) *
                        static_cast<std::size_t>(size));
  const auto scale = static_cast<float>(set->info().scale);
  for (int row = 0; row < size; ++row)
    for (int column = 0; column < size; ++column) {
      const auto stored = set->stored(row * size + column);
      std::size_t at = 0;
      for (int view = 0; view < static_cast<int>(views.size()); ++view)
        for (int light = 0; light < sample.lights_; ++light) {
          Texel& texel = sample.texels_[sample.place(view, light, column, row)];
          for (const auto part : {&Texel::specular, &Texel::diffuse})
            for (int c = 0; c < 3; ++c) (texel.*part)[c] = scale * static_cast<float>(stored[at++]);
        }
    }
  return sample;
}

std::size_t TracedSample::place(int view, int light, int column, int row) const {
  const auto tile = static_cast<std::size_t>(view) * static_cast<std::size_t>(lights_) +
                    static_cast<std::size_t>(light);
  const auto size = static_cast<std::size_t>(size_);
  return (tile * size + static_cast<std::size_t>(row % size_)) * size +
         static_cast<std::size_t>(column % size_);
}

TracedSample::Texel TracedSample::texel(int view, int light, int column, int row) const {
  return texels_[place(view, light, column, row)];
}

Rgb32f TracedSample::in_room_light(int view, int column, int row) const {
  Rgb32f sum = Rgb32f::Zero();
  for (int light = 0; light < lights_; ++light) {
    const Texel lit = texel(view, light, column, row);
    sum += lit.specular + lit.diffuse;
  }
  return sum / sum_of_cosines_;
}

}  // namespace veneer::simulation::studio
