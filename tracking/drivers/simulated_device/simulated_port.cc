// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/simulated_device/simulated_port.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string_view>
#include <utility>

#include "tracking/drivers/polhemus/polhemus_frame.h"

namespace veneer::tracking {
namespace {

constexpr PolhemusModel kModel = PolhemusModel::kLiberty;
constexpr double kFrame_s = 1 / PolhemusFrame::kFrames_hz;
/// What a duplicate takes to arrive after the first.
constexpr Duration kAgain = std::chrono::microseconds(300);

void check_range(TomlReader& toml, std::string_view key, double value, double least, double most) {
  if (!(value >= least && value <= most)) {
    toml.add_error(key, fmt::format("{} is outside {} to {}", value, least, most));
  }
}

/// A pose that is none, of one of many kinds.
void spoil(PolhemusFrame& frame, Pcg32& random) {
  using Limits = std::numeric_limits<float>;
  constexpr std::array kBad{Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(), 1e30F};
  switch (random.next() % 4) {
    case 0:
      frame.position_cm[random.next() % 3] = kBad[random.next() % kBad.size()];
      break;
    case 1:
      frame.rotation.coeffs()[random.next() % 4] = kBad[random.next() % kBad.size()];
      break;
    case 2:
      frame.rotation.coeffs().setZero();
      break;
    default:
      frame.rotation.coeffs().setConstant(Limits::denorm_min());
  }
}

}  // namespace

Result<SimulatedDeviceOptions> SimulatedDeviceOptions::read(TomlReader& toml) {
  SimulatedDeviceOptions options;
  options.noise = PoseNoise::read(toml);
  toml.read("seed", options.seed);
  toml.read("delay_ms", options.delay_ms);
  toml.read("jitter_ms", options.jitter_ms);
  toml.read("skew_ppm", options.skew_ppm);
  toml.read("first_count", options.first_count);
  check_range(toml, "delay_ms", options.delay_ms, 0, 1000);
  check_range(toml, "jitter_ms", options.jitter_ms, 0, 100);
  check_range(toml, "skew_ppm", options.skew_ppm, -1000, 1000);
  options.faults = read_faults(toml);
  VENEER_ASSIGN(options.paths, Path::read_all(toml));
  for (const Path& path : options.paths) {
    if (path.body() < 1 || path.body() > PolhemusFrame::kStations) {
      return fail(Errc::kInvalidOption,
                  "opening the simulated device: body {} is no station; choose 1 to {}",
                  path.body(),
                  PolhemusFrame::kStations);
    }
  }
  return options;
}

/// The device itself, plugged in or not.
class SimulatedPort::Device {
 public:
  Device(SimulatedDeviceOptions options, Clock& clock)
      : options_(std::move(options)),
        clock_(clock),
        start_(clock.now()),
        random_(options_.seed),
        count_(static_cast<std::uint32_t>(options_.first_count)) {}

  [[nodiscard]] Clock& clock() const { return clock_; }
  [[nodiscard]] Time time_of(double seconds) const { return start_ + from_seconds(seconds); }
  [[nodiscard]] double now_s() const { return to_seconds(clock_.now() - start_); }

  [[nodiscard]] bool is_plugged() const { return active(FaultKind::kUnplug, now_s()) == nullptr; }
  /// How often it has been unplugged by now.
  [[nodiscard]] std::ptrdiff_t unplugged() const { return begun(FaultKind::kUnplug, now_s()); }
  /// The next moment after now at which a fault of this kind begins (or ends).
  [[nodiscard]] std::optional<Time> next(FaultKind kind, bool end) const;
  /// Off and on again.
  void power_up() {
    messages_.clear();
    sends_ = false;
    binary_ = false;
    count_ = 0;
  }
  void take_commands(std::span<const std::byte> bytes);
  [[nodiscard]] Received read(std::span<std::byte> buffer, Time deadline);
  void clear_stall() { stalled_ = false; }

 private:
  struct Message {
    Time arrival;
    std::uint64_t number = 0;
    IoStatus status = IoStatus::kOk;
    std::vector<std::byte> bytes;
  };

  /// The fault of this kind that covers a moment and, by its share, this frame.
  [[nodiscard]] const Fault* active(FaultKind kind, double seconds) const;
  [[nodiscard]] const Fault* strikes(FaultKind kind, double seconds, int body = 0);
  [[nodiscard]] std::ptrdiff_t begun(FaultKind kind, double seconds) const;
  /// When frame `number` is measured; its clock may run slow.
  [[nodiscard]] double measured_s(std::uint64_t number) const {
    return static_cast<double>(number) * kFrame_s * (1 + 1e-6 * options_.skew_ppm);
  }
  void measure(std::uint64_t number);
  [[nodiscard]] std::optional<std::vector<std::byte>> frame_of(const Path& path, double seconds);
  void send(std::vector<std::byte> bytes, std::uint64_t number, double seconds);

  SimulatedDeviceOptions options_;
  Clock& clock_;
  Time start_;
  Pcg32 random_;
  std::uint32_t count_;
  std::uint64_t next_frame_ = 0;
  std::uint64_t next_message_ = 0;
  std::ptrdiff_t clock_restarts_ = 0;
  std::ptrdiff_t texts_ = 0;
  Time latest_arrival_;
  bool sends_ = false;
  bool binary_ = false;
  bool stalled_ = false;
  std::string command_;
  std::vector<Message> messages_;  // on their way
};

const Fault* SimulatedPort::Device::active(FaultKind kind, double seconds) const {
  for (const Fault& fault : options_.faults) {
    if (fault.kind == kind && fault.covers(seconds)) return &fault;
  }
  return nullptr;
}

const Fault* SimulatedPort::Device::strikes(FaultKind kind, double seconds, int body) {
  for (const Fault& fault : options_.faults) {
    if (fault.kind != kind || !fault.covers(seconds)) continue;
    if (fault.body != 0 && fault.body != body) continue;
    if (fault.share >= 1 || random_.uniform() < fault.share) return &fault;
  }
  return nullptr;
}

std::ptrdiff_t SimulatedPort::Device::begun(FaultKind kind, double seconds) const {
  return std::ranges::count_if(options_.faults, [kind, seconds](const Fault& fault) {
    return fault.kind == kind && fault.at_s <= seconds;
  });
}

std::optional<Time> SimulatedPort::Device::next(FaultKind kind, bool end) const {
  std::optional<Time> soonest;
  for (const Fault& fault : options_.faults) {
    const Time moment = time_of(end ? fault.at_s + fault.for_s : fault.at_s);
    if (fault.kind != kind || moment <= clock_.now()) continue;
    if (!soonest || moment < *soonest) soonest = moment;
  }
  return soonest;
}

void SimulatedPort::Device::take_commands(std::span<const std::byte> bytes) {
  for (const std::byte byte : bytes) {
    const char c = std::to_integer<char>(byte);
    if (c == 'P' && command_.empty()) {  // the only one without a line end
      sends_ = false;
    } else if (c != '\r') {
      command_ += c;
    } else {
      if (command_ == "F1") binary_ = true;
      if (command_ == "F0") binary_ = false;
      if (command_ == "C") {
        sends_ = true;
        for (; measured_s(next_frame_) < now_s(); ++next_frame_) ++count_;
      }
      command_.clear();
    }
  }
}

std::optional<std::vector<std::byte>> SimulatedPort::Device::frame_of(const Path& path,
                                                                      double seconds) {
  const int body = path.body();
  RigidTransform pose = options_.noise.added_to(path.at(seconds), random_);
  if (const Fault* fault = strikes(FaultKind::kTeleport, seconds, body)) {
    pose.translation += fault->shift_m;
  }
  if (strikes(FaultKind::kMirror, seconds, body) != nullptr) pose.translation *= -1;
  if (strikes(FaultKind::kDrop, seconds, body) != nullptr) return std::nullopt;
  PolhemusFrame frame;
  frame.station = static_cast<std::uint8_t>(body);
  frame.count = count_;
  frame.milliseconds = static_cast<std::uint32_t>(std::uint64_t{count_} * 1000 / 240);
  frame.position_cm = (100 * pose.translation).cast<float>();
  frame.rotation = pose.rotation.cast<float>();
  if (strikes(FaultKind::kInvalid, seconds, body) != nullptr) spoil(frame, random_);
  std::array bytes = encode(frame, kModel);
  if (strikes(FaultKind::kBitFlip, seconds, body) != nullptr) {
    bytes[random_.next() % bytes.size()] ^= static_cast<std::byte>(1U << (random_.next() % 8));
  }
  return std::vector<std::byte>(bytes.begin(), bytes.end());
}

void SimulatedPort::Device::measure(std::uint64_t number) {
  const double seconds = measured_s(number);
  if (const std::ptrdiff_t restarts = begun(FaultKind::kClockRestart, seconds);
      restarts != clock_restarts_) {
    clock_restarts_ = restarts;
    count_ = 0;
  } else if (active(FaultKind::kClockFreeze, seconds) == nullptr) {
    ++count_;
  }
  if (const std::ptrdiff_t texts = begun(FaultKind::kText, seconds); texts != texts_) {
    texts_ = texts;
    binary_ = false;
  }
  if (active(FaultKind::kSilence, seconds) != nullptr) return;
  const Fault* thin = active(FaultKind::kThin, seconds);
  if (thin != nullptr && number % static_cast<std::uint64_t>(thin->samples) != 0) return;

  std::vector<std::byte> bytes;
  const auto append = [&bytes](const auto& more) {
    for (const auto byte : more) bytes.push_back(static_cast<std::byte>(byte));
  };
  if (strikes(FaultKind::kGarbage, seconds) != nullptr) {
    for (std::uint32_t n = 1 + random_.next() % 60; n > 0; --n)
      bytes.push_back(static_cast<std::byte>(random_.next()));
  }
  for (const Path& path : options_.paths) {
    if (const auto frame = frame_of(path, seconds); frame && binary_) {
      append(*frame);
    } else if (frame) {
      append(fmt::format("{:02d}  12.34  -5.67  89.01  0.12 -3.45 6.78\r\n", path.body()));
    }
  }
  if (!bytes.empty()) send(std::move(bytes), number, seconds);
}

void SimulatedPort::Device::send(std::vector<std::byte> bytes,
                                 std::uint64_t number,
                                 double seconds) {
  double sent_s = seconds;
  if (const Fault* burst = active(FaultKind::kBurst, seconds)) {
    const auto size = static_cast<std::uint64_t>(burst->samples);
    sent_s = measured_s(number / size * size + size - 1);
  }
  double delay_ms = options_.delay_ms - options_.jitter_ms * std::log1p(-random_.uniform());
  if (const Fault* delay = strikes(FaultKind::kDelay, seconds)) {
    delay_ms += delay->delay_ms * random_.uniform();
  }
  Time arrival = time_of(sent_s) + from_seconds(1e-3 * delay_ms);
  if (const Fault* reorder = strikes(FaultKind::kReorder, seconds)) {
    arrival += from_seconds((reorder->samples + 0.5) * kFrame_s);
  } else {  // in the order of a stream
    arrival = latest_arrival_ = std::max(arrival, latest_arrival_);
  }
  IoStatus status = IoStatus::kOk;
  if (strikes(FaultKind::kIoError, seconds) != nullptr) status = IoStatus::kIo;
  if (strikes(FaultKind::kStall, seconds) != nullptr) status = IoStatus::kStall;
  if (strikes(FaultKind::kDuplicate, seconds) != nullptr) {
    messages_.push_back({arrival + kAgain, next_message_ + 1, status, bytes});
  }
  messages_.push_back({arrival, next_message_, status, std::move(bytes)});
  next_message_ += 2;
}

Received SimulatedPort::Device::read(std::span<std::byte> buffer, Time deadline) {
  const auto soonest = [this] {
    return std::ranges::min_element(messages_, {}, [](const Message& message) {
      return std::pair(message.arrival, message.number);
    });
  };
  while (true) {
    // What is measured later arrives later; what is measured now may still overtake.
    const Time next_measured = time_of(measured_s(next_frame_));
    const auto message = soonest();
    const bool waits = message == messages_.end() || message->arrival > next_measured;
    if (sends_ && waits && next_measured <= deadline) {
      measure(next_frame_++);
      continue;
    }
    if (message == messages_.end() || message->arrival > deadline) {
      clock_.sleep_until(deadline);
      return {IoStatus::kTimeout, 0, clock_.now()};
    }
    const Message taken = std::move(*message);
    messages_.erase(message);
    clock_.sleep_until(taken.arrival);
    if (taken.status == IoStatus::kStall) stalled_ = true;
    if (stalled_) return {IoStatus::kStall, 0, taken.arrival};
    if (taken.status != IoStatus::kOk) return {taken.status, 0, taken.arrival};
    const std::size_t size = std::min(buffer.size(), taken.bytes.size());
    std::copy_n(taken.bytes.begin(), size, buffer.begin());
    return {IoStatus::kOk, size, taken.arrival};
  }
}

/// One opening of the device; dead once it was unplugged.
class SimulatedPort::Connection final : public Transport {
 public:
  explicit Connection(Device& device) : device_(device), unplugged_(device.unplugged()) {}

  Received read(std::span<std::byte> buffer, Time deadline) override {
    if (is_gone()) return {IoStatus::kGone, 0, device_.clock().now()};
    const std::optional<Time> unplug = device_.next(FaultKind::kUnplug, false);
    const bool unplugs = unplug && *unplug <= deadline;
    const Received received = device_.read(
        buffer, unplugs ? std::max(*unplug - Duration{1}, device_.clock().now()) : deadline);
    if (!unplugs || received.status != IoStatus::kTimeout) return received;
    device_.clock().sleep_until(*unplug);
    return {IoStatus::kGone, 0, *unplug};
  }
  IoStatus write(std::span<const std::byte> bytes, Time /*deadline*/) override {
    if (is_gone()) return IoStatus::kGone;
    device_.take_commands(bytes);
    return IoStatus::kOk;
  }
  IoStatus clear_stall() override {
    device_.clear_stall();
    return IoStatus::kOk;
  }

 private:
  [[nodiscard]] bool is_gone() const { return device_.unplugged() != unplugged_; }
  Device& device_;
  std::ptrdiff_t unplugged_;
};

SimulatedPort::SimulatedPort(SimulatedDeviceOptions options, Clock& clock)
    : device_(std::make_unique<Device>(std::move(options), clock)) {}

SimulatedPort::~SimulatedPort() = default;

std::string SimulatedPort::description() const { return "simulated LIBERTY"; }

Result<std::unique_ptr<Transport>> SimulatedPort::open() {
  if (!device_->is_plugged()) {
    return fail(Errc::kNotFound, "opening the simulated device: its plan has it unplugged");
  }
  if (device_->unplugged() > 0) device_->power_up();
  return std::make_unique<Connection>(*device_);
}

bool SimulatedPort::wait_for_arrival(Time deadline) {
  std::optional<Time> arrival = device_->next(FaultKind::kUnplug, true);
  if (const auto other = device_->next(FaultKind::kOtherDevice, false);
      other && (!arrival || *other < *arrival)) {
    arrival = other;
  }
  const bool arrives = arrival && *arrival <= deadline;
  device_->clock().sleep_until(arrives ? *arrival : deadline);
  return arrives;
}

}  // namespace veneer::tracking
