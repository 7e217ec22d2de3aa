// SPDX-License-Identifier: Apache-2.0
#include "projector/control/dlpc350/dlpc350.h"

#include <hidapi/hidapi.h>
#include <unistd.h>

#include <algorithm>
#include <cwchar>
#include <utility>

namespace veneer::projector {

using dlpc350::Bytes;
using dlpc350::Command;
using dlpc350::ReplyReader;
using dlpc350::Report;

namespace {

constexpr unsigned short kVendor = 0x0451;
constexpr unsigned short kProduct = 0x6401;
/// The other one of the two is not for commands.
constexpr int kInterface = 0;
/// Reports after which a device that only ever says other things is given up, whatever the time.
constexpr int kMostReports = 64;
constexpr std::string_view kUdevRule = "etc/udev/60-veneer-projectors.rules";

struct CloseHid {
  void operator()(hid_device* device) const { hid_close(device); }
};
using HidHandle = std::unique_ptr<hid_device, CloseHid>;

struct FreeList {
  void operator()(hid_device_info* list) const { hid_free_enumeration(list); }
};

/// What a device calls itself: ASCII, in practice.
std::string text_of(const wchar_t* wide) {
  std::string text;
  for (; wide != nullptr && *wide != 0; ++wide)
    text += *wide >= 0x20 && *wide < 0x7F ? static_cast<char>(*wide) : '?';
  return text;
}

std::string texts_of(const std::vector<ConnectedLightEngine>& engines) {
  std::string text;
  for (const ConnectedLightEngine& each : engines)
    text += fmt::format("{}{}",
                        text.empty() ? "" : ", ",
                        each.serial.empty() ? "one without a serial number" : each.serial);
  return text;
}

Result<ConnectedLightEngine> choose(const std::string& serial) {
  const std::vector<ConnectedLightEngine> all = connected_light_engines();
  std::vector<ConnectedLightEngine> fitting = all;
  if (!serial.empty())
    std::erase_if(fitting, [&](const ConnectedLightEngine& e) { return e.serial != serial; });
  if (fitting.size() == 1) return fitting.front();
  if (all.empty())
    return fail(Errc::kNotFound,
                "opening the DLPC350: it is not there; see that it is plugged in and switched on");
  if (fitting.empty())
    return fail(Errc::kNotFound,
                "opening the DLPC350: {} is wanted, but there is {}; change `serial`",
                serial,
                texts_of(all));
  return fail(Errc::kInvalidOption,
              "opening the DLPC350: {} of them are there ({}); set `serial` to say which",
              fitting.size(),
              texts_of(fitting));
}

}  // namespace

std::vector<ConnectedLightEngine> connected_light_engines() {
  std::vector<ConnectedLightEngine> engines;
  if (hid_init() != 0) return engines;
  const std::unique_ptr<hid_device_info, FreeList> list(hid_enumerate(kVendor, kProduct));
  for (const hid_device_info* each = list.get(); each != nullptr; each = each->next) {
    if (each->interface_number != kInterface || each->path == nullptr) continue;
    // hidapi lists a node once for every usage of it.
    if (std::ranges::count(engines, each->path, &ConnectedLightEngine::node) > 0) continue;
    engines.push_back({each->path,
                       text_of(each->product_string),
                       text_of(each->serial_number),
                       ::access(each->path, R_OK | W_OK) == 0});
  }
  std::ranges::sort(engines, {}, &ConnectedLightEngine::node);
  return engines;
}

/// The open device. Closed at its first failure: hidapi does not tell an unplug from anything else,
/// and a stale descriptor keeps the node's number taken.
class Dlpc350::Device {
 public:
  Device(HidHandle handle, ConnectedLightEngine engine)
      : handle_(std::move(handle)), engine_(std::move(engine)) {}
  [[nodiscard]] const ConnectedLightEngine& engine() const { return engine_; }

  [[nodiscard]] Status write(const Report& report) {
    // The report's number, 0 for none, goes before it.
    std::array<unsigned char, dlpc350::kReportSize + 1> bytes{};
    std::ranges::transform(
        report, bytes.begin() + 1, [](std::byte b) { return std::to_integer<unsigned char>(b); });
    if (!handle_) return gone();
    if (hid_write(handle_.get(), bytes.data(), bytes.size()) >= 0) return {};
    handle_.reset();
    return gone();
  }

  /// The size of the report, 0 when the deadline passed.
  [[nodiscard]] Result<std::size_t> read(Report& report, Time deadline, Clock& clock) {
    if (!handle_) return gone();
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - clock.now());
    const int size = hid_read_timeout(handle_.get(),
                                      reinterpret_cast<unsigned char*>(report.data()),
                                      report.size(),
                                      static_cast<int>(std::max<std::int64_t>(left.count(), 0)));
    if (size >= 0) return static_cast<std::size_t>(size);
    handle_.reset();
    return gone();
  }

 private:
  [[nodiscard]] static tl::unexpected<Error> gone() {
    return fail(Errc::kDisconnected,
                "speaking with the DLPC350: it was unplugged or switched off; plug it in again");
  }
  HidHandle handle_;
  ConnectedLightEngine engine_;
};

Dlpc350::Dlpc350(const Dlpc350Options& options,
                 std::uint8_t led_enable,
                 std::unique_ptr<Device> device,
                 Clock& clock)
    : options_(options), device_(std::move(device)), clock_(clock), led_enable_(led_enable) {}
Dlpc350::~Dlpc350() = default;

Result<std::unique_ptr<Dlpc350>> Dlpc350::open(TomlReader& config, Clock& clock) {
  Dlpc350Options options;
  config.read("serial", options.serial);
  config.read("led_enable", options.led_enable);
  return open(options, clock);
}

Result<std::unique_ptr<Dlpc350>> Dlpc350::open(const Dlpc350Options& options, Clock& clock) {
  VENEER_ASSIGN(const std::uint8_t led_enable, dlpc350::led_enable_byte(options.led_enable));
  VENEER_ASSIGN(ConnectedLightEngine engine, choose(options.serial));
  HidHandle handle(hid_open_path(engine.node.c_str()));
  if (!handle && !engine.may_open)
    return fail(
        Errc::kUnavailable,
        "opening the DLPC350: {} may not be opened; install {} and plug it out and in again",
        engine.node,
        kUdevRule);
  if (!handle)
    return fail(
        Errc::kIo, "opening the DLPC350: {} does not open; plug it out and in again", engine.node);
  auto device = std::make_unique<Device>(std::move(handle), std::move(engine));
  std::unique_ptr<Dlpc350> opened(new Dlpc350(options, led_enable, std::move(device), clock));
  return opened;
}

std::string Dlpc350::description() const {
  const ConnectedLightEngine& engine = device_->engine();
  return fmt::format("{} light engine{}{}",
                     engine.model.empty() ? "DLPC350" : engine.model,
                     engine.serial.empty() ? "" : ", serial number ",
                     engine.serial);
}

Result<std::optional<Bytes>> Dlpc350::exchange(Command command,
                                               const std::vector<Report>& request,
                                               bool is_read) {
  // Looked at between messages alone; one takes no longer than the time limit.
  if (interrupted_) return fail(Errc::kCancelled, "speaking with the DLPC350: it was interrupted");
  const Time deadline = clock_.now() + options_.time_limit;
  const auto sequence = std::to_integer<std::uint8_t>(request.front()[1]);
  for (const Report& report : request) VENEER_TRY(device_->write(report));
  ReplyReader reply(sequence, is_read);
  for (int reports = 0; reports < kMostReports; ++reports) {
    Report report{};
    VENEER_ASSIGN(const std::size_t size, device_->read(report, deadline, clock_));
    if (size == 0) break;
    switch (reply.add(std::span(report).first(size))) {
      case ReplyReader::Step::kDone:
        return std::optional(reply.data());
      case ReplyReader::Step::kRefused:
        return std::optional<Bytes>();
      case ReplyReader::Step::kNonsense:
        return fail(
            Errc::kBadFormat,
            "speaking with the DLPC350: its reply to command {:#06x} is broken; plug it out "
            "and in again",
            static_cast<int>(command));
      case ReplyReader::Step::kMore:
      case ReplyReader::Step::kStray:  // of a request that was given up
        break;
    }
  }
  return fail(Errc::kTimeout,
              "speaking with the DLPC350: no reply to command {:#06x} within {:.1f} s; try again, "
              "and plug it out and in if this lasts",
              static_cast<int>(command),
              to_seconds(options_.time_limit));
}

Result<std::optional<Bytes>> Dlpc350::read(Command command) {
  return exchange(command, dlpc350::read_request(command, sequence_++), true);
}

Result<std::optional<std::uint8_t>> Dlpc350::read_byte(Command command) {
  VENEER_ASSIGN(const std::optional<Bytes> data, read(command));
  if (!data) return std::optional<std::uint8_t>();
  VENEER_ASSIGN(const std::uint8_t byte, dlpc350::read_byte(*data));
  return std::optional(byte);
}

Result<std::uint8_t> Dlpc350::require_byte(Command command) {
  VENEER_ASSIGN(const std::optional<std::uint8_t> byte, read_byte(command));
  if (byte) return *byte;
  return fail(Errc::kUnavailable,
              "asking the DLPC350: it refuses command {:#06x}; update its firmware",
              static_cast<int>(command));
}

Status Dlpc350::write(Command command, std::span<const std::byte> parameters) {
  VENEER_ASSIGN(const std::optional<Bytes> accepted,
                exchange(command, dlpc350::write_request(command, sequence_++, parameters), false));
  if (accepted) return {};
  return fail(Errc::kUnavailable,
              "commanding the DLPC350: it refuses command {:#06x} (NACK); it may be in standby, or "
              "in a mode that has no such command",
              static_cast<int>(command));
}

Status Dlpc350::write(Command command, std::uint8_t parameter) {
  const std::array bytes{static_cast<std::byte>(parameter)};
  return write(command, bytes);
}

Result<ProjectorState> Dlpc350::read_state() {
  ProjectorState state;
  state.maker = "TI";
  state.model = device_->engine().model.empty() ? "DLPC350" : device_->engine().model;
  if (!device_->engine().serial.empty()) state.serial = device_->engine().serial;
  VENEER_ASSIGN(const auto version, read(Command::kVersion));
  if (version) {
    VENEER_ASSIGN(state.firmware, dlpc350::read_version(*version));
  }
  VENEER_ASSIGN(const auto standby, read_byte(Command::kPower));
  if (standby) state.power = (*standby & 1U) != 0 ? Power::kOff : Power::kOn;
  VENEER_ASSIGN(const auto hardware, read_byte(Command::kHardwareStatus));
  VENEER_ASSIGN(const auto system, read_byte(Command::kSystemStatus));
  if (hardware && system) state.health["other"] = dlpc350::health_of(*hardware, *system);
  VENEER_ASSIGN(const auto main, read_byte(Command::kMainStatus));
  if (main) {
    state.frozen = dlpc350::main_status(*main).frozen;
    state.degamma = dlpc350::main_status(*main).degamma;
  }
  VENEER_ASSIGN(const auto source, read_byte(Command::kInputSource));
  if (source) state.input = std::string(dlpc350::input_name(*source));
  VENEER_ASSIGN(const auto mode, read_byte(Command::kDisplayMode));
  if (mode) state.processing = (*mode & 1U) == 0;
  VENEER_ASSIGN(const auto signal, read(Command::kVideoSignal));
  if (signal) {
    VENEER_ASSIGN(state.locked, dlpc350::read_lock(*signal));
  }
  VENEER_ASSIGN(const auto enabled, read_byte(Command::kLedEnable));
  if (enabled) {
    const std::string lit_by = dlpc350::led_enable_name(*enabled);
    state.muted = lit_by.empty();
    if (!lit_by.empty()) state.led_enable = lit_by;
  }
  VENEER_ASSIGN(const auto inverted, read_byte(Command::kPwmInvert));
  VENEER_ASSIGN(const auto currents, read(Command::kLedCurrent));
  if (inverted && currents) {
    VENEER_ASSIGN(state.led_levels, dlpc350::read_led_levels(*currents, (*inverted & 1U) != 0));
  }
  return state;
}

Status Dlpc350::power(bool on) {
  return write(Command::kPower, static_cast<std::uint8_t>(on ? 0 : 1));
}

Status Dlpc350::mute(bool on) {
  VENEER_ASSIGN(const std::uint8_t now, require_byte(Command::kLedEnable));
  const bool muted = dlpc350::led_enable_name(now).empty();
  if (on == muted) return {};
  if (on) led_enable_ = now;
  return write(Command::kLedEnable, on ? std::uint8_t{0} : led_enable_);
}

Status Dlpc350::freeze(bool on) {
  return write(Command::kFreeze, static_cast<std::uint8_t>(on ? 1 : 0));
}

Status Dlpc350::select_input(const std::string& input) {
  VENEER_ASSIGN(const std::uint8_t now, require_byte(Command::kInputSource));
  VENEER_ASSIGN(const std::uint8_t wanted, dlpc350::with_input(now, input));
  return write(Command::kInputSource, wanted);
}

Status Dlpc350::set_degamma(bool on) {
  VENEER_ASSIGN(const std::uint8_t now, require_byte(Command::kGamma));
  return write(Command::kGamma, dlpc350::with_degamma(now, on));
}

Status Dlpc350::set_led_levels(const LedLevels& levels) {
  VENEER_ASSIGN(const std::uint8_t inverted, require_byte(Command::kPwmInvert));
  VENEER_ASSIGN(const auto parameters, dlpc350::led_parameters(levels, (inverted & 1U) != 0));
  return write(Command::kLedCurrent, parameters);
}

Status Dlpc350::set_processing(bool on) {
  return write(Command::kDisplayMode, static_cast<std::uint8_t>(on ? 0 : 1));
}

Status Dlpc350::show_test_pattern(const std::string& name) {
  VENEER_ASSIGN(const std::uint8_t pattern, dlpc350::test_pattern(name));
  VENEER_ASSIGN(const std::uint8_t before, require_byte(Command::kInputSource));
  VENEER_ASSIGN(const std::uint8_t wanted, dlpc350::with_input(before, "test-pattern"));
  VENEER_TRY(write(Command::kInputSource, wanted));
  Status shown = write(Command::kTestPattern, pattern);
  // It would go on with whatever pattern it had, in place of the picture.
  if (!shown) static_cast<void>(write(Command::kInputSource, before));
  return shown;
}

}  // namespace veneer::projector
