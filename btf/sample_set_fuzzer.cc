// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <filesystem>
#include <fstream>

#include "base/files.h"
#include "base/testing/fuzzing.h"
#include "base/testing/temporary_folder.h"
#include "btf/sample_set.h"

namespace veneer::btf {
namespace {

/// The files of a set; the input holds one after the other, with form feeds between.
constexpr std::array kFiles{"set.toml", "views.csv", "lights.csv", "samples.safetensors"};

/// What is opened holds what its info says, to the last sample.
std::string laws_of(const SampleSet& set) {
  const SampleSetInfo& info = set.info();
  const auto pairs = static_cast<std::size_t>(info.pair_count());
  for (const DirectionSet* directions : {&info.views, &info.lights})
    for (const Direction& d : *directions)
      if (!(std::abs(d.norm() - 1) < 1e-5)) return "a direction that is no unit vector";
  const auto finite = set.check_finite();
  std::vector<float> rgb(3 * pairs);
  for (const int texel : {0, info.texel_count() - 1}) {
    if (set.stored(texel).size() != pairs * static_cast<std::size_t>(info.channel_count()))
      return "a texel of another size";
    set.rgb(texel, Part::kTotal, rgb);
    for (const float value : rgb)
      if (finite && !std::isfinite(value)) return "what was called finite is not";
  }
  return "";
}

Verdict read(std::string_view text) {
  static const TemporaryFolder kFolder;
  for (std::size_t i = 0; i < kFiles.size(); ++i) {
    const std::size_t end =
        i + 1 < kFiles.size() ? std::min(text.find('\f'), text.size()) : text.size();
    std::ofstream(kFolder.path() / kFiles.at(i), std::ios::binary) << text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  const auto set = SampleSet::open(kFolder.path());
  if (!set) return refused(set.error());
  return accepted(laws_of(*set));
}

std::string seed(bool polarised) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "a.btfset";
  SampleSetInfo info;
  info.width = 2;
  info.height = 1;
  info.polarised = polarised;
  info.views = {{0, 0, 1}, {0.6, 0, 0.8}};
  info.lights = {{0, 0, 1}};
  auto writer = SampleSetWriter::create(path, info);
  VENEER_CHECK(writer.has_value());
  for (int texel = 0; texel < 2; ++texel)
    for (Eigen::half& value : writer->texel(texel)) value = Eigen::half(0.25F);
  VENEER_CHECK(writer->finish().has_value());
  std::string text;
  for (const char* file : kFiles) text += (text.empty() ? "" : "\f") + *read_text(path / file);
  return text;
}

}  // namespace
}  // namespace veneer::btf

const veneer::FuzzedReader& veneer::fuzzed_reader() {
  using namespace btf;
  static const FuzzedReader kReader{&read, {seed(false), seed(true)}, {16 << 10, 96}};
  return kReader;
}
