// SPDX-License-Identifier: Apache-2.0
#include "tracking/recording.h"

#include <fcntl.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <limits>
#include <utility>

namespace veneer::tracking {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "veneer-poses";
constexpr int kVersion = 1;

template <std::size_t kSize>
bool read_numbers(const Json& json, std::array<double, kSize>& numbers) {
  if (!json.is_array() || json.size() != kSize) return false;
  for (std::size_t i = 0; i < kSize; ++i) {
    if (!json[i].is_number() && !json[i].is_null()) return false;
    numbers[i] =
        json[i].is_null() ? std::numeric_limits<double>::quiet_NaN() : json[i].get<double>();
  }
  return true;
}

std::optional<std::int64_t> whole_number(const Json& json) {
  if (!json.is_number_integer()) return std::nullopt;
  // get() would wrap it around.
  if (json.is_number_unsigned() && !std::in_range<std::int64_t>(json.get<std::uint64_t>()))
    return std::nullopt;
  return json.get<std::int64_t>();
}

Result<PoseSample> sample_from(const Json& json) {
  if (!json.is_object()) return fail(Errc::kBadFormat, "it is no JSON object");
  for (const char* key : {"t_ns", "body", "seq", "p", "q"}) {
    if (!json.contains(key))
      return fail(Errc::kBadFormat, "one of t_ns, body, seq, p and q is missing");
  }
  PoseSample sample;
  const std::optional<std::int64_t> time_ns = whole_number(json["t_ns"]);
  if (!time_ns) return fail(Errc::kBadFormat, "t_ns is no whole number of 64 bits");
  sample.time = Time{Duration{*time_ns}};
  const std::optional<std::int64_t> body = whole_number(json["body"]);
  if (!body || !std::in_range<BodyId>(*body))
    return fail(Errc::kBadFormat, "body is no whole number of 32 bits");
  sample.body = static_cast<BodyId>(*body);
  if (!json["seq"].is_number_unsigned())
    return fail(Errc::kBadFormat, "seq is no whole number from 0");
  sample.sequence = json["seq"].get<std::uint64_t>();
  std::array<double, 3> p{};
  std::array<double, 4> q{};
  if (!read_numbers(json["p"], p)) return fail(Errc::kBadFormat, "p is no list of 3 numbers");
  if (!read_numbers(json["q"], q)) return fail(Errc::kBadFormat, "q is no list of 4 numbers");
  sample.world_from_body = {Eigen::Quaterniond(q[0], q[1], q[2], q[3]),
                            Eigen::Vector3d(p[0], p[1], p[2])};
  return sample;
}

Json parse(const std::string& line) {
  return Json::parse(line, nullptr, /*allow_exceptions=*/false);
}

}  // namespace

Result<PoseRecorder> PoseRecorder::create(const std::filesystem::path& path) {
  std::error_code ignored;  // open() below says what is wrong
  if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path(), ignored);
  UniqueFd file(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
  if (!file)
    return fail(Errc::kIo, "recording poses to {}: {}", path.string(), std::strerror(errno));
  PoseRecorder recorder(path, std::move(file));
  VENEER_TRY(recorder.write_line(Json{{"format", kFormat}, {"version", kVersion}}.dump()));
  return recorder;
}

Status PoseRecorder::write(const PoseSample& sample) {
  const Eigen::Vector3d& p = sample.world_from_body.translation;
  const Eigen::Quaterniond& q = sample.world_from_body.rotation;
  const Json json{{"t_ns", sample.time.time_since_epoch().count()},
                  {"body", sample.body},
                  {"seq", sample.sequence},
                  {"p", {p.x(), p.y(), p.z()}},
                  {"q", {q.w(), q.x(), q.y(), q.z()}}};
  return write_line(json.dump());
}

Status PoseRecorder::write_line(const std::string& line) {
  const std::string text = line + '\n';
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t count = ::write(file_.value(), text.data() + done, text.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) {
      // What there was room for; the next line begins where this one did.
      const int reason = errno;
      const off_t end = ::lseek(file_.value(), 0, SEEK_CUR);
      if (done > 0 && end >= static_cast<off_t>(done) &&
          ::ftruncate(file_.value(), end - static_cast<off_t>(done)) == 0)
        ::lseek(file_.value(), end - static_cast<off_t>(done), SEEK_SET);
      return fail(Errc::kIo,
                  "recording poses to {}: {}; free some space or record elsewhere",
                  path_.string(),
                  std::strerror(reason));
    }
    done += static_cast<std::size_t>(count);
  }
  return {};
}

Result<PoseRecordingReader> PoseRecordingReader::open(const std::filesystem::path& path) {
  std::error_code ignored;  // is_regular_file() is false where it cannot tell
  std::ifstream file(path, std::ios::binary);
  if (!file || std::filesystem::is_directory(path, ignored)) {
    return fail(Errc::kNotFound,
                "opening the pose recording {}: there is no readable file of that name",
                path.string());
  }
  PoseRecordingReader reader(path, std::move(file));
  const Json header = reader.read_line() ? parse(reader.line_) : Json{};
  if (!header.is_object() || header.value("format", Json{}) != kFormat) {
    return fail(Errc::kBadFormat,
                "opening the pose recording {}: line 1 is not {{\"format\":\"{}\",...}}; is this a "
                "recording of poses?",
                path.string(),
                kFormat);
  }
  if (header.value("version", Json{}) != kVersion) {
    return fail(Errc::kBadFormat,
                "opening the pose recording {}: version {} is not known; this program reads {}",
                path.string(),
                header.value("version", Json{}).dump(),
                kVersion);
  }
  return reader;
}

bool PoseRecordingReader::read_line() {
  if (ended_ || !std::getline(file_, line_)) return false;
  ++line_number_;
  ended_ = file_.eof();
  return true;
}

Result<std::optional<PoseSample>> PoseRecordingReader::next() {
  if (!read_line()) return std::nullopt;
  const Json json = parse(line_);
  if (json.is_discarded() && ended_) {
    truncated_ = true;
    return std::nullopt;
  }
  const Result<PoseSample> sample = sample_from(json);
  if (!sample) {
    return fail(Errc::kBadFormat,
                "reading the pose recording {}: line {}: {}; remove the line",
                path_.string(),
                line_number_,
                sample.error().what);
  }
  return *sample;
}

}  // namespace veneer::tracking
