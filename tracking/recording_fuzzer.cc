// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "base/testing/fuzzing.h"
#include "base/testing/memory_file.h"
#include "tracking/recording.h"

namespace veneer::tracking {
namespace {

bool is_same(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }

bool is_same(const PoseSample& a, const PoseSample& b) {
  if (a.time != b.time || a.body != b.body || a.sequence != b.sequence) return false;
  for (int i = 0; i < 3; ++i)
    if (!is_same(a.world_from_body.translation[i], b.world_from_body.translation[i])) return false;
  for (int i = 0; i < 4; ++i)
    if (!is_same(a.world_from_body.rotation.coeffs()[i], b.world_from_body.rotation.coeffs()[i]))
      return false;
  return true;
}

/// Sample by sample, since a recording need not fit into memory. What is read can be recorded and
/// read again.
Verdict read(std::string_view text) {
  static const MemoryFile kFile;
  static const MemoryFile kCopy;
  const std::filesystem::path path = kFile.path();
  const std::filesystem::path copy = kCopy.path();
  kFile.write(text);
  auto reader = PoseRecordingReader::open(path);
  if (!reader) return refused(reader.error());
  auto recorder = PoseRecorder::create(copy);
  VENEER_CHECK(recorder.has_value());
  std::size_t samples = 0;
  while (true) {
    const auto sample = reader->next();
    if (!sample) return refused(sample.error());
    if (!*sample) break;
    ++samples;
    if (const Status written = recorder->write(**sample); !written)
      return accepted("a sample that cannot be recorded: " + written.error().what);
  }
  const auto after = reader->next();
  if (!after || *after) return accepted("something after the end");
  auto first = PoseRecordingReader::open(path);
  auto second = PoseRecordingReader::open(copy);
  VENEER_CHECK(first.has_value());
  if (!second) return accepted("what was recorded is not read: " + second.error().what);
  for (std::size_t i = 0; i < samples; ++i) {
    const auto a = first->next();
    const auto b = second->next();
    if (!a || !*a || !b || !*b || !is_same(**a, **b)) return accepted("another sample");
  }
  return accepted();
}

}  // namespace
}  // namespace veneer::tracking

const veneer::FuzzedReader& veneer::fuzzed_reader() {
  using namespace tracking;
  static const std::string kHeader = "{\"format\":\"veneer-poses\",\"version\":1}\n";
  static const std::string kLine =
      "{\"t_ns\":5,\"body\":1,\"seq\":2,\"p\":[1,-2.5,3e-7],\"q\":[1,0,0,0]}\n";
  static const FuzzedReader kReader{
      &read,
      {kHeader + kLine + kLine + kLine,
       // Cut short, as where the recorder was killed.
       kHeader + kLine + kLine.substr(0, 30),
       kHeader + "{\"t_ns\":-9223372036854775808,\"body\":-2147483648,"
                 "\"seq\":18446744073709551615,\"p\":[null,1e308,-0.0],\"q\":[1,0,0,5e-324]}\n",
       kHeader},
      {48 << 10, 64},
      {kHeader + "{\"t_ns\":9223372036854775808,\"body\":1,\"seq\":2,\"p\":[1],\"q\":[]}\n",
       "{\"format\":\"veneer-poses\",\"version\":[[[[[[[[]]]]]]]]}\n"}};
  return kReader;
}
