// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <memory>
#include <numbers>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>

#include "base/random.h"
#include "base/testing/temporary_folder.h"
#include "btf/sample_set.h"

// Small things that several tests of this module need.
namespace veneer::btf::testing {

/// Uniform over the sphere, z from `lowest_z` upwards.
inline Direction random_direction(Pcg32& random, double lowest_z = 0.0) {
  const double z = lowest_z + (1.0 - lowest_z) * random.uniform();
  const double phi = 2.0 * std::numbers::pi * random.uniform();
  const double radius = std::sqrt(std::max(0.0, 1.0 - z * z));
  return {radius * std::cos(phi), radius * std::sin(phi), z};
}

/// The normal, and `count` directions around it at polar angle `theta`.
inline DirectionSet ring(int count, double theta) {
  DirectionSet directions{Direction::UnitZ()};
  for (int i = 0; i < count; ++i)
    directions.push_back(direction_from_angles({theta, 2.0 * std::numbers::pi * i / count}));
  return directions;
}

/// The value of a channel of a sample: sample(texel, view, light, channel).
using SampleFunction = std::function<float(int, int, int, int)>;

/// Writes a set whose samples are given by a function, and opens it.
inline SampleSet make_set(const std::filesystem::path& folder,
                          const SampleSetInfo& info,
                          const SampleFunction& sample) {
  auto writer = SampleSetWriter::create(folder, info);
  if (!writer) throw std::runtime_error(writer.error().what);
  for (int texel = 0; texel < info.texel_count(); ++texel) {
    std::size_t i = 0;
    const std::span<Eigen::half> out = writer->texel(texel);
    for (int view = 0; view < static_cast<int>(info.views.size()); ++view)
      for (int light = 0; light < static_cast<int>(info.lights.size()); ++light)
        for (int channel = 0; channel < info.channel_count(); ++channel)
          out[i++] = Eigen::half(sample(texel, view, light, channel));
  }
  if (auto status = writer->finish(); !status) throw std::runtime_error(status.error().what);
  auto set = SampleSet::open(folder);
  if (!set) throw std::runtime_error(set.error().what);
  return *set;
}

/// What a disabled test of this program prints behind "result ", run in a process of its own for
/// each number of threads, which is settled when it is first asked for.
inline std::set<std::string> results_on_threads(std::string_view test,
                                                std::initializer_list<int> threads) {
  const std::string program = std::filesystem::read_symlink("/proc/self/exe").string();
  std::set<std::string> results;
  for (const int count : threads) {
    const std::string command = fmt::format(
        "VENEER_THREADS={0} OPENBLAS_NUM_THREADS={0} '{1}' --gtest_also_run_disabled_tests "
        "--gtest_filter={2}",
        count,
        program,
        test);
    const std::unique_ptr<FILE, int (*)(FILE*)> output(::popen(command.c_str(), "r"), &::pclose);
    if (!output) throw std::runtime_error(command);
    std::array<char, 256> line{};
    std::string result;
    while (std::fgets(line.data(), line.size(), output.get()) != nullptr)
      if (std::string_view(line.data()).starts_with("result ")) result = line.data();
    if (result.empty()) throw std::runtime_error("no result of " + command);
    results.insert(result);
  }
  return results;
}

}  // namespace veneer::btf::testing
