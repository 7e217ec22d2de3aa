// SPDX-License-Identifier: Apache-2.0
#include "service/bus/bus_client.h"

#include "service/bus/internal_connection.h"
#include "service/bus/internal_properties.h"
#include "service/bus/names.h"

namespace veneer::service {
namespace {

/// The service answers questions at once; a machine that swaps may need longer.
constexpr Duration kAskTimeout = std::chrono::seconds(5);
/// ServiceControl returns within two minutes; another may wait before us.
constexpr Duration kTellTimeout = std::chrono::seconds(150);

using Triple = sdbus::Struct<double, double, double>;

Triple triple_of(const Eigen::Vector3d& v) { return Triple{v.x(), v.y(), v.z()}; }

void append(sdbus::Message& call, const LoadMaterial& c) { call << c.path; }
void append(sdbus::Message& call, const SetScene& c) { call << c.path; }
void append(sdbus::Message& call, const SetLight& c) {
  call << std::int32_t{c.index} << triple_of(c.light.direction_to_light) << c.light.illuminance_lux
       << triple_of(c.light.colour);
}
void append(sdbus::Message& call, const Blank& c) { call << c.on; }
void append(sdbus::Message&, const Reload&) {}
void append(sdbus::Message&, const Snapshot&) {}

std::uint64_t microseconds(Duration d) {
  return static_cast<std::uint64_t>(std::chrono::ceil<std::chrono::microseconds>(d).count());
}

std::string_view name_after_last_dot(std::string_view name) {
  return name.substr(name.rfind('.') + 1);
}

Error error_of(const std::string& doing, const sdbus::Error& error, const BusAddress& address) {
  const std::string_view name = error.getName();
  if (name.starts_with(std::string(kInterface) + ".Error."))
    return {errc_of(name), error.getMessage()};
  const std::string_view kind = name_after_last_dot(name);
  if (kind == "ServiceUnknown" || kind == "NameHasNoOwner" || kind == "UnknownObject")
    return {Errc::kUnavailable,
            fmt::format("{}: there is no veneerd on {}; is it running (systemctl status veneerd), "
                        "and does its configuration name this bus (bus = \"system\" in [service])?",
                        doing,
                        address.name())};
  if (kind == "AccessDenied")
    return {Errc::kUnavailable,
            fmt::format("{}: this is for root and the group veneer; an administrator adds you to "
                        "it with: usermod -aG veneer USER",
                        doing)};
  if (kind == "NoReply" || kind == "Timeout" || kind == "TimedOut")
    return {Errc::kTimeout,
            fmt::format("{}: veneerd did not answer; see systemctl status veneerd", doing)};
  return {Errc::kUnavailable, fmt::format("{}: {}", doing, error.getMessage())};
}

}  // namespace

struct BusClient::Impl {
  BusAddress address;
  std::unique_ptr<sdbus::IConnection> connection;
  std::unique_ptr<sdbus::IProxy> proxy;
};

BusClient::BusClient(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
BusClient::BusClient(BusClient&& other) noexcept = default;
BusClient& BusClient::operator=(BusClient&& other) noexcept = default;
BusClient::~BusClient() = default;

Result<BusClient> BusClient::connect(const BusAddress& address) {
  auto impl = std::make_unique<Impl>();
  impl->address = address;
  VENEER_ASSIGN(impl->connection, connect_to(address, kAskTimeout));
  try {
    // On a borrowed connection it starts no thread.
    impl->proxy = sdbus::createProxy(*impl->connection, kBusName, kObjectPath);
  } catch (const sdbus::Error& error) {
    return tl::unexpected(error_of("connecting to veneerd", error, address));
  }
  return BusClient(std::move(impl));
}

Result<ServiceStatus> BusClient::status() {
  std::map<std::string, sdbus::Variant> values;
  try {
    sdbus::MethodCall call =
        impl_->proxy->createMethodCall("org.freedesktop.DBus.Properties", "GetAll");
    call << kInterface;
    sdbus::MethodReply reply = call.send(microseconds(kAskTimeout));
    reply >> values;
  } catch (const sdbus::Error& error) {
    return tl::unexpected(error_of("asking veneerd", error, impl_->address));
  }
  return status_of(values);
}

Result<std::string> BusClient::tell(const Command& command) {
  VENEER_TRY(check(command));
  std::string answer;
  try {
    sdbus::MethodCall call =
        impl_->proxy->createMethodCall(kInterface, std::string(method_name_of(command)));
    std::visit([&](const auto& c) { append(call, c); }, command);
    sdbus::MethodReply reply = call.send(microseconds(kTellTimeout));
    if (!reply.isEmpty()) reply >> answer;
  } catch (const sdbus::Error& error) {
    return tl::unexpected(error_of(text_of(command), error, impl_->address));
  }
  return answer;
}

}  // namespace veneer::service
