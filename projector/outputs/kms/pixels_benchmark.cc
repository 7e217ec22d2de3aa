// SPDX-License-Identifier: Apache-2.0
// What packing a frame's codes into a display's words costs, beside copying as many bytes.
#include <benchmark/benchmark.h>

#include <cstring>
#include <vector>

#include "projector/outputs/kms/pixels.h"

namespace veneer::projector {
namespace {

constexpr int kWidth = 1920;
constexpr int kHeight = 1080;
constexpr std::size_t kPixels = std::size_t{kWidth} * kHeight;

void write(benchmark::State& state, int bits, int channel_bits) {
  Image<Rgb16> codes(kWidth, kHeight);
  std::uint16_t next = 0;
  for (Rgb16& pixel : codes.pixels()) {
    for (std::uint16_t& code : pixel)
      code = static_cast<std::uint16_t>(next++ & ((1U << bits) - 1));
  }
  std::vector<std::uint32_t> words(kPixels);
  for ([[maybe_unused]] const auto each : state) {
    write_pixels(codes.view(), bits, channel_bits, {words.data(), kWidth, kHeight, kWidth});
    benchmark::DoNotOptimize(words.data());
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(static_cast<std::int64_t>(state.iterations() * kPixels * 4));
}
BENCHMARK_CAPTURE(write, 8_bits, 8, 8)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(write, 8_bits_in_10, 8, 10)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(write, 10_bits, 10, 10)->Unit(benchmark::kMillisecond);

/// @param bytes  of a pixel: 4 are written, 6 are read.
void copy(benchmark::State& state, std::size_t bytes) {
  const std::vector<char> from(bytes * kPixels, 1);
  std::vector<char> to(bytes * kPixels);
  for ([[maybe_unused]] const auto each : state) {
    std::memcpy(to.data(), from.data(), to.size());
    benchmark::DoNotOptimize(to.data());
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(static_cast<std::int64_t>(state.iterations() * to.size()));
}
BENCHMARK_CAPTURE(copy, 4_bytes_a_pixel, 4)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(copy, 6_bytes_a_pixel, 6)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace veneer::projector

BENCHMARK_MAIN();
