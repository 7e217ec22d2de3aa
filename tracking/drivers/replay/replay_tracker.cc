// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/replay/replay_tracker.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "tracking/internal_arrival.h"

namespace veneer::tracking {
namespace {

/// Between the last sample and the first of the next loop where the recording does not tell.
constexpr Duration kDefaultStep = std::chrono::milliseconds(10);
/// Stamps farther apart are damage: at the lowest speed the replay would not fit into 64 bits.
constexpr double kLongestRecording_s = 3e7;

}  // namespace

Status ReplayOptions::check() const {
  if (file.empty())
    return fail(Errc::kInvalidOption, "opening the replay: set file to a pose recording");
  if (!(speed >= 0.01 && speed <= 100)) {
    return fail(Errc::kInvalidOption, "opening the replay: speed is {}; choose 0.01 to 100", speed);
  }
  return {};
}

Result<std::unique_ptr<ReplayTracker>> ReplayTracker::open(TomlReader& config, Clock& clock) {
  ReplayOptions options;
  config.read("file", options.file);
  config.read("loop", options.loop);
  config.read("speed", options.speed);
  VENEER_TRY(options.check());
  options.file = config.folder() / options.file;
  VENEER_ASSIGN(Contents contents, scan(options.file));
  VENEER_ASSIGN(PoseRecordingReader reader, PoseRecordingReader::open(options.file));
  return std::unique_ptr<ReplayTracker>(
      new ReplayTracker(std::move(options), std::move(contents), std::move(reader), clock));
}

ReplayTracker::ReplayTracker(ReplayOptions options,
                             Contents contents,
                             PoseRecordingReader reader,
                             Clock& clock)
    : options_(std::move(options)),
      contents_(std::move(contents)),
      reader_(std::move(reader)),
      clock_(clock),
      start_(clock.now()) {}

Result<ReplayTracker::Contents> ReplayTracker::scan(const std::filesystem::path& file) {
  struct Range {
    std::uint64_t low;
    std::uint64_t high;
  };
  std::map<BodyId, Range> sequences;
  double earliest_s = 0;  // relative to the first sample
  double latest_s = 0;
  Contents contents;
  VENEER_ASSIGN(PoseRecordingReader reader, PoseRecordingReader::open(file));
  while (true) {
    VENEER_ASSIGN(const std::optional<PoseSample> sample, reader.next());
    if (!sample) break;
    if (contents.samples++ == 0) contents.first = sample->time;
    // In floating point, since stamps of a damaged file may lie anywhere.
    const double offset_s =
        to_seconds(sample->time.time_since_epoch()) - to_seconds(contents.first.time_since_epoch());
    earliest_s = std::min(earliest_s, offset_s);
    latest_s = std::max(latest_s, offset_s);
    const auto [range, is_new] =
        sequences.try_emplace(sample->body, Range{sample->sequence, sample->sequence});
    range->second.low = std::min(range->second.low, sample->sequence);
    range->second.high = std::max(range->second.high, sample->sequence);
  }
  if (contents.samples == 0) {
    return fail(Errc::kBadFormat,
                "opening the replay of {}: the recording holds no samples",
                file.string());
  }
  const double span_s = latest_s - earliest_s;
  if (span_s > kLongestRecording_s) {
    return fail(Errc::kBadFormat,
                "opening the replay of {}: its times are {:.0f} days apart; it is damaged",
                file.string(),
                span_s / 86400);
  }
  contents.truncated = reader.truncated();
  const Duration mean_step = contents.samples > 1
                                 ? from_seconds(span_s / static_cast<double>(contents.samples - 1))
                                 : Duration{};
  contents.period = from_seconds(span_s) + (mean_step > Duration{} ? mean_step : kDefaultStep);
  for (const auto& [body, range] : sequences)
    contents.sequence_steps[body] = range.high - range.low + 1;
  return contents;
}

std::string ReplayTracker::description() const {
  return fmt::format("replay of {}, {} samples{}{}",
                     options_.file.string(),
                     contents_.samples,
                     options_.loop ? ", in a loop" : "",
                     contents_.truncated ? " (its last line was cut short and is left out)" : "");
}

Result<PoseSample> ReplayTracker::wait_pose(Duration timeout) {
  if (!waiting_) {
    VENEER_ASSIGN(waiting_, fetch());
  }
  VENEER_TRY(wait_for_arrival(clock_, waiting_->time, timeout));
  return *std::exchange(waiting_, std::nullopt);
}

Result<PoseSample> ReplayTracker::fetch() {
  const auto lost = [](const Error& error) {
    return tl::unexpected<Error>(Error{Errc::kDisconnected, error.what});
  };
  Result<std::optional<PoseSample>> sample = reader_.next();
  if (sample && !*sample && options_.loop) {
    Result<PoseRecordingReader> again = PoseRecordingReader::open(options_.file);
    if (!again) return lost(again.error());
    reader_ = *std::move(again);
    ++loops_;
    sample = reader_.next();
  }
  if (!sample) return lost(sample.error());  // the file has changed since it was opened
  if (!*sample) {
    return fail(
        Errc::kDisconnected, "replaying {}: the recording has ended", options_.file.string());
  }
  PoseSample moved = **sample;
  const Duration offset = (moved.time - contents_.first) + loops_ * contents_.period;
  moved.time =
      start_ + Duration{std::llround(static_cast<double>(offset.count()) / options_.speed)};
  moved.sequence += loops_ * contents_.sequence_steps[moved.body];
  return moved;
}

}  // namespace veneer::tracking
