// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "btf/material.h"
#include "btf/models/internal_test_models.h"

namespace veneer::btf {
namespace {

namespace fs = std::filesystem;
using testing::components_of;
using testing::dichromatic_set;
using testing::fit;
using testing::options_with;

TEST(LoadMaterial, RefusesDamagedFilesWithAMessage) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", true);
  const fs::path path = folder.path() / "a.safetensors";
  for (const Model& model : models()) {
    const auto material = fit(model.name, set, options_with(components_of(model, "2", "1+1")));
    ASSERT_TRUE(material) << material.error().what;
    const Material::Contents good = (*material)->contents();

    // Writes the contents after a change, under the given version.
    const auto load_changed = [&](const std::function<void(Material::Contents&)>& change) {
      Material::Contents contents = good;
      contents.metadata["format"] = "veneer-material";
      contents.metadata["version"] = "1";
      contents.metadata["model"] = model.name;
      change(contents);
      std::ranges::stable_sort(contents.tensors, std::greater{}, [](const auto& tensor) {
        return size_of(tensor.spec.dtype);
      });
      std::vector<TensorSpec> specs;
      for (const auto& tensor : contents.tensors) specs.push_back(tensor.spec);
      auto writer = SafetensorsWriter::create(path, specs, contents.metadata);
      EXPECT_TRUE(writer);
      for (const auto& tensor : contents.tensors) {
        const auto fill = [&]<class T>(std::span<T> target) {
          std::memcpy(target.data(),
                      tensor.bytes.data(),
                      std::min(target.size_bytes(), tensor.bytes.size()));
        };
        if (tensor.spec.dtype == DType::kU8) fill(writer->tensor<std::uint8_t>(tensor.spec.name));
        if (tensor.spec.dtype == DType::kF16) fill(writer->tensor<Eigen::half>(tensor.spec.name));
        if (tensor.spec.dtype == DType::kF32) fill(writer->tensor<float>(tensor.spec.name));
        if (tensor.spec.dtype == DType::kF64) fill(writer->tensor<double>(tensor.spec.name));
      }
      EXPECT_TRUE(writer->finish());
      return load_material(path);
    };
    const auto expect_refused = [&](const std::string& what,
                                    const std::function<void(Material::Contents&)>& change) {
      const auto loaded = load_changed(change);
      ASSERT_FALSE(loaded) << model.name << ": " << what;
      EXPECT_EQ(loaded.error().code, Errc::kBadFormat) << loaded.error().what;
      EXPECT_NE(loaded.error().what.find("a.safetensors"), std::string::npos)
          << loaded.error().what;
    };

    ASSERT_TRUE(load_changed([](auto&) {}));
    std::vector<std::string> keys{"format", "version", "model", "width"};
    for (const char* key : {"components", "lobes", "fallback_texels"})
      if (good.metadata.contains(key)) keys.emplace_back(key);
    for (const std::string& key : keys) {
      expect_refused(key, [key](auto& c) { c.metadata.erase(key); });
      expect_refused(key, [key](auto& c) { c.metadata[key] = "-7"; });
    }
    for (const char* name : {"views", "lights"}) {
      const auto tensor = std::ranges::find(
          good.tensors, name, [](const auto& t) -> const std::string& { return t.spec.name; });
      const auto index = static_cast<std::size_t>(tensor - good.tensors.begin());
      std::vector<double> values(tensor->bytes.size() / sizeof(double));
      std::memcpy(values.data(), tensor->bytes.data(), tensor->bytes.size());
      const auto replace_second = [&](const Direction& direction) {
        std::copy_n(direction.data(), 3, values.begin() + 3);
        return [&values, index](auto& c) {
          c.tensors[index].bytes = std::as_bytes(std::span(values));
        };
      };
      expect_refused("equal directions", replace_second({values[0], values[1], values[2]}));
      expect_refused("a direction from below", replace_second({0.6, 0.0, -0.8}));
    }
    if (good.metadata.contains("angular"))
      expect_refused("too many nodes", [](auto& c) { c.metadata["angular"] = "64"; });
    expect_refused("a newer version", [](auto& c) { c.metadata["version"] = "2"; });
    for (std::size_t i = 0; i < good.tensors.size(); ++i) {
      const TensorSpec& spec = good.tensors[i].spec;
      expect_refused("without " + spec.name, [i](auto& c) {
        c.tensors.erase(c.tensors.begin() + static_cast<std::ptrdiff_t>(i));
      });
      expect_refused("another shape of " + spec.name,
                     [i](auto& c) { c.tensors[i].spec.shape.back() *= 2; });
      // Any byte is a value of an image.
      if (spec.name == "eigen_textures" && spec.dtype == DType::kU8) continue;
      // All bits set: NaN, or a cluster that is not there.
      const std::vector<std::byte> bad(good.tensors[i].bytes.size(), std::byte{0xFF});
      expect_refused("bad values in " + spec.name, [&, i](auto& c) { c.tensors[i].bytes = bad; });
    }
  }
  EXPECT_EQ(load_material(folder.path() / "none.safetensors").error().code, Errc::kNotFound);

  ASSERT_TRUE(fit("lpca", set, options_with("2")).and_then([&](const auto& material) {
    return save_material(*material, path, {}).map([] { return 0; });
  }));
  fs::resize_file(path, fs::file_size(path) / 2);
  EXPECT_EQ(load_material(path).error().code, Errc::kBadFormat);
}

}  // namespace
}  // namespace veneer::btf
