// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstring>
#include <functional>
#include <map>
#include <numeric>

#include "base/testing/fuzzing.h"
#include "base/testing/memory_file.h"
#include "btf/fit_region.h"
#include "btf/material.h"
#include "btf/models/internal_test_models.h"

// A material is thousands of bytes that all hang together, so that a byte changed at random is
// mostly refused by the container. The input is therefore a list of changes to a good material of
// one of the models, and the container is written well; safetensors_fuzzer.cc minds the container.
namespace veneer::btf {
namespace {

struct Tensor {
  std::string name;
  DType dtype = DType::kU8;
  std::vector<std::int64_t> shape;
  std::string bytes;
};
struct Contents {
  std::vector<Tensor> tensors;
  std::map<std::string, std::string> metadata;
};

/// A good material of every model, and of those with a second form one of it.
const std::vector<Contents>& good_materials() {
  static const std::vector<Contents> kGood = [] {
    std::vector<Contents> all;
    const TemporaryFolder folder;
    const SampleSet set = testing::dichromatic_set(folder.path() / "a.btfset", true);
    const auto add = [&](const Model& model, const FitOptions& options) {
      const auto material = testing::fit(model.name, set, options);
      if (!material) return;  // a model that has no such form
      Contents contents;
      contents.metadata = (*material)->contents().metadata;
      contents.metadata["format"] = "veneer-material";
      contents.metadata["version"] = "1";
      contents.metadata["model"] = model.name;
      for (const auto& [spec, bytes] : (*material)->contents().tensors)
        contents.tensors.push_back({spec.name,
                                    spec.dtype,
                                    spec.shape,
                                    {reinterpret_cast<const char*>(bytes.data()), bytes.size()}});
      all.push_back(std::move(contents));
    };
    for (const Model& model : models()) {
      FitOptions options = testing::options_with(testing::components_of(model, "2", "1+1"));
      options.angular = FitOptions::kLeastAngular;
      options.iterations = 2;  // good enough to be changed, and there at once
      add(model, options);
      FitRegion region;
      region.views = {0.4, 0.9, 0.3, 0.7};
      region.lights = {0.6, 0.6, 0.2, 0.2};
      options.region = &region;
      add(model, options);
      options.region = nullptr;
      if (model.terms == 0) continue;  // lobes have one form
      options.mip_levels = 2;
      options.precision = "float16";
      options.specular = model.name == "dichromatic-lpca" ? "half-angle" : "";
      options.clustering = model.name == "dichromatic-lpca" ? "separate" : "";
      add(model, options);
    }
    return all;
  }();
  return kGood;
}

/// Bytes as they are asked for; zeros when there are no more.
class Input {
 public:
  explicit Input(std::string_view text) : rest_(text) {}
  [[nodiscard]] bool empty() const { return rest_.empty(); }
  std::uint8_t byte() {
    if (rest_.empty()) return 0;
    const auto value = static_cast<std::uint8_t>(rest_.front());
    rest_.remove_prefix(1);
    return value;
  }
  std::size_t below(std::size_t count) { return count == 0 ? 0 : (byte() * 256U + byte()) % count; }
  std::int64_t extent() {
    constexpr std::array<std::int64_t, 6> kEdges{0, 1, 255, 65536, 1LL << 31, 1LL << 62};
    const std::uint8_t choice = byte();
    return choice < kEdges.size() ? kEdges.at(choice) : choice - 5;
  }
  std::string word() {
    std::string text;
    for (std::size_t left = byte() % 24U; left > 0 && !rest_.empty(); --left)
      text += static_cast<char>(byte());
    return text;
  }

 private:
  std::string_view rest_;
};

/// Bytes as many as the shape wants, where that is little.
void fit_to_shape(Tensor& tensor) {
  std::size_t bytes = size_of(tensor.dtype);
  for (const std::int64_t extent : tensor.shape)
    if (__builtin_mul_overflow(bytes, static_cast<std::size_t>(extent), &bytes)) return;
  constexpr std::size_t kMost = 1U << 20U;
  if (bytes <= kMost) tensor.bytes.resize(bytes);
}

void change(Contents& contents, Input& input) {
  enum { kMetadata, kNoMetadata, kExtent, kValue, kType, kNoTensor, kDouble, kBytes, kKinds };
  const auto choose_tensor = [&]() -> Tensor* {
    if (contents.tensors.empty()) return nullptr;
    return &contents.tensors[input.byte() % contents.tensors.size()];
  };
  const auto choose_key = [&] {
    if (contents.metadata.empty()) return contents.metadata.end();
    return std::next(contents.metadata.begin(),
                     static_cast<std::ptrdiff_t>(input.byte() % contents.metadata.size()));
  };
  const int kind = input.byte() % kKinds;
  if (kind == kMetadata || kind == kNoMetadata) {
    const auto key = choose_key();
    if (key == contents.metadata.end()) return;
    if (kind == kMetadata) {
      key->second = input.word();
    } else {
      contents.metadata.erase(key);
    }
    return;
  }
  Tensor* const tensor = choose_tensor();
  if (tensor == nullptr) return;
  switch (kind) {
    case kExtent: {
      if (tensor->shape.empty()) return;
      tensor->shape[input.byte() % tensor->shape.size()] = input.extent();
      fit_to_shape(*tensor);
      return;
    }
    case kValue: {  // NaN, infinities, huge and negative ones by their bits
      const std::size_t size = size_of(tensor->dtype);
      const std::size_t count = tensor->bytes.size() / size;
      if (count == 0) return;
      const std::size_t at = input.below(count) * size;
      for (std::size_t i = 0; i < size; ++i)
        tensor->bytes[at + i] = static_cast<char>(input.byte());
      return;
    }
    case kType:
      tensor->dtype = static_cast<DType>(input.byte() % 6);
      fit_to_shape(*tensor);
      return;
    case kNoTensor:
      contents.tensors.erase(contents.tensors.begin() + (tensor - contents.tensors.data()));
      return;
    case kDouble:
      tensor->shape.push_back(input.extent());
      fit_to_shape(*tensor);
      return;
    default: {
      const auto fill = static_cast<char>(input.byte());
      std::ranges::fill(tensor->bytes, fill);
    }
  }
}

/// The file, by hand: the writer minds alignment and would refuse some.
std::string file_of(Contents contents) {
  std::ranges::stable_sort(
      contents.tensors, std::greater{}, [](const Tensor& tensor) { return size_of(tensor.dtype); });
  const auto quoted = [](const std::string& text) {
    std::string result = "\"";
    for (const char c : text) {
      const bool plain = c >= ' ' && c < 0x7F && c != '"' && c != '\\';
      result += plain ? std::string(1, c) : fmt::format("\\u{:04x}", static_cast<unsigned char>(c));
    }
    return result + "\"";
  };
  std::string header = "{\"__metadata__\":{";
  for (const auto& [key, value] : contents.metadata)
    header += (header.back() == '{' ? "" : ",") + quoted(key) + ":" + quoted(value);
  header += "}";
  std::size_t offset = 0;
  std::string body;
  for (const Tensor& tensor : contents.tensors) {
    header += fmt::format(
        ",{}:{{\"dtype\":\"{}\",\"shape\":[", quoted(tensor.name), name_of(tensor.dtype));
    for (const std::int64_t extent : tensor.shape)
      header += fmt::format("{}{}", header.back() == '[' ? "" : ",", extent);
    header += fmt::format("],\"data_offsets\":[{},{}]}}", offset, offset + tensor.bytes.size());
    offset += tensor.bytes.size();
    body += tensor.bytes;
  }
  header += "}";
  header.append((8 - header.size() % 8) % 8, ' ');
  std::string text(8, '\0');
  const std::uint64_t length = header.size();
  std::memcpy(text.data(), &length, sizeof(length));
  return text + header + body;
}

/// What is loaded can be drawn: every texel answers, in the factors' numbers and in the GPU's.
std::string laws_of(const Material& material) {
  if (material.width() < 1 || material.height() < 1 || material.mip_levels() < 1)
    return "a material without texels";
  std::vector<float> rgb(material.views().size() * material.lights().size() * 3);
  const int last = material.width() * material.height() - 1;
  for (const int texel : {0, last / 2, last}) {
    material.reconstruct(texel, rgb);
    for (const Direction& view : {Direction(0, 0, 1), Direction(0.6, 0, 0.8), Direction(1, 0, 0)}) {
      for (const Direction& light : {Direction(0, 0, 1), Direction(0, -0.6, 0.8)}) {
        const Eigen::Vector3d seen = material.radiance(texel, view, light);
        if (!(seen.minCoeff() >= 0)) return "a radiance that is negative or no number";
        if (!(material.diffuse_radiance(texel, view, light).minCoeff() >= 0))
          return "a diffuse radiance that is negative or no number";
      }
    }
  }
  if (!std::isfinite(material.values_per_texel())) return "a size that is no number";
  static_cast<void>(material.shader());
  return "";
}

/// The file that an input asks for.
std::string make(std::string_view text) {
  Input input(text);
  const std::vector<Contents>& good = good_materials();
  Contents contents = good[input.byte() % good.size()];
  for (int changes = 0; changes < 8 && !input.empty(); ++changes) change(contents, input);
  return file_of(std::move(contents));
}

Verdict read(std::string_view file) {
  static const MemoryFile kFile;
  kFile.write(file);
  const auto material = load_material(kFile.path());
  if (!material) return refused(material.error());
  return accepted(laws_of(**material));
}

/// For every kind of material the changes, before which stands which it is.
std::vector<std::string> every_kind(const std::string& changes) {
  std::vector<std::string> all;
  for (std::size_t i = 0; i < good_materials().size(); ++i)
    all.push_back(std::string(1, static_cast<char>(i)) + changes);
  return all;
}

}  // namespace
}  // namespace veneer::btf

const veneer::FuzzedReader& veneer::fuzzed_reader() {
  using namespace btf;
  static const FuzzedReader kReader{&read,
                                    every_kind(""),
                                    {4 << 20, 256},
                                    every_kind({"\0\1\3"
                                                "100",
                                                6}),  // a number changed
                                    &make};
  return kReader;
}
