// SPDX-License-Identifier: Apache-2.0
#include "capture/polarisers/elliptec/elliptec.h"

#include <cmath>
#include <numbers>

#include "capture/polarisers/elliptec/protocol.h"
#include "capture/polarisers/elliptec/serial_port.h"

namespace veneer::capture {
namespace {

using elliptec::Reply;

constexpr int kTries = 3;
constexpr Duration kBusyPause = std::chrono::milliseconds(100);
/// Of where it was sent; Thorlabs states a repeatability below it.
constexpr double kAccuracyDeg = 0.25;

class Elliptec final : public Polariser {
 public:
  Elliptec(ElliptecOptions options, SerialPort port)
      : options_(std::move(options)), port_(std::move(port)) {}

  Status begin() {
    VENEER_ASSIGN(const Reply reply, ask("in", {}, "IN", options_.answer_time));
    VENEER_ASSIGN(information_, elliptec::parse_information(reply));
    if (!information_.is_rotation_stage())
      return fail(Errc::kInvalidOption,
                  "it is an ELL{} with {} pulses, no rotation stage; name another port or address",
                  information_.type,
                  information_.pulses_per_revolution);
    VENEER_ASSIGN(const Reply there,
                  options_.home ? ask("ho", "0", "PO", options_.move_time)
                                : ask("gp", {}, "PO", options_.answer_time));
    VENEER_ASSIGN(position_, elliptec::parse_position(there));
    return {};
  }

  [[nodiscard]] std::string description() const override {
    return fmt::format("Thorlabs ELL{} {}", information_.type, information_.serial_number);
  }

  [[nodiscard]] Status turn_to(double angle_rad) override {
    const std::string doing =
        fmt::format("turning the analyser to {:.4g} degrees", angle_rad * kDegrees);
    if (!std::isfinite(angle_rad)) return fail(Errc::kInvalidOption, "{}: no angle", doing);
    const std::int32_t target = nearest(angle_rad);
    const std::string request = elliptec::move_request(options_.address, target);
    const auto reply = ask("ma", request.substr(3), "PO", options_.move_time);
    if (!reply) return fail_while(doing, reply.error());
    const auto reached = elliptec::parse_position(*reply);
    if (!reached) return fail_while(doing, reached.error());
    position_ = *reached;
    const double off = std::abs(static_cast<double>(position_) - target) / pulses_per_degree();
    if (off > kAccuracyDeg)
      return fail(Errc::kBadFormat,
                  "{}: the stage stopped {:.2f} degrees beside it; see that nothing holds it",
                  doing,
                  off);
    return {};
  }

 private:
  static constexpr double kDegrees = 180 / std::numbers::pi;

  [[nodiscard]] double pulses_per_degree() const {
    return information_.pulses_per_revolution / 360.0;
  }

  /// An axis is the same after half a turn: of its two positions in a turn, the nearer.
  [[nodiscard]] std::int32_t nearest(double angle_rad) const {
    const double sign = options_.reversed ? -1 : 1;
    double wanted = std::fmod(options_.zero_deg + sign * angle_rad * kDegrees, 180);
    if (wanted < 0) wanted += 180;
    const double here = position_ / pulses_per_degree();
    if (std::abs(wanted + 180 - here) < std::abs(wanted - here)) wanted += 180;
    return static_cast<std::int32_t>(std::lround(wanted * pulses_per_degree()));
  }

  /// Sends a request until it is answered as expected. All requests may be repeated: moves go to
  /// a place, not by a way.
  Result<Reply> ask(std::string_view command,
                    std::string_view data,
                    std::string_view expected,
                    Duration time) {
    const std::string request = fmt::format("{}{}{}", options_.address, command, data);
    SteadyClock clock;
    const Time busy_until = clock.now() + options_.move_time;
    Error last{Errc::kTimeout, ""};
    for (int tried = 0; tried < kTries;) {
      VENEER_TRY(port_.send(request));
      const auto line = port_.read_line(clock.now() + time);
      const auto reply =
          line ? elliptec::parse_reply(*line) : Result<Reply>(tl::unexpected<Error>(line.error()));
      if (!reply) {
        if (reply.error().code == Errc::kDisconnected) return reply;
        last = reply.error();
        if (last.code == Errc::kTimeout)
          last.what += ", address " + std::string(1, options_.address) +
                       "; see that the stage has power and that the address is its own";
        ++tried;
        continue;
      }
      if (reply->address != options_.address)
        return fail(Errc::kInvalidOption,
                    "a device with address {} answered instead of {}; set polariser.address",
                    reply->address,
                    options_.address);
      if (reply->command == expected) return reply;
      const auto status = elliptec::parse_status(*reply);
      if (!status) {
        last = status.error();
        ++tried;
        continue;
      }
      if (*status != elliptec::kStatusBusy)
        return fail(Errc::kBadFormat,
                    "the stage reports status {}: {}",
                    *status,
                    elliptec::text_of_status(*status));
      if (clock.now() > busy_until)
        return fail(Errc::kTimeout, "the stage stays busy; switch it off and on");
      clock.sleep_until(clock.now() + kBusyPause);
    }
    return tl::unexpected<Error>(last);
  }

  ElliptecOptions options_;
  SerialPort port_;
  elliptec::Information information_;
  std::int32_t position_ = 0;  // pulses
};

}  // namespace

Result<std::unique_ptr<Polariser>> open_elliptec(const ElliptecOptions& options) {
  VENEER_ASSIGN(SerialPort port, SerialPort::open(options.port));
  auto stage = std::make_unique<Elliptec>(options, std::move(port));
  if (const Status begun = stage->begin(); !begun)
    return fail_while(fmt::format("the polariser on {}", options.port.string()), begun.error());
  return stage;
}

Result<std::unique_ptr<Polariser>> open_elliptec_polariser(TomlReader& config, Hands& /*hands*/) {
  ElliptecOptions options;
  std::string address = "0";
  config.read("port", options.port);
  config.read("address", address);
  config.read("zero_deg", options.zero_deg);
  config.read("reversed", options.reversed);
  config.read("home", options.home);
  if (options.port.empty())
    return fail(Errc::kInvalidOption,
                "polariser.port is missing: the stage's serial port, as in /dev/serial/by-id");
  if (address.size() != 1 ||
      std::string_view("0123456789ABCDEF").find(address[0]) == std::string::npos)
    return fail(Errc::kInvalidOption,
                "polariser.address is \"{}\"; it must be one of \"0\" to \"9\", \"A\" to \"F\"",
                address);
  options.address = address[0];
  return open_elliptec(options);
}

}  // namespace veneer::capture
